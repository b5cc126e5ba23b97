"""Invariances of the measures: time, left and right, units, constants, sampling rate and order; and sums."""

from dataclasses import astuple, replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from two_hands import ARM, TwoHands, minimum_jerk_rate, rolled, two_hands

from netboard.analysis.measures.braking import first_braking
from netboard.analysis.measures.cooperation import contributions
from netboard.analysis.measures.ellipses import convergence, groups_of
from netboard.analysis.measures.information import Past, chance_level, granger
from netboard.analysis.measures.interaction import effort, exchanged, point_velocities, supports, work
from netboard.analysis.measures.lags import lag_of, leadership, windowed_lags
from netboard.analysis.measures.motion import Trial, ball_speed, find_completion, motion, placements
from netboard.analysis.measures.movements import classify, mean_shares, shares
from netboard.analysis.measures.passive import PassiveHand, driven
from netboard.analysis.measures.peaks import velocity_peaks
from netboard.analysis.measures.performance import (
    RelativePerformance,
    better_dyads,
    learning_curve,
    level,
    running_number,
    summarise,
    trial_times,
)
from netboard.analysis.measures.segments import board_segments
from netboard.analysis.measures.signals import LowPass, bridge, by_number, derivative, evenly, resample, runs
from netboard.analysis.measures.smoothness import dimensionless_jerk
from netboard.analysis.measures.task import fall_time, falls, overshoots, reaction, time_in_target
from netboard.analysis.statistics.effect_sizes import hedges_g
from netboard.analysis.statistics.estimates import bootstrap, cluster_mean, ratio_of_sums, t_interval
from netboard.analysis.statistics.exact_tests import permutation_test, permutation_test_between, sign_test

RATE = 1000.0
ONE = Past(step=1, own=1, other=1, delay=1)

units = st.floats(1e-3, 1e3)
offsets = st.floats(-5, 5)
signals = arrays(np.float64, st.integers(3, 60), elements=st.floats(-1, 1, width=16))
forces = arrays(np.float64, 30, elements=st.floats(-4, 4, width=16))
few = arrays(np.float64, st.integers(2, 8), elements=st.integers(-20, 20))
times_of = arrays(np.float64, st.integers(1, 40), elements=st.floats(0.5, 30) | st.just(np.nan))
balls = arrays(
    np.float64, st.integers(1, 40), elements=st.sampled_from([-0.4, -0.3, -0.15, 0.0, 0.12, 0.15, 0.19, 0.4])
)
moves = st.lists(st.tuples(st.floats(0.1, 2), st.floats(0.2, 0.8), st.floats(-0.02, 0.02)), min_size=1, max_size=4)


def assert_close(found: object, expected: object, within: float = 1e-9) -> None:
    """Check that two results are close and are NaN in the same places."""
    np.testing.assert_allclose(np.asarray(found, float), np.asarray(expected, float), rtol=1e-6, atol=within)


def shuffled(seed: int, count: int) -> np.ndarray:
    return np.random.default_rng(seed).permutation(count)


# --- signals -----------------------------------------------------------------------------------------------------


@pytest.mark.evidence("properties", runs, of=("time", "balance"))
@given(arrays(bool, st.integers(0, 60)), st.integers(0, 9))
def test_runs_are_invariant_to_shift_reversal_and_negation(mask: np.ndarray, shift: int) -> None:
    found = runs(mask)
    assert_close(runs(np.concatenate([np.zeros(shift, bool), mask])), found + shift)
    assert_close(runs(mask[::-1]), mask.size - found[::-1, ::-1])
    lengths = [np.diff(one).sum() for one in (found, runs(~mask))]
    assert sum(lengths) == mask.size


@pytest.mark.evidence("properties", derivative, of=("unit", "constant", "time", "mirror"))
@given(signals, units, offsets)
def test_derivative_follows_scale_and_reversal_and_ignores_offset(x: np.ndarray, unit: float, offset: float) -> None:
    found = derivative(x, RATE)
    assert_close(derivative(unit * x + offset, RATE), unit * found, within=1e-6 * (1 + unit))
    assert_close(derivative(-x[::-1], RATE), found[::-1])
    assert_close(derivative(-x, RATE), -found)


@pytest.mark.slow
@pytest.mark.evidence("properties", derivative, LowPass, of="rate")
@given(st.floats(0.2, 2), st.floats(0, 6), st.sampled_from([2, 4]))
def test_filter_and_derivative_hardly_depend_on_the_sampling_rate(frequency: float, phase: float, finer: int) -> None:
    def wave(rate: float) -> np.ndarray:
        return np.sin(2 * np.pi * frequency * np.arange(round(4 * rate)) / rate + phase)

    for change in (derivative, LowPass(20.0)):
        coarse, fine = change(wave(500.0), 500.0), change(wave(500.0 * finer), 500.0 * finer)[::finer]
        assert_close(fine[500:1500], coarse[500:1500], within=3e-3)


