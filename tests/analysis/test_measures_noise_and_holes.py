"""Effects of noise and missing samples: noise changes a measure as theory predicts, or little; holes add no values.

There is one rule for holes: a value measured with missing samples equals that of the whole record, or is NaN.
"""

from collections.abc import Callable
from dataclasses import astuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from two_hands import ARM, minimum_jerk, minimum_jerk_rate, rolled, two_hands

from netboard.analysis.measures.braking import first_braking
from netboard.analysis.measures.cooperation import contributions, delays
from netboard.analysis.measures.information import Past, chance_level, granger, transfer_entropy
from netboard.analysis.measures.interaction import (
    effort,
    exchanged,
    force_share,
    interaction,
    point_velocities,
    supports,
    work,
)
from netboard.analysis.measures.lags import lag_of, peak_delay, windowed_lags
from netboard.analysis.measures.motion import FilteredMotion, Trial, ball_speed, find_completion, motion, placements
from netboard.analysis.measures.movements import classify, mean_shares, movement_times
from netboard.analysis.measures.passive import (
    Gains,
    PassiveHand,
    driven,
    passive_partner,
)
from netboard.analysis.measures.peaks import velocity_peaks
from netboard.analysis.measures.performance import first_and_last, relative_performance
from netboard.analysis.measures.segments import Segments, board_segments
from netboard.analysis.measures.signals import LowPass, bridge, derivative, evenly
from netboard.analysis.measures.smoothness import (
    dimensionless_jerk,
    log_dimensionless_jerk,
    spectral_arc_length,
)
from netboard.analysis.measures.task import fall_time, overshoots, reaction, time_in_target
from netboard.analysis.statistics.effect_sizes import hedges_g
from netboard.analysis.statistics.estimates import bootstrap, ratio_of_sums
from netboard.analysis.statistics.exact_tests import permutation_test, permutation_test_between

RATE = 1000.0
SEEDS = range(5)
GAINS = Gains(74.1, 25.9, 0.98)
MOVES = [(0.4 + 0.5 * k, 0.4, (-1) ** k * (0.016 if k else 0.008)) for k in range(5)]
HANDS = two_hands([(start + 0.04, duration, -z) for start, duration, z in MOVES], MOVES, length=3.5)
BALL, BALL_RATE = rolled(HANDS.theta, RATE, 0.15)

balls = arrays(np.float64, 30, elements=st.sampled_from([-0.4, -0.15, 0.0, 0.12, 0.15, 0.18, 0.2, 0.4]))
speeds = arrays(np.float64, 30, elements=st.floats(-1, 1, width=16))
holes = st.lists(st.integers(0, 29), min_size=1, max_size=5)


def with_holes(x: np.ndarray, missing: list[int]) -> np.ndarray:
    holed = x.copy()
    holed[missing] = np.nan
    return holed


def assert_equal_or_nan(measure: Callable[..., object], missing: list[int], *signals: np.ndarray) -> None:
    """Check that, with a hole in any one signal, each finite result equals that of the whole record."""
    whole = np.ravel(np.array(measure(*signals), float))
    for k in range(len(signals)):
        holed = [with_holes(x, missing) if k == one else x for one, x in enumerate(signals)]
        found = np.ravel(np.array(measure(*holed), float))
        number = ~np.isnan(found)
        np.testing.assert_allclose(found[number], whole[number], rtol=1e-9, atol=1e-12)


def disturbed(seed: int, deviation: float = 5e-5) -> FilteredMotion:
    """The filtered movements with 50 um of noise on each stylus, as of a device's position sensor."""
    noise = np.random.default_rng(seed).normal(0, deviation, (3, HANDS.times.size))
    left, right = HANDS.left_z + noise[0], HANDS.right_z + noise[1]
    return motion(RATE, left, right, (right - left) / (2 * ARM), BALL + noise[2])


CLEAN = disturbed(0, 0.0)


def turns(of: FilteredMotion) -> Segments:
    return board_segments(of.omega, of.theta, RATE)


# --- noise -------------------------------------------------------------------------------------------------------


