"""Reconstruction: the same maps as the command, and a solve that stops on request."""

import copy
import json
import os
import pickle
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

import thirdbounce as tb
from conftest import SHORT

FIVE_LINES = """\
import thirdbounce as tb
capture, truth = tb.simulate("sphere", scan=8, bin_width=0.03, noise=0.3)
maps = tb.reconstruct(capture, lateral=16)
maps.save("result")
print(round(float(abs(maps.depth - 0.7)[maps.mask].mean()), 3), int(maps.mask.sum()))
"""


def test_five_lines_reconstruct_a_capture(tmp_path):
    assert len(FIVE_LINES.splitlines()) == 5
    done = subprocess.run([sys.executable, "-c", FIVE_LINES], cwd=tmp_path, capture_output=True, text=True, check=True)
    error, pixels = done.stdout.split()
    assert float(error) < 0.3 and int(pixels) > 10
    names = {p.name for p in (tmp_path / "result").iterdir()}
    assert {"maps.npz", "report.json", "depth.png", "mesh.ply", "maps.exr"} <= names
    report = json.loads((tmp_path / "result/report.json").read_text())
    # The way of the command: models are tried.
    assert len(report["settings"]["model_found"]["trials"]) >= 3


def test_maps_are_those_of_the_command_to_the_bit(tmp_path, capture, maps, command):
    capture.save(tmp_path / "z.npz")
    options = "--model cosine --lateral 16 --iterations 12 --deterministic --no-preview -q"
    run = [command, "reconstruct", "z.npz", "--out", "out", *options.split()]
    subprocess.run(run, cwd=tmp_path, check=True, stdout=subprocess.DEVNULL)
    theirs = tb.load_maps(tmp_path / "out/maps.npz")
    for name in ["albedo", "depth", "normals", "mask", "depth_error"]:
        mine = getattr(maps, name)
        assert mine.tobytes() == getattr(theirs, name).tobytes(), name
    assert tuple(maps.extent) == theirs.extent
    report = json.loads((tmp_path / "out/report.json").read_text())
    # The capture's path, the command's note on the preset, and the seconds of the trials.
    different = {"capture", "notes", "trials_s", "candidates"}
    for key, value in report["settings"].items():
        assert key in different or maps.report["settings"][key] == value, key


def test_arrays_give_the_same_as_a_capture(capture, maps):
    H = np.moveaxis(capture.H, -1, 0)
    again = tb.reconstruct(H, capture.sensor_xyz, bin_width=capture.bin_width, bins_axis=0, **SHORT)
    assert again.albedo.tobytes() == maps.albedo.tobytes()


def test_maps_have_shapes_and_units(maps, rendered):
    assert maps.shape == (16, 16) and maps.normals.shape == (16, 16, 3)
    assert maps.mask.dtype == bool and maps.albedo.dtype == maps.depth.dtype == np.float32
    assert maps.x[0] == pytest.approx(maps.extent[0] + 0.5 * (maps.extent[1] - maps.extent[0]) / 16)
    assert (np.diff(maps.y) > 0).all() and len(maps.layers) in (1, 2)
    lengths = np.linalg.norm(maps.normals[maps.mask], axis=1)
    np.testing.assert_allclose(lengths, 1, atol=1e-3)
    assert (maps.normals[maps.mask][:, 2] < 0).mean() > 0.9
    truth = rendered[1]
    depth = np.median(truth.depth[truth.mask])
    assert abs(np.median(maps.depth[maps.mask]) - depth) < 0.1
    assert maps.points().shape == (maps.mask.sum(), 3)
    assert "deep" in repr(maps) and maps.report["totals"]["solve_s"] == maps.seconds


def test_maps_are_saved_and_loaded(tmp_path, maps):
    (file,) = maps.save(tmp_path / "m.npz")
    again = tb.load_maps(file)
    for name in ["albedo", "depth", "normals", "mask", "depth_error"]:
        assert getattr(again, name).tobytes() == getattr(maps, name).tobytes(), name
    assert maps._repr_png_().startswith(b"\x89PNG")


