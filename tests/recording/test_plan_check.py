"""A block of a study is compared with the plan that its journal names."""

import hashlib
from dataclasses import replace
from pathlib import Path

import pytest

from netboard.base.config import Config
from netboard.recording.integrity.journal_check import check_plan
from netboard.recording.integrity.severity import Severity
from netboard.recording.recovery.journal_file import journal_path
from netboard.task.journal.entries import Header, line_of
from netboard.task.plans.plan import Plan, config_of, digest, plan_of, seated
from netboard.task.studies.study import Study, digest_of_study, paper_study, parse_study, resolve_study

STUDY = paper_study()


def block(plan: Plan, number: int) -> Config:
    config = seated(Config(), plan)
    config = replace(config, session=replace(config.session, dyad="D03"))
    return config_of(config, plan.sessions[0], number)


def keep_journal(
    folder: Path, plan: Plan, config: Config, plan_digest: str = "", study: Study = STUDY, study_text: str = ""
) -> Path:
    study_digest = digest_of_study(study)
    who = config.session
    header = Header(
        1, study.name, study_digest, plan_digest or digest(plan), plan.seed, who.dyad, who.name, 1, ("A", "B"),
        pilot=who.pilot, consent=True, netboard="0", config_digest="", study_text=study_text,
    )  # fmt: skip
    journal_path(folder, config).write_bytes(line_of(header, "now"))
    return folder / "a.mcap"


@pytest.mark.parametrize("number", [1, 7, 18])
def test_block_that_agrees_with_its_plan_is_sound(tmp_path: Path, number: int) -> None:
    plan = plan_of(STUDY, 5, 3)
    config = block(plan, number)
    (finding,) = check_plan(keep_journal(tmp_path, plan, config), config)
    assert (finding.severity, config.block.label in finding.text) == (Severity.SOUND, True)
    assert f"block {number} of 18 agrees with the plan" in finding.text


def test_block_that_differs_from_its_plan_is_damage(tmp_path: Path) -> None:
    plan = plan_of(STUDY, 5, 3)
    config = block(plan, 4)
    other = replace(config, block=replace(config.block, first_target="random", trials=61))
    (finding,) = check_plan(keep_journal(tmp_path, plan, config), other)
    assert finding.severity == Severity.DAMAGE
    assert "[block] trials: found 61, planned 60" in finding.text
    assert "[block] first_target: found 'random'" in finding.text


def test_shortened_pilot_run_is_sound(tmp_path: Path) -> None:
    plan = plan_of(STUDY, 5, 3)
    config = block(plan, 2)
    config = replace(
        config, session=replace(config.session, pilot=True), block=replace(config.block, trials=6, blocks=2)
    )
    short = hashlib.sha256(f"{digest(plan)} 2 6".encode()).hexdigest()
    (finding,) = check_plan(keep_journal(tmp_path, plan, config, short), config)
    assert (finding.severity, "agrees with the plan" in finding.text) == (Severity.SOUND, True)


def test_block_is_not_compared_with_a_plan_that_cannot_be_verified(tmp_path: Path) -> None:
    plan = plan_of(STUDY, 5, 3)
    config = block(plan, 2)
    (finding,) = check_plan(tmp_path / "a.mcap", config)
    assert "no journal beside it" in finding.text
    (finding,) = check_plan(keep_journal(tmp_path, plan, config, "0" * 64), config)
    assert (finding.severity, "not compared" in finding.text) == (Severity.SOUND, True)


def test_block_of_a_study_of_ones_own_is_compared_with_its_plan(tmp_path: Path) -> None:
    text = resolve_study(STUDY).replace('name = "paper"', 'name = "ours"').replace("trials = 60", "trials = 12")
    own = parse_study(text)
    plan = plan_of(own, 5, 3)
    config = block(plan, 4)
    assert config.block.trials == 12
    older = keep_journal(tmp_path, plan, config, study=own)
    (finding,) = check_plan(older, config)
    assert "has no text of the study" in finding.text
    path = keep_journal(tmp_path, plan, config, study=own, study_text=resolve_study(own))
    (finding,) = check_plan(path, config)
    assert (finding.severity, "agrees with the plan of study ours" in finding.text) == (Severity.SOUND, True)
    (finding,) = check_plan(path, replace(config, block=replace(config.block, trials=13)))
    assert (finding.severity, "trials: found 13, planned 12" in finding.text) == (Severity.DAMAGE, True)
    keep_journal(tmp_path, plan, config, study=own, study_text=text.replace("trials = 12", "trials = 13"))
    (finding,) = check_plan(path, config)
    assert "the study has changed" in finding.text


def test_block_without_a_study_has_no_plan(tmp_path: Path) -> None:
    assert [*check_plan(tmp_path / "a.mcap", Config())] == []