@pytest.mark.evidence("disturbance", LowPass, derivative, of="noise")
def test_filtered_white_noise_has_the_predicted_deviation() -> None:
    noise = np.random.default_rng(1).normal(size=200_000)
    frequency = np.linspace(0, RATE / 2, 50_001)
    gain = 1 / (1 + (np.tan(np.pi * np.minimum(frequency, 499.9) / RATE) / np.tan(np.pi * 20 / RATE)) ** 10)
    filtered = LowPass(20.0)(noise, RATE)
    assert filtered.std() == pytest.approx(np.sqrt(np.mean(gain**2)), rel=0.03)
    assert derivative(noise, RATE).std() == pytest.approx(RATE / np.sqrt(2), rel=0.01)
    slope = RATE * np.sin(2 * np.pi * frequency / RATE) * gain
    assert derivative(filtered, RATE).std() == pytest.approx(np.sqrt(np.mean(slope**2)), rel=0.03)


@pytest.mark.evidence("disturbance", board_segments, contributions, delays, of="noise")
@pytest.mark.parametrize("seed", SEEDS)
def test_sensor_noise_shifts_movements_by_milliseconds(seed: int) -> None:
    noisy = disturbed(seed)
    clean, found = turns(CLEAN), turns(noisy)
    assert len(found) == len(clean) == 5
    np.testing.assert_allclose(found.first, clean.first, atol=3)
    np.testing.assert_allclose(found.angle, clean.angle, atol=np.radians(0.01))
    moved = contributions(found, noisy.left_z, noisy.right_z)
    assert moved.cooperative.all()
    np.testing.assert_allclose(moved.left, contributions(clean, CLEAN.left_z, CLEAN.right_z).left, atol=1e-4)
    delay = delays(found, moved, noisy.left_vz, noisy.right_vz, RATE, threshold="own_peak").signed
    np.testing.assert_allclose(delay, 0.04, atol=0.012)
    assert np.nanmean(delay) == pytest.approx(0.04, abs=0.0015)


@pytest.mark.evidence("disturbance", classify, movement_times, of="noise")
@pytest.mark.parametrize("seed", SEEDS)
def test_sensor_noise_changes_shares_by_at_most_0_02(seed: int) -> None:
    noisy = disturbed(seed)
    found, clean = (movement_times(classify(one.left_vz, one.right_vz), RATE).shares for one in (noisy, CLEAN))
    np.testing.assert_allclose(found, clean, atol=0.02)
    # Without a filter nothing is ever still: the noise of a derivative is ten times the limit.
    raw = derivative(HANDS.left_z + np.random.default_rng(seed).normal(0, 5e-5, HANDS.times.size), RATE)
    assert movement_times(classify(raw, noisy.right_vz), RATE).shares[3] < clean[3] / 2


@pytest.mark.evidence("disturbance", velocity_peaks, ball_speed, of="noise")
@pytest.mark.parametrize("seed", SEEDS)
def test_noise_adds_no_prominent_peaks(seed: int) -> None:
    noisy = disturbed(seed)
    away_from_ends = slice(200, -200)
    np.testing.assert_allclose(noisy.speed[away_from_ends], CLEAN.speed[away_from_ends], atol=2e-3)
    found, clean = (velocity_peaks(one.speed[away_from_ends], least_prominence=0.01) for one in (noisy, CLEAN))
    assert found.count == clean.count == 2
    np.testing.assert_allclose(found.samples, clean.samples, atol=40)


@pytest.mark.evidence("disturbance", first_braking, of="noise")
@pytest.mark.parametrize("seed", SEEDS)
def test_noise_shifts_the_first_braking_by_millimetres(seed: int) -> None:
    trial = Trial(0, BALL.size, -0.15)
    found, clean = (
        astuple(first_braking(turns(one), one.theta, one.p, one.vp, RATE, trial)) for one in (disturbed(seed), CLEAN)
    )
    assert np.isfinite(clean).all()
    np.testing.assert_allclose(found, clean, atol=3e-3)