@pytest.mark.evidence("properties", by_number, of=("time", "unit"))
@given(st.lists(st.integers(0, 40), min_size=1, max_size=20, unique=True).map(sorted), st.integers(-50, 50), units)
def test_by_number_is_invariant_to_shifted_numbers(numbers: list[int], shift: int, unit: float) -> None:
    values = np.cos(np.arange(len(numbers)))
    found = by_number(np.array(numbers), values)
    assert_close(by_number(np.array(numbers) + shift, unit * values), unit * found)
    assert np.isfinite(found).sum() == len(numbers)


@pytest.mark.evidence("properties", bridge, of=("time", "unit", "constant", "mirror"))
@given(signals, units, offsets, st.data())
def test_bridge_follows_scale_offset_and_reversal(
    x: np.ndarray, unit: float, offset: float, data: st.DataObject
) -> None:
    x[data.draw(st.lists(st.integers(0, x.size - 1)))] = np.nan
    found = bridge(x, RATE, 0.003)
    assert_close(bridge(-unit * x + offset, RATE, 0.003), -unit * found + offset)
    assert_close(bridge(x[::-1], RATE, 0.003), found[::-1])
    known = np.isfinite(x)
    np.testing.assert_array_equal(found[known], x[known])


@pytest.mark.evidence("properties", resample, of=("unit", "constant", "mirror", "rate"))
@given(st.floats(0.2, 2), st.floats(0, 6), units, offsets)
def test_resampling_to_another_rate_and_back_restores_the_signal(
    frequency: float, phase: float, unit: float, offset: float
) -> None:
    x = np.sin(2 * np.pi * frequency * np.arange(2000) / RATE + phase)
    there = resample(x, RATE, 400.0)
    assert_close(resample(-unit * x + offset, RATE, 400.0), -unit * there + offset, within=1e-9 * (1 + unit))
    assert_close(resample(there, 400.0, RATE)[300:1700], x[300:1700], within=5e-3)


@pytest.mark.evidence("properties", evenly, of=("time", "unit", "constant", "rate"))
@given(arrays(np.float64, st.integers(3, 40), elements=st.floats(0.001, 0.05)), units, offsets)
def test_evenly_follows_scale_offset_and_time_shift(steps: np.ndarray, unit: float, offset: float) -> None:
    times = np.cumsum(steps)
    values = np.sin(9 * times)
    for kind in ("linear", "monotone"):
        found = evenly(times, values, 250.0, kind)
        assert_close(
            evenly(times, unit * values + offset, 250.0, kind), unit * found + offset, within=1e-9 * (1 + unit)
        )
        fine = evenly(times, values, 1000.0, kind)[::4]
        assert_close(fine[: found.size], found)
        later = evenly(times + 8, values, 250.0, kind)
        assert_close(later[: found.size - 1], found[: later.size][: found.size - 1], within=1e-7)
        assert found.min() >= values.min() - 1e-9, "interpolation overshoots"


# --- motion, trials ----------------------------------------------------------------------------------------------


@pytest.mark.evidence("properties", placements, of=("time", "mirror", "unit", "constant", "rate"))
@given(st.lists(st.floats(-0.3, 0.3), min_size=1, max_size=5), st.integers(1, 50), units, offsets)
def test_placements_are_invariant_to_shift_mirror_scale_and_rate(
    spots: list[float], shift: int, unit: float, at: float
) -> None:
    p = np.repeat(spots, 200)
    assume(
        (np.abs(np.abs(np.diff(spots)) - 0.002) > 1e-6).all() and (np.abs(np.abs(np.diff(spots)) - 0.004) > 1e-6).all()
    )
    found = placements(p, RATE)
    assert_close(placements(np.concatenate([np.full(shift, p[0]), p]), RATE), found + shift)
    assert_close(placements(-p + at, RATE), found)
    assert_close(placements(unit * p, RATE, fastest=2.0 * unit * (1 + 1e-9)), found)
    assert_close(placements(p[::2], RATE / 2, fastest=1.0), found / 2)


@pytest.mark.evidence("properties", ball_speed, of=("mirror", "unit", "time", "rate"))
@given(st.floats(0.3, 1.5), st.floats(0, 3), units, st.sampled_from(["absolute_first", "filter_first"]))
def test_ball_speed_is_invariant_to_mirror_and_time_reversal(
    frequency: float, phase: float, unit: float, order: str
) -> None:
    vp = 0.2 * np.sin(2 * np.pi * frequency * np.arange(4000) / RATE + phase)
    found = ball_speed(vp, RATE, order=order)
    assert_close(ball_speed(-unit * vp, RATE, order=order), unit * found, within=1e-9 * (1 + unit))
    assert_close(ball_speed(vp[::-1], RATE, order=order)[::-1][1000:3000], found[1000:3000], within=1e-4)
    assert_close(ball_speed(vp[::2], RATE / 2, order=order)[500:1500], found[::2][500:1500], within=5e-4)


