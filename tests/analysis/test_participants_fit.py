"""The fit of simulated participants: prior, summaries, emulator, sampling, recovery, and the files."""

import json
from collections.abc import Iterator
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from sklearn.linear_model import RidgeCV

pytest.importorskip("emcee", reason="the fit needs the extra fit")

from netboard.analysis.cohort.block import measured, rehearse
from netboard.analysis.cohort.posterior import Posterior, read_posterior
from netboard.analysis.cohort.workers import Runner
from netboard.analysis.inference import fit as fitting
from netboard.analysis.inference.emulator import PENALTIES, Emulator, features, fitted
from netboard.analysis.inference.priors import FARTHEST, NAMES, PRIORS, drawn_scores, participant_at, values_of
from netboard.analysis.inference.sampling import Likelihood, sampled
from netboard.analysis.inference.summaries import SUMMARIES, ends_of, observed, simulated, summarised, tolerance
from netboard.analysis.inference.tables import posterior_of, write
from netboard.base.config import Config, parse
from netboard.base.errors import ConfigError, NetboardError
from netboard.base.tables.simulated import Participant

RUNNER = Runner(lambda what, done, total: None)
COUNT, SIZE = len(NAMES), len(SUMMARIES)


def test_priors_are_those_of_keys_of_participants_and_stay_within_their_limits() -> None:
    assert set(PRIORS) <= {field.name for field in fields(Participant)}
    corners = values_of(FARTHEST * np.array([np.full(COUNT, -1.0), np.full(COUNT, 1.0)]))
    for corner in corners:
        lines = [f"participant.{name}={value!r}" for name, value in zip(NAMES, corner.tolist(), strict=True)]
        person = parse("", "corner", lines).participant
        assert [getattr(person, name) for name in NAMES] == corner.tolist()


@pytest.mark.parametrize("name", NAMES)
def test_score_is_the_inverse_of_value_and_the_default_is_plausible(name: str) -> None:
    prior, scores = PRIORS[name], np.linspace(-2.0, 2.0, 5)
    assert prior.score(prior.value(scores)) == pytest.approx(scores)
    assert prior.value(np.zeros(1)) == pytest.approx(prior.median)
    assert np.abs(prior.score(np.array(getattr(Participant(), name)))) < FARTHEST


def test_participant_has_fitted_parameters_and_is_otherwise_as_usual() -> None:
    usual = Participant(arm_mass=0.7)
    person = participant_at(np.zeros(COUNT), usual)
    assert replace(person, **{name: getattr(usual, name) for name in NAMES}) == usual
    assert [getattr(person, name) for name in NAMES] == pytest.approx([one.median for one in PRIORS.values()])


def test_prior_is_a_standard_normal_distribution_without_its_ends() -> None:
    scores = drawn_scores(np.random.default_rng(1), 4000)
    assert np.abs(scores).max() <= FARTHEST
    assert scores.mean() == pytest.approx(0.0, abs=0.02)
    assert scores.std() == pytest.approx(0.987, abs=0.01)  # of a normal distribution that is cut at 3


def test_summaries_are_the_numbers_of_the_paper() -> None:
    values = {one.name: one.value for one in SUMMARIES}
    assert list(values.values()) == [5.71, 4.48, 3.61, 3.08, 3.92, 2.42, 3.17, 1.85, 0.04]
    assert np.exp(observed()) == pytest.approx(list(values.values()))
    assert np.sqrt(np.diag(tolerance())).tolist() == [0.05] * 8 + [0.1]


def test_only_ends_of_bimanual_blocks_with_haptics_off_are_simulated() -> None:
    found = list(ends_of(Config(), 1, 2))
    assert [end for end, _ in found] == ["first", "last"] * 2
    for place, (_, job) in enumerate(found):
        block = job.config.block
        assert (block.configuration, block.force, block.trials) == ("bimanual", "none", 30)
        assert list(job.people) == [block.performer] == ["AABB"[place]]
    practice = [job.people[job.config.block.performer].practice for _, job in found]
    # Six bimanual blocks and six dyadic ones of 60 trials, half of the last bimanual block being practice, too.
    assert min(practice[::2]) >= 0.0
    assert max(practice[1::2]) >= 600.0 + 30.0


