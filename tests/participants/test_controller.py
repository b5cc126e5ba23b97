"""The controller's decisions, one situation at a time."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from netboard.base.config import Side
from netboard.base.tables.experiment import Task
from netboard.base.tables.scene import Physics
from netboard.base.tables.simulated import Participant
from netboard.participants.controller import Controller, _learn_partner, learned
from netboard.participants.senses import Glimpse
from netboard.participants.submovement import Submovement

CALM = Participant(
    position_noise=0.0,
    velocity_noise=0.0,
    tilt_noise_deg=0.0,
    partner_noise=0.0,
    haptic_noise=0.0,
    amplitude_cv=0.0,
    movement_cv=0.0,
    threshold_cv=0.0,
    bimanual_async=0.0,
    bimanual_amplitude_cv=0.0,
)


def make(
    sides: tuple[Side, ...], person: Participant = CALM, physics: Physics | None = None, seed: int = 1
) -> Controller:
    return Controller(person, physics or Physics(), Task(), sides, np.random.default_rng(seed))


def scene(phase: str = "running", p: float | None = -0.15, theta: float = 0.0, left: float = 0.0, right: float = 0.0):
    def shown(time: float) -> Glimpse:
        return Glimpse(time, phase, (left + right) * 0.37, theta, p, 0.15, left, right)

    return shown


def moves_of(
    controller: Controller, shown, seconds: float, first: float = 0.0, felt: float | None = None
) -> list[Submovement]:
    """Show the same scene for a while, 120 times a second, and collect what the controller does."""
    moves: list[Submovement] = []
    for k in range(round(seconds * 1000)):
        now = first + k * 1e-3
        moves.extend(controller.step(now, shown(np.floor(now * 120) / 120), felt))
    return moves


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("p", [-0.15, 0.30])
def test_it_lowers_the_side_the_ball_shall_roll_to(side: Side, p: float) -> None:
    """The target is at +0.15 m: a ball left of it needs the right side down, one right of it the left side."""
    first = moves_of(make((side,)), scene(p=p), 1.0)[0]
    downhill_is_right = p < 0.15
    assert (first.displacement < 0) == ((side == "right") == downhill_is_right)
    assert first.side == side


def test_half_of_the_turn_is_the_own_hand_s() -> None:
    first = moves_of(make(("right",)), scene(p=-0.30), 1.0)[0]
    assert first.displacement == pytest.approx(-Physics().l * np.radians(CALM.max_tilt_deg), rel=1e-9)


def test_two_hands_move_against_each_other() -> None:
    left, right = moves_of(make(("left", "right")), scene(), 1.0)[:2]
    assert (left.side, right.side) == ("left", "right")
    assert left.displacement == pytest.approx(-right.displacement)
    assert left.start == right.start


def test_one_person_s_hands_differ_in_onset_and_amplitude() -> None:
    person = replace(CALM, bimanual_async=0.045, bimanual_amplitude_cv=0.2)
    onsets, ratios = [], []
    for seed in range(200):
        left, right = moves_of(make(("left", "right"), person, seed=seed), scene(p=-0.3), 0.8)[:2]
        onsets.append(left.start - right.start)
        ratios.append((abs(left.displacement) - abs(right.displacement)) / abs(left.displacement - right.displacement))
    assert np.std(onsets) == pytest.approx(0.045, rel=0.2)
    assert np.std(ratios) == pytest.approx(0.1, rel=0.2)


@pytest.mark.parametrize("phase", ["idle", "succeeded", "failed", "paused", "finished"])
def test_it_keeps_still_when_there_is_nothing_to_do(phase: str) -> None:
    assert moves_of(make(("left",)), scene(phase, theta=0.1, left=0.03), 2.0) == []


def test_it_keeps_still_while_the_ball_rests_in_the_target() -> None:
    assert moves_of(make(("left",)), scene("holding", p=0.15), 3.0) == []


def test_it_does_nothing_blind() -> None:
    controller = make(("left",))
    assert [controller.step(0.01 * k, None, None) for k in range(100)] == [()] * 100


@pytest.mark.slow
def test_the_first_movement_takes_a_reaction_time() -> None:
    starts = [moves_of(make(("left",), seed=seed), scene(), 1.5)[0].start for seed in range(200)]
    assert min(starts) >= CALM.visual_delay
    assert np.mean(starts) == pytest.approx(CALM.reaction_time, abs=0.02)


@pytest.mark.slow
def test_nobody_waits_for_ever() -> None:
    """However unlucky a person is with the tilt that is put up with, a ball far from the target is not just watched."""
    unlucky = replace(CALM, threshold_deg=2.0, threshold_cv=2.0)
    for seed in range(100):
        assert moves_of(make(("left", "right"), unlucky, seed=seed), scene(), 2.0)


def test_movements_keep_their_distance() -> None:
    starts = [m.start for m in moves_of(make(("left",), Participant()), scene(), 6.0)]
    assert len(starts) > 3
    assert min(np.diff(starts)) >= Participant().refractory - 1e-9


def test_it_does_not_repeat_what_is_under_way() -> None:
    """Seen is still the level board; expected is the tilt asked for, and the partner's share of it."""
    controller = make(("left", "right"))
    moves = moves_of(controller, scene(p=-0.3), CALM.reaction_time * 2)
    assert [m.side for m in moves] == ["left", "right"]