@pytest.mark.slow
@pytest.mark.evidence("properties", motion, of=("time", "mirror", "unit", "constant"))
@given(moves, moves, st.floats(0.1, 10), st.floats(-0.05, 0.05))
def test_motion_follows_mirror_scale_and_height(left: list, right: list, unit: float, height: float) -> None:
    hands = two_hands(left, right)
    p, _ = rolled(hands.theta, RATE, -0.15)
    found = motion(RATE, hands.left_z, hands.right_z, hands.theta, p)
    mirrored = motion(RATE, hands.right_z, hands.left_z, -hands.theta, -p)
    for one, other, sign in (
        *(("left_z", "right_z", 1), ("left_vz", "right_vz", 1), ("theta", "theta", -1)),
        *(("omega", "omega", -1), ("p", "p", -1), ("vp", "vp", -1), ("speed", "speed", 1)),
    ):
        assert_close(getattr(mirrored, other), sign * getattr(found, one))
    moved = motion(RATE, unit * hands.left_z + height, unit * hands.right_z + height, unit * hands.theta, unit * p)
    for name in ("left_vz", "right_vz", "omega", "vp", "speed"):
        assert_close(getattr(moved, name), unit * getattr(found, name), within=1e-6)
    late = slice(250, None)
    cut = motion(RATE, hands.left_z[late], hands.right_z[late], hands.theta[late], p[late])
    assert_close(cut.omega[1500:2000], found.omega[1750:2250], within=2e-3)


@pytest.mark.evidence("properties", find_completion, of="unit")
@given(balls, units)
def test_completion_is_independent_of_the_unit_of_length(p: np.ndarray, unit: float) -> None:
    one, other = (
        find_completion(scale * p, 10.0, scale * 0.15, half_width=scale * 0.0351, hold=0.3) for scale in (1.0, unit)
    )
    assert astuple(one) == pytest.approx(astuple(other), nan_ok=True) if one.sample else one.entries == other.entries


@pytest.mark.evidence("properties", classify, of="time")
@given(*[arrays(np.float64, 20, elements=st.floats(-0.02, 0.02))] * 2, st.integers(0, 20))
def test_class_depends_only_on_its_own_sample(left: np.ndarray, right: np.ndarray, at: int) -> None:
    parts = [classify(left[part], right[part]) for part in (slice(at), slice(at, None))]
    np.testing.assert_array_equal(np.concatenate(parts), classify(left, right))


seconds_of = arrays(np.float64, st.tuples(st.integers(1, 20), st.just(4)), elements=st.integers(0, 9))


@pytest.mark.evidence("properties", shares, mean_shares, of=("unit", "order", "balance"))
@given(seconds_of, units, st.integers(0, 99), st.sampled_from(["trials", "time"]))
def test_shares_are_independent_of_unit_and_order(seconds: np.ndarray, unit: float, seed: int, of: str) -> None:
    people = np.arange(len(seconds)) % 3
    assert_close(shares(unit * seconds), shares(seconds))
    found, order = mean_shares(seconds, people, of=of), shuffled(seed, len(seconds))
    assert_close(mean_shares(unit * seconds[order], people[order], of=of), found)
    assert_close(mean_shares(seconds[:, ::-1], people, of=of), found[::-1])
    assert np.isnan(found).all() or found.sum() == pytest.approx(1)


@pytest.mark.evidence("properties", contributions, of=("mirror", "unit"))
@given(moves, moves, st.sampled_from(["net", "majority"]), st.sampled_from(["net", "path"]))
def test_contributions_follow_swapped_sides_and_unit(left: list, right: list, opposite: str, amount: str) -> None:
    hands = two_hands(left, right, rate=250.0)
    segments = board_segments(hands.omega, hands.theta, hands.rate)
    found = contributions(segments, hands.left_z, hands.right_z, opposite=opposite, amount=amount)
    swapped = contributions(segments, 1024 * hands.right_z, 1024 * hands.left_z, opposite=opposite, amount=amount)
    assert_close(swapped.left, 1024 * found.right)
    assert_close(swapped.right, 1024 * found.left)
    np.testing.assert_array_equal(swapped.cooperative, found.cooperative)


