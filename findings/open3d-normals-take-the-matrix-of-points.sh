#!/bin/sh
# open3d 0.20.0 with numpy 2.4.6: transform() multiplies normals by the matrix of the points, scales included.
#
# Guess: normals are of unit length and at right angles to the surface after transform(), for clouds and meshes.
# Seen:  they are multiplied by the upper 3 x 3 of the matrix. Metres from millimetres give normals of length 0.001.
#        If the steps of a volume differ from axis to axis the normals are not at right angles any more: with three
#        to one, up to 53 degrees off, and normalising does not mend it. A mirrored mesh keeps its faces' order, so
#        that its transformed normals point out and those of compute_vertex_normals() in. The tensor classes do the
#        same. scale() leaves the normals alone.
# Output:
#   mesh: length 0.001 after a scale of 0.001, 53 degrees off after z times 3
#   cloud: length 0.001 after a scale of 0.001, 53 degrees off after z times 3
#   tensor mesh: length 0.001 after a scale of 0.001, 53 degrees off after z times 3
#   tensor cloud: length 0.001 after a scale of 0.001, 53 degrees off after z times 3
#   cloud: length 1.000 after scale()
#   mirrored mesh: normal along radius at least 1.00, computed again at most -1.00
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
trap 'exit 1' HUP INT TERM
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet --disable-pip-version-check numpy==2.4.6 libusb-package==1.0.30.0 open3d==0.20.0
# Open3D's library asks for the system's libusb, which this package brings along.
mkdir "$work/lib"
ln -s "$("$work/venv/bin/python" -c 'import libusb_package as p; print(p.get_library_path())')" \
    "$work/lib/libusb-1.0.so.0"
cd "$work"
LD_LIBRARY_PATH="$work/lib" "$work/venv/bin/python" - <<'PY'
import sys

import numpy as np
import open3d as o3d


def sphere(kind):
    mesh = o3d.geometry.TriangleMesh.create_sphere(1.0, 20)
    mesh.compute_vertex_normals()
    cloud = o3d.geometry.PointCloud(mesh.vertices)
    cloud.normals = mesh.vertex_normals
    return {
        "mesh": lambda: mesh,
        "cloud": lambda: cloud,
        "tensor mesh": lambda: o3d.t.geometry.TriangleMesh.from_legacy(mesh),
        "tensor cloud": lambda: o3d.t.geometry.PointCloud.from_legacy(cloud),
    }[kind]()


def normals_of(solid):
    if isinstance(solid, o3d.geometry.TriangleMesh):
        return np.asarray(solid.vertex_normals)
    if isinstance(solid, o3d.geometry.PointCloud):
        return np.asarray(solid.normals)
    return (solid.vertex if isinstance(solid, o3d.t.geometry.TriangleMesh) else solid.point).normals.numpy()


for kind in ("mesh", "cloud", "tensor mesh", "tensor cloud"):
    before = normals_of(sphere(kind)).astype(float)
    small = np.linalg.norm(normals_of(sphere(kind).transform(np.diag([0.001, 0.001, 0.001, 1]))), axis=1).max()
    got = normals_of(sphere(kind).transform(np.diag([1.0, 1, 3, 1])))
    # Normals take the inverse transpose.
    true = before / [1, 1, 3]
    cosine = (got * true).sum(1) / np.linalg.norm(got, axis=1) / np.linalg.norm(true, axis=1)
    off = np.degrees(np.arccos(cosine.min()))
    print(f"{kind}: length {small:.3f} after a scale of 0.001, {off:.0f} degrees off after z times 3")
    if abs(small - 0.001) > 1e-6 or not 52 < off < 54 or not np.allclose(got, before * [1, 1, 3], atol=1e-6):
        sys.exit("no longer as written: normals are transformed otherwise")

scaled = sphere("cloud").scale(0.001, (0, 0, 0))
print(f"cloud: length {np.linalg.norm(normals_of(scaled), axis=1).max():.3f} after scale()")
if abs(np.linalg.norm(normals_of(scaled), axis=1).max() - 1) > 1e-6:
    sys.exit("no longer as written: scale() changes the normals")
mirrored = sphere("mesh").transform(np.diag([1.0, 1, -1, 1]))
first = (normals_of(mirrored) * np.asarray(mirrored.vertices)).sum(1).min()
again = (normals_of(mirrored.compute_vertex_normals()) * np.asarray(mirrored.vertices)).sum(1).max()
print(f"mirrored mesh: normal along radius at least {first:.2f}, computed again at most {again:.2f}")
if first < 0.99 or again > -0.99:
    sys.exit("no longer as written: faces and normals of a mirrored mesh agree")
PY