@pytest.mark.evidence("disturbance", lag_of, peak_delay, windowed_lags, of="noise")
@pytest.mark.parametrize("seed", SEEDS)
def test_noise_shifts_the_correlation_lag_less_than_the_peak_delay(seed: int) -> None:
    noisy = disturbed(seed)
    assert lag_of(noisy.left_vz, noisy.right_vz, RATE).delay == pytest.approx(0.04, abs=0.0005)
    _, lags = windowed_lags(noisy.left_vz[300:3000], noisy.right_vz[300:3000], RATE)
    np.testing.assert_allclose([lag.delay for lag in lags], 0.04, atol=0.004)
    one = slice(300, 850)
    assert peak_delay(noisy.left_vz[one], noisy.right_vz[one], RATE) == pytest.approx(0.04, abs=0.03)
    raw = [z + np.random.default_rng(seed).normal(0, 0.02, z.size) for z in (HANDS.left_vz, HANDS.right_vz)]
    assert lag_of(*raw, RATE).delay == pytest.approx(0.04, abs=0.015), "half as much noise as signal"


@pytest.mark.evidence("disturbance", spectral_arc_length, dimensionless_jerk, log_dimensionless_jerk, of="noise")
@pytest.mark.parametrize("seed", SEEDS)
def test_noise_changes_jerk_measures_and_not_spectral_arc_length(seed: int) -> None:
    speed = minimum_jerk_rate(np.arange(800) / RATE, 0.0, 0.8, 0.1)
    noisy = speed + np.random.default_rng(seed).normal(0, 0.001, speed.size)
    assert spectral_arc_length(noisy, RATE) == pytest.approx(spectral_arc_length(speed, RATE), abs=0.03)
    # White noise of deviation s has second differences of 6 s^2.
    expected = dimensionless_jerk(speed, RATE) - 0.8**3 / noisy.max() ** 2 * 6 * 1e-6 * RATE**4 * 0.8
    assert dimensionless_jerk(noisy, RATE) == pytest.approx(expected, rel=0.2)
    assert log_dimensionless_jerk(noisy, RATE) < log_dimensionless_jerk(speed, RATE) - 5


@pytest.mark.evidence("disturbance", find_completion, time_in_target, fall_time, overshoots, of="noise")
@pytest.mark.parametrize("seed", SEEDS)
def test_noise_of_the_ball_shifts_times_by_milliseconds(seed: int) -> None:
    times = np.arange(4000) / RATE
    noise = np.random.default_rng(seed).normal(0, 1e-4, times.size)
    p = minimum_jerk(times, 0.2, 1.2, 0.30) - 0.15
    # At the edge of the target it goes 0.25 m/s: five deviations are 2 ms.
    found, clean = (find_completion(one, RATE, 0.15).time for one in (p + noise, p))
    assert found == pytest.approx(clean, abs=0.003)
    stay = time_in_target(p + noise, RATE, centre=0.15)
    assert stay.time == pytest.approx(4.0 - clean, abs=0.003)
    assert overshoots(p + noise, RATE, centre=0.15).count == 0
    assert overshoots(p + noise, RATE, centre=0.15, beyond="centre").largest == pytest.approx(4e-4, abs=2e-4)
    assert fall_time(4 * p + 4 * noise, RATE) == pytest.approx(fall_time(4 * p, RATE), abs=0.003)


@pytest.mark.evidence("disturbance", reaction, of="noise")
@pytest.mark.parametrize("seed", SEEDS)
def test_noise_shifts_reaction_times_by_milliseconds(seed: int) -> None:
    velocity = minimum_jerk_rate(np.arange(2000) / RATE, 0.3, 0.4, 0.02)
    noisy = velocity + np.random.default_rng(seed).normal(0, 5e-4, velocity.size)
    assert reaction(noisy, RATE).time == pytest.approx(reaction(velocity, RATE).time, abs=0.01)


@pytest.mark.evidence("disturbance", work, effort, of="noise")
def test_noise_adds_effort_and_no_work() -> None:
    times = np.arange(20_000) / RATE
    force, velocity = np.sin(times), 0.1 * np.sin(times + 1)
    noise = np.random.default_rng(2).normal(0, 0.2, (2, times.size))
    clean = work(force, velocity, RATE).net
    assert work(force + noise[0], velocity + 0.1 * noise[1], RATE).net == pytest.approx(clean, abs=0.02)
    # Deviation squared times 20 s.
    assert effort(force + noise[0], RATE) - effort(force, RATE) == pytest.approx(0.04 * 20, rel=0.1)


