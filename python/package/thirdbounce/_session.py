"""Sessions: frame after frame of one scan."""

from __future__ import annotations

from types import TracebackType
from typing import Any, Dict, NamedTuple, Optional, Type, Union

import numpy as np

from . import _native
from ._arrays import as_bools, as_counts, as_points, like_points, texts
from ._capture import Capture
from ._maps import Maps
from ._solve import OnProgress, _on_progress


class Latency(NamedTuple):
    """Times of the last frames, up to 256, from submission to result, in seconds: what waits is included."""

    frames: int
    """Frames that were solved."""
    dropped: int
    """Frames that were submitted and never solved, as newer ones replaced them."""
    last: float
    """The last frame's."""
    median: float
    """Half of the frames took no longer."""
    p90: float
    """Nine of ten."""
    p99: float
    """Ninety-nine of a hundred."""
    frames_per_second: float
    """Results in a second, while frames came; 0 before the second one."""


class Session:
    """A solver that is made once for a scan: planned, compiled and allocated. Then frames of counts go in, and maps come out.

        with tb.Session(points, bins=512, bin_width=0.006, lateral=64) as session:
            for H in camera:
                session.submit(H)
                show(session.wait())

    One frame at a time is solved, in a thread of the session's own; `submit` returns at once. Methods may be called from any
    thread. A session that is made of a `Capture` finds the model and the pulse that nobody named in its counts, as
    `reconstruct` does; one that is made of points takes the cosine model.
    """

    def __init__(
        self,
        sensor_xyz: Any,
        laser_xyz: Any = None,
        *,
        bins: Optional[int] = None,
        bin_width: Optional[float] = None,
        t_start: float = 0.0,
        photon_counts: bool = False,
        time_limit: Optional[float] = None,
        on_progress: Optional[OnProgress] = None,
        feed: Union[str, float] = "one",
        **settings: Any,
    ) -> None:
        """Prepares for frames of a scan.

        sensor_xyz, laser_xyz: (X, Y, 3) or (P, 3) points, metres, as for `Capture`; or a `Capture`, whose points, bins, pulse and
            spots are those of the frames, and whose counts tell how deep the volume is, which model fits, and how wide the
            pulse is.
        bins, bin_width, t_start: number and width of the bins, and leading edge of bin 0, metres of path.
        photon_counts: whether counts are photon counts; else the noise of each frame is estimated, which takes longer.
        time_limit: a frame that takes longer is stopped, seconds.
        feed: what becomes of frames that come while one is solved: "one" refuses them, "newest" keeps the newest, "every" solves
            all in order; a number from 0 to 1 adds all up and multiplies the sum by it before each.
        on_progress: called with a `Progress` by the session's thread; the frame stops if it returns False.
        settings: as for `reconstruct`.
        """
        if isinstance(sensor_xyz, Capture):
            arrays = sensor_xyz._arrays()
        else:
            arrays = _scan(sensor_xyz, laser_xyz, bins, bin_width, t_start)
        if arrays.get("photon_counts") is None or photon_counts:
            arrays["photon_counts"] = photon_counts
        self._scan = tuple(arrays["scan"])
        self._native = _native.Session(arrays, texts(settings), time_limit, _on_progress(on_progress), feed)

    def submit(self, H: Any, *, bins_axis: int = -1, measured: Any = None) -> int:
        """Begins to solve a frame, and returns its number. Any thread, also while another one waits.

        H: (X, Y, T) or (P, T) counts, as for `Capture`. float32 in C order is read in place; the engine copies it.
        measured: (X, Y) or (P,), true where a point has new counts: the others keep those of the frames before.
        Raises OptionsError while another frame is being solved, unless `feed` lets it wait, and InputError for counts that cannot
        be used.
        """
        part = None if measured is None else as_bools(measured)
        return self._native.submit(as_counts(H, self._scan, bins_axis).reshape(-1), part)

    @property
    def latency(self) -> Latency:
        """How long the last frames took, and how many were dropped."""
        frames, dropped, seconds, rate = self._native.latency()
        return Latency(frames, dropped, *seconds, rate)

    def wait(self, timeout: Optional[float] = None) -> Optional[Maps]:
        """Waits for the frame that was submitted last, or for the next result if frames may wait (`feed`); None if there is
        none after `timeout` seconds.

        Raises CancelledError if the frame was stopped. Ctrl-C stops it: KeyboardInterrupt; the session can be used on.
        """
        found = self._native.wait(timeout)
        return None if found is None else Maps._of(found)

    def poll(self) -> Optional[Maps]:
        """The frame that was submitted last, if it is solved by now."""
        return self.wait(0.0)

    def solve(self, H: Any, *, bins_axis: int = -1) -> Maps:
        """Submits a frame and waits for it."""
        self.submit(H, bins_axis=bins_axis)
        maps = self.wait()
        assert maps is not None
        return maps

    def cancel(self) -> None:
        """Stops the frame that is being solved: its `wait` raises CancelledError."""
        self._native.cancel()

    def close(self) -> None:
        """Stops what the session does, and gives its memory back."""
        self._native.close()

    def __enter__(self) -> Session:
        return self

    def __exit__(
        self,
        kind: Optional[Type[BaseException]],
        error: Optional[BaseException],
        trace: Optional[TracebackType],
    ) -> None:
        self.close()


def _scan(sensor_xyz: Any, laser_xyz: Any, bins: Optional[int], bin_width: Optional[float], t_start: float) -> Dict[str, Any]:
    """A capture without counts, as the native part takes it."""
    if bins is None or bin_width is None:
        raise TypeError("a session of points needs bins and bin_width")
    sensor = as_points(sensor_xyz, "sensor_xyz")
    laser = sensor if laser_xyz is None else as_points(laser_xyz, "laser_xyz")
    widest = sensor if sensor.size >= laser.size else laser
    scan = (widest.shape[0], widest.shape[1])
    sensor_points = like_points(sensor, scan, "sensor_xyz")
    laser_points = like_points(laser, scan, "laser_xyz")
    assert isinstance(sensor_points, np.ndarray) and isinstance(laser_points, np.ndarray)
    return {
        "name": "session",
        "scan": scan,
        "sensor": sensor_points.reshape(-1),
        "laser": laser_points.reshape(-1),
        "bins": bins,
        "bin_width": float(bin_width),
        "t_start": float(t_start),
    }