@pytest.mark.slow
def test_summaries_are_computed_from_the_measures_of_an_analysis() -> None:
    blocks, tables = [], []
    for end, job in list(ends_of(Config(), 1, 1))[:2]:
        short = replace(job, config=replace(job.config, block=replace(job.config.block, trials=3)))
        found = rehearse(short)
        blocks.append((end, found.block))
        tables.append(measured(short, 1, found))
    values = dict(zip([one.name for one in SUMMARIES], np.exp(summarised(blocks)), strict=True))
    for end, table in zip(("first", "last"), tables, strict=True):
        trials = pd.DataFrame(table.trials)
        done = trials[trials["outcome"] == "success"]
        for quantity, column in (("completion time", "completion"), ("number of velocity peaks", "peaks")):
            assert values[f"{quantity}, {end} 30"] == pytest.approx(done[column].mean())
            assert values[f"{quantity}, {end} 30, SD"] == pytest.approx(done[column].std())
    moves = pd.concat([pd.DataFrame(table.movements) for table in tables])
    delays = moves[[f"delay_{q}" for q in (10, 20, 30, 40)]].abs()
    assert values["delay between the hands"] == pytest.approx(delays.mean().mean())


@pytest.mark.slow
def test_simulation_depends_on_parameters_and_seed_alone() -> None:
    config = replace(Config(), participant=Participant(velocity_noise=0.002))
    one = simulated(config, 1, 1)
    assert one.tobytes() == simulated(config, 1, 1).tobytes()
    slower = simulated(replace(config, participant=Participant(velocity_noise=0.03)), 1, 1)
    assert slower[0] > one[0]
    assert np.isfinite(one).all()


