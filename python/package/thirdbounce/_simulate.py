"""Captures of known scenes."""

from __future__ import annotations

from typing import Dict, Optional, Tuple, Union

from . import _native
from ._arrays import count, metres, refuse
from ._capture import Capture
from ._maps import Maps


def simulate(
    scene: str,
    *,
    scan: int = 32,
    wall: Union[float, str] = 1.0,
    bin_width: Union[float, str] = 0.006,
    bins: Optional[int] = None,
    pairs: str = "confocal",
    point: Tuple[float, float] = (0.0, 0.0),
    lasers: Optional[int] = None,
    model: str = "cosine",
    occlusion: bool = True,
    albedo: Optional[float] = None,
    pulse: Union[None, float, str] = None,
    photons: Optional[float] = None,
    dark: float = 0.0,
    seed: int = 0,
    noise: float = 0.01,
    truth_pixels: int = 128,
) -> Tuple[Capture, Maps]:
    """Renders a capture of a known scene, and its truth.

    scene: a name of `scenes()`, or the path of a .obj or .ply mesh.
    scan: points per side of the square wall; wall: its side, metres.
    bin_width: metres of path, or text: "20ps"; bins: None for as many as the scene's paths need.
    pairs: "confocal", "one-laser" or "one-sensor" (at `point`, metres), "exhaustive" (with `lasers` points per side), "irregular".
    model: how surfaces reflect: "cosine", "lambertian", "retroreflective" or "isotropic".
    pulse: full width at half maximum of the instrument's pulse, metres of path.
    photons: draw photon counts, with this mean count in the strongest bin; dark: mean dark counts of a bin.
    noise: sample until the rendering's noise (RMS error over RMS value) is below this.
    truth_pixels: pixels per side of the truth, whose albedo is 1 where there is surface.
    """
    wanted = {
        "scene": scene,
        "scan": count(scan, "scan"),
        "wall": metres(wall, "wall"),
        "bin_width": metres(bin_width, "bin_width", True),
        "bins": None if bins is None else count(bins, "bins"),
        "pairs": pairs,
        "point": point,
        "lasers": lasers,
        "model": model,
        "occlusion": occlusion,
        "albedo": albedo,
        "pulse": None if pulse is None else metres(pulse, "pulse", True),
        "photons": photons,
        "dark": dark,
        "seed": seed,
        "noise": noise,
        "truth_pixels": count(truth_pixels, "truth_pixels"),
    }
    try:
        capture, truth = _native.simulate(wanted)
    except (TypeError, OverflowError) as error:
        raise refuse(f"an argument has a wrong type: {error}", "see help(thirdbounce.simulate)") from error
    return Capture._of(capture, []), Maps._of(truth)


def scenes() -> Dict[str, str]:
    """The built-in scenes, and what each is."""
    return dict(_native.scenes())
