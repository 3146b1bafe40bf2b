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
    """What a progress function is told."""

    doing: str
    """"trial" while quick trials look for the model and the pulse, "solve" afterwards."""
    iteration: int
    """Iterations that are done."""
    iterations: int
    """The most iterations of the solve."""
    seconds: float
    """Seconds since the solve began."""
    remaining: Optional[float]
    """Seconds that are left, if that is known."""
    loss: float
    """The loss."""
    lateral: int
    """Lateral resolution of the grid."""


Hear = Callable[[Progress], Optional[bool]]


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
    keep_empty: bool = False,
    stride: Optional[int] = None,
    subset: Optional[int] = None,
    wall: Optional[float] = None,
    volume: Optional[Tuple[Interval, Interval, Interval]] = None,
    bins: Union[None, str, int] = None,
    depth_pitch: Optional[float] = None,
    mask_fraction: Optional[float] = None,
    device: Union[None, str, int] = None,
    memory: Union[None, str, int] = None,
    progress: Optional[Hear] = None,
    **options: Any,
) -> Maps:
    """Reconstructs a hidden scene, as `thirdbounce reconstruct` does: the same trials, the same maps.

    H: a `Capture`, or its counts: (X, Y, T) or (P, T), with `bins_axis=0` (T, X, Y). float32 in C order is handed over as it
        is; everything else is converted first. The engine works on a copy of its own.
    sensor_xyz, laser_xyz: (X, Y, 3) or (P, 3) points on the wall, metres, or one point; without `laser_xyz` confocal.
    bin_width, t0: width of a bin, and leading edge of bin 0, metres of path.
    photon_counts: whether counts are photon counts; None: if all are whole and none is negative.
    pixels: lateral pixels of the maps (the solver's option `lateral`).
    solver: "surface", "paper", or a closed-form method: "lct", "dlct", "fk", "phasor", "phasor-bp", "fbp", "bp".
    model: "cosine", "lambertian", "retroreflective", "isotropic", or "auto" to try the first three; None: as the solver does.
    preset: "synthetic" or "captured"; None: as the counts are.
    pulse: full width at half maximum, metres of path; the same and the length of the tail; "none"; "auto" to find it; None:
        the capture's, else it is found where it shows.
    spot: full width at half maximum of the spots on the wall, metres: one for both, or laser and sensor.
    gate: use only these paths, metres, for example (0.8, None); auto_gate=False uses all.
    keep_empty: keep pairs without any count as dark ones; otherwise those beside lit pairs are left out.
    stride, subset: use every Nth scan point; use only so many pairs, drawn at random.
    wall: scale the wall so that its outermost points are this far apart, metres.
    volume: the box to reconstruct: ((x0, x1), (y0, y1), (z0, z1)), metres.
    bins: "auto", "native", or how many neighbouring bins are one; depth_pitch: depth of a voxel, metres.
    mask_fraction: a pixel is surface above this share of the brightest albedo; None: found at the albedo's edges.
    device: index or part of the name; memory: most device memory, bytes or text such as "2G".
    progress: is called with a `Progress` about five times a second, and stops the solve if it returns False.
    options: the options of the solver, by their names in `thirdbounce.options()`; deterministic=True repeats bit by bit.

    Ctrl-C stops the solve: KeyboardInterrupt. Other threads run meanwhile.
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
        keep_empty=keep_empty,
        stride=stride,
        subset=subset,
        wall=wall,
        volume=volume,
        bins=None if bins is None else str(bins),
        depth_pitch=depth_pitch,
        mask_fraction=mask_fraction,
    )
    return Maps._of(_native.reconstruct(capture._arrays(), settings, _hear(progress)))


def _settings(
    solver: str, pixels: Optional[int], options: Dict[str, Any], device: Any, memory: Any
) -> Dict[str, Any]:
    """What the native part takes, with the usual values of everything that `reconstruct` has and sessions do not."""
    if pixels is not None:
        options = {"lateral": pixels, **options}
    usual = ["model", "preset", "wall", "stride", "subset", "gate", "pulse", "spot", "bins", "depth_pitch", "volume"]
    settings: Dict[str, Any] = dict.fromkeys(usual + ["mask_fraction"])
    settings.update(
        solver=solver,
        options=list(options.items()),
        auto_gate=True,
        keep_empty=False,
        device=None if device is None else str(device),
        memory=memory,
    )
    return settings


def _hear(progress: Optional[Hear]) -> Optional[Callable[..., Optional[bool]]]:
    if progress is None:
        return None
    return lambda *told: progress(Progress(*told))


def options(solver: str = "surface") -> Dict[str, str]:
    """The options of a solver, and what each is and is by default."""
    return dict(_native.options(solver))


def devices() -> List[Dict[str, Any]]:
    """The Vulkan devices of this machine: index, name, kind, memory in bytes, driver."""
    return _native.devices()