def brakes(hands: TwoHands, p: np.ndarray, vp: np.ndarray, unit: float = 1.0, late: int = 0) -> tuple[float, ...]:
    segments = board_segments(hands.omega, hands.theta, hands.rate)
    trial = Trial(late, p.size, 0.15 * unit)
    return astuple(first_braking(segments, hands.theta, unit * p, unit * vp, hands.rate, trial))


@pytest.mark.evidence("properties", first_braking, of=("time", "unit", "rate"))
@given(st.floats(-8, -2), st.floats(0.3, 0.9), st.floats(2, 12), st.integers(1, 300), units)
def test_braking_is_invariant_to_shift_unit_and_rate(
    tilt: float, pause: float, back: float, late: int, unit: float
) -> None:
    def board(rate: float, after: float = 0.0) -> TwoHands:
        tilts = [
            (0.3 + after, 0.3, ARM * np.radians(tilt)),
            (0.6 + pause + after, 0.4, ARM * np.radians(back - tilt)),
        ]
        return two_hands([(start, duration, -z) for start, duration, z in tilts], tilts, rate=rate)

    hands = board(RATE)
    p, vp = rolled(hands.theta, RATE, -0.15)
    distance, velocity, *rest = brakes(hands, p, vp)
    assert np.isfinite(distance)
    assert_close(brakes(hands, p, vp, unit), [unit * distance, unit * velocity, *rest])
    after = board(RATE, late / RATE)
    ball = rolled(after.theta, RATE, -0.15, late)
    assert_close(brakes(after, *ball, late=late), [distance, velocity, *rest], within=5e-3)
    coarse = board(RATE / 2)
    assert_close(brakes(coarse, *rolled(coarse.theta, RATE / 2, -0.15)), [distance, velocity, *rest], within=5e-3)


@pytest.mark.evidence("properties", velocity_peaks, of=("constant", "time"))
@given(arrays(np.float64, st.integers(0, 40), elements=st.floats(0, 1, width=16)), st.sampled_from([0.5, 4.0]))
def test_peak_count_is_invariant_to_reversal_and_offset(speed: np.ndarray, constant: float) -> None:
    found = velocity_peaks(speed, plateau="midpoint")
    assert velocity_peaks(speed + constant, plateau="midpoint").count == found.count
    assert velocity_peaks(speed[::-1], plateau="midpoint").count == found.count


# --- many trials -------------------------------------------------------------------------------------------------


@pytest.mark.evidence("properties", groups_of, of="time")
@given(arrays(np.int64, st.integers(1, 30), elements=st.integers(1, 400)), st.integers(1, 50))
def test_trials_one_group_size_later_are_in_the_next_group(order: np.ndarray, size: int) -> None:
    assert_close(groups_of(order + size, size), groups_of(order, size) + 1)


@pytest.mark.evidence("properties", convergence, of=("order", "unit", "constant"))
@given(st.integers(0, 99), st.floats(0.01, 100), offsets)
def test_convergence_is_invariant_to_order_and_offset(seed: int, unit: float, offset: float) -> None:
    points = np.random.default_rng(seed).normal(size=(60, 2)) * [0.06, 0.02]
    groups, order = np.arange(60) // 20, shuffled(seed, 60)
    found, other = convergence(points, groups), convergence((unit * points + offset)[order], groups[order])
    assert_close(other.variance, unit**2 * found.variance)
    assert_close(other.generalised, unit**4 * found.generalised)
    assert_close(other.areas, unit**2 * found.areas)


@pytest.mark.evidence("properties", summarise, learning_curve, of=("unit", "constant", "order"))
@pytest.mark.evidence("properties", level, of=("unit", "constant"))
@given(times_of, st.floats(0.01, 100), offsets, st.integers(0, 99))
def test_means_over_trials_follow_unit_and_offset_in_any_order(
    values: np.ndarray, unit: float, offset: float, seed: int
) -> None:
    places, order = 1 + np.arange(values.size) % 7, shuffled(seed, values.size)
    found, other = summarise(values, places), summarise((unit * values + offset)[order], places[order])
    assert_close([other.mean, other.deviation], [unit * found.mean + offset, unit * found.deviation], within=1e-6)
    curve, moved = learning_curve(values, places), learning_curve((unit * values + offset)[order], places[order])
    assert_close(moved.mean, unit * curve.mean + offset, within=1e-6)
    assert_close(moved.deviation, unit * curve.deviation, within=1e-6)
    for of in ("mean", "median", "last"):
        assert_close(level(unit * values + offset, of=of), unit * level(values, of=of) + offset, within=1e-6)


@pytest.mark.evidence("properties", running_number, of=("time", "unit"))
@given(arrays(np.int64, st.integers(1, 40), elements=st.integers(0, 4)))
def test_running_number_ignores_names_and_later_trials(labels: np.ndarray) -> None:
    found = running_number(labels)
    np.testing.assert_array_equal(running_number(np.array(list("QXAZM"))[labels]), found)
    np.testing.assert_array_equal(running_number(labels[:-1]), found[:-1])


