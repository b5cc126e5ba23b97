"""The tutorial notebooks run from the first cell to the last."""

import os
import re
import sys
from collections.abc import Callable
from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

TUTORIALS = Path(__file__).parents[2] / "docs" / "tutorials"

pytestmark = [
    pytest.mark.integration,
    pytest.mark.slow,
    pytest.mark.timeout(900),
    pytest.mark.filterwarnings("default::DeprecationWarning:jupyter_client"),
    pytest.mark.filterwarnings("default::DeprecationWarning:zmq"),
]


@pytest.fixture
def printed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str], str]:
    """Runs a notebook, and returns what its cells print."""
    monkeypatch.setenv("PATH", f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setenv("TMPDIR", str(tmp_path))

    def run(name: str) -> str:
        notebook = nbformat.read(TUTORIALS / name, 4)
        resources = {"metadata": {"path": str(tmp_path)}}
        NotebookClient(notebook, timeout=600, kernel_name="python3", resources=resources).execute()
        return "".join(output.get("text", "") for cell in notebook.cells for output in cell.get("outputs", ()))

    return run


@pytest.mark.sampled(0, of="longest")
def test_notebook_of_the_analysis_runs_completely(printed: Callable[[str], str]) -> None:
    texts = printed("analyse-a-study.ipynb")
    assert "20 recordings: 20 complete" in texts
    assert "60 trials count" in texts
    assert texts.count("report.html and") == 2


@pytest.mark.sampled(0, of="longest")
def test_notebook_of_the_partner_trains_one_that_succeeds_and_is_stable(printed: Callable[[str], str]) -> None:
    pytest.importorskip("gymnasium", reason="needs netboard[environments]")
    texts = printed("train-a-partner.ipynb")
    found = re.search(r"(\d+) % of 96 new trials succeed; growth (\d[.]\d+)", texts)
    assert found is not None
    assert int(found[1]) >= 90
    assert float(found[2]) <= 1.0
    assert "4 recordings: 4 complete" in texts
    assert "40 trials counted" in texts
