"""Virtual studies: measures equal those of recordings, tables do not depend on the workers, and errors are clear."""

import json
import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from netboard.analysis.cohort import block, virtual
from netboard.analysis.cohort.block import Rehearsed, rehearse
from netboard.analysis.cohort.folder import Cohort, make_cohort
from netboard.analysis.cohort.planning import Request, answer
from netboard.analysis.cohort.posterior import Posterior
from netboard.analysis.cohort.power import performer_means
from netboard.analysis.cohort.rows import KEPT
from netboard.analysis.cohort.virtual import LAST_SEED, VirtualDesign, jobs_of_dyad, simulate, unpack
from netboard.analysis.cohort.workers import Runner
from netboard.analysis.extraction.recordings import measure
from netboard.analysis.extraction.settings import Readings
from netboard.analysis.extraction.study import StudyData as Tables
from netboard.analysis.extraction.study import study_of
from netboard.analysis.extraction.trials import PLACES
from netboard.analysis.topics.measures import levels
from netboard.analysis.topics.pushes import pushes
from netboard.base.config import Config
from netboard.base.errors import ConfigError
from netboard.base.tables.perturbations import Perturbation
from netboard.nodes.rehearsal.jobs import RehearsalJob, rehearse_all
from netboard.recording.export.runs import runs_of
from netboard.task.studies.study import parse_study

PLAN = """
name = "short"
block.trials = 2
[orders]
short = "2 dyadic"
[factors.haptics]
order = "alternate"
levels.on.block.force = "full"
levels.off.block.force = "none"
[kinds.dyadic]
performers = "dyad"
"""

DESIGN = VirtualDesign(parse_study(PLAN, "short"), Config(), dyads=2, seed=3, keep_trials=True)


def check_progress(what: str, done: int, total: int) -> None:
    assert 0 <= done <= total


RUNNER = Runner(check_progress)


@pytest.fixture(scope="module")
def cohort(tmp_path_factory: pytest.TempPathFactory) -> Cohort:
    folder = tmp_path_factory.mktemp("cohort") / "whole"
    return make_cohort(DESIGN, 3, folder, RUNNER)


@pytest.fixture(scope="module")
def analysed(tmp_path_factory: pytest.TempPathFactory) -> Tables:
    return recorded(DESIGN, tmp_path_factory.mktemp("recorded"))


def recorded(design: VirtualDesign, folder: Path) -> Tables:
    """Record and analyse the first virtual study."""
    for dyad in range(1, design.dyads + 1):
        jobs = jobs_of_dyad(design.config, design.study, design.seed_of(1), dyad)
        rehearse_all([replace(job, folder=folder) for job in jobs], 1)
    return study_of([measure(run, Readings()) for run in runs_of(sorted(folder.glob("*.mcap")))], Readings())


def table_files(cohort: Cohort) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted((cohort.folder / "tables").iterdir())}


@pytest.mark.slow
def test_cohort_measures_equal_those_of_analysed_recordings(cohort: Cohort, analysed: Tables) -> None:
    found = pd.DataFrame(cohort.get(1).tables["trials"])
    common = [name for name in found if name in analysed.trials]
    assert {"completion", "peaks", "cooperative", "still", "braking_distance", "order", "flags"} <= set(common)
    expected = analysed.trials[common].reset_index(drop=True)
    pd.testing.assert_frame_equal(found[common], expected, check_exact=True)


@pytest.mark.slow
@pytest.mark.parametrize("kept", KEPT, ids=lambda kept: kept.measure.name)
def test_dyad_levels_equal_those_of_analysed_recordings(cohort: Cohort, analysed: Tables, kept) -> None:
    performers = performer_means(pd.DataFrame(cohort.get(1).tables["groups"]), kept)
    found = performers.groupby("dyad").mean()
    expected = levels(analysed, kept.measure).pivot(index="dyad", columns="condition", values="level")
    assert found.to_numpy() == pytest.approx(expected.to_numpy(), rel=1e-12)
    assert list(found.index) == ["D01", "D02"]


def pushed_design(trials: int, perturbed: int) -> VirtualDesign:
    push = "perturbation = { at = 'ball', force = 0.03, time = 0.3 }\n"
    plan = PLAN.replace("trials = 2", f"trials = {trials}").replace("[orders]", f"{push}[orders]")
    return replace(DESIGN, study=parse_study(f"{plan}perturbed = {perturbed}\n", "pushed"), dyads=1)


@pytest.mark.slow
def test_block_does_not_depend_on_the_room_for_its_ticks(monkeypatch: pytest.MonkeyPatch) -> None:
    job = jobs_of_dyad(DESIGN.config, DESIGN.study, seed=5, dyad=1)[0]
    whole = rehearse(job)
    for name, size in {"RING": 2, "PIECE": 777, "TURNS": 4, "ROOM": 1000}.items():
        monkeypatch.setattr(block, name, size)
    narrow = rehearse(job)
    assert whole.ticks > 5000
    assert (narrow.ticks, narrow.flags, narrow.given_up) == (whole.ticks, whole.flags, whole.given_up)
    assert repr(narrow.block.attempts) == repr(whole.block.attempts)  # repr, because NaN != NaN
    for name in PLACES:
        assert narrow.block.raw(name).tobytes() == whole.block.raw(name).tobytes()


