"""The notebook runs, and shows pictures."""

import base64
import os
from pathlib import Path

import pytest

nbclient = pytest.importorskip("nbclient")
nbformat = pytest.importorskip("nbformat")
pytest.importorskip("matplotlib")
pytest.importorskip("ipykernel")

NOTEBOOK = Path(__file__).parents[2] / "examples/notebook.ipynb"


def test_the_notebook_runs(tmp_path):
    book = nbformat.read(NOTEBOOK, as_version=4)
    # Who reads it on a page sees what it shows.
    stored = [output for cell in book.cells if cell.cell_type == "code" for output in cell.outputs]
    assert sum("image/png" in o.get("data", {}) for o in stored) >= 4
    nbclient.NotebookClient(book, timeout=300, kernel_name="python3", resources={"metadata": {"path": tmp_path}}).execute()
    outputs = [output for cell in book.cells if cell.cell_type == "code" for output in cell.outputs]
    shown = [o["data"]["image/png"] for o in outputs if "image/png" in o.get("data", {})]
    # Histograms, maps as the notebook shows them, maps as matplotlib draws them, and truth.
    assert len(shown) >= 4
    folder = Path(os.environ.get("THIRDBOUNCE_PICTURES", tmp_path))
    for number, picture in enumerate(shown):
        data = base64.b64decode(picture)
        assert data.startswith(b"\x89PNG") and len(data) > 2000
        (folder / f"notebook{number}.png").write_bytes(data)
    text = "".join(o.get("text", "") for o in outputs)
    assert "depth error: median" in text
