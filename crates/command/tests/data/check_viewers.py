"""Opens results with the programs of the table in docs/results.md, and checks types and values.

Usage: check_viewers.py RESULT_FOLDER

RESULT_FOLDER is what `reconstruct --out` wrote. Needs imageio, meshio, numpy, opencv, plyfile, pyexr, trimesh and vtk.
"""

import os
import sys

os.environ["OPENCV_IO_ENABLE_OPENEXR"] = "1"  # before the import of cv2

import cv2
import imageio.v3 as iio
import meshio
import numpy as np
import plyfile
import pyexr
import trimesh
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkIOPLY import vtkPLYReader

folder = sys.argv[1]
maps = np.load(f"{folder}/maps.npz")
# Rows from the largest y down, columns from the largest x down.
picture = {name: maps[name].T[::-1, ::-1] for name in ("albedo", "depth", "mask")}
exr = f"{folder}/maps.exr"
layers = pyexr.open(exr)
for name, channel in (("albedo", "albedo.Y"), ("depth", "depth.Z"), ("mask", "mask.Y")):
    assert np.array_equal(layers.get(channel)[..., 0], picture[name], equal_nan=True), channel
# Both show the plain channel Y alone.
assert np.array_equal(cv2.imread(exr, cv2.IMREAD_UNCHANGED), picture["albedo"])
assert np.array_equal(iio.imread(exr, plugin="opencv", flags=cv2.IMREAD_UNCHANGED), picture["albedo"])

for name in ("points.ply", "mesh.ply"):
    path = f"{folder}/{name}"
    vertex = plyfile.PlyData.read(path)["vertex"]
    points, normals, colours = (
        np.stack([vertex[c] for c in names], -1) for names in (("x", "y", "z"), ("nx", "ny", "nz"), ("red", "green", "blue"))
    )
    assert colours.dtype == np.uint8 and colours.max() == 255 and points.dtype == np.float32

    read = meshio.read(path)
    assert np.array_equal(read.points, points)
    for c, channel in enumerate(("red", "green", "blue")):
        assert read.point_data[channel].dtype == np.uint8 and np.array_equal(read.point_data[channel], colours[:, c])

    reader = vtkPLYReader()
    reader.SetFileName(path)
    reader.Update()
    data = reader.GetOutput()
    assert np.array_equal(vtk_to_numpy(data.GetPoints().GetData()), points)
    assert np.array_equal(vtk_to_numpy(data.GetPointData().GetArray("RGB")), colours)
    assert np.allclose(vtk_to_numpy(data.GetPointData().GetNormals()), normals)

    loaded = trimesh.load(path)
    assert np.array_equal(loaded.vertices.astype(np.float32), points)
    if name == "mesh.ply":
        assert np.array_equal(loaded.visual.vertex_colors[:, :3], colours)
        assert np.allclose(loaded.vertex_normals, normals)
    else:
        # A point cloud of trimesh has no normals of its own.
        assert not hasattr(loaded, "vertex_normals") and np.array_equal(loaded.colors[:, :3], colours)
        stored = loaded.metadata["_ply_raw"]["vertex"]["data"]
        assert np.array_equal(np.stack([stored[c] for c in ("nx", "ny", "nz")], -1), normals)
print("all viewers agree")
