"""The import contracts of pyproject.toml hold over the whole tree, and would catch a breach."""

import ast
import os
import re
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


def exists(tree: Path, module: str) -> bool:
    path = tree.joinpath(*module.split("."))
    return path.is_dir() or path.with_suffix(".py").is_file()


def named_modules(text: str, wings: set[str]) -> list[str]:
    """Names of modules in strings, of which no import knows: programs to run, and packages with data."""
    if not re.search(r"[\"']netboard\.", text):  # parsing takes a hundred times longer than looking
        return []
    strings = [node.value for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Constant)]
    names = [name for name in strings if isinstance(name, str) and re.fullmatch(r"netboard(\.[a-z_]\w*)+", name)]
    return [name for name in names if name.split(".")[1] in wings]


def test_modules_named_in_strings_exist(tree: Path) -> None:
    wings = {path.name for path in (tree / "netboard").iterdir() if path.is_dir()}
    found = {file: named_modules(file.read_text(encoding="utf-8"), wings) for file in tree.rglob("*.py")}
    assert "netboard.services.cli" in found[tree / "netboard/nodes/operator/launcher.py"]
    assert [(file, name) for file, names in found.items() for name in names if not exists(tree, name)] == []


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
def test_import_contracts_hold(tree: Path) -> None:
    done = lint(tree)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "0 broken" in done.stdout


BREACHES = (
    ("physics.leak", "import time", "The pure part"),
    ("nodes.server.leak", "import zmq", "Only network/transport/ imports zmq"),
    ("nodes.screen", "from PySide6 import QtCore", "Only windows/ imports Qt"),
    ("nodes.hidden", "import hid", "Only devices/ imports device libraries"),
    ("recording.leak", "import netboard.nodes.server.session", "Arrows"),
    ("devices.leak", "import netboard.network.transport.sockets", "A device"),
    ("benchmarks.loop.leak", "import evidence.faults.bench", "The product"),
    ("stage_two", "X = 1", "Arrows"),
)
"""A module that must not be, what it imports, and how the name of the contract begins that forbids it."""


def reasons(output: str, contract: str) -> str:
    """The part of the linter's output about one broken contract."""
    _, _, broken = output.partition("Broken contracts")
    sections = re.split(r"^(.+)\n-{3,}\n", broken, flags=re.MULTILINE)  # text, then title and text by turns
    return "\n".join(text for title, text in zip(sections[1::2], sections[2::2], strict=True) if contract in title)


@pytest.mark.slow
def test_each_breach_is_reported_by_its_contract(tree: Path) -> None:
    """All breaches at once, because reading the tree takes longer than checking it."""
    for module, line, _ in BREACHES:
        (tree / "netboard" / f"{module.replace('.', '/')}.py").write_text(f"{line}\n", encoding="utf-8")
    done = lint(tree)
    assert done.returncode != 0
    missed = [breach for breach in BREACHES if f"netboard.{breach[0]}" not in reasons(done.stdout, breach[2])]
    assert missed == [], done.stdout + done.stderr