@pytest.mark.evidence("disturbance", granger, transfer_entropy, of="noise")
def test_independent_noise_has_the_influence_expected_by_chance() -> None:
    past = Past(step=1, own=2, other=2, delay=1)
    pairs = [np.random.default_rng(seed).normal(size=(2, 200)) for seed in range(200)]
    p = np.array([granger([x], [y], past=past).p for x, y in pairs])
    assert np.mean(p < 0.05) == pytest.approx(0.05, abs=0.03)
    assert p.mean() == pytest.approx(0.5, abs=0.06)
    # Of as many as two parameters more, the mean of the strength is 2 / n.
    strengths = [2 * transfer_entropy([x], [y], past=past) for x, y in pairs]
    assert np.mean(strengths) == pytest.approx(2 / 195, rel=0.2)


@pytest.mark.evidence("disturbance", placements, of=("noise", "holes"))
@given(st.integers(0, 99), st.lists(st.integers(0, 398), max_size=5))
def test_noise_and_holes_add_no_placements(seed: int, missing: list[int]) -> None:
    p = np.repeat([-0.15, 0.3], 200) + np.random.default_rng(seed).normal(0, 1e-4, 400)
    assert placements(p, RATE).tolist() == [200]
    holed = placements(with_holes(p, missing), RATE)
    # Across a hole nothing is filtered anyway.
    assert holed.tolist() == ([] if {199, 200} & set(missing) else [200])


# --- holes -------------------------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.evidence("disturbance", motion, ball_speed, of="holes")
@given(st.lists(st.integers(1, 3000), min_size=1, max_size=4))
def test_holes_in_a_recording_stay_local(missing: list[int]) -> None:
    def filtered(ball: np.ndarray, left: np.ndarray, *, unfilled: bool = True) -> FilteredMotion:
        return motion(RATE, left if unfilled else bridge(left, RATE), HANDS.right_z, HANDS.theta, ball)

    found = filtered(with_holes(BALL, missing), with_holes(HANDS.left_z, missing))
    for name in ("left_z", "p", "vp", "speed"):
        values = getattr(found, name)
        assert np.isnan(values[missing]).all(), name
        whole = getattr(filtered(BALL, HANDS.left_z), name)
        far = np.min(np.abs(np.arange(values.size)[:, None] - missing), axis=1) > 500
        np.testing.assert_allclose(values[far], whole[far], atol=2e-3, err_msg=name)
    np.testing.assert_array_equal(found.right_vz, filtered(BALL, HANDS.left_z).right_vz)
    filled = filtered(BALL, with_holes(HANDS.left_z, missing), unfilled=False)
    np.testing.assert_allclose(filled.left_vz, CLEAN.left_vz, atol=1e-3)


@pytest.mark.evidence("disturbance", find_completion, time_in_target, overshoots, fall_time, of="holes")
@given(balls, holes)
def test_task_measures_that_a_hole_could_change_are_nan(p: np.ndarray, missing: list[int]) -> None:
    def completed(ball: np.ndarray) -> list[float]:
        found = find_completion(ball, 10.0, 0.15, half_width=0.0351, hold=0.3)
        return [found.time, found.entries, np.nan if found.sample is None else found.sample]

    assert_equal_or_nan(completed, missing, p)
    assert_equal_or_nan(lambda ball: astuple(time_in_target(ball, 10.0, centre=0.15)), missing, p)
    assert_equal_or_nan(lambda ball: astuple(overshoots(ball, 10.0, centre=0.15)), missing, p)
    assert_equal_or_nan(lambda ball: fall_time(ball, 10.0), missing, p)


