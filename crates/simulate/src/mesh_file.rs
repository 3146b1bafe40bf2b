//! Meshes from OBJ and PLY files.

use super::{Mesh, MeshPlace, Placement};
use crate::{Error, Result};
use glam::{DVec3, dvec3};
use ply_rs_bw::parser::{Parser, Reader};
use ply_rs_bw::ply::{Property, PropertyAccess, PropertyAccessResult};
use std::{collections::HashMap, fs::File, io::BufReader, path::Path};

/// Corners whose faces meet at less than this angle (cosine of 40°) share a smooth normal.
const CREASE: f64 = 0.766;

/// Loads the triangles of a `.obj` or `.ply` file, in the file's units and axes. Polygons are cut into fans, missing
/// normals become smooth except across creases, and a closed mesh that is wound inside out is turned.
///
/// # Errors
/// A file that is missing, has another format or no triangles, coordinates that are not finite, or indices out of
/// range.
pub fn load_mesh(path: &Path) -> Result<Mesh> {
    let file = File::open(path).map_err(|e| {
        Error::input(
            format!("the mesh cannot be opened: {e}"),
            "check the path; it must be a readable .obj or .ply file",
        )
        .at(path.display())
    })?;
    let reader = BufReader::new(file);
    let soup = match extension(path).as_str() {
        "obj" => read_obj(reader),
        "ply" => read_ply(reader),
        other => Err(Error::input(format!("{other:?} is no mesh format"), "give a .obj or .ply file")),
    };
    soup.and_then(build).map_err(|e| e.at(path.display()))
}

/// The stem and the mesh of a mesh file in metres, and where it is; `None` if the path does not have the extension of a mesh file.
/// A mesh in front of the wall, z > 0, stays unless it is to be `centred`.
pub(super) fn scene(path: &Path, centred: bool) -> Option<Result<(String, Mesh, MeshPlace)>> {
    if !matches!(extension(path).as_str(), "obj" | "ply") {
        return None;
    }
    let placement = |mesh: &Mesh| {
        let (low, high) = mesh.bounds().unwrap_or_default();
        let centre = low.midpoint(high);
        let rotate = [0.0, 180.0, 0.0];
        Placement { rotate, translate: dvec3(centre.x, -centre.y, 0.8 + centre.z), ..Placement::default() }
    };
    let stem = path.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
    let mesh = load_mesh(path).and_then(|mesh| {
        if !centred && mesh.bounds().is_some_and(|(low, _)| low.z > 0.0) {
            return Ok((mesh, MeshPlace::OfFile));
        }
        let place = placement(&mesh);
        Ok((mesh.placed(&place)?, MeshPlace::Centred))
    });
    Some(mesh.map(|(mesh, place)| (stem, mesh, place)))
}

fn extension(path: &Path) -> String {
    path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default()
}

/// Vertices and faces as read, and normals per face corner if the file has them.
#[derive(Default)]
struct Soup {
    points: Vec<DVec3>,
    faces: Vec<Vec<usize>>,
    normals: Vec<Option<Vec<DVec3>>>,
}

fn read_obj(mut reader: BufReader<File>) -> Result<Soup> {
    let options = tobj::LoadOptions { ignore_points: true, ignore_lines: true, ..Default::default() };
    let no_materials = |_: &Path| Ok(Default::default());
    let (models, _) = tobj::load_obj_buf(&mut reader, &options, no_materials).map_err(|e| {
        Error::input(format!("the OBJ cannot be read: {e}"), "export the mesh again as a plain OBJ")
    })?;
    let mut soup = Soup::default();
    for mesh in models.into_iter().map(|m| m.mesh) {
        let base = soup.points.len();
        let vectors = |v: &[f32]| -> Vec<DVec3> {
            v.chunks_exact(3).map(|p| DVec3::new(p[0] as f64, p[1] as f64, p[2] as f64)).collect()
        };
        let normals = vectors(&mesh.normals);
        soup.points.extend(vectors(&mesh.positions));
        let mut start = 0;
        let count =
            if mesh.face_arities.is_empty() { mesh.indices.len() / 3 } else { mesh.face_arities.len() };
        for face in 0..count {
            let arity = mesh.face_arities.get(face).map_or(3, |&a| a as usize);
            let range = start..start + arity;
            start += arity;
            let given: Option<Vec<DVec3>> = mesh
                .normal_indices
                .get(range.clone())
                .map(|ids| ids.iter().filter_map(|&i| normals.get(i as usize).copied()).collect());
            soup.normals.push(given.filter(|n| n.len() == arity));
            soup.faces.push(mesh.indices[range].iter().map(|&i| base + i as usize).collect());
        }
    }
    Ok(soup)
}

