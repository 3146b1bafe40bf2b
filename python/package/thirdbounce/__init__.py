"""Non-line-of-sight reconstruction of hidden scenes from transient histograms.

    import thirdbounce as tb
    capture = tb.read("capture.npz")
    maps = tb.reconstruct(capture)
    maps.save("result")

Lengths are in metres, times in metres of path (seconds times 299 792 458). The relay wall is near z = 0, the hidden scene at
z > 0, y is up. The first index of arrays is along +x, the second along +y.
"""

import atexit
import os

# A scheduler of a cluster sets the threads of each of its workers; the native part reads this name at its first use.
if "OMP_NUM_THREADS" in os.environ:
    os.environ.setdefault("RAYON_NUM_THREADS", os.environ["OMP_NUM_THREADS"].split(",")[0])

from . import _native
from ._capture import Capture, Pulse, read
from ._maps import Layer, Maps, evaluate, load_maps
from ._native import (
    CancelledError,
    DefectError,
    DeviceError,
    Error,
    InputError,
    OptionsError,
    OutOfMemoryError,
    OutputError,
    __version__,
)
from ._session import Latency, Session
from ._solve import Progress, benchmark, devices, options, reconstruct
from ._simulate import scenes, simulate

# Compiled kernels are kept for later runs when a device closes.
atexit.register(_native.close_devices)

__all__ = [
    "CancelledError",
    "Capture",
    "DefectError",
    "DeviceError",
    "Error",
    "InputError",
    "Latency",
    "Layer",
    "Maps",
    "OptionsError",
    "OutOfMemoryError",
    "OutputError",
    "Progress",
    "Pulse",
    "Session",
    "__version__",
    "benchmark",
    "devices",
    "evaluate",
    "load_maps",
    "options",
    "read",
    "reconstruct",
    "scenes",
    "simulate",
]
