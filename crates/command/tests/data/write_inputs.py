"""Writes HDF5 and MATLAB files in many layouts with h5py and scipy, and beside each what stands in it as an npz file.

Usage: write_inputs.py FOLDER

An array of a MATLAB file has its axes reversed in the npz file, as in C order. Needs numpy, h5py and scipy.
"""

import sys
from pathlib import Path

import h5py
import numpy as np
import scipy.io

folder = Path(sys.argv[1])
random = np.random.default_rng(48)
COUNTS = random.poisson(3.0, (5, 7, 33))
REAL = random.normal(size=(5, 7, 33))


def beside(name, arrays):
    np.savez(folder / name, **{key: np.asarray(array, np.float64) for key, array in arrays.items()})


def hdf5(name, dtype, values, libver="earliest", group="", **layout):
    array = values.astype(dtype)
    with h5py.File(folder / f"{name}.h5", "w", libver=libver) as file:
        file.create_dataset(group + "counts", data=array, **layout)
        file.create_dataset("flag", data=True)
        file.create_dataset("scalar", data=np.float32(0.1))
        file.create_dataset("list", data=np.arange(4, dtype=">i4") - 1)
    beside(name, {group + "counts": array, "flag": 1.0, "scalar": np.float32(0.1), "list": np.arange(4) - 1})


for dtype in ("u1", "<u2", ">u2", "<u4", "<i8", "<f4", ">f4", "<f8", ">f8"):
    values = REAL if "f" in dtype else COUNTS
    plain = dtype.replace("<", "l").replace(">", "b")
    hdf5(f"plain_{plain}", dtype, values)
    hdf5(f"packed_{plain}", dtype, values, chunks=(2, 3, 8), compression="gzip", shuffle=True)
hdf5("checked", "<f4", REAL, chunks=(5, 7, 4), fletcher32=True)
hdf5("fast", "<u2", COUNTS, chunks=(1, 7, 33), compression="lzf")
hdf5("grows", "<u2", COUNTS, chunks=(2, 2, 2), maxshape=(None, None, 33))
for libver in ("v108", "v110", "latest"):
    hdf5(f"libver_{libver}", "<u2", COUNTS, libver, chunks=(2, 3, 8), compression="gzip")
    hdf5(f"one_chunk_{libver}", "<f4", REAL, libver, chunks=COUNTS.shape)
    hdf5(f"extends_{libver}", "<f4", REAL, libver, chunks=(2, 3, 8), maxshape=(None, 7, 33))
    hdf5(f"extends_twice_{libver}", "<f4", REAL, libver, chunks=(2, 3, 8), maxshape=(None, None, 33))
hdf5("group", "<f8", REAL, group="measured/")
hdf5("many", "<u2", random.poisson(3.0, (64, 64, 64)), chunks=(2, 8, 8), compression="gzip")


def matlab(name, arrays, **options):
    scipy.io.savemat(folder / f"{name}.mat", arrays, **options)
    flat = {}
    for key, array in arrays.items():
        fields = array.items() if isinstance(array, dict) else [("", array)]
        flat |= {f"{key}/{field}".rstrip("/"): np.atleast_2d(value).T for field, value in fields}
    beside(name, flat)


for pack in (False, True):
    for dtype in ("u1", "u2", "u4", "i1", "i2", "i4", "f4", "f8"):
        values = REAL if "f" in dtype else COUNTS
        matlab(f"{dtype}_{pack}", {"counts": values.astype(dtype), "scalar": 0.1}, do_compression=pack)
    # Stored as whole numbers of few bytes, though they are doubles.
    matlab(f"whole_{pack}", {"counts": COUNTS.astype("f8"), "row": np.arange(300.0)}, do_compression=pack)
    matlab(f"struct_{pack}", {"data": {"counts": COUNTS.astype("u2"), "width": 0.5}}, do_compression=pack)
    matlab(f"bool_{pack}", {"flags": COUNTS > 2}, do_compression=pack)

# One capture of Stanford's in both, its counts in chunks that blocks of bins cut.
(folder / "captures").mkdir()
counts, tof = random.poisson(3.0, (8, 6, 600)).astype("u2"), random.uniform(0, 900, (8, 6))
with h5py.File(folder / "captures" / "h5py.mat", "w") as file:
    file.create_dataset("meas", data=counts.T, chunks=(7, 4, 3), compression="gzip", shuffle=True)
    file.create_dataset("tofgrid", data=tof.T)
scipy.io.savemat(folder / "captures" / "scipy.mat", {"meas": counts, "tofgrid": tof}, do_compression=True)
