"""The study of a manifest becomes recordings, or all its errors are reported before any is written."""

import os
import signal
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from netboard.base.errors import ConfigError, NetboardError
from netboard.recording.files.reader import Recording
from netboard.recording.importing.study_import import UNNAMED, ImportJob, examine, import_one, run
from netboard.recording.importing.table_import import Imported
from netboard.recording.integrity.checking import check
from netboard.recording.integrity.severity import Severity
from netboard.services.cli import app

HEAD = """\
config = "rig.toml"
rate = 100
columns.time = { name = "t", unit = "ms" }
columns.left_z = { name = "Height1", unit = "mm" }
columns.right_z = { name = "Height2", unit = "-mm" }
session.study = "theirs"
"""
BLOCK = """
[[recording]]
file = "D{dyad}/b{number}.csv"
session = {{ dyad = "D{dyad}", name = "S01", participant_a = "P{dyad}a", participant_b = "P{dyad}b" }}
block = {{ number = {number}, configuration = "{configuration}", force = "{force}" }}
"""
BLOCKS = [
    {"dyad": dyad, "number": number, "configuration": configuration, "force": force}
    for dyad in ("01", "02")
    for number, configuration, force in ((1, "bimanual", "full"), (2, "dyadic", "none"))
]


def quiet(what: str, done: int, total: int) -> None:
    assert 0 < done <= total


def write_table(path: Path, rows: int = 300, names: str = "t,Height1,Height2,trial", *, timed: bool = True) -> None:
    t = np.arange(rows) / 100
    columns = [1000 * t, 10 * np.sin(3 * t), 10 * np.cos(3 * t), (t > 1)]
    path.parent.mkdir(exist_ok=True)
    chosen = np.stack(columns if timed else columns[1:], 1)
    np.savetxt(path, chosen, "%.9g", ",", header=names, comments="")


