"""Captures: histograms of pairs of wall points."""

from __future__ import annotations

import dataclasses
import os
from typing import Any, Dict, List, NamedTuple, Optional, Tuple, Union

import numpy as np

from . import _native
from ._arrays import as_array, as_counts, as_points, like_points, texts

Path = Union[str, "os.PathLike[str]"]


class Pulse(NamedTuple):
    """How an instrument spreads a path over time."""

    samples: np.ndarray
    """(n,) float64."""
    width: float
    """Width of a sample, metres of path."""
    start: float
    """Leading edge of the first sample behind the path's end, metres of path."""


@dataclasses.dataclass(eq=False, init=False)
class Capture:
    """Histograms of pairs of points on a relay wall, with the geometry of the scan.

    Its arrays are numpy arrays, and may be changed in place.
    """

    H: np.ndarray
    """(X, Y, T) float32: counts of pair (ix, iy) by the length of the path. For a list of P pairs X = P and Y = 1."""
    sensor_xyz: np.ndarray
    """(X, Y, 3) float64: where the sensor looks, metres."""
    laser_xyz: np.ndarray
    """(X, Y, 3) float64: where the laser shines, metres. Of a confocal scan the same as `sensor_xyz`."""
    bin_width: float
    """Width of a bin, metres of path."""
    t_start: float
    """Leading edge of bin 0, metres of path."""
    sensor_normal: Optional[np.ndarray]
    """(X, Y, 3) float64: the wall's unit normals at the sensor points, if known."""
    laser_normal: Optional[np.ndarray]
    """(X, Y, 3) float64: the same at the laser points."""
    photon_counts: Optional[bool]
    """Whether the counts are photon counts; None: if all are whole and none is negative."""
    pulse: Optional[Pulse]
    """The instrument's pulse, if known."""
    laser_spot: Optional[float]
    """Full width at half maximum of what the laser lights on the wall, metres."""
    sensor_spot: Optional[float]
    """The same of what the sensor sees."""
    cycles: Optional[float]
    """Laser pulses of each pair, if the detector records only the first photon of each."""
    direct: Optional[float]
    """The path of light from the wall itself in every pair, metres, if it is known."""
    name: str
    """A short name."""
    notes: List[str]
    """What the reader assumed, as sentences."""

    def __init__(
        self,
        H: Any,
        sensor_xyz: Any,
        laser_xyz: Any = None,
        *,
        bin_width: float,
        t_start: float = 0.0,
        bins_axis: int = -1,
        sensor_normal: Any = None,
        laser_normal: Any = None,
        photon_counts: Optional[bool] = None,
        pulse: Optional[Tuple[Any, float, float]] = None,
        laser_spot: Optional[float] = None,
        sensor_spot: Optional[float] = None,
        cycles: Optional[float] = None,
        direct: Optional[float] = None,
        name: str = "arrays",
    ) -> None:
        """A capture of arrays.

        H: (X, Y, T) or (P, T) counts; with `bins_axis=0` (T, X, Y), as npz files have it. numpy arrays, and arrays of other
            libraries that speak DLPack and are in the host's memory. float32 in C order is used in place, other arrays are
            converted.
        sensor_xyz, laser_xyz: (X, Y, 3) or (P, 3), metres; a single point (3,) is that of every pair. Without
            `laser_xyz` the scan is confocal.
        bin_width: metres of path.
        direct: the path of light that comes from the wall itself in every pair, metres, if the capture holds it.
        """
        sensor = as_points(sensor_xyz, "sensor_xyz")
        laser = None if laser_xyz is None else as_points(laser_xyz, "laser_xyz")
        widest = sensor if laser is None or sensor.size >= laser.size else laser
        scan = (widest.shape[0], widest.shape[1])
        self.sensor_xyz = like_points(sensor, scan, "sensor_xyz")
        self.laser_xyz = self.sensor_xyz if laser is None else like_points(laser, scan, "laser_xyz")
        self.H = as_counts(H, scan, bins_axis)
        self.bin_width, self.t_start = float(bin_width), float(t_start)
        self.sensor_normal = like_points(sensor_normal, scan, "sensor_normal")
        self.laser_normal = like_points(laser_normal, scan, "laser_normal")
        self.photon_counts = photon_counts
        self.pulse = None if pulse is None else Pulse(as_array(pulse[0], np.float64, "pulse"), *map(float, pulse[1:]))
        self.laser_spot, self.sensor_spot, self.cycles = laser_spot, sensor_spot, cycles
        self.direct = direct
        self.name, self.notes = name, []

    @property
    def scan(self) -> Tuple[int, int]:
        """Points along x and along y."""
        return (self.H.shape[0], self.H.shape[1])

    @property
    def is_confocal(self) -> bool:
        """Whether laser and sensor point of every pair are the same."""
        return self.laser_xyz is self.sensor_xyz or np.array_equal(self.laser_xyz, self.sensor_xyz)

    def save(self, path: Path) -> List[str]:
        """Writes the capture: .npz, .hdf5 (y-tal) or .mat (Stanford). Returns what the format cannot hold, as sentences."""
        return _native.write(self._arrays(), path)

    def __repr__(self) -> str:
        x, y, bins = self.H.shape
        pairs = "confocal" if self.is_confocal else "not confocal"
        return f"<Capture {self.name!r}: {x} x {y} pairs, {pairs}, {bins} bins of {1e3 * self.bin_width:.4g} mm>"

    def _arrays(self) -> Dict[str, Any]:
        """What the native part takes. A field may have been changed since the capture was made."""
        scan = self.scan

        def flat(points: Any, name: str) -> Optional[np.ndarray]:
            shaped = like_points(points, scan, name)
            return None if shaped is None else shaped.reshape(-1)

        return {
            "name": self.name,
            "scan": scan,
            "counts": as_counts(self.H, scan, -1).reshape(-1),
            "laser": flat(self.laser_xyz, "laser_xyz"),
            "sensor": flat(self.sensor_xyz, "sensor_xyz"),
            "laser_normal": flat(self.laser_normal, "laser_normal"),
            "sensor_normal": flat(self.sensor_normal, "sensor_normal"),
            "bins": self.H.shape[2],
            "bin_width": self.bin_width,
            "t_start": self.t_start,
            "photon_counts": self.photon_counts,
            "pulse": None if self.pulse is None else tuple(self.pulse),
            "laser_spot": self.laser_spot,
            "sensor_spot": self.sensor_spot,
            "cycles": self.cycles,
            "direct": self.direct,
        }

    @classmethod
    def _of(cls, arrays: Dict[str, Any], notes: List[str]) -> Capture:
        """The capture of what the native part gives. Nothing is copied."""
        scan = tuple(arrays["scan"])

        def shaped(key: str) -> Optional[np.ndarray]:
            return None if arrays[key] is None else arrays[key].reshape(scan + (3,))

        made = cls.__new__(cls)
        made.H = arrays["counts"].reshape(scan + (arrays["bins"],))
        made.sensor_xyz, made.laser_xyz = shaped("sensor"), shaped("laser")
        made.sensor_normal, made.laser_normal = shaped("sensor_normal"), shaped("laser_normal")
        made.bin_width, made.t_start = arrays["bin_width"], arrays["t_start"]
        made.photon_counts = arrays["photon_counts"]
        made.pulse = None if arrays["pulse"] is None else Pulse(*arrays["pulse"])
        made.laser_spot, made.sensor_spot = arrays["laser_spot"], arrays["sensor_spot"]
        made.cycles, made.direct = arrays["cycles"], arrays["direct"]
        made.name, made.notes = arrays["name"], notes
        return made


def read(path: Path, **settings: Any) -> Capture:
    """Reads a capture of any format that thirdbounce knows: npz, y-tal, Z-NLOS, Stanford f-k, LCT and more.

    Settings complete files that lack a value: wall, bin_width, wall_depth_unit, bounce, tof, axes, keep_empty, flip, rotate, as for `reconstruct`;
    lengths are metres or text with a unit: wall="1m", bin_width="133ps".
    """
    arrays, notes = _native.read(path, texts(settings))
    return Capture._of(arrays, notes)