def test_the_ending_of_a_name_says_what_is_saved(tmp_path, maps):
    heads = {"npz": b"PK", "mat": b"MATLAB 5.0", "exr": b"\x76\x2f\x31\x01", "ply": b"ply", "png": b"\x89PNG", "svg": b"<svg"}
    for ending, head in heads.items():
        file = tmp_path / f"x.{ending}"
        assert maps.save(file) == [str(file)] and file.read_bytes().startswith(head)
    with pytest.raises(tb.OptionsError, match=r"\.tiff\n.*\.mat"):
        maps.save(tmp_path / "x.tiff")
    scipy = pytest.importorskip("scipy.io")
    again = scipy.loadmat(tmp_path / "x.mat")
    np.testing.assert_array_equal(again["depth"], maps.depth)
    np.testing.assert_array_equal(again["normal"], maps.normals)
    np.testing.assert_array_equal(again["extent"][0], maps.extent)


def test_drawing_needs_matplotlib(tmp_path, maps):
    try:
        import matplotlib
    except ImportError:
        with pytest.raises(ImportError, match="pip install matplotlib"):
            maps.plot()
        return
    matplotlib.use("Agg")
    figure = maps.plot()
    titles = [ax.get_title() for ax in figure.axes]
    assert {"albedo", "depth", "normals", "expected depth error"} <= set(titles)
    figure.savefig(os.environ.get("THIRDBOUNCE_FIGURE", tmp_path / "maps.png"))


def test_progress_is_told_and_may_stop_the_solve(capture):
    reports = []

    def hear(progress):
        reports.append(progress)
        return len(reports) < 2

    with pytest.raises(tb.CancelledError, match="^cancelled by the caller"):
        tb.reconstruct(capture, on_progress=hear, model="cosine", high_pass=0, lateral=32, iterations=200)
    assert len(reports) == 2 and isinstance(reports[0], tb.Progress) and reports[0].iterations > 50


def test_what_a_progress_function_raises_comes_back(capture):
    def hear(progress):
        raise KeyError("mine")

    with pytest.raises(KeyError, match="mine"):
        tb.reconstruct(capture, on_progress=hear, **SHORT)
    assert tb.reconstruct(capture, **SHORT).mask.any()


def test_progress_never_goes_back_and_the_end_says_what_was_done(capture):
    reports, start = [], time.monotonic()
    maps = tb.reconstruct(capture, on_progress=lambda p: reports.append((time.monotonic() - start, p)), lateral=32)
    taken = time.monotonic() - start
    *before, (_, last) = reports
    assert {p.doing for _, p in before} == {"trial", "solve"}
    for name in ["fraction", "seconds"]:
        values = [getattr(p, name) for _, p in reports]
        assert values == sorted(values), name
    for doing in ["trial", "solve"]:
        done = [p.iteration for _, p in before if p.doing == doing]
        assert done == sorted(done) and all(p.iteration <= p.iterations for _, p in before)
    # Seconds are those of the clock on the wall.
    assert all(at - 0.5 < p.seconds <= at for at, p in reports) and taken - 1 < last.seconds <= taken
    solved = [p for _, p in before if p.doing == "solve"][-1]
    assert last.doing == "done" and last.fraction == 1.0 and last.remaining == 0.0
    assert last.iteration >= solved.iteration and last.iterations == solved.iterations
    assert last.iteration == maps.report["trace"][-1]["iteration"]


