#!/bin/sh
# pymeshlab 2025.7.post1 with numpy 2.4.6: a point cloud with normals is saved without them, a mesh gets others.
#
# Guess: a PLY file that has normals has them again after it is read and saved, and Mesh() keeps the normals that it
#        is given.
# Seen:  the cloud is read with its normals, but save_current_mesh() to PLY or OBJ leaves them out unless it is
#        called with save_vertex_normal=True: read again, all are (0, 0, 0), without a warning. A mesh with faces is
#        saved to PLY without them too; read again it has normals, which are sums of the faces' normals by their
#        angles, not of unit length and not those of the file. The same sums replace what Mesh() is given as
#        v_normals_matrix as soon as it has faces, where a cloud keeps its own. Measured normals of a wall or of a
#        reconstruction turn silently into those of the triangles.
# Output:
#   cloud, file: [0.6, 0.0, 0.8]
#   cloud, saved as PLY: [0.0, 0.0, 0.0]
#   cloud, saved as OBJ: [0.0, 0.0, 0.0]
#   cloud, PLY with normals asked: [0.6, 0.0, 0.8]
#   cloud, Mesh(): [0.6, 0.0, 0.8]
#   mesh, file: [0.6, 0.0, 0.8]
#   mesh, saved as PLY: [0.0, 0.0, 1.571]
#   mesh, saved as OBJ: [0.6, 0.0, 0.8]
#   mesh, PLY with normals asked: [0.6, 0.0, 0.8]
#   mesh, Mesh(): [0.0, 0.0, 1.571]
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
trap 'exit 1' HUP INT TERM
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet --disable-pip-version-check numpy==2.4.6 pymeshlab==2025.7.post1
cd "$work"
"$work/venv/bin/python" - <<'PY'
import sys

import numpy as np
import pymeshlab

points = np.array([[0, 0, 1], [1, 0, 1], [0, 1, 1], [1, 1, 1]], float)
normals = np.tile([0.6, 0, 0.8], (4, 1))
faces = np.array([[0, 1, 2], [1, 3, 2]])


def write(path, with_faces):
    lines = ["ply", "format ascii 1.0", "element vertex 4"]
    lines += [f"property double {name}" for name in ("x", "y", "z", "nx", "ny", "nz")]
    lines += ["element face 2", "property list uchar int vertex_indices"] if with_faces else []
    rows = [" ".join(map(str, row)) for row in np.hstack([points, normals]).tolist()]
    rows += ["3 " + " ".join(map(str, face)) for face in faces.tolist()] if with_faces else []
    with open(path, "w") as file:
        file.write("\n".join([*lines, "end_header", *rows, ""]))


def first_normal(path):
    meshes = pymeshlab.MeshSet()
    meshes.load_new_mesh(path)
    return meshes, meshes.current_mesh().vertex_normal_matrix()[0].round(3).tolist()


seen = {}
for name, with_faces in (("cloud", False), ("mesh", True)):
    write("given.ply", with_faces)
    meshes, got = first_normal("given.ply")
    meshes.save_current_mesh("plain.ply")
    meshes.save_current_mesh("plain.obj")
    meshes.save_current_mesh("asked.ply", save_vertex_normal=True)
    made = pymeshlab.Mesh(points, v_normals_matrix=normals)
    if with_faces:
        made = pymeshlab.Mesh(points, faces, v_normals_matrix=normals)
    seen[name] = [got, *(first_normal(path)[1] for path in ("plain.ply", "plain.obj", "asked.ply"))]
    seen[name].append(made.vertex_normal_matrix()[0].round(3).tolist())
    for what, normal in zip(("file", "saved as PLY", "saved as OBJ", "PLY with normals asked", "Mesh()"), seen[name]):
        print(f"{name}, {what}: {normal}")
own, none, summed = [0.6, 0.0, 0.8], [0.0, 0.0, 0.0], [0.0, 0.0, 1.571]
if seen["cloud"] != [own, none, none, own, own]:
    sys.exit("no longer as written: normals of the cloud are others")
if seen["mesh"] != [own, summed, own, own, summed]:
    sys.exit("no longer as written: normals of the mesh are others")
PY
