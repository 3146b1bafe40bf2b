"""Opens everything that thirdbounce writes with the programs of others, and checks what stands in it.

Usage: check_outputs.py RESULT_FOLDER CAPTURES_FOLDER

RESULT_FOLDER is what `reconstruct --out` wrote, with volume.npz and volume.hdf5 in it; CAPTURES_FOLDER holds one
capture as made.npz, made.hdf5 and made.mat. Needs numpy, h5py, scipy, matplotlib and OpenEXR; ends with 77 if one of
them is missing.
"""

import struct
import sys
from pathlib import Path

try:
    import h5py
    import matplotlib.image
    import numpy as np
    import OpenEXR
    import scipy.io
except ImportError as missing:
    print(f"skipped: {missing}")
    sys.exit(77)


def read_ply(path):
    """The elements of a binary little-endian PLY: name -> structured array, or list of index lists."""
    data = path.read_bytes()
    head, body = data.split(b"end_header\n", 1)
    lines = head.decode("ascii").splitlines()
    assert lines[0] == "ply" and lines[1] == "format binary_little_endian 1.0", lines[:2]
    elements = []
    for line in lines[2:]:
        words = line.split()
        if words[0] == "element":
            elements.append((words[1], int(words[2]), []))
        elif words[0] == "property":
            elements[-1][2].append(words[1:])
    types = {"float32": "<f4", "uint8": "u1", "int32": "<i4"}
    found, at = {}, 0
    for name, count, properties in elements:
        if properties[0][0] == "list":
            rows = []
            for _ in range(count):
                n = body[at]
                rows.append(struct.unpack_from(f"<{n}i", body, at + 1))
                at += 1 + 4 * n
            found[name] = rows
        else:
            kind = np.dtype([(p[1], types[p[0]]) for p in properties])
            found[name] = np.frombuffer(body, kind, count, at)
            at += kind.itemsize * count
    assert at == len(body), f"{path}: {len(body) - at} bytes left over"
    return found


def same(a, b):
    return np.array_equal(np.asarray(a, np.float64), np.asarray(b, np.float64), equal_nan=True)


def check_result(folder):
    maps = np.load(folder / "maps.npz")
    albedo, depth, normal, mask = (maps[k] for k in ("albedo", "depth", "normal", "mask"))
    nx, ny = albedo.shape
    assert depth.shape == mask.shape == (nx, ny) and normal.shape == (nx, ny, 3)
    assert mask.dtype == bool and maps["extent"].shape == (4,)

    matlab = scipy.io.loadmat(folder / "maps.mat")
    assert set(maps) == {name for name in matlab if not name.startswith("__")}
    assert all(same(matlab[name].reshape(maps[name].shape), maps[name]) for name in maps)
    assert matlab["depth"].shape == (nx, ny) and matlab["mask"].dtype == np.uint8 and matlab["depth"].dtype == np.float32

    with OpenEXR.File(str(folder / "maps.exr"), separate_channels=True) as exr:
        header, channels = exr.header(), exr.channels()
        for window in ("dataWindow", "displayWindow"):
            low, high = header[window]
            assert tuple(low) == (0, 0) and tuple(high) == (nx - 1, ny - 1), (window, low, high)
        wanted = {"Y": albedo, "albedo.Y": albedo, "depth.Z": depth, "depth_error.Z": maps["depth_error"], "mask.Y": mask}
        wanted |= {f"normal.{c}": normal[..., i] for i, c in enumerate("XYZ")}
        assert set(channels) == set(wanted), sorted(channels)
        for name, values in wanted.items():
            # Rows from the largest y down, columns from the largest x down.
            assert same(channels[name].pixels, values.T[::-1, ::-1]), name

    points = read_ply(folder / "points.ply")["vertex"]
    surface = mask & np.isfinite(depth)
    assert len(points) == surface.sum()
    assert same(np.sort(points["z"]), np.sort(depth[surface]))
    mesh = read_ply(folder / "mesh.ply")
    faces = np.array(mesh["face"]).reshape(-1, 3)
    if len(faces):
        vertices, seen = (np.stack([v[c] for c in "xyz"], -1) for v in (mesh["vertex"], points))
        x0, x1, y0, y1 = maps["extent"]
        pixel = max((x1 - x0) / nx, (y1 - y0) / ny)
        apart = [np.linalg.norm((seen - v)[:, :2], axis=1).min() for v in vertices]
        assert max(apart) < 0.81 * pixel, f"a vertex is {max(apart)} m aside of every point"
        assert faces.min() == 0 and faces.max() == len(mesh["vertex"]) - 1
        corners = np.stack([mesh["vertex"][c] for c in "xyz"], -1)[faces]
        facing = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        assert (facing[:, 2] < 0).all(), "triangles that face away from the wall"

    for name in ("albedo.png", "depth.png", "normal.png", "depth_error.png"):
        picture = matplotlib.image.imread(folder / name)
        assert picture.ndim == 3 and picture.shape[0] >= 128, (name, picture.shape)
    # Beside the depth map stands a colour bar with its labels.
    bar, plain = (matplotlib.image.imread(folder / n).shape[1] for n in ("depth.png", "albedo.png"))
    assert bar > plain or not surface.any()

    volume = np.load(folder / "volume.npz")
    with h5py.File(folder / "volume.hdf5") as file:
        assert set(file) == {"albedo", "extent"}, sorted(file)
        assert same(file["albedo"][:], volume["albedo"]) and same(file["extent"][:], volume["extent"])
        assert file["albedo"].shape[:2] == (nx, ny)


def check_captures(folder):
    plain = np.load(folder / "made.npz")
    counts = plain["H"]
    with h5py.File(folder / "made.hdf5") as file:
        assert same(file["H"][:], counts)
        assert file["H_format"][:] == [1] and file["t_accounts_first_and_last_bounces"][()] == 0
        assert "laser_xyz" not in file, "an unknown device is left out"
        for ours, theirs in (("laser_xyz", "laser_grid_xyz"), ("sensor_xyz", "sensor_grid_xyz")):
            assert same(file[theirs][:], plain[ours])
        assert file["delta_t"][()] == plain["delta_t"]
    raw = (folder / "made.mat").read_bytes()
    assert raw.startswith(b"MATLAB 7.3 MAT-file") and raw[124:128] == b"\0\2IM"
    assert raw[512:520] == b"\x89HDF\r\n\x1a\n"
    with h5py.File(folder / "made.mat") as file:
        # (t, d2, d1) here, (d1, d2, t) in MATLAB: d1 runs up, d2 to the left.
        assert same(file["meas"][:], counts)
        assert file["meas"].attrs["MATLAB_class"] == b"single"
        assert file["tofgrid"].shape == counts.shape[1:] and not file["tofgrid"][:].any()
    try:
        scipy.io.loadmat(folder / "made.mat")
    except NotImplementedError as reported:
        # scipy knows v7.3 by its header and sends one to an HDF5 reader.
        assert "HDF" in str(reported), reported


check_result(Path(sys.argv[1]))
check_captures(Path(sys.argv[2]))
print("all outputs open")