def test_ctrl_c_of_paper_answers_at_once_and_its_first_block_is_seen():
    """An iteration takes longer than a second."""
    x, y = np.meshgrid(np.linspace(-0.5, 0.5, 32), np.linspace(-0.5, 0.5, 32), indexing="ij")
    points = np.stack([x, y, np.zeros_like(x)], axis=-1)
    counts = np.random.default_rng(1).random((32, 32, 512), dtype=np.float32)
    waits = []
    for _ in range(3):
        after, reports = [], []
        interrupt = lambda: (after.append(time.monotonic()), os.kill(os.getpid(), signal.SIGINT))  # noqa: E731
        threading.Timer(1.2, interrupt).start()
        with pytest.raises(KeyboardInterrupt):
            tb.reconstruct(counts, points, bin_width=0.006, solver="paper", on_progress=reports.append)
        waits.append(time.monotonic() - after[0])
        assert reports and reports[0].seconds < 1.2 and reports[0].doing == "solve"
        # Another program may take the processors meanwhile.
        if waits[-1] < 0.3:
            return
    raise AssertionError(waits)


def test_what_a_benchmark_leaves_out_is_said():
    capture, truth = tb.simulate("plane", scan=6, bin_width=0.04, noise=0.3, pairs="one-laser")
    with pytest.warns(UserWarning, match="lct is left out: .+"):
        results = tb.benchmark(capture, truth, ["lct", "fbp"], lateral=16)
    assert list(results) == ["fbp"]


def test_maps_and_captures_can_be_pickled_and_copied(tmp_path, capture, maps):
    for copied in [copy.deepcopy(maps), pickle.loads(pickle.dumps(maps))]:
        assert copied.depth.tobytes() == maps.depth.tobytes() and copied.report == maps.report
        copied.save(tmp_path / "copied")
        assert (tmp_path / "copied/report.html").stat().st_size > 100000
    for copied in [copy.deepcopy(capture), pickle.loads(pickle.dumps(capture))]:
        assert copied.H.tobytes() == capture.H.tobytes() and copied.is_confocal
        assert tb.reconstruct(copied, **SHORT).depth.tobytes() == maps.depth.tobytes()


@pytest.mark.parametrize(("name", "like"), [("laterl", "lateral"), ("iteration", "iterations"), ("on_progres", "on_progress")])
def test_similar_names_are_named(capture, name, like):
    with pytest.raises(tb.OptionsError, match=f"did you mean {like}"):
        tb.reconstruct(capture, **{name: 1})


def test_names_and_words_may_be_of_any_case(capture, maps):
    assert tb.reconstruct(capture, **{**SHORT, "model": "Cosine", "Stride": 1}).depth.tobytes() == maps.depth.tobytes()
    assert tb.reconstruct(capture, solver="LCT", lateral=16).report["settings"]["solver"] == "lct"


LONG = {"model": "cosine", "lateral": 64, "iterations": 100000}


def test_ctrl_c_stops_a_solve_soon(capture):
    after = []
    timer = threading.Timer(1.0, lambda: (after.append(time.monotonic()), os.kill(os.getpid(), signal.SIGINT)))
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        tb.reconstruct(capture, **LONG)
    assert time.monotonic() - after[0] < 5
    assert tb.reconstruct(capture, **SHORT).mask.any()


def test_other_threads_run_during_a_solve(capture):
    ticks, done = [], threading.Event()

    def tick():
        while not done.wait(0.01):
            ticks.append(time.monotonic())

    thread = threading.Thread(target=tick)
    thread.start()
    start = time.monotonic()
    tb.reconstruct(capture, **{**SHORT, "lateral": 32, "iterations": 60})
    taken = time.monotonic() - start
    done.set()
    thread.join()
    assert len(ticks) > 10 * taken, (len(ticks), taken)