def test_it_levels_the_board() -> None:
    left = moves_of(make(("left",)), scene("levelling", theta=np.radians(3.0), left=-0.013, right=0.013), 0.4)
    right = moves_of(make(("right",)), scene("levelling", theta=np.radians(3.0), left=-0.013, right=0.013), 0.4)
    assert left[0].displacement == pytest.approx(0.25 * np.radians(3.0), rel=0.01)
    assert right[0].displacement == pytest.approx(-left[0].displacement)


def test_it_brings_the_board_to_the_height_asked_for() -> None:
    moves = moves_of(make(("left", "right")), scene("levelling", left=0.02, right=0.02), 0.4)
    assert [m.displacement for m in moves] == pytest.approx([-0.02, -0.02])


def test_a_level_board_is_left_alone() -> None:
    assert moves_of(make(("left", "right")), scene("levelling", theta=np.radians(0.3)), 3.0) == []


def test_a_partner_who_has_acted_is_felt_before_he_is_seen() -> None:
    """The force says that the partner has turned the board as far as is wanted, so nothing is left to do."""
    person = replace(CALM, haptic_gain=1.0, max_tilt_deg=1.5)
    physics, p = Physics(), -0.30
    partner = 2 * physics.l * np.radians(1.5)
    weight = (physics.M + physics.m) * physics.g
    z = (physics.k_h * partner - weight) / (2 * physics.k_h + physics.k_s)
    on_board = (weight + physics.k_s * z) / 2 + physics.m * physics.g * p / (2 * physics.l)
    assert moves_of(make(("right",), person), scene(p=p), 1.0)
    assert moves_of(make(("right",), person), scene(p=p), 1.0, felt=-on_board) == []


def test_learning_is_exponential_in_the_logarithm() -> None:
    trials = np.array([0.0, 100.0, 200.0, 1000.0, np.inf])
    levels = [learned(2.0, n, 200.0) for n in trials]
    np.testing.assert_allclose(np.log2(levels), np.exp(-trials / 200.0))
    assert {learned(1.0, n, 200.0) for n in trials} == {1.0}


def test_each_attempt_is_practice() -> None:
    """The skill of an attempt is that of the attempts before it."""
    person = replace(CALM, novice=3.0, practice=0.0, learning_trials=2.0)
    controller = make(("left",), person)
    factors = []
    for attempt in range(4):
        for phase in ("levelling", "running"):
            moves_of(controller, scene(phase, p=0.15), 1.0, first=2.0 * attempt + (phase == "running"))
        factors.append(float(controller.state["learning_factor"][0]))
    assert factors == pytest.approx([3.0 ** np.exp(-n / 2.0) for n in range(4)])


def after_movements(rate: float, share: float, movements: int) -> float:
    """Return the expected share after movements that the partner mirrored by another share."""
    controller = make(("right",), replace(CALM, mirror_rate=rate))
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
def test_what_the_partner_does_is_learned_by_the_delta_rule(share: float) -> None:
    expected = share + (CALM.mirror - share) * (1 - 0.1) ** 7
    assert after_movements(0.1, share, 7) == pytest.approx(expected)
    assert after_movements(0.0, share, 7) == CALM.mirror


def test_the_same_seed_gives_the_same_person() -> None:
    a = moves_of(make(("left",), Participant(), seed=7), scene(), 4.0)
    assert a == moves_of(make(("left",), Participant(), seed=7), scene(), 4.0)
    assert a != moves_of(make(("left",), Participant(), seed=8), scene(), 4.0)


@pytest.mark.parametrize("physics", [Physics(g=0.0), Physics(balls=0), Physics(k_s=0.0)])
def test_odd_scenes_do_no_harm(physics: Physics) -> None:
    p = -0.15 if physics.balls else None
    moves = moves_of(make(("left",), Participant(), physics), scene(p=p), 2.0, felt=-0.2)
    assert all(np.isfinite(m.displacement) for m in moves)


@given(st.floats(-0.35, 0.35), st.floats(-0.1, 0.1), st.floats(-0.02, 0.02))
def test_first_movement_is_no_larger_than_tilt_and_height_require(p: float, theta: float, own: float) -> None:
    """A turn never exceeds what the seen and the largest wanted tilt ask for, nor a lift the height that is off."""
    controller, shown = make(("left",)), scene(p=p, theta=theta, left=own)
    begun = [controller.step(0.01 * k, shown(0.01 * k), None) for k in range(60)]
    first = next(filter(None, begun), ())
    assume(first)
    reach = Physics().l * (np.radians(CALM.max_tilt_deg) + abs(theta))
    off = abs(own + Physics().l * theta)
    assert all(abs(move.displacement) <= reach + CALM.centring * off + 1e-12 for move in first)


@pytest.mark.parametrize("sides", [(), ("left", "left")])
def test_a_person_has_one_hand_or_two_different_ones(sides: tuple[Side, ...]) -> None:
    with pytest.raises(ValueError, match="a participant moves"):
        make(sides)