def quadratic(scores: np.ndarray) -> np.ndarray:
    """Known summaries: each a quadratic function of some scores."""
    rng = np.random.default_rng(5)
    linear, squared = rng.normal(0.0, 0.1, (COUNT, SIZE)), rng.normal(0.0, 0.01, (COUNT * (COUNT + 1) // 2, SIZE))
    terms = features(scores)
    return 1.0 + terms[:, :COUNT] @ linear + terms[:, COUNT:] @ squared


def test_emulator_is_the_ridge_regression_of_scikit_learn() -> None:
    rng = np.random.default_rng(2)
    scores, others = drawn_scores(rng, 300), drawn_scores(rng, 50)
    summaries = quadratic(scores) + rng.normal(0.0, 0.2, (300, SIZE))
    found = fitted(scores, summaries)
    theirs = RidgeCV(alphas=PENALTIES, alpha_per_target=True).fit(features(scores), summaries)
    assert found(others) == pytest.approx(theirs.predict(features(others)), rel=1e-6)
    assert found.explained == pytest.approx(1.0 + theirs.best_score_ / summaries.var(axis=0), rel=1e-6)


def test_posterior_of_a_linear_model_is_the_known_normal_distribution() -> None:
    rng = np.random.default_rng(3)
    effects, noise = rng.normal(0.0, 0.2, (COUNT, SIZE)), 0.2
    terms = COUNT + COUNT * (COUNT + 1) // 2
    slopes = np.concatenate([effects, np.zeros((terms - COUNT, SIZE))])
    emulator = Emulator(np.zeros(terms), slopes, np.zeros(SIZE), np.ones(SIZE))
    summaries = np.full(SIZE, 0.1)
    density = Likelihood(emulator, np.full(SIZE, 0.1), np.eye(SIZE) / noise**2, summaries)
    found = sampled(density, drawn_scores(rng, 64), 1, 4000).scores
    covariance = np.linalg.inv(np.eye(COUNT) + effects @ effects.T / noise**2)
    mean = covariance @ effects @ (summaries - 0.1) / noise**2
    assert found.mean(axis=0) == pytest.approx(mean, abs=0.12)
    assert found.std(axis=0) == pytest.approx(np.sqrt(np.diag(covariance)), abs=0.1)
    again = sampled(density, drawn_scores(np.random.default_rng(3), 64), 1, 50).scores
    assert again.tobytes() == sampled(density, drawn_scores(np.random.default_rng(3), 64), 1, 50).scores.tobytes()


@pytest.fixture(scope="module")
def known() -> Iterator[fitting.Fit]:
    """A fit of known functions of the parameters, to the numbers that one parameter set gives."""
    truth = np.linspace(-1.0, 1.0, COUNT)

    def study(config: Config, seed: int, dyads: int) -> np.ndarray:
        person = config.participant
        scores = np.array([[prior.score(np.array(getattr(person, name))) for name, prior in PRIORS.items()]])
        noise = np.random.default_rng(seed).normal(0.0, 0.1, SIZE)
        return quadratic(scores)[0] + noise

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(fitting, "simulated", study)
        patch.setattr(fitting, "compile_kernels", lambda jobs: None)
        patch.setattr(fitting, "observed", lambda: quadratic(truth[None])[0])
        yield fitting.fit(
            fitting.FitRequest(Config(), 1, designs=300, calibrations=100, truths=6, predictions=20), RUNNER
        )


@pytest.mark.slow
def test_fit_recovers_known_parameters(known: fitting.Fit) -> None:
    assert known.emulator.explained.min() > 0.95  # designs share their random numbers, so nothing but curvature is left
    assert known.offset == pytest.approx(-np.random.default_rng(1_000_000).normal(0.0, 0.1, SIZE), abs=0.05)
    assert np.sqrt(np.diag(known.covariance)) == pytest.approx(np.full(SIZE, 0.1), rel=0.35)
    scores = known.chains.scores
    apart = (scores.mean(axis=0) - np.linspace(-1.0, 1.0, COUNT)) / scores.std(axis=0)
    assert np.abs(apart).max() < 3.0
    contraction = 1.0 - scores.var(axis=0)
    assert 0.2 < contraction.mean() < 0.9
    coverage = known.recovery.covered.mean(axis=(1, 2))
    assert coverage == pytest.approx(fitting.LEVELS, abs=0.15)
    assert (np.diff(coverage) > 0).all()


@pytest.mark.slow
def test_fit_is_written_as_tables_and_as_a_posterior(known: fitting.Fit, tmp_path: Path) -> None:
    folder = tmp_path / "fit"
    parts = {part["name"]: part for part in write(folder, known)}
    assert json.loads((folder / "fit.json").read_text(encoding="utf-8"))["parts"][0]["name"] == "summaries"
    assert [row[0] for row in parts["parameters"]["rows"]] == list(NAMES)
    assert [row[0] for row in parts["recovery"]["rows"]][:-1] == list(NAMES)
    assert len(parts["summaries"]["rows"]) == SIZE
    found = read_posterior(str(folder / "posterior.json"))
    assert found.parameters == NAMES
    assert found.draws == pytest.approx(posterior_of(known).draws, rel=1e-4)
    assert (found.about["condition"], found.about["seed"]) == ("bimanual, haptics off", 1)


def test_fit_whose_participants_cannot_do_the_task_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fitting, "simulated", lambda config, seed, dyads: np.full(SIZE, np.nan))
    monkeypatch.setattr(fitting, "compile_kernels", lambda jobs: None)
    request = fitting.FitRequest(Config(), 1, designs=3, calibrations=2, truths=2, predictions=2)
    with pytest.raises(NetboardError, match="--designs: participants of 3 parameter sets cannot do the task"):
        fitting.fit(request, RUNNER)


def test_drawn_participants_depend_on_the_seed_alone() -> None:
    draws = np.arange(20.0).reshape(10, 2) + 1.0
    posterior = Posterior(("kp", "kd"), draws, {})
    usual = Participant(arm_mass=0.7)
    people = [posterior.participant(usual, seed) for seed in range(60)]
    assert people == [posterior.participant(usual, seed) for seed in range(60)]
    assert {(person.kp, person.kd) for person in people} == {tuple(draw) for draw in draws.tolist()}
    assert {person.arm_mass for person in people} == {0.7}


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("{", "expected a posterior of netboard participants fit"),
        ("[]", "expected a posterior"),
        ('{"parameters": ["kp"]}', "expected a posterior.*draws"),
        (
            '{"parameters": ["kp", "wit"], "draws": [[1, 2]]}',
            r"found the parameters wit, which \[participant\] does not",
        ),
        ('{"parameters": ["kp"], "draws": [[1, 2]]}', r"found the shape \(1, 2\), expected \(n, 1\)"),
        ('{"parameters": ["kp"], "draws": []}', "found the shape"),
        ('{"parameters": ["kp"], "draws": [["x"]]}', "expected a posterior"),
        ('{"parameters": ["kp"], "draws": [[-1.0]]}', "kp"),
    ],
)
def test_file_that_is_no_posterior_is_refused(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "wrong.json"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError, match=words):
        read_posterior(str(path))


def test_missing_file_is_an_error_that_names_the_posterior_of_netboard(tmp_path: Path) -> None:
    with pytest.raises(
        ConfigError, match=r"none.json: no such file; expected the posterior.json of netboard .* or bimanual_off"
    ):
        read_posterior(str(tmp_path / "none.json"))


def test_posterior_of_netboard_is_of_the_fitted_parameters_and_has_the_defaults_within() -> None:
    found = read_posterior()
    assert found.parameters == NAMES
    assert found.about["condition"] == "bimanual, haptics off"
    assert found.about["priors"] == {
        name: {"median": one.median, "log_sd": one.spread, "floor": one.floor} for name, one in PRIORS.items()
    }
    assert [one["value"] for one in found.about["summaries"].values()] == [one.value for one in SUMMARIES]
    low, high = np.percentile(found.draws, (2.5, 97.5), axis=0)
    usual = np.array([getattr(Participant(), name) for name in NAMES])
    assert ((low < usual) & (usual < high)).all()