#[derive(Default)]
struct PlyVertex(DVec3);

impl PropertyAccess for PlyVertex {
    fn new() -> Self {
        PlyVertex(DVec3::NAN)
    }

    fn set_property(&mut self, key: &str, property: Property) -> PropertyAccessResult {
        let value = match property {
            Property::Float(v) => v as f64,
            Property::Double(v) => v,
            Property::Short(v) => v as f64,
            Property::UShort(v) => v as f64,
            Property::Int(v) => v as f64,
            _ => return PropertyAccessResult::Ignored,
        };
        match key {
            "x" => self.0.x = value,
            "y" => self.0.y = value,
            "z" => self.0.z = value,
            _ => return PropertyAccessResult::Ignored,
        }
        PropertyAccessResult::Set
    }
}

struct PlyFace(Vec<i64>);

impl PropertyAccess for PlyFace {
    fn new() -> Self {
        PlyFace(Vec::new())
    }

    fn set_property(&mut self, key: &str, property: Property) -> PropertyAccessResult {
        if key != "vertex_indices" && key != "vertex_index" {
            return PropertyAccessResult::Ignored;
        }
        self.0 = match property {
            Property::ListChar(v) => v.into_iter().map(i64::from).collect(),
            Property::ListUChar(v) => v.into_iter().map(i64::from).collect(),
            Property::ListShort(v) => v.into_iter().map(i64::from).collect(),
            Property::ListUShort(v) => v.into_iter().map(i64::from).collect(),
            Property::ListInt(v) => v.into_iter().map(i64::from).collect(),
            Property::ListUInt(v) => v.into_iter().map(i64::from).collect(),
            _ => return PropertyAccessResult::Ignored,
        };
        PropertyAccessResult::Set
    }
}

fn read_ply(reader: BufReader<File>) -> Result<Soup> {
    let broken = |e: &dyn std::fmt::Display| {
        Error::input(format!("the PLY cannot be read: {e}"), "export the mesh again as ASCII or binary PLY")
    };
    let mut reader = Reader::new(reader);
    let vertices = Parser::<PlyVertex>::new();
    let faces = Parser::<PlyFace>::new();
    let header = vertices.read_header(&mut reader).map_err(|e| broken(&e))?;
    let mut soup = Soup::default();
    for (name, element) in &header.elements {
        if name == "face" {
            let read =
                faces.read_payload_for_element(&mut reader, element, &header).map_err(|e| broken(&e))?;
            for face in read {
                // A negative index becomes an index out of range, which is reported later.
                soup.faces.push(face.0.iter().map(|&i| usize::try_from(i).unwrap_or(usize::MAX)).collect());
                soup.normals.push(None);
            }
        } else {
            // All elements must be read, in the order of the header.
            let read =
                vertices.read_payload_for_element(&mut reader, element, &header).map_err(|e| broken(&e))?;
            if name == "vertex" {
                soup.points = read.into_iter().map(|v| v.0).collect();
            }
        }
    }
    Ok(soup)
}

