"""Captures: histograms of pairs of wall points."""

from __future__ import annotations

import dataclasses
import os
from typing import Any, Dict, List, NamedTuple, Optional, Tuple, Union

import numpy as np

from . import _native
from ._arrays import as_array, as_counts, as_points, like_points, metres, refuse, texts

Path = Union[str, "os.PathLike[str]"]


class Pulse(NamedTuple):
    """Impulse response of an instrument."""

    samples: np.ndarray
    """(n,) float64."""
    width: float
    """Width of a sample, metres of path."""
    start: float
    """Leading edge of the first sample relative to the path, metres of path."""


@dataclasses.dataclass(eq=False, init=False)
class Capture:
    """Histograms of laser-sensor pairs on a relay wall, with the geometry of the scan.

    Its numpy arrays may be modified in place.
    """

    H: np.ndarray
    """(X, Y, T) float32: counts of pair (ix, iy) over path length. For a list of P pairs X = P and Y = 1."""
    sensor_xyz: np.ndarray
    """(X, Y, 3) float64: sensor points, metres."""
    laser_xyz: np.ndarray
    """(X, Y, 3) float64: laser points, metres. The same as `sensor_xyz` in a confocal scan."""
    bin_width: float
    """Width of a bin, metres of path."""
    t_start: float
    """Leading edge of bin 0, metres of path."""
    sensor_normal: Optional[np.ndarray]
    """(X, Y, 3) float64: the wall's unit normals at the sensor points, if known."""
    laser_normal: Optional[np.ndarray]
    """(X, Y, 3) float64: the same at the laser points."""
    photon_counts: Optional[bool]
    """Whether the counts are photon counts; None: true if all are non-negative integers."""
    pulse: Optional[Pulse]
    """Impulse response, if known."""
    laser_spot: Optional[float]
    """Full width at half maximum of the laser spot on the wall, metres."""
    sensor_spot: Optional[float]
    """The same of the sensor spot."""
    cycles: Optional[float]
    """Laser pulses per pair, if the detector records only the first photon of each."""
    direct: Optional[float]
    """Path of direct light in every pair, metres, if known."""
    devices: Optional[Tuple[Optional[Tuple[float, float, float]], Optional[Tuple[float, float, float]]]]
    """Positions of laser and detector, metres, if known."""
    empty: Optional[np.ndarray]
    """(X, Y, T) float32: counts of the same scan without the object, if they were measured: their light is subtracted where held-out pairs prove it."""
    name: str
    """Short name."""
    notes: List[str]
    """Values assumed by the reader, as sentences."""

    def __init__(
        self,
        H: Any,
        sensor_xyz: Any,
        laser_xyz: Any = None,
        *,
        bin_width: Union[float, str],
        t_start: Union[float, str] = 0.0,
        bins_axis: int = -1,
        sensor_normal: Any = None,
        laser_normal: Any = None,
        photon_counts: Optional[bool] = None,
        pulse: Optional[Tuple[Any, Union[float, str], Union[float, str]]] = None,
        laser_spot: Union[None, float, str] = None,
        sensor_spot: Union[None, float, str] = None,
        cycles: Optional[float] = None,
        direct: Union[None, float, str] = None,
        devices: Optional[Tuple[Any, Any]] = None,
        empty: Any = None,
        name: str = "arrays",
    ) -> None:
        """A capture from arrays.

        H: (X, Y, T) or (P, T) counts; with `bins_axis=0` (T, X, Y), as in npz files. numpy arrays, or arrays in host memory
            with DLPack support. float32 in C order is used in place, other arrays are converted.
        sensor_xyz, laser_xyz: (X, Y, 3) or (P, 3), metres; a single point (3,) is shared by all pairs. Without
            `laser_xyz` the scan is confocal.
        bin_width: metres of path, or text: "20ps", "6mm". So are all lengths.
        direct: path of direct light in every pair, metres, if the bins contain it.
        devices: positions (x, y, z) of laser and detector, metres; None for an unknown one. Their light may weaken with distance.
        empty: counts as `H`, of the same scan without the object. Sessions subtract them from every frame.
        """
        sensor = as_points(sensor_xyz, "sensor_xyz")
        laser = None if laser_xyz is None else as_points(laser_xyz, "laser_xyz")
        widest = sensor if laser is None or sensor.size >= laser.size else laser
        scan = (widest.shape[0], widest.shape[1])
        self.sensor_xyz = like_points(sensor, scan, "sensor_xyz")
        self.laser_xyz = self.sensor_xyz if laser is None else like_points(laser, scan, "laser_xyz")
        self.H = as_counts(H, scan, bins_axis)
        self.bin_width, self.t_start = metres(bin_width, "bin_width", True), metres(t_start, "t_start", True)
        self.sensor_normal = like_points(sensor_normal, scan, "sensor_normal")
        self.laser_normal = like_points(laser_normal, scan, "laser_normal")
        self.photon_counts = photon_counts
        if pulse is not None and len(pulse) != 3:
            raise refuse(f"pulse has {len(pulse)} parts", "give (samples, width of one, start of the first)")
        lengths = None if pulse is None else [metres(part, "pulse", True) for part in pulse[1:]]
        self.pulse = None if pulse is None else Pulse(as_array(pulse[0], np.float64, "pulse"), *lengths)
        spots = (("laser_spot", laser_spot), ("sensor_spot", sensor_spot))
        self.laser_spot, self.sensor_spot = (None if spot is None else metres(spot, key) for key, spot in spots)
        self.cycles = cycles
        self.direct = None if direct is None else metres(direct, "direct", True)
        self.devices = None if devices is None else as_devices(devices)
        self.empty = None if empty is None else as_counts(empty, scan, bins_axis)
        self.name, self.notes = name, []

    @property
    def scan(self) -> Tuple[int, int]:
        """Points along x and along y."""
        return (self.H.shape[0], self.H.shape[1])

    @property
    def is_confocal(self) -> bool:
        """Whether laser and sensor point coincide in every pair."""
        return self.laser_xyz is self.sensor_xyz or np.array_equal(self.laser_xyz, self.sensor_xyz)

    def save(self, path: Path) -> List[str]:
        """Writes the capture: .npz, .hdf5 (y-tal) or .mat (Stanford). Returns the information lost in the format, as sentences."""
        return _native.write(self._arrays(), path)

    def __repr__(self) -> str:
        x, y, bins = self.H.shape
        pairs = "confocal" if self.is_confocal else "not confocal"
        return f"<Capture {self.name!r}: {x} x {y} pairs, {pairs}, {bins} bins of {1e3 * self.bin_width:.4g} mm>"

    def _arrays(self) -> Dict[str, Any]:
        """Arguments of the native part, checked again, as fields may have been modified."""
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
            "devices": None if self.devices is None else as_devices(self.devices),
            "empty": None if self.empty is None else as_counts(self.empty, scan, -1).reshape(-1),
        }

    @classmethod
    def _of(cls, arrays: Dict[str, Any], notes: List[str]) -> Capture:
        """A capture from native arrays, without copies."""
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
        made.devices = None if not any(arrays["devices"]) else as_devices(arrays["devices"])
        made.empty = None if arrays["empty"] is None else arrays["empty"].reshape(made.H.shape)
        made.name, made.notes = arrays["name"], notes
        return made


def as_devices(devices: Any) -> Tuple[Any, Any]:
    """Positions of laser and detector as tuples of three numbers, or None each."""
    both = tuple(devices)
    if len(both) != 2:
        raise refuse(f"devices has {len(both)} parts", "give the positions of laser and detector, None for an unknown one")
    laser, sensor = (None if at is None else tuple(as_array(at, np.float64, "devices").tolist()) for at in both)
    for at in (laser, sensor):
        if at is not None and len(at) != 3:
            raise refuse(f"a position of devices has {len(at)} numbers", "give x, y, z in metres")
    return (laser, sensor)


def read(path: Path, **settings: Any) -> Capture:
    """Reads a capture of any format that thirdbounce knows: npz, y-tal, Z-NLOS, Stanford f-k, LCT and more.

    Settings complete files that lack a value: wall, bin_width, wall_depth_unit, bounce, tof, axes, array, keep_empty, flip, rotate, as for `reconstruct`;
    lengths are metres or text with a unit: wall="1m", bin_width="32ps".
    """
    arrays, notes = _native.read(path, texts(settings))
    return Capture._of(arrays, notes)
