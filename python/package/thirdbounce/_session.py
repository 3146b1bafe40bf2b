"""Sessions: solves of frames of one scan."""

from __future__ import annotations

import os
from types import TracebackType
from typing import Any, Dict, NamedTuple, Optional, Type, Union

import numpy as np

from . import _native
from ._arrays import as_bools, as_counts, as_points, count, like_points, metres, refuse, texts
from ._capture import Capture, read
from ._maps import Maps
from ._solve import OnProgress, _on_progress


_MOVING_FRAMES = 31
"""Frames of the background with `moving=True`, as in `thirdbounce live --moving`."""


class Latency(NamedTuple):
    """Latency of the last frames (at most 256) from submission to result, seconds, including queueing."""

    frames: int
    """Solved frames."""
    dropped: int
    """Frames replaced by newer ones before they were solved."""
    last: float
    """Last frame."""
    median: float
    """50th percentile."""
    p90: float
    """90th percentile."""
    p99: float
    """99th percentile."""
    frames_per_second: float
    """Results per second while frames arrive; 0 before the second result."""


class Session:
    """A solver prepared once for a scan (planned, compiled, allocated) that solves frames of counts.

        with tb.Session(points, bins=512, bin_width=0.006, lateral=64) as session:
            for H in camera:
                session.submit(H)
                show(session.wait())

    One frame at a time is solved, in the session's own thread; `submit` returns immediately. Methods may be called from any
    thread. A session constructed from a `Capture` estimates an unspecified model and impulse response from its counts, as
    `reconstruct` does; one constructed from points uses the cosine model.
    """

    def __init__(
        self,
        sensor_xyz: Any,
        laser_xyz: Any = None,
        *,
        bins: Optional[int] = None,
        bin_width: Union[None, float, str] = None,
        t_start: Union[float, str] = 0.0,
        photon_counts: bool = False,
        time_limit: Optional[float] = None,
        on_progress: Optional[OnProgress] = None,
        feed: Union[str, float] = "one",
        follow: bool = False,
        budget: Optional[float] = None,
        moving: Union[bool, int] = False,
        **settings: Any,
    ) -> None:
        """Prepares a solver for frames of a scan.

        sensor_xyz, laser_xyz: (X, Y, 3) or (P, 3) points, metres, as for `Capture`; or a `Capture` or its file, with the points, bins,
            impulse response and spots of the frames, and counts that determine the volume, the model and the impulse response.
        bins, bin_width, t_start: number and width of the bins, and leading edge of bin 0, metres of path.
        photon_counts: whether counts are photon counts; otherwise the noise of each frame is estimated.
        time_limit: time after which a frame is cancelled, seconds.
        feed: handling of frames submitted during a solve: "one" refuses them, "newest" keeps the newest, "every" queues all; a
            number from 0 to 1 sums them, multiplying the sum by it before each.
        follow: start each frame from the surface of the one before (solver "surface"), as `thirdbounce live` does.
        budget: time for a frame, seconds; needs `follow`.
        moving: number of solved frames (True: 31) whose static light is subtracted as an empty room, so that moving objects are left. The
            first five frames are solved as measured, with a warning.
        on_progress: called with a `Progress` by the session's thread; the frame stops if it returns False.
        settings: as for `reconstruct`.
        """
        if budget is not None and not follow:
            raise refuse("budget was given without follow", "give follow=True, or time_limit, which cancels late frames")
        if moving is True:
            frames: Optional[int] = _MOVING_FRAMES
        else:
            frames = None if moving is False else count(moving, "moving")
        if isinstance(sensor_xyz, (str, os.PathLike)):
            sensor_xyz = read(sensor_xyz)
        if isinstance(sensor_xyz, Capture):
            arrays = sensor_xyz._arrays()
        else:
            arrays = _scan(sensor_xyz, laser_xyz, bins, bin_width, t_start)
        if arrays.get("photon_counts") is None or photon_counts:
            arrays["photon_counts"] = photon_counts
        self._scan = tuple(arrays["scan"])
        self._native = _native.Session(arrays, texts(settings), time_limit, _on_progress(on_progress), feed, (budget,) if follow else None, frames)

    def submit(self, H: Any, *, bins_axis: int = -1, measured: Any = None) -> int:
        """Submits a frame without waiting, and returns its number. Any thread, also during a wait of another one.

        H: (X, Y, T) or (P, T) counts, as for `Capture`. float32 in C order is read in place; the engine copies it.
        measured: (X, Y) or (P,), true for points with new counts; the others keep their previous counts.
        Raises OptionsError during a solve, unless `feed` allows queueing, and InputError for invalid counts.
        """
        part = None if measured is None else as_bools(measured)
        return self._native.submit(as_counts(H, self._scan, bins_axis).reshape(-1), part)

    @property
    def latency(self) -> Latency:
        """Latency statistics and the number of dropped frames."""
        frames, dropped, seconds, rate = self._native.latency()
        return Latency(frames, dropped, *seconds, rate)

    def wait(self, timeout: Optional[float] = None) -> Optional[Maps]:
        """Waits for the next result (of the frame submitted last, unless frames are queued); None without one after `timeout`
        seconds.

        Raises CancelledError if the frame was cancelled. Ctrl-C cancels it with KeyboardInterrupt; the session remains usable.
        """
        found = self._native.wait(timeout)
        return None if found is None else Maps._of(found)

    def poll(self) -> Optional[Maps]:
        """The next result, if available."""
        return self.wait(0.0)

    def solve(self, H: Any, *, bins_axis: int = -1) -> Maps:
        """Submits a frame and waits for it."""
        self.submit(H, bins_axis=bins_axis)
        maps = self.wait()
        assert maps is not None
        return maps

    def cancel(self) -> None:
        """Cancels the current frame: its `wait` raises CancelledError."""
        self._native.cancel()

    def close(self) -> None:
        """Cancels all work and frees the session."""
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


def _scan(sensor_xyz: Any, laser_xyz: Any, bins: Any, bin_width: Any, t_start: Any) -> Dict[str, Any]:
    """A capture without counts, in the native form."""
    if bins is None or bin_width is None:
        missing = " and ".join(name for name, value in (("bins", bins), ("bin_width", bin_width)) if value is None)
        raise refuse(f"{missing} missing", "give the bins of the frames with their points, or give a Capture")
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
        "bins": count(bins, "bins"),
        "bin_width": metres(bin_width, "bin_width", True),
        "t_start": metres(t_start, "t_start", True),
    }