def test_holes_that_cannot_matter_change_no_measure() -> None:
    """A sample lost after the result, or before it and far from the target, does not matter."""
    p = np.repeat([-0.15, 0.15], [50, 50])
    whole = find_completion(p, 10.0, 0.15, hold=1.0)
    assert (whole.sample, whole.entries) == (50, 1)
    assert find_completion(with_holes(p, [80]), 10.0, 0.15, hold=1.0) == whole
    before = find_completion(with_holes(p, [20]), 10.0, 0.15, hold=1.0)
    assert (before.sample, before.time) == (50, 5.0)
    assert np.isnan(before.entries)
    for unclear in ([49], [55]):
        hidden = find_completion(with_holes(p, unclear), 10.0, 0.15, hold=1.0)
        assert hidden.sample is None
        assert np.isnan(hidden.time)
    off = np.repeat([0.0, 0.4], [50, 50])
    assert fall_time(with_holes(off, [70]), 10.0) == 5.0
    assert np.isnan(fall_time(with_holes(off, [10]), 10.0))


@pytest.mark.evidence("disturbance", reaction, of="holes")
@given(st.integers(0, 400), st.integers(1, 40), st.sampled_from(["sustained", "before_peak"]))
def test_reaction_that_a_hole_may_hide_is_nan(at: int, length: int, onset: str) -> None:
    velocity = minimum_jerk_rate(np.arange(500) / RATE, 0.2, 0.25, 0.02)
    holed = with_holes(velocity, list(range(at, min(at + length, 500))))
    found, whole = (reaction(one, RATE, onset=onset).time for one in (holed, velocity))
    assert np.isnan(found) or found == whole
    assert np.isnan(found) == (at < (1000 * whole + 30 if onset == "sustained" else 458)) or at > 440


@pytest.mark.evidence("disturbance", velocity_peaks, of="holes")
@given(speeds, holes)
def test_peak_count_with_a_hole_is_nan(speed: np.ndarray, missing: list[int]) -> None:
    assert_equal_or_nan(lambda one: velocity_peaks(one).count, missing, speed)
    found = velocity_peaks(with_holes(speed, missing))
    assert np.isnan(found.count)
    assert set(found.samples) <= set(velocity_peaks(speed).samples)


@pytest.mark.evidence("disturbance", first_braking, of="holes")
@given(st.integers(0, 3400), st.integers(1, 200), st.sampled_from(["tilt", "rotation"]))
def test_first_braking_does_not_skip_a_movement_hidden_by_a_hole(at: int, length: int, braking: str) -> None:
    missing = slice(at, at + length)
    trial = Trial(100, HANDS.times.size, -0.15)

    def strategy(theta: np.ndarray, omega: np.ndarray) -> np.ndarray:
        segments = board_segments(omega, theta, RATE)
        return np.array(astuple(first_braking(segments, theta, BALL, BALL_RATE, RATE, trial, braking=braking)))

    theta, omega = HANDS.theta.copy(), HANDS.omega.copy()
    whole = strategy(theta, omega)
    theta[missing] = omega[missing] = np.nan
    found = strategy(theta, omega)
    assert np.isfinite(whole).all()
    np.testing.assert_array_equal(found[~np.isnan(found)], whole[~np.isnan(found)])
    ball = BALL.copy()
    ball[round(100 + 1000 * whole[2])] = np.nan
    lost = first_braking(turns(CLEAN), HANDS.theta, ball, BALL_RATE, RATE, trial, braking=braking)
    assert lost.wrong_way == whole[-1]


@pytest.mark.evidence("disturbance", contributions, delays, of="holes")
@given(st.integers(0, 3400), st.integers(1, 60), st.sampled_from(["net", "path"]), st.sampled_from(["net", "majority"]))
def test_hole_never_makes_a_movement_cooperative(at: int, length: int, amount: str, opposite: str) -> None:
    clean = turns(CLEAN)
    left_z, left_vz = HANDS.left_z.copy(), HANDS.left_vz.copy()
    left_z[at : at + length] = left_vz[at : at + length] = np.nan
    options = {"amount": amount, "opposite": opposite}
    whole, found = (contributions(clean, z, HANDS.right_z, **options) for z in (HANDS.left_z, left_z))
    known = np.isfinite(found.left)
    np.testing.assert_array_equal(found.left[known], whole.left[known])
    touched = (at < clean.stop) & (at + length > clean.first)
    assert not (found.cooperative & ~whole.cooperative).any()
    if amount == "path" or opposite == "majority":
        assert not (found.cooperative & touched).any()
    one, other = (
        delays(clean, moved, vz, HANDS.right_vz, RATE).signed
        for moved, vz in ((whole, HANDS.left_vz), (found, left_vz))
    )
    known = np.isfinite(other)
    np.testing.assert_array_equal(other[known], one[known])


