"""Reconstruction."""

from __future__ import annotations

from typing import Any, Callable, Dict, List, NamedTuple, Optional, Tuple, Union

import numpy as np

from . import _native
from ._arrays import refuse
from ._capture import Capture
from ._maps import Maps

Interval = Tuple[float, float]


class Progress(NamedTuple):
    """A progress report."""

    doing: str
    """"trial" during estimates, "solve" afterwards."""
    iteration: int
    """Iterations done."""
    iterations: int
    """Maximum number of iterations of the solve."""
    seconds: float
    """Seconds since the start of the solve."""
    remaining: Optional[float]
    """Expected remaining seconds, if known."""
    loss: float
    """The loss."""
    lateral: int
    """Lateral resolution of the grid."""


ProgressCallback = Callable[[Progress], Optional[bool]]


def reconstruct(
    H: Any,
    sensor_xyz: Any = None,
    laser_xyz: Any = None,
    *,
    bin_width: Optional[float] = None,
    t0: float = 0.0,
    bins_axis: int = -1,
    photon_counts: Optional[bool] = None,
    pixels: Optional[int] = None,
    solver: str = "surface",
    model: Optional[str] = None,
    preset: Optional[str] = None,
    pulse: Union[None, str, float, Tuple[float, float]] = None,
    spot: Union[None, float, Tuple[float, float]] = None,
    gate: Optional[Tuple[Optional[float], Optional[float]]] = None,
    auto_gate: bool = True,
    stride: Optional[int] = None,
    subset: Optional[int] = None,
    wall: Optional[float] = None,
    volume: Optional[Tuple[Interval, Interval, Interval]] = None,
    bins: Union[None, str, int] = None,
    depth_pitch: Optional[float] = None,
    mask_fraction: Optional[float] = None,
    device: Union[None, str, int] = None,
    memory: Union[None, str, int] = None,
    progress: Optional[ProgressCallback] = None,
    **options: Any,
) -> Maps:
    """Reconstructs a hidden scene with the estimates and maps of `thirdbounce reconstruct`.

    H: a `Capture`, or its counts: (X, Y, T) or (P, T), with `bins_axis=0` (T, X, Y). float32 in C order is passed
        without conversion. The engine works on a copy.
    sensor_xyz, laser_xyz: (X, Y, 3) or (P, 3) points on the wall, metres, or one point; without `laser_xyz` confocal.
    bin_width, t0: width of a bin, and leading edge of bin 0, metres of path.
    photon_counts: whether counts are photon counts; None: true if all are non-negative integers.
    pixels: lateral pixels of the maps (the solver's option `lateral`).
    solver: "surface", "paper", or a closed-form method: "lct", "dlct", "fk", "phasor", "phasor-bp", "fbp", "bp".
    model: "cosine", "lambertian", "retroreflective", "isotropic", or "auto" to estimate one of the first three; None: the
        solver's default.
    preset: "synthetic" or "captured"; None: by the counts.
    pulse: impulse response: full width at half maximum, metres of path; the same and the length of the tail; "none"; "auto"
        (estimated); None: the capture's, else estimated where the data show one.
    spot: full width at half maximum of the spots on the wall, metres: one for both, or laser and sensor.
    gate: interval of path lengths, metres, e.g. (0.8, None); auto_gate=False uses all.
    stride, subset: use every Nth scan point; use this number of random pairs.
    wall: distance between the outermost scan points after scaling, metres.
    volume: reconstructed box: ((x0, x1), (y0, y1), (z0, z1)), metres.
    bins: "auto", "native", or number of neighbouring bins to sum; depth_pitch: depth of a voxel, metres.
    mask_fraction: mask threshold as a share of the brightest albedo; None: the method's own mask.
    device: index, part of the name, or UUID; memory: maximum device memory, bytes or text such as "2G".
    progress: called with a `Progress` about five times per second; cancels the solve if it returns False.
    options: options of the solver by their names in `thirdbounce.options()`; deterministic=True makes runs bit-identical.

    Ctrl-C cancels the solve with KeyboardInterrupt. The GIL is released meanwhile.
    """
    if isinstance(H, Capture):
        if sensor_xyz is not None or laser_xyz is not None or bin_width is not None:
            raise refuse("points or bins were given with a Capture", "a Capture holds them: leave them out")
        capture = H
    else:
        if sensor_xyz is None or bin_width is None:
            raise refuse("sensor_xyz or bin_width is missing", "give both with H, or give a Capture")
        capture = Capture(
            H,
            sensor_xyz,
            laser_xyz,
            bin_width=bin_width,
            t0=t0,
            bins_axis=bins_axis,
            photon_counts=photon_counts,
        )
    settings = _settings(solver, pixels, options, device, memory)
    settings.update(
        model=model,
        preset=preset,
        pulse=pulse,
        spot=(spot, spot) if np.isscalar(spot) else spot,
        gate=gate,
        auto_gate=auto_gate,
        stride=stride,
        subset=subset,
        wall=wall,
        volume=volume,
        bins=None if bins is None else str(bins),
        depth_pitch=depth_pitch,
        mask_fraction=mask_fraction,
    )
    return Maps._of(_native.reconstruct(capture._arrays(), settings, _callback(progress)))


def _settings(
    solver: str, pixels: Optional[int], options: Dict[str, Any], device: Any, memory: Any
) -> Dict[str, Any]:
    """Arguments of the native part, with defaults of those that sessions do not have."""
    if pixels is not None:
        options = {"lateral": pixels, **options}
    usual = ["model", "preset", "wall", "stride", "subset", "gate", "pulse", "spot", "bins", "depth_pitch", "volume"]
    settings: Dict[str, Any] = dict.fromkeys(usual + ["mask_fraction"])
    settings.update(
        solver=solver,
        options=list(options.items()),
        auto_gate=True,
        device=None if device is None else str(device),
        memory=memory,
    )
    return settings


def _callback(progress: Optional[ProgressCallback]) -> Optional[Callable[..., Optional[bool]]]:
    if progress is None:
        return None
    return lambda *fields: progress(Progress(*fields))


def options(solver: str = "surface") -> Dict[str, str]:
    """Options of a solver, with description and default."""
    return dict(_native.options(solver))


def devices() -> List[Dict[str, Any]]:
    """Vulkan devices of this machine: index, name, kind, memory in bytes, driver."""
    return _native.devices()
