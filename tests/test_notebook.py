"""The notebook of the examples runs from top to bottom, and ends in a number and a picture."""

import os
import re
import sys
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[1]
NOTEBOOKS = sorted((ROOT / "examples").glob("*.ipynb"))


def cells(notebook: Any) -> list[Any]:
    return [cell for cell in notebook.cells if cell.cell_type == "code"]


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs(path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    nbformat = pytest.importorskip("nbformat", reason="nbclient is not installed (extra dev)")
    nbclient = pytest.importorskip("nbclient", reason="nbclient is not installed (extra dev)")
    pytest.importorskip("ipykernel", reason="ipykernel is not installed (extra dev)")
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join((str(ROOT), *sys.path[:1])))
    monkeypatch.setenv("IPYTHONDIR", str(tmp_path / "ipython"))
    notebook = nbformat.read(path, as_version=4)
    assert not any(cell.outputs or cell.execution_count for cell in cells(notebook)), (
        "clear the outputs before you commit a notebook"
    )
    client = nbclient.NotebookClient(
        notebook, timeout=120, resources={"metadata": {"path": str(tmp_path)}}
    )
    client.execute()
    outputs = [output for cell in cells(notebook) for output in cell.outputs]
    told = "".join(output.get("text", "") for output in outputs)
    match = re.search(r"([\d.]+) cm from the goal, ([\d.-]+) cm clear", told)
    assert match is not None, told
    assert float(match[1]) < 5.0 and float(match[2]) > 0.0
    assert any("image/png" in output.get("data", {}) for output in outputs)
    assert not any(output.get("name") == "stderr" for output in outputs)


def test_there_is_a_notebook_and_it_is_small() -> None:
    assert NOTEBOOKS
    assert all(path.stat().st_size < 20_000 for path in NOTEBOOKS)