@pytest.mark.evidence("disturbance", lag_of, windowed_lags, peak_delay, of="holes")
@given(speeds, speeds, holes)
def test_signals_with_a_hole_have_no_delay(left: np.ndarray, right: np.ndarray, missing: list[int]) -> None:
    for measure in (
        lambda a, b: astuple(lag_of(a, b, 30.0, longest=0.3))[:3],
        lambda a, b: [lag.delay for lag in windowed_lags(a, b, 30.0, window=0.5, step=0.2, longest=0.2)[1]],
        lambda a, b: peak_delay(a, b, 30.0),
    ):
        assert_equal_or_nan(measure, missing, left, right)
    assert np.isnan(lag_of(with_holes(left, missing), right, 30.0, longest=0.3).coefficient)
    assert np.isnan(peak_delay(with_holes(left, missing), right, 30.0))


@pytest.mark.evidence("disturbance", interaction, supports, point_velocities, of="holes")
@pytest.mark.evidence("disturbance", work, exchanged, effort, force_share, of="holes")
@given(speeds, speeds, holes, st.sampled_from(["opposing", "half_difference"]))
def test_hole_in_a_force_makes_its_measures_nan(a: np.ndarray, b: np.ndarray, missing: list[int], rule: str) -> None:
    for measure in (
        lambda x, y: np.stack(astuple(interaction(x, y, rule=rule))),
        lambda x, y: np.stack(supports(x, board_mass=0.01, ball_mass=0.05, arm=ARM)),
        lambda x, y: np.stack(point_velocities(x, y, y, arm=ARM)),
        lambda x, y: astuple(work(x, y, RATE)),
        lambda x, y: exchanged(x, y, RATE),
        lambda x, y: [effort(x, RATE, kind=kind) for kind in ("squared", "absolute", "rms")],
        force_share,
    ):
        assert_equal_or_nan(measure, missing, a, b)
    holed = with_holes(a, missing)
    assert np.isnan(np.stack(astuple(interaction(holed, b, rule=rule)))[:, missing]).all()
    assert np.isnan([*astuple(work(holed, b, RATE)), *exchanged(holed, b, RATE), force_share(holed, b)]).all()


@pytest.mark.evidence("disturbance", granger, transfer_entropy, of="holes")
@given(st.integers(0, 20), st.lists(st.integers(0, 119), min_size=1, max_size=6))
def test_samples_whose_past_has_a_hole_are_left_out(seed: int, missing: list[int]) -> None:
    past = Past(step=1, own=2, other=1, delay=1)
    x, y = np.random.default_rng(seed).normal(size=(2, 120))
    y[1:] += x[:-1]
    found = granger([with_holes(x, missing)], [y], past=past)
    assert found.n == 118 - len({k + 1 for k in missing if 1 <= k < 119})
    # Trials that are cut where the hole is have the same rows, less those whose past is cut.
    once = with_holes(y, [60])
    cut = granger([x[:60], x[61:]], [y[:60], y[61:]], past=past)
    assert granger([x], [once], past=past).strength == pytest.approx(cut.strength)
    for estimator in ("gaussian", "binned", "nearest"):
        assert np.isfinite(transfer_entropy([x], [once], past=past, estimator=estimator))


@pytest.mark.evidence("disturbance", chance_level, of="holes")
def test_chance_level_with_a_missing_value_is_nan() -> None:
    x = np.random.default_rng(1).normal(size=(3, 1, 20))

    def product(a: list[np.ndarray], b: list[np.ndarray]) -> float:
        return float(a[0] @ b[0])

    whole = chance_level(list(x), list(x), product, np.random.default_rng(1))
    assert whole.p == pytest.approx(1 / 6)
    x[1, 0, 5] = np.nan
    holed = chance_level(list(x), list(x), product, np.random.default_rng(1))
    assert np.isnan([holed.value, holed.excess, holed.p]).all()


