"""Delays between two hands in synthetic minimum-jerk movements, against their closed form."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from two_hands import TwoHands, time_to_portion, two_hands

from netboard.analysis.measures.cooperation import PORTIONS, Contributions, Delays, contributions, delays
from netboard.analysis.measures.motion import motion
from netboard.analysis.measures.segments import Segments, board_segments

START = 1.0


def measured(hands: TwoHands, *, opposite: str = "net", amount: str = "net", **options: object) -> Delays:
    """Delays from the exact velocities."""
    segments = board_segments(hands.omega, hands.theta, hands.rate)
    moved = contributions(segments, hands.left_z, hands.right_z, opposite=opposite, amount=amount)
    return delays(segments, moved, hands.left_vz, hands.right_vz, hands.rate, **options)


def measured_after_filtering(hands: TwoHands, **options: object) -> Delays:
    """Delays from filtered positions, as in the analysis of a recording."""
    found = motion(hands.rate, hands.left_z, hands.right_z, hands.theta, np.zeros_like(hands.theta))
    segments = board_segments(found.omega, found.theta, hands.rate)
    moved = contributions(segments, found.left_z, found.right_z)
    return delays(segments, moved, found.left_vz, found.right_vz, hands.rate, **options)


def opposed(lag: float = 0.0, ratio: float = 1.0, duration: float = 0.4, rate: float = 1000.0) -> TwoHands:
    """The right hand goes 10 mm up; the left one goes down `lag` later, `ratio` times as far."""
    left, right = (START + lag, duration, -0.01 * ratio), (START, duration, 0.01)
    return two_hands([left], [right], rate=rate)


def closed_form(lag: float, ratio: float, duration: float = 0.4) -> np.ndarray:
    """Delay with one threshold for both hands, a fraction of the smaller peak."""
    smaller = min(ratio, 1.0)
    return np.array(
        [
            lag + time_to_portion(portion * smaller / ratio, duration) - time_to_portion(portion * smaller, duration)
            for portion in PORTIONS
        ]
    )


@pytest.mark.evidence("truth", delays)
@pytest.mark.parametrize("lag", [0.0, 0.02, 0.04, 0.08])
@pytest.mark.parametrize("ratio", [1.0, 2.0, 0.5, 4.0])
def test_delays_equal_the_closed_form(lag: float, ratio: float) -> None:
    found = measured(opposed(lag, ratio))
    np.testing.assert_allclose(found.signed, [closed_form(lag, ratio)], atol=5e-5)
    np.testing.assert_allclose(found.absolute, np.abs([closed_form(lag, ratio)]), atol=5e-5)
    assert not found.truncated.any()
    own = measured(opposed(lag, ratio), threshold="own_peak")
    np.testing.assert_allclose(own.signed, lag, atol=5e-5)


@pytest.mark.evidence("truth", delays)
def test_common_threshold_makes_the_larger_movement_earlier() -> None:
    """Even without a lag: the bias grows with the threshold, to the known values for movements of 0.5 s."""
    for ratio, expected in ((2.0, (14, 21, 28, 34)), (9.0, (30, 45, 58, 71))):
        np.testing.assert_allclose(-1e3 * closed_form(0.0, ratio, 0.5), expected, atol=1)
        np.testing.assert_allclose(
            -1e3 * measured(opposed(0.0, ratio - 1e-9, 0.5)).signed[0], expected, atol=1, err_msg=str(ratio)
        )


@pytest.mark.parametrize("lag", [0.0, 0.04, 0.08])
@pytest.mark.parametrize("ratio", [1.0, 2.0])
def test_filters_hardly_change_delays(lag: float, ratio: float) -> None:
    found = measured_after_filtering(opposed(lag, ratio))
    np.testing.assert_allclose(found.signed, [closed_form(lag, ratio)], atol=4e-3)
    if ratio == 1:
        np.testing.assert_allclose(found.signed, lag, atol=1e-4)


def test_search_inside_is_cut_off_at_the_onset_of_the_board_movement() -> None:
    found = measured_after_filtering(opposed(0.04), search="inside")
    np.testing.assert_allclose(1e3 * found.signed, [[31, 40, 40, 40]], atol=2)
    np.testing.assert_array_equal(found.truncated, [[True, False, False, False]])


@pytest.mark.evidence("truth", delays)
@pytest.mark.parametrize(
    ("lag", "ratio", "expected"),
    [(0.04, 1.0, (31, 40, 40, 40)), (0.04, 2.0, (22, 23, 18, 13)), (0.08, 2.0, (50, 61, 58, 53))],
)
def test_delays_by_the_literal_rule_of_the_paper(lag: float, ratio: float, expected: tuple[int, ...]) -> None:
    """10 mm in 0.4 s; the later side goes `ratio` times as far; the search stops at the onset of the board movement."""
    found = measured_after_filtering(opposed(lag, ratio), search="inside")
    np.testing.assert_allclose(1e3 * found.signed, [expected], atol=0.6)
    for search in ("back", "before_peak"):
        own = measured_after_filtering(opposed(lag, ratio), threshold="own_peak", search=search)
        np.testing.assert_allclose(own.signed, lag, atol=1e-4)


def one_segment(first: int, stop: int) -> Segments:
    return Segments(np.array([first]), np.array([stop]), np.array([0.1]), np.array([False]))


TOGETHER = Contributions(np.array([-0.01]), np.array([0.01]), np.array([True]))
"""The left hand went down, the right one up."""


def ramps(*, left_from: int, right_from: int) -> tuple[np.ndarray, np.ndarray]:
    """Velocities of two hands that accelerate to 0.1 m/s within 0.1 s."""
    samples = np.arange(1500)
    return tuple(sign * np.clip(samples - at, 0, 100) / 1000 for sign, at in ((-1, left_from), (1, right_from)))


@pytest.mark.evidence("truth", delays)
@pytest.mark.parametrize(("back", "known"), [(0.3, True), (0.18, False), (0.19, True)])
def test_onset_search_goes_back_by_the_configured_time(back: float, known: bool) -> None:
    """The left hand reaches 10 % of its peak 190 ms before the board moves, the right hand 10 ms after."""
    left_vz, right_vz = ramps(left_from=800, right_from=1000)
    found = delays(one_segment(1000, 1400), TOGETHER, left_vz, right_vz, 1000.0, search_back=back)
    np.testing.assert_array_equal(found.truncated[0, 0], not known)
    np.testing.assert_allclose(found.signed[0, 0], -0.2 if known else np.nan)
    inside = delays(one_segment(1000, 1400), TOGETHER, left_vz, right_vz, 1000.0, search="inside")
    np.testing.assert_allclose(inside.signed, [[-0.01, -0.02, -0.03, -0.04]])
    assert inside.truncated.all()


def test_crossing_within_one_sample_is_found_unless_a_sample_is_missing() -> None:
    """Each hand reaches its speed in one sample: the left one before the board moves, the right one during it."""
    left_vz, right_vz = np.zeros(1500), np.zeros(1500)
    left_vz[900:], right_vz[1100:] = -0.1, 0.1
    found = delays(one_segment(1000, 1400), TOGETHER, left_vz, right_vz, 1000.0)
    np.testing.assert_allclose(found.signed, -0.2)
    missing = left_vz.copy()
    missing[899] = np.nan
    cut = delays(one_segment(1000, 1400), TOGETHER, missing, right_vz, 1000.0)
    assert cut.truncated.all()
    assert np.isnan(cut.signed).all()


def test_record_that_begins_too_late_truncates_the_search() -> None:
    """At the first sample the left hand already has half of its peak velocity."""
    left_vz, right_vz = (vz[850:] for vz in ramps(left_from=800, right_from=1000))
    found = delays(one_segment(150, 550), TOGETHER, left_vz, right_vz, 1000.0)
    assert found.truncated.all()
    assert np.isnan(found.signed).all()


@pytest.mark.evidence("truth", contributions)
@pytest.mark.parametrize(
    ("left", "right", "cooperative"),
    [
        (-0.010, 0.010, True),
        (0.010, -0.010, True),
        (-0.010, 0.00112, True),
        (-0.010, 0.00110, False),
        (0.00112, -0.010, True),
        (-0.012, 0.0, False),
        (-0.020, -0.005, False),
        (0.001, 0.015, False),
    ],
)
def test_cooperative_movements_are_opposite_and_of_similar_size(left: float, right: float, cooperative: bool) -> None:
    hands = two_hands([(START, 0.4, left)], [(START, 0.4, right)])
    segments = board_segments(hands.omega, hands.theta, hands.rate)
    for amount in ("net", "path"):
        moved = contributions(segments, hands.left_z, hands.right_z, amount=amount)
        np.testing.assert_array_equal(moved.cooperative, [cooperative])
    found = measured(hands)
    assert np.isfinite(found.signed).all() == cooperative
    assert np.isfinite(found.left_peak).all() == cooperative


@pytest.mark.evidence("truth", contributions)
@pytest.mark.parametrize("amount", ["net", "path"])
def test_ratio_of_nine_is_still_cooperative(amount: str) -> None:
    left, right = np.array([0.0, -9, -18]), np.array([0.0, 1, 2])
    assert contributions(one_segment(0, 3), left, right, amount=amount).cooperative[0]
    assert not contributions(one_segment(0, 3), 1.01 * left, right, amount=amount).cooperative[0]


@pytest.mark.evidence("truth", contributions)
def test_reversing_movement_is_cooperative_by_path_or_by_majority() -> None:
    """The left hand goes 10 mm up; the right one 10 mm down and 9 mm back, or 4 mm down and 6 mm back."""
    left = np.linspace(0, 0.010, 1001)
    nearly_back = np.concatenate([np.linspace(0, -0.010, 600, endpoint=False), np.linspace(-0.010, -0.001, 401)])
    beyond = np.concatenate([np.linspace(0, -0.004, 600, endpoint=False), np.linspace(-0.004, 0.002, 401)])
    segment = one_segment(0, 1001)
    by_net, by_path = (contributions(segment, left, nearly_back, amount=amount) for amount in ("net", "path"))
    assert (by_net.cooperative[0], by_path.cooperative[0]) == (False, True)
    np.testing.assert_allclose((by_path.left[0], by_path.right[0]), (0.010, -0.001))
    by_net, by_most = (contributions(segment, left, beyond, opposite=opposite) for opposite in ("net", "majority"))
    assert (by_net.cooperative[0], by_most.cooperative[0]) == (False, True)


def test_peak_velocities_equal_the_minimum_jerk_closed_form() -> None:
    found = measured(opposed(0.0, 2.0))
    np.testing.assert_allclose(found.right_peak, 1.875 * 0.01 / 0.4, rtol=1e-6)
    np.testing.assert_allclose(found.left_peak, 2 * 1.875 * 0.01 / 0.4, rtol=1e-6)
    np.testing.assert_array_equal(measured(opposed(0.0, 2.0), velocity="magnitude").signed, found.signed)


def test_twitch_in_the_other_direction_counts_only_as_magnitude() -> None:
    left_vz, right_vz = ramps(left_from=1050, right_from=1050)
    right_vz[1010:1030] = -0.05
    segment = one_segment(1000, 1400)
    signed, magnitude = (
        delays(segment, TOGETHER, left_vz, right_vz, 1000.0, velocity=velocity).signed[0, 1]
        for velocity in ("own_direction", "magnitude")
    )
    assert signed == pytest.approx(0)
    assert magnitude == pytest.approx(1.070 - 1.010, abs=1e-3)


@pytest.mark.evidence("truth", delays)
def test_search_before_the_peak_ignores_an_earlier_twitch() -> None:
    """The left hand twitches 300 ms before both move together; each reaches 20 % of its peak of 0.1 m/s 20 ms later."""
    left_vz, right_vz = ramps(left_from=1350, right_from=1350)
    left_vz[1030:1060] = -0.05
    segment = one_segment(1000, 1490)
    first, last = (
        delays(segment, TOGETHER, left_vz, right_vz, 1000.0, search=search) for search in ("back", "before_peak")
    )
    assert first.signed[0, 1] == pytest.approx(-0.34, abs=1e-3)
    np.testing.assert_allclose(last.signed, 0.0, atol=1e-12)
    assert not last.truncated.any()
    early = ramps(left_from=800, right_from=1000)
    np.testing.assert_allclose(
        delays(one_segment(1000, 1400), TOGETHER, *early, 1000.0, search="before_peak").signed[0], [-0.2] * 4
    )
    late = delays(one_segment(1000, 1400), TOGETHER, *early, 1000.0, search="before_peak", search_back=0.18)
    np.testing.assert_array_equal(late.truncated, [[True, False, False, False]])


def test_portions_outside_0_to_1_are_refused() -> None:
    for portion in (0.0, 1.01, np.nan):
        with pytest.raises(ValueError, match="at most 1"):
            delays(one_segment(1000, 1400), TOGETHER, *ramps(left_from=1000, right_from=1000), 1e3, portions=(portion,))


def test_record_without_movements_has_no_delays() -> None:
    hands = two_hands([], [])
    found = measured(hands)
    assert (found.signed.shape, found.absolute.shape) == ((0, 4), (0, 4))
    assert len(measured(hands, portions=(0.5,), opposite="majority", amount="path").signed) == 0


@pytest.mark.evidence("disturbance", delays, of="holes")
def test_delay_of_a_movement_with_missing_samples_is_nan() -> None:
    hands = opposed(0.04)
    segments = board_segments(hands.omega, hands.theta, hands.rate)
    moved = contributions(segments, hands.left_z, hands.right_z)
    left_vz = hands.left_vz.copy()
    left_vz[segments.first[0] + 50] = np.nan
    assert np.isnan(delays(segments, moved, left_vz, hands.right_vz, hands.rate).signed).all()


lags, ratios, durations = st.floats(-0.1, 0.1), st.floats(0.2, 5), st.floats(0.3, 0.8)


@pytest.mark.evidence("properties", delays, of="unit")
@given(lags, ratios, durations)
def test_delay_at_own_peaks_equals_the_lag_for_any_amplitudes(lag: float, ratio: float, duration: float) -> None:
    found = measured(opposed(lag, ratio, duration), threshold="own_peak", portions=(0.2, 0.4))
    assume(len(found.signed) == 1 and np.isfinite(found.signed).all())
    np.testing.assert_allclose(found.signed, lag, atol=2e-4)


@pytest.mark.evidence("properties", delays, of="mirror")
@given(lags, ratios, st.sampled_from(["slower_side", "own_peak"]), st.sampled_from(["back", "inside"]))
def test_swapping_sides_reverses_the_sign_of_the_delay(lag: float, ratio: float, threshold: str, search: str) -> None:
    hands = opposed(lag, ratio)
    swapped = TwoHands(hands.rate, hands.times, hands.right_z, hands.left_z, hands.right_vz, hands.left_vz)
    options = {"threshold": threshold, "search": search}
    np.testing.assert_allclose(measured(swapped, **options).signed, -measured(hands, **options).signed)


@pytest.mark.evidence("properties", delays, contributions, of=("time", "constant"))
@given(lags, ratios, st.integers(1, 500), st.floats(-0.05, 0.05))
def test_delays_are_invariant_to_shifts_of_time_and_height(lag: float, ratio: float, shift: int, height: float) -> None:
    hands = opposed(lag, ratio)
    later = TwoHands(
        hands.rate,
        np.arange(hands.times.size + shift) / hands.rate,
        np.pad(hands.left_z, (shift, 0)) + height,
        np.pad(hands.right_z, (shift, 0)) + height,
        np.pad(hands.left_vz, (shift, 0)),
        np.pad(hands.right_vz, (shift, 0)),
    )
    np.testing.assert_allclose(measured(later).signed, measured(hands).signed, atol=1e-9)


@pytest.mark.evidence("properties", delays, contributions, of="rate")
@given(lags, ratios)
def test_delays_hardly_depend_on_the_sampling_rate(lag: float, ratio: float) -> None:
    coarse, fine = (measured(opposed(lag, ratio, rate=rate)).signed for rate in (500.0, 2000.0))
    assume(coarse.shape == fine.shape)
    known = np.isfinite(coarse) & np.isfinite(fine)
    np.testing.assert_allclose(coarse[known], fine[known], atol=5e-4)