fn build(soup: Soup) -> Result<Mesh> {
    if let Some(i) = soup.points.iter().position(|p| !p.is_finite()) {
        return Err(Error::input(
            format!("vertex {i} of {} has no finite x, y, z", soup.points.len()),
            "repair the mesh, or export it again",
        ));
    }
    let mut mesh = Mesh { self_occluding: true, ..Mesh::default() };
    let mut missing: Vec<(usize, [usize; 3])> = Vec::new();
    for (face, given) in soup.faces.iter().zip(&soup.normals) {
        if let Some(&i) = face.iter().find(|&&i| i >= soup.points.len()) {
            return Err(Error::input(
                format!("a face uses vertex {i}, but there are only {}", soup.points.len()),
                "repair the mesh, or export it again",
            ));
        }
        for k in 2..face.len() {
            let ids = [face[0], face[k - 1], face[k]];
            let corners = ids.map(|i| soup.points[i]);
            let flat = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize_or_zero();
            if flat == DVec3::ZERO {
                continue;
            }
            let normals = given.as_ref().map(|n| [n[0], n[k - 1], n[k]].map(DVec3::normalize_or_zero));
            match normals.filter(|n| n.iter().all(|n| n.dot(flat) > 0.0)) {
                Some(normals) => mesh.normals.push(normals),
                None => {
                    missing.push((mesh.triangles.len(), ids));
                    mesh.normals.push([flat; 3]);
                }
            }
            mesh.triangles.push(corners);
        }
    }
    if mesh.triangles.is_empty() {
        return Err(Error::input(
            "the file has no triangle with an area",
            "give a mesh with faces, not a point cloud or curves",
        ));
    }
    smooth(&mut mesh, &missing, &soup.points);
    turn_outside(&mut mesh);
    Ok(mesh)
}

/// Smooth normals for triangles without normals: the area-weighted mean over the faces around a position whose angle is
/// below the crease angle.
fn smooth(mesh: &mut Mesh, missing: &[(usize, [usize; 3])], points: &[DVec3]) {
    let key = |i: usize| points[i].to_array().map(f64::to_bits);
    let mut around: HashMap<[u64; 3], Vec<usize>> = HashMap::new();
    for &(triangle, ids) in missing {
        for id in ids {
            around.entry(key(id)).or_default().push(triangle);
        }
    }
    let flat: HashMap<usize, DVec3> =
        missing.iter().map(|&(t, _)| (t, mesh.geometric_normal(t) * mesh.area(t))).collect();
    for &(triangle, ids) in missing {
        let own = flat[&triangle].normalize_or_zero();
        mesh.normals[triangle] = ids.map(|id| {
            let near = around[&key(id)].iter().map(|t| flat[t]);
            let sum: DVec3 = near.filter(|n| n.normalize_or_zero().dot(own) > CREASE).sum();
            sum.try_normalize().unwrap_or(own)
        });
    }
}

/// Maximum ratio of the summed vector areas to the area of a mesh that counts as closed.
const CLOSED: f64 = 0.05;

/// Turns a closed mesh with a negative enclosed volume inside out; open meshes are unchanged.
fn turn_outside(mesh: &mut Mesh) {
    let Some((lo, hi)) = mesh.bounds() else { return };
    let middle = 0.5 * (lo + hi);
    let volume: f64 =
        mesh.triangles.iter().map(|&[a, b, c]| (a - middle).dot((b - middle).cross(c - middle))).sum();
    let twice = |&[a, b, c]: &[DVec3; 3]| (b - a).cross(c - a);
    let area: f64 = mesh.triangles.iter().map(|t| twice(t).length()).sum();
    let open = mesh.triangles.iter().map(twice).sum::<DVec3>().length();
    // Flat meshes enclose almost no volume.
    if open < CLOSED * area && volume < -1e-3 * (hi - lo).max_element().powi(3) {
        mesh.triangles.iter_mut().for_each(|t| t.swap(1, 2));
        for n in &mut mesh.normals {
            *n = [-n[0], -n[2], -n[1]];
        }
    }
}
