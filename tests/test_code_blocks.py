"""Every code block of README and docs runs, or says why it does not."""

from pathlib import Path

import pytest

import code_blocks
from code_blocks import CodeBlock
from lab_folder import LabFolder, local
from netboard.analysis.extraction import settings
from netboard.base.config import parse
from netboard.devices.simulated.playback import read_track
from netboard.recording.importing.hand_files import read_hands
from netboard.recording.importing.manifest import Manifest
from netboard.task.studies.study import parse_study

BLOCKS = list(code_blocks.blocks())
CODE = [block for block in BLOCKS if block.language not in code_blocks.SHOWN]
RUN = [block for block in CODE if block.mark != "not run"]
PAGES = list(dict.fromkeys(block.page for block in RUN))


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> LabFolder:
    return LabFolder(tmp_path_factory.mktemp("lab"))


def test_every_block_can_be_run_or_says_why_not() -> None:
    assert {block.mark for block in BLOCKS} == {"", "not run", "file"}
    for block in RUN:
        assert block.language in RUNNERS, f"{block.name}: say why it is not run"


def test_every_exception_is_in_use() -> None:
    commands = [command for block in RUN for command in block.commands]
    reasons = [code_blocks.reason_not_run(command) for command in commands]
    assert set(code_blocks.NOT_RUN.values()) <= set(reasons)


@pytest.mark.timeout(900)
@pytest.mark.sampled(5)
@pytest.mark.parametrize("page", PAGES)
def test_blocks_of_page_run(page: str, lab: LabFolder, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for block in (block for block in RUN if block.page == page):
        lab.prepare(local(block.text), tmp_path)
        RUNNERS[block.language](block, tmp_path)


def _run_commands(block: CodeBlock, folder: Path) -> None:
    for shown in block.commands:
        command = local(shown)
        if code_blocks.reason_not_run(command):
            code_blocks.require_valid(command, folder)
        else:
            done = code_blocks.run(command, folder)
            assert done.returncode == 0, f"{block.name}: {command}\n{done.stdout}{done.stderr}"


def _compare_outputs(block: CodeBlock, folder: Path) -> None:
    for shown, expected in code_blocks.outputs(block):
        command = local(shown)
        if code_blocks.reason_not_run(command):
            code_blocks.require_valid(command, folder)
        else:
            done = code_blocks.run(command, folder)
            assert (done.returncode == 0) == ("netboard: " not in expected), f"{block.name}: {done.stderr}"
            code_blocks.require_output(done.stdout + done.stderr, expected)


def _run_python(block: CodeBlock, folder: Path) -> None:
    (folder / "block.py").write_text(local(block.text), encoding="utf-8")
    done = code_blocks.run("python block.py", folder)
    assert done.returncode == 0, f"{block.name}: {done.stderr}"
    assert done.stdout or "print(" not in block.text
    (folder / "block.py").unlink()


def _read_table(block: CodeBlock, folder: Path) -> None:
    name, text = block.value or "rig.toml", local(block.text)
    (folder / name).write_text(text, encoding="utf-8")
    READERS[name](text)


READERS = {
    "rig.toml": lambda text: parse(text, "rig.toml"),
    "study.toml": lambda text: parse_study(text, "study.toml"),
    "analysis.toml": lambda text: settings.parse(text, "analysis.toml"),
    "manifest.toml": lambda _: Manifest(Path("manifest.toml")),
    "stylus.csv": lambda _: read_hands(Path("stylus.csv")),
    "played.csv": lambda _: read_track(Path("played.csv"), "left", 0),
}
RUNNERS = {
    "sh": _run_commands,
    "console": _compare_outputs,
    "python": _run_python,
    "toml": _read_table,
    "csv": _read_table,
}