@pytest.mark.parametrize(
    ("arguments", "kind", "words"),
    [
        ({"iterations": 0}, tb.OptionsError, "iterations is 0"),
        ({"iterations": 2.5}, tb.OptionsError, "iterations is 2.5"),
        ({"nonsense": 1}, tb.OptionsError, "no setting \"nonsense\""),
        ({"learning_rate": 0.1}, tb.OptionsError, "learning_rate is no option of the solver surface"),
        ({"solver": "magic"}, tb.OptionsError, "solver magic is not known"),
        ({"model": "shiny"}, tb.OptionsError, "model is shiny"),
        ({"preset": "real"}, tb.OptionsError, "preset"),
        ({"pulse": "wide"}, tb.OptionsError, "pulse"),
        ({"device": "no such device"}, tb.OptionsError, "no such device"),
        ({"volume": ((0, 1), (0, 1), (2, 1))}, tb.Error, ""),
        ({"gate": (90.0, None)}, tb.Error, ""),
        ({"memory": "1K"}, tb.OutOfMemoryError, ""),
    ],
)
def test_wrong_arguments_are_told(capture, arguments, kind, words):
    with pytest.raises(kind) as raised:
        tb.reconstruct(capture, **{**SHORT, **arguments})
    assert words in str(raised.value) and raised.value.hint
    assert "--" not in str(raised.value), "the words of the command line"


def test_wrong_counts_are_told(capture):
    for value in [np.nan, np.inf]:
        H = capture.H.copy()
        H[2, 3, 4] = value
        with pytest.raises(tb.InputError):
            tb.reconstruct(H, capture.sensor_xyz, bin_width=capture.bin_width, **SHORT)
    with pytest.raises(tb.InputError):
        tb.reconstruct(0 * capture.H, capture.sensor_xyz, bin_width=capture.bin_width, **SHORT)
    with pytest.raises(tb.OptionsError, match="sensor_xyz"):
        tb.reconstruct(capture.H)


def test_options_and_devices_are_listed():
    assert "sparsity" in tb.options() and "learning_rate" in tb.options("paper")
    devices = tb.devices()
    assert devices and {"index", "name", "kind", "memory", "driver"} <= set(devices[0])


def test_a_file_gives_the_maps_of_the_command(tmp_path, capture, maps, rendered):
    capture.save(tmp_path / "z.npz")
    mine = tb.reconstruct(tmp_path / "z.npz", truth=rendered[1], **SHORT)
    assert mine.albedo.tobytes() == maps.albedo.tobytes()
    assert mine.report["settings"]["capture"].endswith("z.npz") and mine.metrics["iou"] > 0.3
    # Truth in memory and in the report.
    assert tb.evaluate(maps, rendered[1]) == mine.metrics == mine.report["metrics"]
    with pytest.raises(tb.OptionsError, match="the file holds them"):
        tb.reconstruct("z.npz", capture.sensor_xyz)


def test_truth_in_a_file_is_measured_along_the_way(tmp_path, command):
    make = [command, "simulate", "letter-Z", "--scan", "8", "--bin-width", "0.03", "--noise", "0.3", "-q"]
    subprocess.run([*make, "--out", "z.npz", "--truth", "t.npz"], cwd=tmp_path, check=True)
    maps = tb.reconstruct(tmp_path / "z.npz", truth=tmp_path / "t.npz", **SHORT)
    maps.save(tmp_path / "out")
    assert maps.metrics["iou"] == tb.evaluate(tmp_path / "out", tmp_path / "t.npz")["iou"] > 0.3
    theirs = subprocess.run([command, "evaluate", "out", "--truth", "t.npz", "--json"], cwd=tmp_path, capture_output=True)
    assert json.loads(theirs.stdout) == tb.evaluate(tmp_path / "out", tmp_path / "t.npz")
    assert sum("iou" in point for point in maps.report["trace"]) >= 1


def test_a_folder_is_saved_with_its_page_and_loaded(tmp_path, maps):
    written = {os.path.basename(path) for path in maps.save(tmp_path / "out")}
    assert {"report.html", "report.json", "maps.npz"} <= written
    page = (tmp_path / "out/report.html").read_text()
    assert "<title>thirdbounce: " in page and '"counts"' in page
    again = tb.load_maps(tmp_path / "out")
    assert again.report == maps.report and again.seconds == maps.seconds
    assert again.depth.tobytes() == maps.depth.tobytes()


