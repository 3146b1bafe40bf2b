"""Sessions: frame after frame."""

import os
import signal
import threading
import time

import numpy as np
import pytest

import thirdbounce as tb

QUICK = {"lateral": 16, "iterations": 12, "deterministic": True}
LONG = {"lateral": 64, "iterations": 100000}


def session(capture, **more):
    bins = capture.H.shape[2]
    return tb.Session(capture.sensor_xyz, bins=bins, bin_width=capture.bin_width, **more)


def test_frames_go_in_and_maps_come_out(capture):
    with session(capture, **QUICK) as frames:
        first = frames.solve(capture.H)
        assert first.frame == 1 and first.mask.any() and first.shape == (16, 16)
        assert frames.submit(np.moveaxis(2 * capture.H, -1, 0), bins_axis=0) == 2
        second = frames.wait()
        np.testing.assert_array_equal(second.mask, first.mask)
        # The first result is the program's own.
        again = frames.solve(capture.H)
        assert again.albedo.tobytes() == first.albedo.tobytes()


def test_a_frame_may_be_polled_and_stopped(capture):
    with session(capture, **LONG) as frames:
        frames.submit(capture.H)
        assert frames.poll() is None and frames.wait(0.05) is None
        with pytest.raises(tb.OptionsError, match="still being solved"):
            frames.submit(capture.H)
        frames.cancel()
        with pytest.raises(tb.CancelledError):
            frames.wait()
        with pytest.raises(tb.OptionsError, match="no frame"):
            frames.wait()


def test_a_camera_thread_feeds_parts_of_a_scan(capture):
    half = np.zeros(capture.H.shape[:2], bool)
    half[::2] = True
    with session(capture, feed="newest", model="cosine", **QUICK) as frames:
        camera = threading.Thread(target=lambda: [frames.submit(capture.H, measured=m) for m in (half, ~half)])
        camera.start()
        shown = [frames.wait(60.0)]
        while shown[-1].frame < 2:
            shown.append(frames.wait(60.0))
        camera.join()
        # Both halves are the whole scan.
        assert shown[-1].albedo.tobytes() == frames.solve(capture.H).albedo.tobytes()
        latency = frames.latency
        assert latency.frames + latency.dropped == 3 and 0.0 < latency.median <= latency.p99
    with pytest.raises(tb.OptionsError, match="feed"):
        session(capture, feed="some", **QUICK)


@pytest.mark.parametrize("model", [None, "cosine", "lambertian"])
def test_a_session_of_a_capture_finds_what_a_reconstruction_finds(capture, model):
    # A session has no candidates: its support is that of the closed form.
    fixed = {"model": model, "support": "fixed", **QUICK}
    with tb.Session(capture, **fixed) as frames:
        maps = tb.reconstruct(capture, **fixed)
        assert frames.solve(capture.H).albedo.tobytes() == maps.albedo.tobytes()


def test_a_time_limit_stops_a_frame(capture):
    with session(capture, time_limit=0.2, **LONG) as frames:
        with pytest.raises(tb.CancelledError, match="limit"):
            frames.solve(capture.H)


def test_ctrl_c_stops_a_frame_and_the_session_lives(capture):
    with session(capture, **{**LONG, "iterations": 4000}) as frames:
        frames.submit(capture.H)
        sent = []
        timer = threading.Timer(0.5, lambda: (sent.append(time.monotonic()), os.kill(os.getpid(), signal.SIGINT)))
        timer.start()
        with pytest.raises(KeyboardInterrupt):
            frames.wait()
        assert time.monotonic() - sent[0] < 3
        with pytest.raises(tb.CancelledError):
            frames.wait()


def test_progress_comes_from_the_session(capture):
    reports = []
    # Rounds of the support may be fewer than there is room for.
    with session(capture, on_progress=reports.append, support="fixed", **QUICK) as frames:
        frames.solve(capture.H)
    assert reports and reports[-1].iteration == reports[-1].iterations

    def refuse(progress):
        raise KeyError("mine")

    with session(capture, on_progress=refuse, **QUICK) as frames:
        frames.submit(capture.H)
        with pytest.raises(KeyError, match="mine"):
            while frames.wait(1.0) is None:
                pass


@pytest.mark.parametrize("progress", [None, lambda reports: None])
def test_polling_and_progress_do_not_wait_for_each_other(capture, progress):
    with session(capture, on_progress=progress, **QUICK) as frames:
        for _ in range(5):
            frames.submit(capture.H)
            while frames.poll() is None:
                pass


def test_a_session_that_is_dropped_while_it_solves_ends(capture):
    reported = threading.Event()
    frames = session(capture, on_progress=lambda p: reported.set(), **LONG)
    frames.submit(capture.H)
    assert reported.wait(30)
    start = time.monotonic()
    del frames
    assert time.monotonic() - start < 10


def test_a_closed_session_says_so(capture):
    frames = session(capture, **QUICK)
    frames.close()
    frames.close()
    with pytest.raises(tb.OptionsError, match="closed"):
        frames.submit(capture.H)


def test_wrong_frames_change_nothing(capture):
    with session(capture, **QUICK) as frames:
        for wrong in [capture.H[:4], capture.H[..., :-1]]:
            with pytest.raises(tb.Error):
                frames.submit(wrong)
        with pytest.raises(tb.InputError):
            frames.submit(np.nan * capture.H)
        assert frames.solve(capture.H).mask.any()
    with pytest.raises(tb.OptionsError, match="bins"):
        tb.Session(capture.sensor_xyz)


def test_two_sessions_in_two_threads(capture):
    found = {}

    def work(name):
        with session(capture, **QUICK) as frames:
            found[name] = [frames.solve(capture.H).albedo.tobytes() for _ in range(2)]

    threads = [threading.Thread(target=work, args=(name,)) for name in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len({bits for all in found.values() for bits in all}) == 1


def test_frames_follow_each_other(capture):
    with tb.Session(capture, follow=True, budget=2.0, **QUICK) as frames:
        first, second = frames.solve(capture.H), frames.solve(capture.H)
    assert second.mask.sum() > 0.5 * first.mask.sum() and second.frame == 2
    with pytest.raises(tb.OptionsError, match="follow"):
        tb.Session(capture, follow=True, solver="paper", lateral=16)


def test_frames_keep_their_volume(capture):
    with tb.Session(capture, solver="lct", lateral=16, keep_volume=True) as frames:
        assert frames.solve(capture.H).volume.shape[:2] == (16, 16)


def test_what_rests_is_subtracted_after_five_frames(capture):
    with session(capture, moving=True, **QUICK) as frames:
        results = [frames.solve(capture.H * (1 + 0.01 * (k % 3))) for k in range(7)]
    known = ["what rests is not known yet" not in " ".join(maps.warnings) for maps in results]
    assert known == [False] * 5 + [True] * 2
    # Nothing moves: what is left is a small share of what was there.
    assert np.nansum(results[-1].albedo) < 0.3 * np.nansum(results[0].albedo)
    with pytest.raises(tb.OptionsError, match="4 frames"):
        session(capture, moving=4, **QUICK)
    with pytest.raises(tb.OptionsError, match="whole number"):
        session(capture, moving="many", **QUICK)
