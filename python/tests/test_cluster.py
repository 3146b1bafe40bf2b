"""Captures over a cluster of two workers: results, failures, a worker that is killed, and resumption."""

import importlib
import os
import signal
from pathlib import Path

import pytest

import thirdbounce as tb

distributed = pytest.importorskip("distributed", reason="the cluster is not tested, as dask.distributed is not installed")

EXAMPLE = Path(__file__).parents[2] / "examples/cluster.py"
SETTINGS = {"model": "cosine", "lateral": 16, "iterations": 12}


def test_no_capture_is_lost_when_a_worker_is_killed(tmp_path, capture, monkeypatch):
    captures = [str(tmp_path / f"c{number}.npz") for number in range(6)]
    for path in captures:
        capture.save(path)
    bad = tmp_path / "bad.npz"
    bad.write_text("no capture")
    # Workers import the module by its name.
    monkeypatch.setenv("PYTHONPATH", str(EXAMPLE.parent))
    monkeypatch.syspath_prepend(str(EXAMPLE.parent))
    cluster = importlib.import_module("cluster")
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as local:
        with distributed.Client(local) as client:
            every = cluster.run(client, [*captures, str(bad)], tmp_path / "out", SETTINGS, devices=["0"], threads=1)
            lines = [next(every)]
            os.kill(next(iter(client.run(os.getpid).values())), signal.SIGKILL)
            lines += every
            found = {line["capture"]: line["status"] for line in lines}
            assert len(lines) == 7 and set(found) == {*captures, str(bad)}
            assert all(found[path] in ("done", "skipped") for path in captures), lines
            failed = next(line for line in lines if line["status"] == "failed")
            assert failed["capture"] == str(bad) and "format" in failed["error"] and failed["hint"]
            assert {line.get("device") for line in lines if line["status"] == "done"} == {"0"}
            for path in captures:
                assert tb.load_maps(tmp_path / "out" / Path(path).stem).report["version"] == tb.__version__
            # What has a report is done; what has none is made anew.
            (tmp_path / "out/c3/report.json").unlink()
            again = {line["folder"][-2:]: line["status"] for line in cluster.run(client, captures, tmp_path / "out", SETTINGS)}
            assert [again[f"c{number}"] for number in range(6)] == ["skipped"] * 3 + ["done"] + ["skipped"] * 2
    assert not (tmp_path / "out/bad").exists()
