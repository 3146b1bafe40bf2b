"""The code of the notebooks of each role runs, and does what their text says. Without a kernel of notebooks: in one namespace."""

import json
from pathlib import Path

import pytest

NOTEBOOKS = Path(__file__).parents[2] / "examples/notebooks"


def run(name, tmp_path, monkeypatch):
    """Executes the code of a notebook in an empty folder; returns its names."""
    cells = json.loads((NOTEBOOKS / f"{name}.ipynb").read_text(encoding="utf-8"))["cells"]
    code = [cell for cell in cells if cell["cell_type"] == "code"]
    assert all(cell["outputs"] == [] and cell["execution_count"] is None for cell in code), "outputs are not stored"
    monkeypatch.chdir(tmp_path)
    names = {"__name__": "__main__"}
    for number, cell in enumerate(code):
        exec(compile("".join(cell["source"]), f"{name}.ipynb, code {number}", "exec"), names)
    return names


def test_every_notebook_has_a_test():
    assert sorted(path.stem for path in NOTEBOOKS.glob("*.ipynb")) == ["embedder", "lab", "student"]


def test_a_student_compares_two_methods(tmp_path, monkeypatch):
    monkeypatch.setenv("MPLBACKEND", "agg")
    pytest.importorskip("matplotlib")
    names = run("student", tmp_path, monkeypatch)
    surface, lct = (names["results"][solver].metrics["iou"] for solver in ("surface", "lct"))
    assert surface > lct > 0.2
    assert [ax.get_title() for ax in names["axes"]] == ["surface", "lct", "truth"]


def test_a_lab_calibrates_its_rig(tmp_path, monkeypatch):
    names = run("lab", tmp_path, monkeypatch)
    unchanged, calibrated = names["unchanged"].report, names["calibrated"].report
    assert unchanged["verdict"]["grade"] == "poor" and "every second one of the rows is late" in unchanged["warnings"][0]
    assert calibrated["verdict"]["grade"] != "poor" and "undone here" in calibrated["verdict"]["reasons"][0]
    assert names["left"][1] < 0.5 * names["left"][0]
    assert (tmp_path / "rig-result/report.html").is_file()


def test_an_embedder_measures_latency(tmp_path, monkeypatch, capsys):
    names = run("embedder", tmp_path, monkeypatch)
    latency = names["latency"]
    assert latency.frames + latency.dropped == 8 and 1 <= len(names["shown"]) <= latency.frames and latency.median > 0
    assert "NaN" in capsys.readouterr().out
