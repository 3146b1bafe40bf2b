"""Reconstruction."""

from __future__ import annotations

import os
import warnings
from typing import Any, Callable, Dict, List, NamedTuple, Optional, Sequence, Union

from . import _native
from ._arrays import refuse, texts
from ._capture import Capture, Path
from ._maps import Maps, evaluate


class Progress(NamedTuple):
    """Progress of a solve."""

    doing: str
    """"trial" during the short fits of estimates, "solve" afterwards, "done" once at the end."""
    iteration: int
    """Iterations done of the estimates or of the solve, in which they never decrease. Of "done": those of the solve."""
    iterations: int
    """Largest number of iterations, which a solve that converges does not reach; for estimates, as many as are expected."""
    seconds: float
    """Seconds since the call, or since the frame began."""
    remaining: Optional[float]
    """Seconds left, if known."""
    loss: float
    """The loss."""
    lateral: int
    """Lateral resolution of the grid."""
    fraction: float
    """Share of the whole that is done, estimates included, from 0 to 1. It never decreases."""


# Arguments that are no settings.
_ARGUMENTS = ("sensor_xyz", "laser_xyz", "bin_width", "t_start", "bins_axis", "photon_counts", "truth", "on_progress")

OnProgress = Callable[[Progress], Optional[bool]]


def reconstruct(
    H: Any,
    sensor_xyz: Any = None,
    laser_xyz: Any = None,
    *,
    bin_width: Union[None, float, str] = None,
    t_start: Union[float, str] = 0.0,
    bins_axis: int = -1,
    photon_counts: Optional[bool] = None,
    truth: Union[None, Maps, Path] = None,
    on_progress: Optional[OnProgress] = None,
    **settings: Any,
) -> Maps:
    """Reconstructs a hidden scene: the same maps as `thirdbounce reconstruct`.

    H: a `Capture`, the path of a file of any format, or counts: (X, Y, T) or (P, T), with `bins_axis=0` (T, X, Y). float32 in C order is read in place; other
        arrays are converted first. The engine works on a copy.
    sensor_xyz, laser_xyz: (X, Y, 3) or (P, 3) points on the wall, metres, or one point; confocal without `laser_xyz`.
    bin_width, t_start: width of a bin, and leading edge of bin 0, metres of path or text: "20ps".
    truth: measure the result against this truth, that of `simulate` or its file: `Maps.metrics`, and in the report.
    photon_counts: whether counts are photon counts; None: true if all are non-negative integers.
    on_progress: called with a `Progress` about five times a second; the solve stops if it returns False.
    settings: those of the command, by their names with underscores. Lengths are metres, or text with a unit: "2m", "32ps".
        None is the default or an estimate. The most useful ones:

        solver: "surface", "paper", or a closed form: "lct", "dlct", "fk", "phasor", "phasor-bp", "fbp", "bp".
        lateral: lateral pixels of the maps; iterations; deterministic=True for the same bits from every run.
        model: "cosine", "lambertian", "retroreflective", "isotropic", or "auto".
        preset: "synthetic" or "captured".
        pulse: impulse response: the full width at half maximum, metres of path; (width, tail); "none"; "auto".
        spot: full width at half maximum of the spots on the wall, metres: one for both, or (laser, sensor).
        gate: paths to use, metres: (0.8, None); auto_gate=False uses all. keep_empty=True keeps pairs without any count.
        stride, subset: every Nth scan point; a number of pairs, drawn at random.
        wall: distance of the outermost points, metres; the scan is scaled to it.
        volume: reconstructed box: ((x0, x1), (y0, y1), (z0, z1)), metres.
        bins: "auto", "native", or the number of neighbouring bins that are one; depth_pitch: voxel size along z, metres.
        keep_volume: True for `Maps.volume`.
        mask_fraction: a pixel is surface above this share of the brightest albedo.
        device: index or part of the name; memory: largest amount of device memory, bytes or text such as "2G".
        Options of the solver: `thirdbounce.options()`.

    Ctrl-C cancels the solve with KeyboardInterrupt. The GIL is released meanwhile.
    """
    path, capture, given = None, None, texts(settings, _ARGUMENTS)
    if isinstance(H, (str, os.PathLike)):
        if sensor_xyz is not None or laser_xyz is not None:
            raise refuse("points were given with a file", "the file holds them: leave them out")
        path = os.fspath(H)
        # A setting, for files without it.
        given += texts({"bin_width": bin_width})
    elif isinstance(H, Capture):
        if sensor_xyz is not None or laser_xyz is not None or bin_width is not None:
            raise refuse("points or bins were given with a Capture", "a Capture holds them: leave them out")
        capture = H
    else:
        missing = [name for name, value in (("sensor_xyz", sensor_xyz), ("bin_width", bin_width)) if value is None]
        if missing:
            raise refuse(f"{' and '.join(missing)} missing", "give them with H, or give a Capture")
        capture = Capture(
            H,
            sensor_xyz,
            laser_xyz,
            bin_width=bin_width,
            t_start=t_start,
            bins_axis=bins_axis,
            photon_counts=photon_counts,
        )
    arrays = None if capture is None else capture._arrays()
    file = None if truth is None or isinstance(truth, Maps) else truth
    maps = Maps._of(_native.reconstruct(arrays, path, file, given, _on_progress(on_progress)))
    if isinstance(truth, Maps):
        maps.metrics = evaluate(maps, truth)
        if maps.report is not None:
            maps.report["metrics"] = maps.metrics
    return maps


def benchmark(
    capture: Any,
    truth: Union[Maps, Path],
    methods: Sequence[Union[str, Dict[str, Any]]] = ("surface", "lct", "fk", "phasor", "fbp"),
    **settings: Any,
) -> Dict[str, Maps]:
    """Reconstructs a capture by several methods and measures each: maps with `metrics` and `seconds`, by method.

    capture: as for `reconstruct`; truth: that of `simulate`, or its file.
    methods: names, or settings with a `solver` each: {"solver": "paper", "iterations": 500}. settings: those of all.
    A method that does not take the capture is left out with a warning that says why. Pages, curves and other programs:
    `thirdbounce benchmark`.
    """
    results: Dict[str, Maps] = {}
    for method in methods:
        own = {"solver": method} if isinstance(method, str) else dict(method)
        name = ", ".join([str(own["solver"])] + [f"{key}={value}" for key, value in own.items() if key != "solver"])
        try:
            results[name] = reconstruct(capture, truth=truth, **{**settings, **own})
        except _native.InputError as error:
            if own["solver"] in ("surface", "paper"):
                raise
            warnings.warn(f"{name} is left out: {error.what}", stacklevel=2)
    return results


def _on_progress(on_progress: Optional[OnProgress]) -> Optional[Callable[..., Optional[bool]]]:
    if on_progress is None:
        return None
    return lambda *values: on_progress(Progress(*values))


def options(solver: str = "surface") -> Dict[str, str]:
    """The options of a solver, each with its description and default."""
    return dict(_native.options(solver))


def devices() -> List[Dict[str, Any]]:
    """Devices of this machine, of Vulkan and the host: index, name, kind, memory in bytes, driver."""
    return _native.devices()