@pytest.mark.evidence("properties", trial_times, of=("unit", "order"))
@given(times_of, st.floats(0.01, 100), st.sampled_from(["successful_attempt", "all_attempts"]))
def test_trial_times_follow_their_unit(completions: np.ndarray, unit: float, of: str) -> None:
    trials, durations = np.arange(completions.size) // 3, np.nan_to_num(completions, nan=4.0) + 1.5
    found = trial_times(trials, durations, completions, of=of)[1]
    assert_close(trial_times(trials, unit * durations, unit * completions, of=of)[1], unit * found)
    # Trials may come in any order, attempts of one may not.
    order = np.argsort(-trials, kind="stable")
    assert_close(trial_times(trials[order], durations[order], completions[order], of=of)[1], found)


@pytest.mark.evidence("properties", better_dyads, of=("mirror", "unit", "order"))
@given(st.lists(st.tuples(st.integers(-5, 5), st.integers(-5, 5)), max_size=9))
def test_better_dyads_are_the_same_from_both_partners(points: list[tuple[int, int]]) -> None:
    pairs = [RelativePerformance(x, y) for x, y in points]
    partners = [RelativePerformance(-x, y - 2 * x) for x, y in points]
    assert better_dyads(pairs) == better_dyads(partners[::-1])
    assert better_dyads([RelativePerformance(0.25 * x, 0.25 * y) for x, y in points]) == better_dyads(pairs)


# --- two sides ---------------------------------------------------------------------------------------------------


@pytest.mark.evidence("properties", lag_of, of=("unit", "time"))
@pytest.mark.evidence("properties", windowed_lags, of=("unit", "constant", "mirror", "time"))
@given(st.integers(0, 99), units, offsets, st.floats(-0.05, 0.05))
def test_lags_follow_swapped_sides_and_ignore_scale_and_offset(
    seed: int, unit: float, offset: float, lag: float
) -> None:
    source = np.random.default_rng(seed)
    frequency, phase = source.uniform(1, 5, 9), source.uniform(0, 6, 9)
    times = np.arange(1500)[:, None] / RATE
    left, right = (np.sin(2 * np.pi * frequency * (times - late) + phase).sum(axis=1) for late in (lag, 0.0))
    centres, found = windowed_lags(left, -right, RATE, step=0.25, longest=0.1)
    delays = np.array([one.delay for one in found])
    _, swapped = windowed_lags(-unit * right + offset, unit * left - offset, RATE, step=0.25, longest=0.1)
    assert_close([one.delay for one in swapped], -delays, within=1e-6)
    later_centres, later = windowed_lags(left[250:], -right[250:], RATE, step=0.25, longest=0.1)
    assert_close([one.delay for one in later], delays[1:])
    assert_close(later_centres, centres[:-1])
    whole, scaled = lag_of(left, -right, RATE), lag_of(unit * left, -3.0 * unit * right, RATE)
    assert_close([scaled.delay, scaled.coefficient], [whole.delay, whole.coefficient], within=1e-6)
    padded = lag_of(np.pad(left, (400, 0)), np.pad(-right, (400, 0)), RATE)
    assert padded.delay == pytest.approx(whole.delay, abs=0.005), "rest before a movement changes its delay"


@pytest.mark.evidence("properties", leadership, of=("mirror", "unit", "order"))
@given(st.lists(st.sampled_from([-0.05, -0.01, 0.0, 0.004, 0.03, np.nan]), max_size=20), st.integers(0, 99))
def test_leadership_follows_swapped_sides_and_unit(delays: list[float], seed: int) -> None:
    x = np.array(delays)
    found = leadership(x, tolerance=0.005)
    other = leadership(-1024 * x[shuffled(seed, x.size)], tolerance=5.12)
    assert (other.left_first, other.right_first, other.together) == (
        found.right_first,
        found.left_first,
        found.together,
    )
    assert_close([other.index, other.mean, other.deviation], [-found.index, -1024 * found.mean, 1024 * found.deviation])
    assert found.left_first + found.right_first + found.together == found.n


@pytest.mark.evidence("properties", supports, of=("mirror", "unit", "balance"))
@given(arrays(np.float64, 9, elements=st.floats(-0.35, 0.35)), st.floats(0.01, 1), st.floats(0, 1), st.floats(0.1, 1))
def test_supports_balance_weight_and_moment(p: np.ndarray, board: float, ball: float, arm: float) -> None:
    left, right = supports(p, board_mass=board, ball_mass=ball, arm=arm)
    assert_close(left + right, np.full(9, (board + ball) * 9.81))
    assert_close(arm * (right - left), ball * 9.81 * p)
    assert_close(supports(-p, board_mass=board, ball_mass=ball, arm=arm), (right, left))
    assert_close(supports(2 * p, board_mass=8 * board, ball_mass=8 * ball, arm=2 * arm), (8 * left, 8 * right))