def test_responses_to_pushes_equal_those_of_analysed_recordings(tmp_path: Path) -> None:
    design = pushed_design(trials=8, perturbed=3)
    table = pd.DataFrame(unpack(simulate(design, 1)).tables["pushes"])
    parts = pushes(recorded(design, tmp_path)).parts
    assert list(table["condition"]) == [one.condition.name for one in parts for _ in one.performers]
    assert set(table["force"]) == {"full", "none"}
    assert set(table["pushed"]) == {"ball"}
    for name, attribute in (("peak", "peak"), ("peak_time", "at"), ("half_back", "half_back")):
        expected = [getattr(response, attribute) for one in parts for response in one.responses]
        np.testing.assert_array_equal(table[name], expected)


@pytest.mark.slow
def test_plan_with_pushes_has_a_table_of_them_even_if_nobody_was_pushed(monkeypatch: pytest.MonkeyPatch) -> None:
    def unpushed(job: RehearsalJob) -> Rehearsed:
        return rehearse(replace(job, config=replace(job.config, perturbation=Perturbation())))

    monkeypatch.setattr(virtual, "rehearse", unpushed)
    tables = unpack(simulate(pushed_design(trials=2, perturbed=1), 1)).tables
    assert set(tables) == {"groups", "trials", "pushes"}
    assert all(len(column) == 0 for column in tables["pushes"].values())


@pytest.mark.slow
def test_plan_without_pushes_has_no_table_of_them(cohort: Cohort) -> None:
    assert set(cohort.get(1).tables) == {"groups", "trials"}


@pytest.mark.slow
def test_tables_are_equal_with_two_processes_and_after_an_interruption(cohort: Cohort, tmp_path: Path) -> None:
    folder = tmp_path / "again"
    shutil.copytree(cohort.folder, folder)
    shutil.rmtree(folder / "tables")
    (folder / "studies" / "study-000002.tables").unlink()
    damaged = folder / "studies" / "study-000003.tables"
    damaged.write_bytes(damaged.read_bytes()[:-1])
    (folder / "studies" / "killed.part").write_bytes(b"")
    again = make_cohort(DESIGN, 3, folder, Runner(check_progress, 2), resume=True)
    assert table_files(again) == table_files(cohort)
    assert len(list((folder / "studies").iterdir())) == 3


@pytest.mark.slow
def test_every_study_has_its_own_seed_and_results(cohort: Cohort) -> None:
    table = pd.read_csv(cohort.folder / "tables" / "studies.csv")
    assert table["seed"].tolist() == [3_000_001, 3_000_002, 3_000_003]
    groups = pd.read_parquet(cohort.folder / "tables" / "groups.parquet")
    assert groups["completion"].nunique() == len(groups) == 3 * 2 * 2
    assert groups.groupby("study")["trials"].sum().tolist() == table["trials"].tolist()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("design", "words"),
    [
        (replace(DESIGN, seed=4), r'its --seed is "3", and "4" is asked for'),
        (replace(DESIGN, dyads=1), r"its --dyads is"),
        (replace(DESIGN, keep_trials=False), r"its --trials is"),
        (
            replace(DESIGN, study=replace(DESIGN.study, order=("short",), text="other")),
            r'its plan is .*"text = "other""',
        ),
    ],
)
def test_resuming_a_cohort_with_other_settings_is_refused(cohort: Cohort, design: VirtualDesign, words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        make_cohort(design, 3, cohort.folder, RUNNER, resume=True)


@pytest.mark.slow
def test_fewer_studies_than_a_cohort_has_are_refused(cohort: Cohort) -> None:
    """The tables would have two studies, and `netboard power --cohort` would use three."""
    before = table_files(cohort)
    with pytest.raises(ConfigError, match=r"--studies: found 2, but .* has 3, .*; expected 3 or more"):
        make_cohort(DESIGN, 2, cohort.folder, RUNNER, resume=True)
    assert table_files(cohort) == before


@pytest.mark.slow
def test_existing_folder_is_not_overwritten_and_missing_one_not_resumed(cohort: Cohort, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="already exists; name another output, or continue it with --resume"):
        make_cohort(DESIGN, 3, cohort.folder, RUNNER)
    with pytest.raises(ConfigError, match=r"has no cohort.json"):
        make_cohort(DESIGN, 3, tmp_path / "none", RUNNER, resume=True)


def invalid_designs() -> Iterator[tuple[VirtualDesign, int, str]]:
    yield DESIGN, 0, "--studies: found 0, expected 1"
    ball = replace(DESIGN.config, physics=replace(DESIGN.config.physics, balls=0))
    yield replace(DESIGN, config=ball), 1, "balls: found 0, expected 1 or more"
    forces = parse_study(PLAN.replace('"full"', '"unrelated"'), "forces")
    yield replace(DESIGN, study=forces), 1, "unrelated"


@pytest.mark.parametrize(("design", "studies", "words"), list(invalid_designs()))
def test_invalid_designs_are_refused_before_any_file_is_written(
    tmp_path: Path, design: VirtualDesign, studies: int, words: str
) -> None:
    with pytest.raises(ConfigError, match=words):
        make_cohort(design, studies, tmp_path / "new", RUNNER)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("line", "words"), [("block.trials = 0", "trials"), ('short = ""', "short")])
