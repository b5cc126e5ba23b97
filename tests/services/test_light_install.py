"""A machine without Qt runs server, agents and logger; what opens a window says what to install."""

import ast
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from netboard.recording.files.example import copy_example

ROOT = Path(__file__).parents[2]

OPTIONAL = ("dask", "jinja2", "markupsafe", "matplotlib", "pandas", "pyarrow", "pynwb", "statsmodels")


@pytest.fixture
def without_qt(tmp_path: Path) -> dict[str, str]:
    """Environment of processes on a machine that has no Qt."""
    for name in ("PySide6", "shiboken6", "pyqtgraph"):
        (tmp_path / name).mkdir()
        missing = f'raise ModuleNotFoundError("No module named {name!r}", name={name!r})\n'
        (tmp_path / name / "__init__.py").write_text(missing, encoding="utf-8")
    return {**os.environ, "PYTHONPATH": str(tmp_path)}


def modules_of(service: str) -> list[str]:
    """Modules that a command imports, at once or when it runs."""
    tree = ast.parse((ROOT / "services" / f"{service}.py").read_text(encoding="utf-8"))
    imports = [node for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
    return [str(node.module) for node in imports if str(node.module).startswith("netboard.")]


def run(environment: dict[str, str], *words: str, folder: Path | None = None) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, *words]
    return subprocess.run(
        command, env=environment, cwd=folder, capture_output=True, text=True, check=False, timeout=240
    )


def test_server_agent_and_logger_need_no_qt(without_qt: dict[str, str]) -> None:
    modules = sorted({name for service in ("server", "agent", "logger") for name in modules_of(service)})
    assert {"netboard.nodes.server.server", "netboard.nodes.agent.agent", "netboard.nodes.logger.logger"} <= {*modules}
    done = run(without_qt, "-c", "\n".join(f"import {name}" for name in modules))
    assert done.returncode == 0, done.stderr


def test_window_says_what_to_install(without_qt: dict[str, str]) -> None:
    done = run(without_qt, "-m", "netboard.services.cli", "display", "--station", "left", "--offscreen")
    assert done.returncode == 2
    assert "needs PySide6-Essentials, which is not installed: pip install 'netboard[display]'" in done.stderr


@pytest.mark.parametrize(
    "words",
    [
        ("analyse", "S01.mcap"),
        ("cohort", "--studies", "1", "-o", "out"),
        ("explain", "S01.mcap", "--trial", "1"),
        ("export", "S01.mcap", "--to", "parquet", "-o", "out"),
        ("export", "S01.mcap", "--to", "nwb", "-o", "out"),
    ],
)
def test_command_says_which_libraries_to_install(words: tuple[str, ...], tmp_path: Path) -> None:
    copy_example(tmp_path / "S01.mcap")
    (tmp_path / "command.py").write_text(
        f"import sys; sys.modules.update(dict.fromkeys({OPTIONAL}))\nfrom netboard.services.cli import main; main()"
    )
    done = run({**os.environ, "COLUMNS": "200"}, str(tmp_path / "command.py"), *words, folder=tmp_path)
    assert done.returncode == 2, done.stderr
    assert re.search(r"netboard: this needs \w+, which is not installed: pip install 'netboard\[", done.stderr)


@pytest.mark.slow
@pytest.mark.integration
def test_session_without_displays_is_recorded_and_verified(without_qt: dict[str, str], tmp_path: Path) -> None:
    demo = ("-m", "netboard.services.cli", "demo", "--trials", "1", "--directory", str(tmp_path / "recordings"))
    done = run(without_qt, *demo)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "running without displays, because Qt cannot be loaded" in done.stdout + done.stderr
    assert list((tmp_path / "recordings").glob("*.mcap"))
