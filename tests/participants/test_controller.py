"""The decisions of a simulated participant's controller, in one situation each."""

from dataclasses import replace

import numpy as np
import pytest
from closed_loop import decide_if_due
from hypothesis import assume, given
from hypothesis import strategies as st

from netboard.base.config import Side
from netboard.base.tables.experiment import Task
from netboard.base.tables.scene import Physics
from netboard.base.tables.simulated import Participant, VirtualDevice
from netboard.participants.people.controller import Controller, _learn_partner, learned
from netboard.participants.people.senses import Glimpse
from netboard.participants.people.submovement import Submovement

NOISELESS = Participant(
    position_noise=0.0,
    velocity_noise=0.0,
    tilt_noise_deg=0.0,
    partner_noise=0.0,
    weber_fraction=0.0,
    friction_skill=1.0,
    amplitude_cv=0.0,
    movement_cv=0.0,
    threshold_cv=0.0,
    bimanual_async=0.0,
    bimanual_amplitude_cv=0.0,
)


def make(
    sides: tuple[Side, ...], person: Participant = NOISELESS, physics: Physics | None = None, seed: int = 1
) -> Controller:
    return Controller(person, physics or Physics(), Task(), VirtualDevice(), sides, np.random.default_rng(seed))


def scene(phase: str = "running", p: float | None = -0.15, theta: float = 0.0, left: float = 0.0, right: float = 0.0):
    def shown(time: float) -> Glimpse:
        return Glimpse(time, phase, (left + right) * 0.37, theta, p, 0.15, left, right)

    return shown


def moves_of(
    controller: Controller, shown, seconds: float, first: float = 0.0, felt: float | None = None
) -> list[Submovement]:
    """Show the same scene at 120 Hz for a duration, and return the submovements of the controller."""
    moves: list[Submovement] = []
    for k in range(round(seconds * 1000)):
        now = first + k * 1e-3
        moves.extend(decide_if_due(controller, now, shown(np.floor(now * 120) / 120), felt))
    return moves


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("p", [-0.15, 0.30])
def test_controller_lowers_the_side_towards_the_target(side: Side, p: float) -> None:
    """The target is at +0.15 m: a ball to its left needs the right side down, and a ball to its right the left side."""
    first = moves_of(make((side,)), scene(p=p), 1.0)[0]
    downhill_is_right = p < 0.15
    assert (first.displacement < 0) == ((side == "right") == downhill_is_right)
    assert first.side == side


def test_one_hand_makes_half_of_the_tilt() -> None:
    first = moves_of(make(("right",)), scene(p=-0.30), 1.0)[0]
    assert first.displacement == pytest.approx(-Physics().l * np.radians(NOISELESS.max_tilt_deg), rel=1e-9)


def test_two_hands_move_in_opposite_directions() -> None:
    left, right = moves_of(make(("left", "right")), scene(), 1.0)[:2]
    assert (left.side, right.side) == ("left", "right")
    assert left.displacement == pytest.approx(-right.displacement)
    assert left.start == right.start


def test_two_hands_of_a_person_differ_in_onset_and_amplitude() -> None:
    person = replace(NOISELESS, bimanual_async=0.045, bimanual_amplitude_cv=0.2)
    onsets, ratios = [], []
    for seed in range(200):
        left, right = moves_of(make(("left", "right"), person, seed=seed), scene(p=-0.3), 0.8)[:2]
        onsets.append(left.start - right.start)
        ratios.append((abs(left.displacement) - abs(right.displacement)) / abs(left.displacement - right.displacement))
    assert np.std(onsets) == pytest.approx(0.045, rel=0.2)
    assert np.std(ratios) == pytest.approx(0.1, rel=0.2)


@pytest.mark.parametrize("phase", ["idle", "succeeded", "failed", "paused", "finished"])
def test_controller_does_not_move_outside_active_phases(phase: str) -> None:
    assert moves_of(make(("left",)), scene(phase, theta=0.1, left=0.03), 2.0) == []


