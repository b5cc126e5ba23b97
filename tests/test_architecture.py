"""The import contracts of pyproject.toml hold over the whole tree, and would catch a breach."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    """Source and services as one package, as in a wheel."""
    ignore = shutil.ignore_patterns("__pycache__")
    shutil.copytree(ROOT / "src" / "netboard", tmp_path / "netboard", ignore=ignore)
    shutil.copytree(ROOT / "services", tmp_path / "netboard" / "services", ignore=ignore)
    return tmp_path


def lint(tree: Path) -> subprocess.CompletedProcess[str]:
    command = [
        sys.executable,
        "-c",
        "from importlinter.cli import lint_imports_command as main; main()",
        "--no-cache",
        "--no-logo",
        "--config",
        str(ROOT / "pyproject.toml"),
    ]
    environment = {**os.environ, "PYTHONPATH": str(tree), "COLUMNS": "200"}
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=False)


@pytest.mark.slow
def test_contracts_are_kept(tree: Path) -> None:
    done = lint(tree)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "0 broken" in done.stdout


@pytest.mark.slow
@pytest.mark.parametrize(
    ("module", "line", "contract"),
    [
        ("physics/leak.py", "import time", "pure part"),
        ("nodes/server/leak.py", "import zmq", "zmq"),
        ("nodes/screen.py", "from PySide6 import QtCore", "Qt"),
        ("nodes/hidden.py", "import hid", "device libraries"),
        ("recording/leak.py", "import netboard.nodes.server.session", "Arrows"),
        ("devices/leak.py", "import netboard.network.transport.sockets", "A device"),
        ("stage_two.py", "X = 1", "Arrows"),
    ],
)
def test_a_breach_is_found(tree: Path, module: str, line: str, contract: str) -> None:
    (tree / "netboard" / module).write_text(f"{line}\n", encoding="utf-8")
    done = lint(tree)
    assert done.returncode != 0
    broken = [text for text in done.stdout.splitlines() if " BROKEN" in text]
    assert any(contract in text for text in broken), done.stdout + done.stderr