def test_plans_without_blocks_or_trials_are_refused(line: str, words: str) -> None:
    key = line.partition(" =")[0]
    text = "\n".join(line if own.startswith(f"{key} =") else own for own in PLAN.splitlines())
    with pytest.raises(ConfigError, match=words):
        parse_study(text, "none")


def test_designs_without_dyads_or_with_too_large_a_seed_are_refused() -> None:
    with pytest.raises(ConfigError, match="--dyads: found 0, expected 1 or more"):
        replace(DESIGN, dyads=0)
    with pytest.raises(ConfigError, match="--seed: found 99999"):
        replace(DESIGN, seed=99_999)
    assert np.iinfo(np.int32).max >= replace(DESIGN, seed=LAST_SEED).seed_of(999_999)


def test_power_of_a_cohort_without_trials_is_refused(tmp_path: Path) -> None:
    """With so short a time limit nobody succeeds or falls."""
    study = parse_study(PLAN.replace("block.trials = 2", "block.trials = 2\ntask.time_limit = 0.5"), "short")
    design = replace(DESIGN, study=study)
    whole = make_cohort(design, 1, tmp_path / "cohort", RUNNER)
    request = Request(study, design.config, (2,), (0,), 1, design.seed, 0.05)
    with pytest.raises(ConfigError, match="no dyad of this study has both conditions of a contrast"):
        answer(request, tmp_path / "power", whole.folder, RUNNER)


@pytest.mark.slow
def test_each_study_of_a_posterior_has_a_draw_as_its_usual_participant(tmp_path: Path, cohort: Cohort) -> None:
    posterior = Posterior(("reaction_time", "kp"), np.array([[0.3, 2.1], [0.35, 2.2], [0.4, 2.3]]), {})
    design = replace(DESIGN, posterior=posterior, keep_trials=False)
    draws = {number: design.config_of(number).participant for number in range(1, 30)}
    assert {(one.reaction_time, one.kp) for one in draws.values()} == {tuple(row) for row in posterior.draws.tolist()}
    usual = DESIGN.config.participant
    assert {replace(one, reaction_time=usual.reaction_time, kp=usual.kp) for one in draws.values()} == {usual}
    assert DESIGN.config_of(1) == DESIGN.config
    # A study equals one whose configuration has the drawn participant.
    drawn = replace(design, posterior=None, config=replace(design.config, participant=draws[2]))
    one, other = (unpack(simulate(each, 2)).tables["groups"] for each in (design, drawn))
    pd.testing.assert_frame_equal(pd.DataFrame(one), pd.DataFrame(other), check_exact=True)
    made = make_cohort(design, 1, tmp_path / "drawn", RUNNER)
    assert made.manifest["posterior"] == posterior.sha256
    with pytest.raises(ConfigError, match="its --posterior is"):
        make_cohort(replace(design, posterior=None), 1, tmp_path / "drawn", RUNNER, resume=True)
    assert cohort.manifest["posterior"] is None


@pytest.mark.slow
def test_assurance_is_the_power_of_a_cohort_of_a_posterior(tmp_path: Path, cohort: Cohort) -> None:
    draws = np.array([[0.3, 0.002], [0.4, 0.03]])
    posterior = Posterior(("reaction_time", "velocity_noise"), draws, {})
    request = Request(DESIGN.study, DESIGN.config, (2,), (0,), 3, DESIGN.seed, 0.05, posterior=posterior)
    found = answer(request, tmp_path / "power", cohort.folder, RUNNER)
    parts = {part["name"]: part for part in found.parts}
    assured = Cohort(tmp_path / "power" / "assurance")
    assert assured.manifest["posterior"] == posterior.sha256
    of_it = answer(replace(request, posterior=None), tmp_path / "of_it", assured.folder, RUNNER)
    alone = {part["name"]: part for part in of_it.parts}
    assert parts["assurance"]["rows"] == alone["power"]["rows"]
    assert parts["assurance"]["rows"] != parts["power"]["rows"]
    assert "assurance" not in alone
    assert any("so that power is assurance" in row[1] for row in alone["about"]["rows"])
    assert dict(parts["about"]["rows"])["assurance"].startswith("power of a cohort with a draw of the posterior")
    assert "assurance" not in dict(alone["about"]["rows"])
    whole = json.loads((tmp_path / "power" / "power.json").read_text(encoding="utf-8"))
    assert len(whole["assurance"]) == len(parts["assurance"]["rows"])