def test_controller_does_not_move_while_the_ball_rests_in_the_target() -> None:
    assert moves_of(make(("left",)), scene("holding", p=0.15), 3.0) == []


def test_controller_does_nothing_without_a_view() -> None:
    controller = make(("left",))
    assert [decide_if_due(controller, 0.01 * k, None, None) for k in range(100)] == [()] * 100


@pytest.mark.slow
def test_first_movement_starts_after_the_reaction_time() -> None:
    starts = [moves_of(make(("left",), seed=seed), scene(), 1.5)[0].start for seed in range(200)]
    assert min(starts) >= NOISELESS.visual_delay
    assert np.mean(starts) == pytest.approx(NOISELESS.reaction_time, abs=0.02)


@pytest.mark.slow
def test_controller_acts_even_with_a_large_tolerance_of_the_tilt() -> None:
    """Even if a large threshold of tilt is drawn, a participant acts on a ball far from the target."""
    tolerant = replace(NOISELESS, threshold_deg=2.0, threshold_cv=2.0)
    for seed in range(100):
        assert moves_of(make(("left", "right"), tolerant, seed=seed), scene(), 2.0)


def test_movements_are_separated_by_the_refractory_period() -> None:
    starts = [m.start for m in moves_of(make(("left",), Participant()), scene(), 6.0)]
    assert len(starts) > 3
    assert min(np.diff(starts)) >= Participant().refractory - 1e-9


def test_controller_does_not_repeat_a_movement_under_way() -> None:
    """The view still shows a level board; expected are the intended tilt and the partner's share of it."""
    controller = make(("left", "right"))
    moves = moves_of(controller, scene(p=-0.3), NOISELESS.reaction_time * 2)
    assert [m.side for m in moves] == ["left", "right"]


def test_controller_levels_the_board() -> None:
    left = moves_of(make(("left",)), scene("levelling", theta=np.radians(3.0), left=-0.013, right=0.013), 0.4)
    right = moves_of(make(("right",)), scene("levelling", theta=np.radians(3.0), left=-0.013, right=0.013), 0.4)
    assert left[0].displacement == pytest.approx(0.25 * np.radians(3.0), rel=0.01)
    assert right[0].displacement == pytest.approx(-left[0].displacement)


def test_controller_returns_the_board_to_the_required_height() -> None:
    moves = moves_of(make(("left", "right")), scene("levelling", left=0.02, right=0.02), 0.4)
    assert [m.displacement for m in moves] == pytest.approx([-0.02, -0.02])


def test_controller_leaves_a_nearly_level_board_alone() -> None:
    assert moves_of(make(("left", "right")), scene("levelling", theta=np.radians(0.3)), 3.0) == []


def test_logarithm_of_the_learning_factor_decays_exponentially() -> None:
    trials = np.array([0.0, 100.0, 200.0, 1000.0, np.inf])
    levels = [learned(2.0, n, 200.0) for n in trials]
    np.testing.assert_allclose(np.log2(levels), np.exp(-trials / 200.0))
    assert {learned(1.0, n, 200.0) for n in trials} == {1.0}


def test_each_attempt_counts_as_practice() -> None:
    """The skill in an attempt follows from the number of earlier attempts."""
    person = replace(NOISELESS, novice=3.0, practice=0.0, learning_trials=2.0)
    controller = make(("left",), person)
    factors = []
    for attempt in range(4):
        for phase in ("levelling", "running"):
            moves_of(controller, scene(phase, p=0.15), 1.0, first=2.0 * attempt + (phase == "running"))
        factors.append(float(controller.state["learning_factor"][0]))
    assert factors == pytest.approx([3.0 ** np.exp(-n / 2.0) for n in range(4)])


