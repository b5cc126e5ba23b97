"""The validation of the simulated participants: statistics on synthetic trials, and the quick benchmark."""

import json
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from evidence.participants import speed
from evidence.participants.behaviour import order_part, rest_part
from evidence.participants.bench import VARIANTS, posterior_parts, study
from evidence.participants.paper import EXTRA, STATEMENTS, Sample, Statement
from evidence.participants.predictions import Prediction, differences_part, models_part, studies
from evidence.participants.trials import ATTEMPT, Performance, Population, longest_rest, perform
from netboard.analysis.cohort.block import measured, rehearse
from netboard.base.process.workers import cores
from netboard.benchmarks.harness.running import Options, no_progress, run


def attempts_of_dyad(dyad: int = 1, trials: int = 18) -> np.ndarray:
    """Make attempts of a dyad: each participant alone, then both; first without and then with haptic feedback."""
    parts, rng = [], np.random.default_rng(dyad)
    for performer, level in (("A", 5.0), ("B", 3.0), ("dyad", 3.5)):
        for haptics in (False, True):
            rows = np.zeros(trials, ATTEMPT)
            rows["dyad"], rows["performer"], rows["haptics"], rows["success"] = dyad, performer, haptics, True
            rows["block"] = 1 + haptics if dyad % 2 else 2 - haptics
            # A dyad gains a second by haptic feedback; every performer gets 0.1 s faster with each trial.
            rows["completion"] = level - (performer == "dyad") * haptics + 0.1 * np.arange(trials)[::-1]
            rows["cooperative"] = 0.5 + 0.1 * haptics
            rows["delay"], rows["delays"] = 0.2 * (2 - haptics), 2
            rows["delay_back"], rows["delays_back"] = 0.3, 2
            rows["distance"] = (1 + np.arange(trials)[::-1] // 3) * np.tile([-1.0, 0.0, 1.0], trials // 3)
            rows["velocity"], rows["peaks"] = rng.normal(0.1, 0.02, trials), 3
            parts.append(rows)
    return np.concatenate(parts)


def named(text: str) -> Statement:
    (one,) = (one for one in (*STATEMENTS, *EXTRA) if one.name == text)
    return one


def test_statements_recover_the_effects_of_synthetic_trials() -> None:
    sample = Sample(np.concatenate([attempts_of_dyad(1), attempts_of_dyad(2)]))
    # The first three of eighteen trials have 1.7, 1.6 and 1.5 s more than the last, averaged over A and B.
    assert named("completion time [s], bimanual, first 30").of(sample) == pytest.approx(4.0 + 1.6)
    assert named("completion time [s], bimanual, last 30").of(sample) == pytest.approx(4.0 + 0.1)
    assert named("completion time [s], dyadic, last - first").of(sample) == pytest.approx(-1.5)
    assert named("dyads faster than alone, haptics on").of(sample) == 2
    assert named("dyads faster than alone, haptics off").of(sample) == 2
    assert named("cooperative share, dyadic, haptics on - off").of(sample) == pytest.approx(0.1)
    assert named("delay [ms], dyadic").of(sample) == pytest.approx(150.0)
    assert named("delay [ms], dyadic, searched back").of(sample) == pytest.approx(150.0)
    assert named("delay [ms], dyadic, haptics on - off").of(sample) == pytest.approx(-100.0)
    # Distances of the first group are +-6, those of the last +-1.
    assert named("variance of distance, dyadic, log(last/first)").of(sample) == pytest.approx(-2 * np.log(6))


def test_failed_attempts_are_left_out() -> None:
    rows = attempts_of_dyad()
    rows["success"][::3] = False
    rows["completion"][::3] = 1e6
    sample = Sample(rows)
    assert sample.rows.size == rows.size - 36
    assert named("completion time [s], bimanual, last 30").of(sample) < 10.0


def test_levels_alone_may_be_those_of_the_other_condition() -> None:
    rows = attempts_of_dyad()
    rows["completion"] = np.where(rows["performer"] == "dyad", 4.0, np.where(rows["haptics"], 6.0, 3.0))
    sample = Sample(rows)
    assert named("completion time, log(dyad/alone), haptics on").of(sample) == pytest.approx(np.log(4.0 / 6.0))
    other = named("completion time, log(dyad/alone with haptics off), haptics on")
    assert other.of(sample) == pytest.approx(np.log(4.0 / 3.0))
    assert named("dyads faster than alone, haptics on").of(sample) == 1
    assert named("dyads faster than alone with haptics off, haptics on").of(sample) == 0


def test_each_dyad_is_in_one_virtual_study() -> None:
    pool = [Performance(attempts_of_dyad(dyad), 0) for dyad in range(1, 13)]
    assert [one.dyads.tolist() for one in studies(pool)] == [[1, 2, 3, 4], [5, 6, 7, 8], [9, 10, 11, 12]]
    with pytest.raises(ValueError, match="found 6 dyads, expected a multiple of 4"):
        studies(pool[:6])


def compared(shift: float) -> list[Prediction]:
    """Return a value, a count of dyads and a direction, in three virtual studies."""
    value, count = Statement("value", lambda _: 0.0, 2.0), Statement("count", lambda _: 0.0, 1.0, largest=4.0)
    direction = Statement("completion time [s], dyadic, first 30", lambda _: 0.0, sense=-1)
    values = ([2.0 + shift, 3.0 + shift, 2.5 + shift], [3.0, 3.0, 1.0], [-1.0, -1.0, shift - 0.5])
    statements = (value, count, direction)
    return [Prediction(one, np.array(numbers)) for one, numbers in zip(statements, values, strict=True)]


def test_models_are_compared_by_study() -> None:
    found = {"full model": compared(0.0), "other": compared(1.0)}
    full, other = models_part(found, "adjusted").rows
    # Errors of the values: (0, 0.5, 0.25), and (0.5, 1, 0.75); of the counts: (0.5, 0.5, 0), in both.
    assert full[3] == pytest.approx(100.0 * (0.25 + 1.0 / 3.0) / 2.0)
    assert (full[4], other[4]) == (0.0, pytest.approx(25.0))
    assert (full[7], other[7]) == (pytest.approx(100.0), pytest.approx(100.0 * 2.0 / 3.0))
    half_width = 4.302652729911275 * np.std([0.0, 0.0, -100.0], ddof=1) / np.sqrt(3)
    assert other[8:] == pytest.approx((-100.0 / 3.0, -100.0 / 3.0 - half_width, -100.0 / 3.0 + half_width))
    (row,) = differences_part(found).rows
    assert row == ("completion time [s], dyadic, first 30", "0.333 (-1.1 to 1.77)")


def test_prediction_reports_whether_the_result_is_reproduced() -> None:
    values = np.linspace(0.0, 100.0, 1001)
    low, high = (
        Prediction(Statement("", lambda _: 0.0, 2.4), values),
        Prediction(Statement("", lambda _: 0.0, 97.4), values),
    )
    assert low.interval == pytest.approx((50.0, 2.5, 97.5))
    assert (low.inside, high.inside) == (False, True)
    assert (low.reproduced, high.reproduced) == ("NO", "yes")
    for shift, word in ((-10.0, "yes"), (-40.0, "unclear"), (-60.0, "NO")):
        above = Prediction(Statement("", lambda _: 0.0, sense=1), values + shift)
        assert above.reproduced == word


def test_each_variant_differs_in_its_own_part() -> None:
    usual = VARIANTS["full model"]
    for name, person in VARIANTS.items():
        changed = {key for key in person.__slots__ if getattr(person, key) != getattr(usual, key)}
        assert (
            changed == {"stranger", "reading"} if name == "no acquaintance" else len(changed) == (name != "full model")
        )


def test_share_of_studies_has_the_interval_of_wilson() -> None:
    one = Prediction(Statement("", lambda _: 0.0, sense=1), np.where(np.arange(20) < 17, 1.0, -1.0))
    assert one.probability == 0.85
    assert one.probability_limits == pytest.approx((0.6396, 0.9476), abs=1e-4)


def test_haptic_effect_is_known_by_the_condition_that_a_performer_began_with() -> None:
    rows = np.concatenate([attempts_of_dyad(dyad) for dyad in range(1, 5)])
    rows["completion"] = np.where(rows["haptics"], 6.0, 4.0)
    rows["block"] = np.where(rows["haptics"] == (rows["dyad"] % 2 == 0), 1, 2)  # even dyads begin with haptics on
    rows["completion"][(rows["dyad"] % 2 == 0) & rows["haptics"]] = 2.0
    began_on, effects = Sample(rows).haptic_effects("dyadic")
    assert began_on.tolist() == [False, True, False, True]
    assert effects == pytest.approx(np.log([1.5, 0.5, 1.5, 0.5]))
    rng = np.random.default_rng(1)
    rows["completion"] *= rng.uniform(0.9, 1.1, len(rows))
    bimanual, dyadic = (
        dict(zip(order_part(Sample(rows)).columns, row, strict=True)) for row in order_part(Sample(rows)).rows
    )
    assert (bimanual["participants or dyads"], dyadic["participants or dyads"]) == (8, 4)
    for row in (bimanual, dyadic):
        assert row["begins on: on/off - 1 [%]"] == pytest.approx(-50.0, abs=3.0)
        assert row["begins off: on/off - 1 [%]"] == pytest.approx(50.0, abs=6.0)
        assert row["95 % CI low"] < row["ratio of both on/off - 1 [%]"] < row["95 % CI high"] < 0.0


def test_longest_rest_is_that_between_two_changes_or_an_end() -> None:
    assert longest_rest(np.array([1.0, 1.0, 2.0, 2.0, 2.0, 2.0, 3.0])) == pytest.approx(0.004)
    assert longest_rest(np.array([1.0, 2.0, 3.0, 3.0, 3.0])) == pytest.approx(0.003)
    assert longest_rest(np.full(10, 1.0)) == pytest.approx(0.010)


def test_share_of_attempts_with_a_hand_at_rest() -> None:
    rows = np.concatenate([attempts_of_dyad(1), attempts_of_dyad(2)])
    rows["rest"][(rows["performer"] == "dyad") & rows["haptics"]] = np.tile([1.9, 2.0, 5.0], 12)
    shares = {row[:2]: row[2:] for row in rest_part(rows).rows}
    assert shares["dyadic", "on"] == (36, pytest.approx(200.0 / 3.0), 5.0)
    assert shares["dyadic", "off"] == (36, 0.0, 0.0)
    assert shares["bimanual", "on"][0] == 72


@pytest.mark.slow
def test_simulated_dyad_is_reproducible() -> None:
    jobs = Population(trials=1).jobs(1)[8:9]
    one, again = perform(jobs, 1), perform(jobs, 1)
    assert one.attempts.tobytes() == again.attempts.tobytes()
    assert one.given_up == 0
    done = one.attempts[one.attempts["success"]]
    assert done.size == 1
    shares = [float(done[name][0]) for name in ("cooperative", "competitive", "single", "still")]
    assert sum(shares) == pytest.approx(1.0)


@pytest.mark.slow
def test_measures_are_those_of_an_analysis() -> None:
    (job,) = Population(trials=4).jobs(1)[8:9]
    rows, found = perform([job], 1).attempts, rehearse(job)
    expected = pd.DataFrame(measured(job, 1, found).trials)
    assert len(rows) == len(expected) >= 4
    for name, column in {"completion": "completion", "peaks": "peaks", "distance": "braking_distance"}.items():
        np.testing.assert_array_equal(rows[name], expected[column])


def performed(asked: list[tuple[str, int]]) -> Any:
    """Return a stand-in for simulated performances, which notes the participants and numbers of the dyads."""

    def perform_all(tasks: Any, _: int) -> Iterator[Performance]:
        for jobs, dyad in tasks:
            asked.append((repr(jobs[0].config.participant), dyad))
            rows = attempts_of_dyad(dyad)
            rows["completion"][rows["haptics"]] *= 1.0 + 0.01 * (dyad % 5)  # real effects differ between dyads
            yield Performance(rows, given_up=0)

    return perform_all


@pytest.mark.slow
def test_study_writes_all_tables(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for module in ("bench", "slowing"):
        monkeypatch.setattr(f"evidence.participants.{module}.perform_all", performed([]))
    run("participants", partial(study, 3, 1), Options(tmp_path / "found", tmp_path / "found.json", quick=True))
    parts = {part["name"]: part for part in json.loads((tmp_path / "found.json").read_text())["parts"]}
    of_posterior = {"posterior", "posterior-models", "posterior-differences"}
    of_models = {"models", "ablations", "differences"}
    assert set(parts) == {"predictions", "order", "others", "rest", "slowing", *of_models, *of_posterior}
    assert len(parts["predictions"]["rows"]) == len(parts["ablations"]["rows"]) > len(STATEMENTS)
    assert [row[0] for row in parts["posterior"]["rows"]] == [row[0] for row in parts["predictions"]["rows"]]
    assert (tmp_path / "found" / "participants.png").stat().st_size > 10_000


@pytest.mark.slow
def test_posterior_gives_each_virtual_study_another_draw(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[tuple[str, int]] = []
    monkeypatch.setattr("evidence.participants.bench.perform_all", performed(asked))
    predicted, models, _ = posterior_parts(3, 1, 1, lambda *_: None)
    assert len(asked) == 24  # with both models of the partner
    people, dyads = [person for person, _ in asked], [dyad for _, dyad in asked]
    assert [len(set(people[first : first + 4])) for first in range(0, 24, 4)] == [1] * 6
    assert len(set(people)) == 6
    assert dyads == 2 * list(range(1, 13))
    assert "3 virtual studies of 4 dyads" in predicted.title
    assert [row[0] for row in models.rows] == ["position", "mechanics"]


@pytest.mark.slow
def test_speed_is_measured_beside_the_stage_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(speed, "QUICK_TRIALS", 1)
    run("rehearsals", speed.study, Options(tmp_path / "found", tmp_path / "found.json", quick=True))
    part, _ = json.loads((tmp_path / "found.json").read_text())["parts"]
    alone, uninformed, one, batch = (dict(zip(part["columns"], row, strict=True)) for row in part["rows"])
    assert alone["/ stage alone"] == 1.0
    assert alone["ticks"] < min(uninformed["ticks"], one["ticks"]) <= one["ticks"] < batch["ticks"]


@pytest.mark.slow
def test_steps_of_a_virtual_study_are_timed_beside_the_stage_alone() -> None:
    part = speed.cohort_part(1, 1, no_progress)
    alone, simulation, *steps, whole, measuring, tables = part.rows
    assert alone[4] == 1.0
    ticks = sum(rehearse(job).ticks for job in Population(trials=1).jobs(1))
    assert {row[1] for row in part.rows[1:]} == {ticks}
    per_hour = ticks * speed.DYADS * speed.STUDIES / (3600.0 * cores())
    assert all(row[5] == pytest.approx(1e-9 * row[2] * per_hour) for row in part.rows)
    assert simulation[5] + measuring[5] + tables[5] == pytest.approx(whole[5])
    assert len(steps) == 2