@pytest.mark.evidence("disturbance", driven, passive_partner, of="holes")
@given(speeds, holes)
def test_passive_hand_is_nan_after_a_hole(force: np.ndarray, missing: list[int]) -> None:
    for measure in (
        lambda x: driven(x, RATE, PassiveHand()),
        lambda x: passive_partner(x, 0 * x, RATE, PassiveHand(), GAINS),
    ):
        assert_equal_or_nan(measure, missing, force)
        assert np.isnan(measure(with_holes(force, missing))[min(missing) :]).all()


@pytest.mark.evidence("disturbance", passive_partner, driven, of="noise")
def test_passive_hand_smooths_noise_as_predicted() -> None:
    noise = np.random.default_rng(3).normal(size=50_000)
    # The deviation of m z'' + b z' + k z = white force of density S is sqrt(S / (2 b k)), S = 1 / rate.
    expected = np.sqrt(1 / RATE / (2 * 8.0 * 150.0))
    assert driven(noise, RATE, PassiveHand())[1000:].std() == pytest.approx(expected, rel=0.15)
    moved = passive_partner(1e-3 * noise, 0 * noise, RATE, PassiveHand(), GAINS)
    assert moved[1000:].std() < 1e-3 * GAINS.partner * expected


@pytest.mark.evidence("disturbance", evenly, of=("noise", "holes"))
@given(st.integers(0, 99), st.integers(1, 198))
def test_evenly_tolerates_timing_jitter_and_keeps_a_hole(seed: int, missing: int) -> None:
    times = np.arange(200) / 100.0 + np.random.default_rng(seed).uniform(0, 0.004, 200)
    found = evenly(times, np.sin(3 * times), 500.0)
    np.testing.assert_allclose(found, np.sin(3 * (times[0] + np.arange(found.size) / 500.0)), atol=2.5e-4)
    holed = evenly(times, with_holes(np.sin(3 * times), [missing]), 500.0)
    near = np.abs(times[0] + np.arange(found.size) / 500.0 - times[missing]) < 0.005
    assert np.isnan(holed[near]).all()
    np.testing.assert_array_equal(holed[~np.isnan(holed)], found[~np.isnan(holed)])
    assert np.isnan(holed).sum() <= 15
    with pytest.raises(ValueError, match="increasing times"):
        evenly(with_holes(times, [missing]), times, 500.0)


@pytest.mark.evidence("disturbance", mean_shares, first_and_last, relative_performance, of="holes")
def test_trials_with_missing_values_are_left_out() -> None:
    seconds = np.array([[1.0, 0, 0, 1], [3.0, 1, 0, 0], [np.nan, 1, 1, 1]])
    np.testing.assert_allclose(mean_shares(seconds), mean_shares(seconds[:2]))
    times = np.arange(1.0, 13.0)
    times[[1, 10]] = np.nan
    found = first_and_last(times, 1 + np.arange(12), count=3)
    assert (found.first.mean, found.first.count, found.last.mean, found.last.count) == (2.0, 2, 11.0, 2)
    unknown = relative_performance(3.0, np.nan, 3.5)
    assert np.isnan([unknown.against_partner, unknown.gain]).all()
    assert unknown.of_dyad == 0.5


@pytest.mark.evidence("disturbance", bootstrap, ratio_of_sums, of="holes")
@pytest.mark.evidence("disturbance", permutation_test, permutation_test_between, hedges_g, of="holes")
@given(arrays(np.float64, st.integers(2, 6), elements=st.integers(-9, 9)))
def test_units_with_missing_values_are_left_out_or_give_nan(x: np.ndarray) -> None:
    holed = np.concatenate([[np.nan], x, [np.nan]])
    assert permutation_test(holed) == permutation_test(x)
    assert permutation_test_between(holed, x + 1) == permutation_test_between(x, x + 1)
    np.testing.assert_equal(astuple(hedges_g(x, holed + 2)), astuple(hedges_g(x, x + 2)))
    assert np.isnan(ratio_of_sums(holed, np.ones(holed.size)))
    lost = bootstrap([holed], np.mean, np.random.default_rng(1))
    assert np.isnan([lost.value, lost.low, lost.high]).all()