@pytest.mark.evidence("properties", point_velocities, of=("mirror", "unit", "balance"))
@given(*[arrays(np.float64, 9, elements=st.floats(-1, 1, width=32))] * 3, units)
def test_point_velocities_follow_mirror_and_unit(
    vz: np.ndarray, theta: np.ndarray, omega: np.ndarray, unit: float
) -> None:
    left, right = point_velocities(vz, theta, omega, arm=ARM)
    assert_close(left + right, 2 * vz)
    assert_close(point_velocities(vz, -theta, -omega, arm=ARM), (right, left))
    assert_close(point_velocities(unit * vz, theta, omega, arm=unit * ARM), (unit * left, unit * right))


@pytest.mark.evidence("properties", work, exchanged, of=("time", "mirror", "unit", "balance"))
@pytest.mark.evidence("properties", effort, of=("time", "mirror", "unit"))
@given(forces, forces, st.floats(0.01, 100), st.integers(1, 20))
def test_work_and_effort_follow_mirror_scale_and_shift_and_balance(
    a: np.ndarray, b: np.ndarray, unit: float, wait: int
) -> None:
    a[[0, -1]] = b[[0, -1]] = 0.0
    found = work(a, b, RATE)
    assert found.net == pytest.approx(found.given - found.received, abs=1e-12)
    assert_close(astuple(work(-unit * a, -b, RATE)), unit * np.array(astuple(found)))
    given_back = work(-a, b, RATE)
    assert_close([given_back.given, given_back.received], [found.received, found.given])
    to_right, to_left = exchanged(a, b, RATE)
    assert_close(exchanged(unit * b, unit * a, RATE), [unit * to_left, unit * to_right])
    assert 0 <= to_right <= work(a, np.ones_like(a), RATE).given + 1e-12
    for kind, power in (("squared", 2), ("absolute", 1)):
        assert_close(effort(-unit * a, RATE, kind=kind), unit**power * effort(a, RATE, kind=kind))
    assert_close(effort(unit * a, RATE, kind="rms"), unit * effort(a, RATE, kind="rms"))
    late, other = (np.pad(x, (wait, 0)) for x in (a, b))
    assert_close([work(late, other, RATE).net, *exchanged(late, other, RATE)], [found.net, to_right, to_left])
    assert_close(effort(late, RATE), effort(a, RATE))


@pytest.mark.evidence("properties", work, exchanged, effort, of="rate")
@given(st.floats(0.3, 2), st.floats(0, 3))
def test_work_and_effort_hardly_depend_on_the_sampling_rate(frequency: float, phase: float) -> None:
    def measured(rate: float) -> list[float]:
        t = np.arange(round(2 * rate) + 1) / rate
        a, b = np.sin(2 * np.pi * frequency * t), np.cos(2 * np.pi * frequency * t + phase)
        return [*astuple(work(a, b, rate)), *exchanged(a, b, rate), effort(a, rate), effort(a, rate, kind="absolute")]

    assert_close(measured(250.0), measured(1000.0), within=1e-3)


# --- influence, passive hands --------------------------------------------------------------------------------------


@pytest.mark.evidence("properties", granger, of=("unit", "constant", "mirror", "order"))
@given(st.integers(0, 99), units, offsets)
def test_granger_is_invariant_to_scale_offset_and_order_of_trials(seed: int, unit: float, offset: float) -> None:
    source = np.random.default_rng(seed)
    x, y = source.normal(size=(2, 5, 60))
    y[:, 1:] += 0.5 * x[:, :-1]
    found, order = granger(x, y, past=ONE), shuffled(seed, 5)
    assert_close(astuple(granger(list(-unit * x[order] + offset), list(y[order]), past=ONE))[:3], astuple(found)[:3])
    assert_close(astuple(granger(x, -unit * y + offset, past=ONE))[:3], astuple(found)[:3])
    assert found.strength >= 0


@pytest.mark.evidence("properties", chance_level, of=("unit", "order"))
@given(st.integers(0, 99), st.floats(0.1, 10))
def test_chance_level_is_invariant_to_order_of_dyads_and_unit(seed: int, unit: float) -> None:
    source = np.random.default_rng(seed)
    sources, targets = source.normal(size=(2, 4, 2, 30))

    def product(a: list, b: list) -> float:
        return float(np.mean([one @ other for one, other in zip(a, b, strict=True)]))

    order = shuffled(seed, 4)
    found = chance_level(list(sources), list(targets), product, source)
    other = chance_level(list(unit * sources[order]), list(targets[order]), product, source)
    assert_close([other.value, other.level, other.excess], unit * np.array([found.value, found.level, found.excess]))
    assert_close(np.sort(other.surrogates), unit * np.sort(found.surrogates))
    assert other.p == found.p