def test_the_volume_is_kept(capture):
    assert tb.reconstruct(capture, **SHORT).volume is None
    maps = tb.reconstruct(capture, solver="lct", lateral=16, keep_volume=True)
    assert maps.volume.shape[:2] == maps.shape and maps.volume.dtype == np.float32
    x0, x1, y0, y1, z0, z1 = maps.volume_extent
    assert (x0, x1, y0, y1) == pytest.approx(maps.extent) and z0 < np.nanmedian(maps.depth) < z1


def test_methods_are_compared(capture, rendered):
    results = tb.benchmark(capture, rendered[1], ["surface", "lct", {"solver": "surface", "iterations": 5}], model="cosine", lateral=16)
    assert list(results) == ["surface", "lct", "surface, iterations=5"]
    assert all(maps.metrics["depth_mae"] > 0 and maps.seconds > 0 for maps in results.values())


def test_lengths_are_numbers_or_text(capture):
    wide, _ = tb.simulate("sphere", scan=4, wall="1m", bin_width="100ps", pulse="60ps", noise=0.5)
    assert wide.bin_width == pytest.approx(0.0299792458) and wide.pulse is not None
    mine = tb.Capture(wide.H, wide.sensor_xyz, bin_width="100ps", t_start="0cm", laser_spot="2cm")
    assert mine.bin_width == wide.bin_width and mine.laser_spot == 0.02
    floats = {key: float(value) if key in ("lateral", "iterations") else value for key, value in SHORT.items()}
    assert tb.reconstruct(capture, **floats).shape == (16, 16)
    for wrong in [None, "wide", [1]]:
        with pytest.raises(tb.OptionsError, match="bin_width"):
            tb.Capture(wide.H, wide.sensor_xyz, bin_width=wrong)


def test_progress_has_totals_and_never_goes_back(capture):
    reports = []
    tb.reconstruct(capture, on_progress=lambda p: reports.append((time.monotonic(), p)), lateral=32)
    assert {p.doing for _, p in reports} >= {"trial"}
    for (at, p), (then, q) in zip(reports, reports[1:]):
        assert p.fraction <= q.fraction and p.seconds <= q.seconds
        assert p.doing != q.doing or p.iteration <= q.iteration
    for _, p in reports:
        assert 0 <= p.iteration <= p.iterations and 0 <= p.fraction <= 1
        assert p.remaining is None or p.remaining >= 0
    assert reports[-1][1].fraction == 1
    assert len(reports) <= 5 * (reports[-1][0] - reports[0][0]) + 6, "about five a second"


def test_a_bar_takes_one_line(capture):
    tqdm = pytest.importorskip("tqdm").tqdm
    with tqdm(total=1.0) as bar:
        tb.reconstruct(capture, on_progress=lambda p: bar.update(p.fraction - bar.n), **SHORT)
    assert bar.n == pytest.approx(1)


def test_errors_are_ours_in_the_words_of_python(capture):
    seconds = tb.Capture(capture.H, capture.sensor_xyz, bin_width=20e-12)
    for call in [
        lambda: tb.reconstruct(seconds),
        lambda: tb.Session(capture.sensor_xyz),
        lambda: tb.Session(capture.sensor_xyz, bins="many", bin_width=0.01),
        lambda: tb.Session(capture, budget=0.2),
        lambda: tb.simulate("sphere", scan="8x8"),
        lambda: tb.simulate("sphere", dark="none"),
        lambda: tb.reconstruct(capture, lateral=64.5),
        lambda: tb.reconstruct("missing.npz"),
        lambda: tb.load_maps("missing"),
        lambda: tb.evaluate("missing", "missing.npz"),
    ]:
        with pytest.raises(tb.Error) as caught:
            call()
        assert caught.value.hint and caught.value.what, caught.value
        assert "delta_t" not in str(caught.value) and "--" not in str(caught.value), caught.value
