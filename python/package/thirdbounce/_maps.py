"""Maps: the result of a reconstruction."""

from __future__ import annotations

import dataclasses
import json
import os
from typing import Any, Dict, List, Optional, Tuple, Union

import numpy as np

from . import _native
from ._arrays import as_bools

Path = Union[str, "os.PathLike[str]"]


@dataclasses.dataclass(eq=False)
class Layer:
    """Second layer, on the same pixels."""

    albedo: np.ndarray
    """(nx, ny) float32; 0 where there is no second surface."""
    depth: np.ndarray
    """(nx, ny) float32, metres; NaN where there is no second surface."""
    normals: np.ndarray
    """(nx, ny, 3) float32, unit vectors; NaN where there is no second surface."""
    mask: np.ndarray
    """(nx, ny) bool: surface pixels."""
    depth_error: Optional[np.ndarray]
    """(nx, ny) float32: expected depth error, metres."""


@dataclasses.dataclass(eq=False)
class Maps:
    """Albedo, depth and normals of a hidden scene, as seen from the wall. The first index runs along +x, the second along +y."""

    albedo: np.ndarray
    """(nx, ny) float32, in the solver's own scale; 0 where there is no surface. Of truth 1 where there is one."""
    depth: np.ndarray
    """(nx, ny) float32: distance from the plane z = 0, metres; NaN where there is no surface."""
    normals: np.ndarray
    """(nx, ny, 3) float32: unit vectors towards the wall (z < 0); NaN where there is no surface."""
    mask: np.ndarray
    """(nx, ny) bool: surface pixels."""
    extent: Tuple[float, float, float, float]
    """Outer edges of the pixels: x min, x max, y min, y max, metres."""
    depth_error: Optional[np.ndarray] = None
    """(nx, ny) float32: expected depth error, metres (two of three pixels with a given value have a smaller error); None if unknown."""
    behind: Optional[Layer] = None
    """The second layer; None if no pixel has two surfaces."""
    mask_fraction: Optional[float] = None
    """Mask threshold as a share of the brightest albedo; None: the method's own mask."""
    probability: Optional[np.ndarray] = None
    """(nx, ny) float32: probability of surface, where a network concludes; else None."""
    report: Optional[Dict[str, Any]] = None
    """Content of report.json: settings, plan, trace, times; None for truth and frames."""
    notes: List[str] = dataclasses.field(default_factory=list)
    """What was done to the capture, as sentences."""
    warnings: List[str] = dataclasses.field(default_factory=list)
    """What looks wrong with the capture or the result, as sentences."""
    verdict: Optional[str] = None
    """good, fair or poor; the reasons are in report["verdict"]. None for truth and earlier maps."""
    frame: Optional[int] = None
    """Frame number of a session."""
    seconds: Optional[float] = None
    """Solve time, seconds."""
    metrics: Optional[Dict[str, Any]] = None
    """Figures against truth, if `truth` was given: iou, depth_mae, normal_error_deg and others of `evaluate`."""
    volume: Optional[np.ndarray] = None
    """(nx, ny, nz) float32: albedo of the voxels, with `keep_volume=True`."""
    volume_extent: Optional[Tuple[float, ...]] = None
    """Outer faces of the volume: x min, x max, y min, y max, z min, z max, metres."""
    page: Any = dataclasses.field(default=None, repr=False)
    """What report.html shows of the capture."""

    @property
    def shape(self) -> Tuple[int, int]:
        """Pixels along x and along y."""
        return (self.albedo.shape[0], self.albedo.shape[1])

    @property
    def x(self) -> np.ndarray:
        """(nx,) float64: x of the pixels' centres, metres."""
        return _centres(self.extent[0], self.extent[1], self.shape[0])

    @property
    def y(self) -> np.ndarray:
        """(ny,) float64: y of the pixels' centres, metres."""
        return _centres(self.extent[2], self.extent[3], self.shape[1])

    @property
    def layers(self) -> List[Layer]:
        """The first layer, and the second if present."""
        first = Layer(self.albedo, self.depth, self.normals, self.mask, self.depth_error)
        return [first] if self.behind is None else [first, self.behind]

    def points(self) -> np.ndarray:
        """(n, 3) float32: surface points, x, y, z in metres."""
        x, y = np.meshgrid(self.x, self.y, indexing="ij")
        return np.stack([x, y, self.depth], axis=-1)[self.mask].astype(np.float32)

    def save(self, path: Path) -> List[str]:
        """Writes the maps, and returns the paths of the files.

        A path with an ending is one file: .npz, .mat (MATLAB) and .exr hold all arrays, .ply the surface points; .svg is a
        figure of all maps with axes on white, .png shows them side by side without axes. A path without an ending is a folder
        with what the command writes: maps.npz, maps.mat, maps.exr, maps.svg, pictures, points.ply, mesh.ply, report.html,
        and report.json if there is a report.
        """
        report = None if self.report is None else json.dumps(self.report, indent=2) + "\n"
        return [os.fspath(p) for p in _native.write_maps(self._arrays(), path, report, self.page)]

    def plot(self, axes: Any = None) -> Any:
        """Draws albedo, depth, normals and, if it is known, the depth_error, by matplotlib. Returns the figure.

        Pictures show what an eye at the wall sees: +x to the left.

        axes: draw into these axes, one for each picture, instead of a new figure.
        """
        try:
            import matplotlib.pyplot as plt
        except ImportError as error:
            raise ImportError("plot() needs matplotlib: pip install matplotlib") from error
        shown = self._shown()
        left, right, bottom, top = self.extent
        if axes is None:
            _, axes = plt.subplots(1, len(shown), figsize=(3.6 * len(shown), 3.4), layout="constrained")
        for ax, (title, image, colours, unit) in zip(np.ravel(axes), shown):
            seen = np.swapaxes(image[::-1], 0, 1)
            picture = ax.imshow(seen, origin="lower", extent=(right, left, bottom, top), cmap=colours)
            ax.set(title=title, xlabel="x in m")
            ax.set_facecolor("black")
            if unit:
                ax.figure.colorbar(picture, ax=ax, label=unit, shrink=0.8)
        first = np.ravel(axes)[0]
        first.set_ylabel("y in m")
        return first.figure

    def _shown(self) -> List[Tuple[str, np.ndarray, Optional[str], Optional[str]]]:
        """Title, image, colours and unit of each picture."""
        off = ~self.mask
        colour = np.clip(0.5 * (self.normals * (-1, 1, -1) + 1), 0, 1)
        colour[off | ~np.isfinite(colour).all(axis=2)] = 0
        shown = [
            ("albedo", self.albedo, "gray", None),
            ("depth", np.where(off, np.nan, self.depth), "viridis_r", "m"),
            ("normals", colour, None, None),
        ]
        if self.depth_error is not None:
            shown.append(("expected depth error", np.where(off, np.nan, 1e3 * self.depth_error), "magma", "mm"))
        return shown

    def _repr_png_(self) -> bytes:
        """Albedo and depth side by side: notebooks show it."""
        return _native.picture(self._arrays())

    def __repr__(self) -> str:
        x, y = self.shape
        found = f"{100 * self.mask.mean():.1f} % surface"
        if self.mask.any():
            near, far = np.nanmin(self.depth[self.mask]), np.nanmax(self.depth[self.mask])
            found += f", {near:.3f} to {far:.3f} m deep"
        return f"<Maps of {x} x {y} pixels, {found}>"

    def _arrays(self) -> Dict[str, Any]:
        def flat(layer: Union[Maps, Layer]) -> Dict[str, Any]:
            def array(value: Any, dtype: Any) -> Optional[np.ndarray]:
                return None if value is None else np.ascontiguousarray(value, dtype=dtype).reshape(-1)

            floats = ["albedo", "depth", "normals", "depth_error"]
            made = {key: array(getattr(layer, key), np.float32) for key in floats}
            made["mask"] = as_bools(layer.mask)
            return made

        made = flat(self)
        made["shape"] = self.shape
        made["extent"] = tuple(map(float, self.extent))
        made["mask_fraction"] = self.mask_fraction
        made["probability"] = None if self.probability is None else np.ascontiguousarray(self.probability, np.float32).reshape(-1)
        made["behind"] = None if self.behind is None else flat(self.behind)
        return made

    @classmethod
    def _of(cls, arrays: Dict[str, Any]) -> Maps:
        """The maps of what the native part gives. Nothing is copied."""
        arrays["extent"] = tuple(arrays["extent"])
        if arrays["behind"] is not None:
            arrays["behind"] = Layer(**arrays["behind"])
        if "report" in arrays:
            arrays["report"] = json.loads(arrays["report"])
            arrays["seconds"] = arrays["report"]["totals"]["solve_s"]
            arrays["metrics"] = arrays["report"]["metrics"]
            arrays.setdefault("warnings", arrays["report"].get("warnings", []))
            arrays.setdefault("verdict", (arrays["report"].get("verdict") or {}).get("grade"))
        return cls(**arrays)


def _centres(low: float, high: float, count: int) -> np.ndarray:
    return low + (np.arange(count) + 0.5) * (high - low) / count


def load_maps(path: Path) -> Maps:
    """Reads an earlier result: its folder, with the report, or its maps.npz."""
    return Maps._of(_native.read_maps(path))


def evaluate(maps: Union[Maps, Path], truth: Union[Maps, Path], mask_fraction: Optional[float] = None) -> Dict[str, Any]:
    """Measures maps against truth, as `thirdbounce evaluate`: iou, completeness, depth_mae and depth_rmse (metres),
    normal_error_deg, paper (the measure of Shim et al.) and others.

    maps: maps, or the folder or file of a result. truth: that of `simulate`, or its file.
    mask_fraction: a pixel is surface above this share of the brightest albedo; None: the maps' own mask.
    """
    maps = maps if isinstance(maps, Maps) else load_maps(maps)
    truth = truth if isinstance(truth, Maps) else Maps._of(_native.read_truth(truth))
    figures: Dict[str, Any] = json.loads(_native.evaluate(maps._arrays(), truth._arrays(), mask_fraction))
    return figures