@pytest.mark.evidence("properties", driven, of=("time", "mirror", "unit", "constant", "rate"))
@given(st.floats(0.5, 3), st.floats(20, 400), st.floats(0.01, 100), offsets, st.integers(1, 100))
def test_driven_hand_is_linear_and_time_invariant(
    frequency: float, stiffness: float, unit: float, at: float, late: int
) -> None:
    hand, times = PassiveHand(stiffness=stiffness), np.arange(1000) / RATE
    force = np.sin(2 * np.pi * frequency * times)
    found = driven(force, RATE, hand)
    assert_close(driven(-unit * force + at, RATE, hand), -unit * found, within=1e-9 * (1 + unit))
    assert_close(driven(np.pad(force, (late, 0)), RATE, hand)[late:], found)
    assert_close(driven(force[::4], RATE / 4, hand), found[::4], within=2e-5)


# --- smoothness, the task ----------------------------------------------------------------------------------------


@pytest.mark.evidence("properties", dimensionless_jerk, of=("unit", "mirror", "time", "rate"))
@given(st.floats(0.4, 1.5), units, st.sampled_from(["peak_speed", "mean_speed"]))
def test_dimensionless_jerk_is_invariant_to_unit_and_duration(duration: float, unit: float, scale: str) -> None:
    def speed(rate: float) -> np.ndarray:
        return minimum_jerk_rate((np.arange(round(duration * rate)) + 0.5) / rate, 0.0, duration, 0.1)

    found = dimensionless_jerk(speed(RATE), RATE, scale=scale)
    assert_close(dimensionless_jerk(-unit * speed(RATE), RATE, scale=scale), found)
    assert_close(dimensionless_jerk(speed(RATE)[::-1], RATE, scale=scale), found)
    assert dimensionless_jerk(speed(4 * RATE), 4 * RATE, scale=scale) == pytest.approx(found, rel=0.05)
    # Another rate for the same samples is another duration, which does not matter.
    assert_close(dimensionless_jerk(speed(RATE), 3 * RATE, scale=scale), found)


@pytest.mark.evidence("properties", time_in_target, of=("constant", "time", "unit", "rate"))
@pytest.mark.evidence("properties", overshoots, of=("time", "rate"))
@given(balls, st.floats(-1, 1), st.integers(1, 20), st.sampled_from([0.5, 4.0]))
def test_target_measures_are_invariant_to_shift_scale_and_rate(
    p: np.ndarray, at: float, wait: int, unit: float
) -> None:
    target = {"centre": 0.15, "half_width": 0.0351}
    found = time_in_target(p, 10.0, **target)
    assert_close(
        astuple(time_in_target(unit * p + at, 10.0, centre=unit * 0.15 + at, half_width=unit * 0.0351)), astuple(found)
    )
    finer = time_in_target(np.repeat(p, 3), 30.0, **target)
    assert_close(astuple(replace(finer, longest=0.0)), astuple(replace(found, longest=0.0)))
    assert found.longest <= finer.longest <= found.longest + 1 / 10, "a stay lasts from its first sample to its last"
    later = time_in_target(np.concatenate([np.full(wait, -0.4), p]), 10.0, **target)
    assert (later.time, later.visits) == (pytest.approx(found.time), found.visits)
    assert_close(later.first, found.first + wait / 10)
    past = overshoots(p, 10.0, **target)
    assert_close(astuple(overshoots(np.repeat(p, 3), 30.0, **target)), astuple(past))
    assert_close(astuple(overshoots(np.concatenate([np.full(wait, p[0]), p]), 10.0, **target))[:2], astuple(past)[:2])


@pytest.mark.evidence("properties", fall_time, of=("time", "mirror", "unit", "rate"))
@given(balls, units, st.integers(1, 20))
def test_fall_time_follows_shift_and_is_invariant_to_mirror_and_scale(p: np.ndarray, unit: float, wait: int) -> None:
    found = fall_time(p, 10.0)
    assert_close(fall_time(-unit * p, 10.0, edge=unit * 0.35), found)
    assert_close(fall_time(np.concatenate([np.zeros(wait), p]), 10.0), found + wait / 10)
    assert_close(fall_time(np.repeat(p, 4), 40.0), found)