@pytest.fixture
def study(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A manifest of two dyads with two blocks each."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "rig.toml").write_text("[block]\ntrials = 30\nblocks = 1\n[geometry]\ntarget_width = 0.07\n")
    for block in BLOCKS:
        write_table(tmp_path / f"D{block['dyad']}" / f"b{block['number']}.csv")
    manifest = tmp_path / "study.toml"
    manifest.write_text(HEAD + "".join(BLOCK.format(**block) for block in BLOCKS))
    return manifest


def command(*words: str, code: int = 0) -> str:
    result = CliRunner().invoke(app, ["import", *words], env={"COLUMNS": "300", "NO_COLOR": "1"})
    assert result.exit_code == code, result.output
    return result.output


@pytest.mark.slow
def test_study_is_imported_once_and_existing_recordings_are_kept(study: Path) -> None:
    printed = command("--manifest", "study.toml", "-o", "out", "--workers", "2")
    assert "4 imported, 0 already there, 0 failed" in printed
    found = {path.name: path.read_bytes() for path in Path("out").iterdir()}
    assert len(found) == 4
    for name in found:
        assert check(Path("out") / name).severity is Severity.SOUND
    with Recording(next(Path("out").glob("S01_D02_block02_*.mcap"))) as one:
        config = one.config_text
        assert one.ticks()["left_sent_z"][10] == pytest.approx(0.01 * np.sin(0.03), abs=1e-6)
        assert one.ticks()["right_sent_z"][0] == pytest.approx(-0.01)
        assert one.metadata["imported_rate"] == "100.0"
    for line in ('study = "theirs"', 'participant_b = "P02b"', 'force = "none"', "trials = 30", "target_width = 0.07"):
        assert line in config
    next(Path("out").glob("S01_D01_block01_*")).unlink()
    assert "1 imported, 3 already there, 0 failed" in command("--manifest", "study.toml", "-o", "out")
    assert "0 imported, 4 already there, 0 failed" in command("--manifest", "study.toml", "-o", "out")
    kept = {name: data for name, data in found.items() if "D01_block01" not in name}
    assert {name: (Path("out") / name).read_bytes() for name in kept} == kept


WRONG: list[tuple[str, str, str]] = [
    ('file = "D01/b1.csv"', 'file = "D01/b9.csv"', "line 9, key file: D01/b9.csv: no such file"),
    ('unit = "ms"', 'unit = "parsec"', "line 3, key columns.time: unit: expected one of s, ms, us, ns, min"),
    ("number = 2", "number = 1", "dyad D01, session S01, block 1 is listed already, at study.toml, line 8"),
    ('file = "D01/b2.csv"', 'file = "D01/b1.csv"', "line 13 (D01/b1.csv): this file is listed already"),
    ("rate = 100\n", "rate = 1000\n", "found 100 samples a second, expected rate = 1000; is time in another unit?"),
    ("rate = 100\n", "rate = -1\n", "line 2, key rate: found -1, expected samples a second, at least 0.1 [Hz]"),
    ("Height1", "Height9", "has no column Height9; it has t, Height1, Height2, trial"),
    ('force = "full"', 'force = "all"', '[block] force: found "all", expected "none"'),
    ("file = ", "fiel = ", "unknown key, expected one of columns, rate"),
    ('"rig.toml"', '"rag.toml"', "line 1, key config: rag.toml: cannot be read: No such file or directory"),
    ('session.study = "theirs"', "session = 3", "line 6, key session: found 3, expected a table of the configuration"),
    ("columns.left_z", "columns.left", "line 4, key columns.left: unknown column, expected one of time, left_z"),
    ('"-mm"', '"-m"', "is it in another unit? (--unit right_z=mm)"),
    ("[[recording]]", "[[recordings]]", "found no recording, expected [[recording]]"),
    ("rate = 100\n", "rate =\n", "study.toml: not valid TOML"),
]


@pytest.mark.parametrize(("right", "wrong", "problem"), WRONG)
def test_invalid_manifest_is_refused_with_the_place_and_nothing_is_written(
    study: Path, right: str, wrong: str, problem: str
) -> None:
    text = study.read_text()
    assert right in text
    study.write_text(text.replace(right, wrong))
    printed = command("--manifest", "study.toml", "-o", "out", code=2)
    assert problem in printed
    assert "study.toml" in printed
    assert not Path("out").exists()


def test_all_problems_of_a_manifest_are_reported_at_once(study: Path) -> None:
    blocks = [BLOCK.format(**block) for block in BLOCKS]
    blocks[0] = blocks[0].replace("b1.csv", "b9.csv")
    blocks[1] = blocks[1].replace('"none"', '"nothing"')
    blocks[3] = blocks[3].replace("number = 2", "number = 1")
    study.write_text(HEAD + "".join(blocks))
    with pytest.raises(ConfigError) as caught:
        examine(study, Path("out"), quiet)
    first, *problems = str(caught.value).splitlines()
    study.write_text(HEAD.replace('"-mm"', '"-mile"') + blocks[0])
    with pytest.raises(
        ConfigError, match=r"2 problems to fix:\n.*line 5, key columns\.right_z: unit.*\n.*b9\.csv: no such file"
    ):
        examine(study, Path("out"), quiet)
    assert first == "nothing was imported, 3 problems to fix:"
    assert [problem.partition(":")[2].partition(" ")[0] != problem for problem in problems] == [True] * 3
    assert ("b9.csv" in problems[0], "[block] force" in problems[1], "block 1 is listed" in problems[2]) == (True,) * 3


def test_table_of_hands_only_is_refused_before_any_import_unless_the_task_is_simulated(study: Path) -> None:
    write_table(Path("D01/b2.csv"), names="t,Height1,Height2,other")
    printed = command("--manifest", "study.toml", "-o", "out", code=2)
    assert "nothing was imported, 1 problem to fix:\nstudy.toml, line 13 (D01/b2.csv): D01/b2.csv: contains" in printed
    assert not Path("out").exists()
    study.write_text("simulate = true\n" + study.read_text())
    assert len(examine(study, Path("out"), quiet).jobs) == len(BLOCKS)


@pytest.mark.slow
def test_table_that_fails_late_does_not_stop_the_other_imports(study: Path) -> None:
    write_table(Path("D01/b2.csv"), 20_010)
    with Path("D01/b2.csv").open("a") as file:
        file.write("0,0,0,0\n")
    printed = command("--manifest", "study.toml", "-o", "out", code=1)
    assert "3 imported, 0 already there, 1 failed" in printed
    assert "line 13 (D01/b2.csv): D01/b2.csv: line 20012, column time" in printed
    assert sorted(path.suffix for path in Path("out").iterdir()) == [".mcap"] * 3


def killed_at_the_third(job: ImportJob, unnamed: Path) -> Imported:
    """A worker that is killed in the middle of a recording."""
    if job.source.name == "b1.csv" and job.source.parent.name == "D02":
        (unnamed / f"{job.path.name}.part").write_bytes(b"half a recording")
        os.kill(os.getpid(), signal.SIGKILL)
    return import_one(job, unnamed)


@pytest.mark.slow
def test_killed_worker_leaves_only_complete_recordings_and_can_be_resumed(study: Path) -> None:
    plan = examine(study, Path("out"), quiet)
    with pytest.raises(NetboardError, match=r"was killed, .* 2 of 4 recordings .* run the same command again"):
        run(plan, Path("out"), 1, quiet, killed_at_the_third)
    assert not list(Path("out").glob(f"{UNNAMED}*"))
    assert [check(path).severity for path in Path("out").iterdir()] == [Severity.SOUND] * 2
    again = examine(study, Path("out"), quiet)
    assert (len(again.jobs), len(again.done)) == (2, 2)


@pytest.mark.slow
def test_existing_recordings_with_other_settings_are_refused(study: Path) -> None:
    command("--manifest", "study.toml", "-o", "out")
    study.write_text(study.read_text().replace('"-mm"', '"mm"').replace('"bimanual", force = "full"', '"bimanual"'))
    changed = command("--manifest", "study.toml", "-o", "out", code=2)
    assert changed.count("was imported with other settings; move it away") == 4
    victim = next(Path("out").glob("*D01_block01*"))
    victim.write_bytes(victim.read_bytes()[:-100])
    assert f"{victim}: exists but is damaged" in command("--manifest", "study.toml", "-o", "out", code=2)


def test_table_without_times_gets_them_from_the_rate(study: Path) -> None:
    for block in BLOCKS:
        table = Path(f"D{block['dyad']}") / f"b{block['number']}.csv"
        write_table(table, names="Height1,Height2,trial", timed=False)
    study.write_text(study.read_text().replace('columns.time = { name = "t", unit = "ms" }\n', ""))
    (job, *_) = examine(study, Path("out"), quiet).jobs
    Path("out/unnamed").mkdir(parents=True)
    found = import_one(job, Path("out/unnamed"))
    assert found.ticks == 2991


@pytest.mark.parametrize(
    ("words", "problem"),
    [
        ((), "expected either TABLE... or --manifest"),
        (("a.csv", "--manifest", "study.toml"), "expected either TABLE... or --manifest"),
        (("--manifest", "study.toml", "--simulate"), "found with --simulate; set these in study.toml instead"),
        (("--manifest", "none.toml"), "none.toml: cannot be read: No such file or directory"),
    ],
)
def test_tables_and_a_manifest_exclude_each_other(study: Path, words: tuple[Any, ...], problem: str) -> None:
    assert problem in command(*words, code=2)