@pytest.mark.parametrize(("felt", "understood"), [(0.1, [0.0, 1.0, 2.0]), (None, [0.0, 0.0, 0.0])])
def test_reading_of_a_force_is_learned_in_trials_with_it(felt: float | None, understood: list[float]) -> None:
    """The share that is understood in an attempt follows from the earlier attempts in which the force was felt."""
    person = replace(NOISELESS, stranger=3.0, acquaintance=0.0, felt_trials=0.0, learning_trials=2.0)
    controller = make(("left",), person)
    known, read = [], []
    for attempt in range(3):
        for phase in ("levelling", "running"):
            moves_of(controller, scene(phase, p=0.15), 1.0, 2.0 * attempt + (phase == "running"), felt)
        known.append(float(controller.state["strangeness"][0]))
        read.append(float(controller.state["reading"][0]))
    assert known == pytest.approx([3.0 ** np.exp(-n / 2.0) for n in range(3)])
    assert read == pytest.approx([1.0 - np.exp(-n / 2.0) for n in understood])


def after_movements(rate: float, share: float, movements: int) -> float:
    """Return the mirror share learned after movements that the partner mirrored by `share`."""
    controller = make(("right",), replace(NOISELESS, mirror_rate=rate))
    state, constants = controller.state[0], controller.constants[0]
    intent, seen = state["intents"][0], state["percept"]
    lift, turn = 0.002, 0.010
    for _ in range(movements):
        intent["side"], intent["displacement"], intent["turn"], intent["partner"] = 1, lift + turn, turn, 0.003
        other = 0.003 + lift - share * turn
        seen["right"], seen["theta"] = 0.02, (0.02 - other) / (2 * Physics().l)
        _learn_partner(state, constants, intent)
    return float(state["mirror"])


@pytest.mark.parametrize("share", [0.2, 0.9])
def test_partner_share_is_learned_by_the_delta_rule(share: float) -> None:
    expected = share + (NOISELESS.mirror - share) * (1 - 0.1) ** 7
    assert after_movements(0.1, share, 7) == pytest.approx(expected)
    assert after_movements(0.0, share, 7) == NOISELESS.mirror


def test_same_seed_gives_the_same_movements() -> None:
    a = moves_of(make(("left",), Participant(), seed=7), scene(), 4.0)
    assert a == moves_of(make(("left",), Participant(), seed=7), scene(), 4.0)
    assert a != moves_of(make(("left",), Participant(), seed=8), scene(), 4.0)


@pytest.mark.parametrize("physics", [Physics(g=0.0), Physics(balls=0), Physics(k_s=0.0)])
def test_degenerate_scenes_give_finite_movements(physics: Physics) -> None:
    p = -0.15 if physics.balls else None
    moves = moves_of(make(("left",), Participant(), physics), scene(p=p), 2.0, felt=-0.2)
    assert all(np.isfinite(m.displacement) for m in moves)


@given(st.floats(-0.35, 0.35), st.floats(-0.1, 0.1), st.floats(-0.02, 0.02))
def test_first_movement_is_limited_by_tilt_and_height_errors(p: float, theta: float, own: float) -> None:
    """A rotation is bounded by the seen plus the largest intended tilt, and a lift by the height error."""
    controller, shown = make(("left",)), scene(p=p, theta=theta, left=own)
    begun = [decide_if_due(controller, 0.01 * k, shown(0.01 * k), None) for k in range(60)]
    first = next(filter(None, begun), ())
    assume(first)
    reach = Physics().l * (np.radians(NOISELESS.max_tilt_deg) + abs(theta))
    height_error = abs(own + Physics().l * theta)
    assert all(abs(move.displacement) <= reach + NOISELESS.centring * height_error + 1e-12 for move in first)


@pytest.mark.parametrize("sides", [(), ("left", "left")])
def test_controller_requires_one_hand_or_two_different_hands(sides: tuple[Side, ...]) -> None:
    with pytest.raises(ValueError, match="a participant moves"):
        make(sides)
