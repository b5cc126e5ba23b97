"""``netboard plan``: output and refusals."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from netboard.base.config import Config, parse
from netboard.base.errors import ConfigError
from netboard.nodes.server.planned import Planned, StudySession
from netboard.services.cli import app
from netboard.services.loading import load_study
from netboard.task.plans.plan import digest, plan_of
from netboard.task.studies import library
from netboard.task.studies.study import paper_study, parse_study

runner = CliRunner()
UNBALANCED = 'orders.main = "3 duo"\n[kinds.duo]\n[factors.f]\nlevels.a = {}\nlevels.b = {}\n'


@pytest.fixture(autouse=True)
def _run_in_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")
    monkeypatch.setenv("NO_COLOR", "1")


def run(words: str, code: int = 0) -> str:
    result = runner.invoke(app, ["plan", *words.split()])
    assert result.exit_code == code, result.output
    return result.output


@pytest.mark.parametrize("command", ["show", "check", "list", "template"])
def test_every_command_has_help_with_examples(command: str) -> None:
    assert f"netboard plan {command}" in run(f"{command} --help").partition("Examples:")[2]


def test_show_lists_the_blocks_of_a_dyad() -> None:
    output = run("show --study paper --dyad 3")
    assert "dyad 3, seed 1, order paper, A sits right" in output
    assert [line.split()[:4] for line in output.splitlines() if line.split()[:1] == ["9"]] == [
        ["9", "dyadic", "dyad", "off"]
    ]
    assert sum(line.split()[1:2] == ["bimanual"] for line in output.splitlines()) >= 12


def test_show_tabulates_the_balance_over_several_dyads() -> None:
    output = run("show --study paper --dyads 8")
    assert "Session 1" not in output
    assert output.count(" 180 ") == 64
    assert "Over 8 dyads" in output
    assert "uneven" not in output


def test_show_prints_plan_and_balance_as_json() -> None:
    output = json.loads(run("show --study paper --dyad 3 --dyads 4 --seed 5 --json"))
    assert output["digest"] == digest(plan_of(paper_study(), 5, 3))
    assert [block["number"] for block in output["sessions"][0]["blocks"]] == list(range(1, 19))
    assert output["problems"] == output["balance"]["uneven"] == []


@pytest.mark.slow
@pytest.mark.parametrize("name", library.NAMES)
def test_built_in_studies_are_valid_and_listed(name: str) -> None:
    assert f"{name}: valid (1 session, " in run(f"check {name} --dyads 60")
    assert name in run("list")


def test_name_of_a_study_may_select_block_orders() -> None:
    assert load_study("paper:abba").taken() == ("abba",)
    assert load_study("paper:paper,dyadic_first").taken() == ("paper", "dyadic_first")
    assert "order abba" in run("show --study paper:abba")
    assert 'order: found "abab", expected one of paper' in run("check paper:abab", 2)


def test_unbalanced_study_is_refused() -> None:
    Path("study.toml").write_text(UNBALANCED, encoding="utf-8")
    refused = run("check study.toml", 2)
    assert "the study is not valid" in refused
    assert "dyad 2, participant B, duo: trials are not even: a 60 in 1 block, b 120 in 2 blocks" in refused
    assert "and 10 more like these" in refused
    assert "Trials of each participant" in refused
    run("show --study study.toml", 2)


def test_study_that_conflicts_with_the_rig_is_refused() -> None:
    Path("study.toml").write_text('orders.main = "9 a"\n[kinds.a]\ngeometry.target_distance = 0.34', encoding="utf-8")
    refused = run("check study.toml", 2)
    assert refused.count("[geometry] target_distance") == 1
    assert "dyad 1, block 1 (a): [geometry] target_distance" in refused
    assert ": valid (" in run("check study.toml --set geometry.board_length=1 --set task.fall_distance=0.45")


def test_missing_unreadable_and_invalid_studies_are_reported() -> None:
    assert "nothing: no such study or file; the built-in studies are paper, five_forces" in run("check nothing", 2)
    Path("folder").mkdir()
    assert "folder: cannot be read" in run("check folder", 2)
    Path("bad.toml").write_text("a = ", encoding="utf-8")
    assert "bad.toml: not valid TOML" in run("check bad.toml", 2)


def test_template_prints_a_valid_study() -> None:
    assert parse_study(run("template")).name == "template"
    assert parse_study(run("template paper")) == paper_study()
    assert "expected one of paper, " in run("template other", 2)


def test_show_lists_factor_levels_with_their_settings_and_units() -> None:
    Path("own.toml").write_text(
        'orders.main = "3 duo"\n[kinds.duo]\n'
        "[factors.mass]\nlevels.light.physics.M = 0.01\nlevels.heavy.physics.M = 0.05\n"
        '[factors.felt]\nlevels.on.block.force = "full"\nlevels.on.block.force_delay_ms = 20\nlevels.off = {}\n'
    )
    shown = runner.invoke(app, ["plan", "show", "own.toml"]).output
    assert shown == runner.invoke(app, ["plan", "show", "--study", "own.toml"]).output
    output = " ".join(shown.split())
    assert "mass light physics.M = 0.01 kg" in output
    assert "heavy physics.M = 0.05 kg" in output
    assert "felt on block.force = full, block.force_delay_ms = 20 ms" in output
    assert "off nothing" in output


@pytest.mark.slow
def test_server_start_reports_an_existing_journal_of_the_session(capsys: pytest.CaptureFixture[str]) -> None:
    planned = Planned(Config(), load_study("pilot"), StudySession("pilot", 1))
    planned.begin()
    assert capsys.readouterr().out == ""
    planned.path.parent.mkdir()
    planned.path.write_text("begun before")
    planned.begin()
    printed = capsys.readouterr().out
    assert f"{planned.path}: already exists" in printed
    assert "--resume" in printed


@pytest.mark.slow
def test_server_start_says_that_the_first_session_has_not_begun(capsys: pytest.CaptureFixture[str]) -> None:
    study = parse_study('name = "twice"\norders.main = "duo | duo"\n[kinds.duo]\n')
    Planned(Config(), study, StudySession("twice", 1, session=2)).begin()
    assert "session 2 of dyad D01 begins, but no journal here is of session 1" in capsys.readouterr().out


@pytest.mark.slow
def test_server_of_a_session_that_was_started_before_does_not_begin() -> None:
    planned = Planned(parse("[session]\npilot = true"), load_study("pilot"), StudySession("pilot", 1))
    planned.path.parent.mkdir()
    planned.path.touch()
    with pytest.raises(ConfigError, match="this session was started before"):
        planned.begin()