@pytest.mark.evidence("properties", falls, of="order")
@given(st.lists(st.sampled_from(["success", "fell", "skipped"]), max_size=20), st.integers(0, 99))
def test_falls_are_independent_of_order(outcomes: list[str], seed: int) -> None:
    found, other = falls(outcomes), falls([outcomes[k] for k in shuffled(seed, len(outcomes))])
    assert (other.falls, other.n) == (found.falls, found.n)
    assert_close(other.share, found.share)


@pytest.mark.evidence("properties", reaction, of=("unit", "rate"))
@given(st.floats(0.15, 0.8), st.floats(0.3, 0.8), st.floats(0.005, 0.05), units)
def test_reaction_is_independent_of_unit_and_sampling_rate(
    onset: float, duration: float, far: float, unit: float
) -> None:
    def velocity(rate: float) -> np.ndarray:
        return minimum_jerk_rate(np.arange(round(2 * rate)) / rate, onset, duration, far)

    for rule in ("sustained", "before_peak"):
        found = reaction(velocity(RATE), RATE, onset=rule)
        assert np.isfinite(found.time)
        scaled = reaction(unit * velocity(RATE), RATE, onset=rule, threshold=0.003 * unit)
        assert scaled.time == pytest.approx(found.time, abs=1.001 / RATE)
        assert reaction(velocity(500.0), 500.0, onset=rule).time == pytest.approx(found.time, abs=2.001 / 500.0)


# --- statistics --------------------------------------------------------------------------------------------------


@pytest.mark.evidence("properties", t_interval, of=("unit", "constant", "mirror", "order"))
@given(few, units, offsets, st.integers(0, 99))
def test_t_interval_follows_scale_offset_and_mirror(x: np.ndarray, unit: float, at: float, seed: int) -> None:
    found, other = t_interval(x), t_interval(-unit * x[shuffled(seed, x.size)] + at)
    expected = [at - unit * found.value, at - unit * found.high, at - unit * found.low]
    assert_close([other.value, other.low, other.high], expected, within=1e-9 * (1 + unit))


@pytest.mark.evidence("properties", bootstrap, cluster_mean, of=("unit", "constant"))
@pytest.mark.evidence("properties", ratio_of_sums, of=("unit", "order"))
@given(
    arrays(np.float64, 5, elements=st.integers(-20, 20), unique=True), st.floats(0.1, 10), offsets, st.integers(0, 9)
)
def test_bootstrap_interval_follows_scale_and_offset(x: np.ndarray, unit: float, at: float, seed: int) -> None:
    def ends(values: np.ndarray) -> list[float]:
        drawn = np.random.default_rng(3)
        one = bootstrap([values], np.mean, drawn, method="percentile", resamples=99)
        pairs = [[value - 1.0, value + 1.0] for value in values]
        other = cluster_mean(pairs, np.random.default_rng(3), method="percentile", resamples=99)
        assert_close([other.value, other.low, other.high], [one.value, one.low, one.high], within=1e-6)
        return [one.value, one.low, one.high]

    assert_close(ends(unit * x + at), unit * np.array(ends(x)) + at, within=1e-6)
    order, below = shuffled(seed, 5), np.arange(1.0, 6.0)
    assert_close(ratio_of_sums(unit * x[order], below[order]), unit * ratio_of_sums(x, below))


@pytest.mark.evidence("properties", sign_test, of=("mirror", "order"))
@pytest.mark.evidence("properties", permutation_test, of=("unit", "mirror", "order"))
@given(few, st.sampled_from([0.25, 8.0]), st.integers(0, 99))
def test_tests_of_mirrored_differences_have_the_same_p(x: np.ndarray, unit: float, seed: int) -> None:
    mirrored = -unit * x[shuffled(seed, x.size)]
    for test in (sign_test, permutation_test):
        assert_close(test(mirrored).p, test(x).p)
        assert_close(test(mirrored, alternative="less").p, test(x, alternative="greater").p)


@pytest.mark.evidence("properties", permutation_test_between, of=("unit", "constant", "mirror", "order"))
@pytest.mark.evidence("properties", hedges_g, of=("unit", "constant", "mirror", "order"))
@given(*[arrays(np.float64, st.integers(2, 5), elements=st.integers(-9, 9))] * 2, st.sampled_from([0.25, 8.0]))
def test_swapping_groups_reverses_the_sign_of_the_effect(x: np.ndarray, y: np.ndarray, unit: float) -> None:
    first, second = unit * y[::-1] + 4, unit * x[::-1] + 4
    found, other = permutation_test_between(x, y), permutation_test_between(first, second)
    assert_close([other.p, other.statistic], [found.p, -unit * found.statistic])
    one, swapped = hedges_g(x, y), hedges_g(first, second)
    assert_close([swapped.value, swapped.low, swapped.high], [-one.value, -one.high, -one.low], within=1e-6)
