"""The observer, compared with a textbook Kalman filter, with simulated dyads, and with the statics of the scene."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are

from evidence.physics.statics import equilibrium
from netboard.base.config import SIDES, Side
from netboard.base.tables.experiment import Task
from netboard.base.tables.scene import Physics
from netboard.base.tables.simulated import Participant, VirtualDevice
from netboard.participants.body.device_models import resolved
from netboard.participants.people.controller import Controller
from netboard.participants.people.dyad_model import STATES, DyadModel, X, dyad_model, felt_noise
from netboard.participants.people.observer import (
    OBSERVED,
    feel,
    observe,
    pack_observer,
    stationary,
    stretch_of,
    uncertainty,
)
from netboard.participants.people.senses import Glimpse
from netboard.participants.people.submovement import minimum_jerk
from netboard.physics.scene.parameters import pack_scene, parts_of

PERSON, PHYSICS, DEVICE = Participant(), Physics(), VirtualDevice()
GOAL, SIGHT = replace(PERSON, partner_model="goal"), replace(PERSON, partner_model="sight")
SCENES = {
    "paper": PHYSICS,
    "soft": Physics(k_s=1.4),
    "damped": Physics(c_h=10.0),
    "undamped": Physics(c_h=0.0),
    "without gravity": Physics(g=0.0),
    "without a ball": Physics(balls=0),
    "without a spring": Physics(k_s=0.0),
    "hinged": Physics(board="hinged"),
    "level": Physics(board="level"),
    "lagrangian": Physics(model="lagrangian", ball_inertia=0.4),
}


def model_of(person: Participant = PERSON, physics: Physics = PHYSICS, side: Side = "left") -> DyadModel:
    return dyad_model(person, physics, DEVICE, side)


@pytest.mark.parametrize("side", SIDES)
def test_model_rests_where_the_scene_has_its_equilibrium(side: Side) -> None:
    heights, p = {"left": 0.004, "right": -0.002}, 0.1
    model, other = model_of(side=side), SIDES[1 - SIDES.index(side)]
    state = model.rest @ (heights[side], heights[other], p) + model.rest_weight
    rest = equilibrium(heights["left"], heights["right"], (p,), parts_of(PHYSICS), pack_scene(PHYSICS)[0])
    assert state[[X["z"], X["theta"]]] == pytest.approx((rest.z, rest.theta), abs=2e-6)
    assert model.felt @ state == pytest.approx(-getattr(rest, side), abs=2e-4)
    after = model.advance @ state + model.weight
    moved = np.flatnonzero(np.abs(after - state) > 1e-4)
    assert {name for name, place in X.items() if place in moved} == {"vp"}, "only the ball begins to roll"


def test_felt_noise_is_a_share_of_the_load_and_the_friction_that_is_left() -> None:
    load = (0.01 + 0.05) * 9.81 * 200.0 / (400.0 + 140.0)
    only_weber = felt_noise(replace(PERSON, friction_skill=1.0), PHYSICS, resolved(DEVICE))
    assert only_weber == pytest.approx(0.1 * load)
    only_friction = felt_noise(replace(PERSON, weber_fraction=0.0), PHYSICS, resolved(DEVICE))
    assert only_friction == pytest.approx(np.std(np.linspace(-0.052, 0.052, 100_001)), rel=1e-4)


@pytest.mark.parametrize("force", [True, False])
@pytest.mark.parametrize("person", [PERSON, GOAL], ids=["position", "goal"])
def test_gains_are_those_of_the_riccati_equation(person: Participant, force: bool) -> None:
    model = model_of(person)
    sense, gains, spread = stationary(model, force)
    error = np.diag([*np.diag(model.seen_variance), model.felt_variance][: len(sense)])
    exact = solve_discrete_are(model.advance.T, sense.T, model.noise, error)
    np.testing.assert_allclose(spread, exact, atol=1e-7 * np.abs(exact).max())
    innovation = sense @ exact @ sense.T + error
    np.testing.assert_allclose(gains @ innovation, exact @ sense.T, atol=1e-7 * np.abs(exact).max())


@pytest.mark.parametrize("person", [PERSON, GOAL], ids=["position", "goal"])
@pytest.mark.parametrize("name", SCENES)
def test_filters_of_every_scene_are_finite_and_do_not_grow(name: str, person: Participant) -> None:
    one = pack_observer(person, SCENES[name], DEVICE, "left")[0]
    assert one["informed"] == 1
    assert all(np.isfinite(one[field]).all() for field in one.dtype.names or ())
    assert max(np.abs(np.linalg.eigvals(one["advance"][way])).max() for way in range(2)) < 1.0 + 1e-12


def follow_textbook(
    model: DyadModel, start: Any, seen: Any, felt: Any, lag: int, force: bool, origin: Any = 0.0
) -> np.ndarray:
    """Estimate the partner's aim at the newest force: a Kalman filter written out, begun anew at each time seen.

    ``origin``: row of what is subtracted, at the time seen.
    """
    sense, gains, before = stationary(model, force)
    x, found = start.copy(), []
    after = before - gains @ sense @ before
    for k in range(lag, len(felt)):
        old = k - lag
        if old > 0:
            x = model.advance @ x + model.weight
            y = np.array([*seen[old], felt[old]][: len(sense)])
            x = x + gains @ (y - sense @ x)
        later, spread = x, after
        for j in range(old + 1, k + 1):
            later = model.advance @ later + model.weight
            spread = model.advance @ spread @ model.advance.T + model.noise
            if force:
                gain = spread @ model.felt / (model.felt @ spread @ model.felt + model.felt_variance)
                later = later + gain * (felt[j] - model.felt @ later)
                spread = spread - np.outer(gain, model.felt @ spread)
        found.append(model.aim @ later - np.sum(origin * x))
    return np.array(found)


def simulate(model: DyadModel, steps: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Draw states of a dyad from its model, and what is seen and felt of them."""
    rng = np.random.default_rng(3)
    states = [model.rest @ (0.0, 0.0, 0.1) + model.rest_weight]
    spread = np.sqrt(np.diag(model.noise))
    for _ in range(1, steps):
        states.append(model.advance @ states[-1] + model.weight + spread * rng.standard_normal(STATES))
    everything = np.array(states)
    return everything, everything @ model.seen.T, everything @ model.felt


def watch(one: Any, seen: Any, felt: Any, commands: Any, partner: float, further: float = 0.0) -> np.ndarray:
    """Return what the kernels tell, with the view as late as it is; the commands are displacements of the aims."""
    state, told = np.zeros(1, OBSERVED)[0], []
    for k, (force, moved) in enumerate(zip(felt, commands, strict=True)):
        feel(state, one, force, 0.0, 0.0)
        state["commands"][int(state["newest"])] = moved
        p, theta, own = seen[max(k - int(one["lag"]), 0)]
        observe(state, one, p, theta, own, partner, further)
        told.append(float(state["surprise"]))
    return np.array(told)


@pytest.mark.parametrize("person", [PERSON, GOAL], ids=["position", "goal"])
def test_observer_is_a_textbook_filter_with_the_force_less_one_without(person: Participant) -> None:
    model, one = model_of(person), pack_observer(person, PHYSICS, DEVICE, "left")[0]
    lag, steps = stretch_of(person), 60
    _, seen, felt = simulate(model, steps)
    start = model.rest @ (seen[0, 2], 0.001, seen[0, 0]) + model.rest_weight
    told = [follow_textbook(model, start, seen, felt, lag, force) for force in (True, False)]
    found = watch(one, seen, felt, np.zeros((steps, 2)), 0.001)
    assert not found[:lag].any()
    np.testing.assert_allclose(found[lag:], told[0] - told[1], atol=1e-9)


def test_observer_by_sight_is_the_textbook_filter_without_force_less_what_is_expected_anyway() -> None:
    model, one = model_of(SIGHT), pack_observer(SIGHT, PHYSICS, DEVICE, "left")[0]
    lag, steps = stretch_of(SIGHT), 60
    _, seen, felt = simulate(model, steps)
    start = model.rest @ (seen[0, 2], 0.001, seen[0, 0]) + model.rest_weight
    told = follow_textbook(model, start, seen, felt, lag, force=False, origin=np.eye(STATES)[X["partner"]])
    found = watch(one, seen, felt, np.zeros((steps, 2)), 0.001, further=0.0007)
    assert not found[:lag].any()
    np.testing.assert_allclose(found[lag:], told - 0.0007, atol=1e-9)
    assert watch(one, seen, 0.0 * felt, np.zeros((steps, 2)), 0.001, further=0.0007).tobytes() == found.tobytes()


def test_commands_since_the_view_move_both_estimates_alike() -> None:
    """Commands alone, of which nothing is unforeseen, tell nothing."""
    model, one = model_of(), pack_observer(PERSON, PHYSICS, DEVICE, "left")[0]
    state = model.rest @ (0.0, 0.0, 0.0) + model.rest_weight
    states, commands = [state], np.zeros((80, 2))
    commands[20:40] = 0.0005, -0.0003
    for k in range(1, 80):
        states.append(model.advance @ states[-1] + model.commands @ commands[k] + model.weight)
    run = np.array(states)
    told = watch(one, run @ model.seen.T, run @ model.felt, commands, 0.0)
    assert np.abs(told).max() < 1e-9
    assert np.abs(watch(one, run @ model.seen.T, run @ model.felt, 0.0 * commands, 0.0)).max() > 1e-4


def test_estimate_has_the_error_that_its_covariance_says_and_the_force_reduces_it() -> None:
    model, lag = model_of(), stretch_of(PERSON)
    states, seen, felt = simulate(model, 6000)
    truth = (states @ model.aim)[lag:]
    errors = {}
    for force in (True, False):
        errors[force] = np.std((follow_textbook(model, states[0], seen, felt, lag, force) - truth)[500:])
        assert errors[force] == pytest.approx(uncertainty(PERSON, PHYSICS, DEVICE, force), rel=0.1)
    assert errors[True] < 0.75 * errors[False]


def information(physics: Physics, person: Participant = PERSON) -> float:
    """Return the share of a lasting displacement of the partner's aim that the force tells within the stretch [1]."""
    one = pack_observer(person, physics, DEVICE, "left")[0]
    model = model_of(person, physics)
    state, told = np.zeros(STATES), 0.0
    state[X["partner_aim"]] = 1.0
    for step in range(int(one["lag"])):
        state = model.advance @ state
        told += float(one["answer_forces"][step] * (model.felt @ state))
    return told


def test_information_rises_with_the_stiffness_that_carries_it() -> None:
    by_spring = [information(Physics(k_s=k)) for k in (1.4, 14.0, 35.0, 140.0, 560.0)]
    by_coupling = [information(Physics(k_h=k)) for k in (5.0, 25.0, 100.0, 400.0)]
    assert np.all(np.diff(by_spring) > 0.0)
    assert np.all(np.diff(by_coupling) > 0.0)
    assert by_spring[0] < 0.05
    assert by_spring[3] > 0.3


def test_information_falls_with_the_noise_of_the_force() -> None:
    by_noise = [information(PHYSICS, replace(PERSON, weber_fraction=w)) for w in (0.01, 0.1, 0.5)]
    assert np.all(np.diff(by_noise) < 0.0)


@pytest.mark.parametrize(
    ("person", "physics"),
    [
        (replace(PERSON, partner_model="mechanics"), PHYSICS),
        (PERSON, Physics(k_h=0.0)),
        (PERSON, Physics(coupling="left")),
    ],
)
def test_force_that_tells_nothing_of_the_partner_is_not_observed(person: Participant, physics: Physics) -> None:
    assert pack_observer(person, physics, DEVICE, "left")[0]["informed"] == 0


@pytest.mark.parametrize("partner_model", ["position", "goal", "mechanics", "sight"])
def test_partner_movement_is_felt_before_it_is_seen(partner_model: Any) -> None:
    """The left partner rises by 10 mm at 1 s: told before it is seen, and no longer once it has been seen."""
    watching = replace(
        PERSON, kp=0.0, kd=0.0, max_tilt_deg=40.0, threshold_deg=40.0, threshold_cv=0.0, centring=0.0, novice=1.0
    )
    quiet = replace(watching, position_noise=1e-5, tilt_noise_deg=0.01, weber_fraction=0.01, friction_skill=0.95)
    person = replace(quiet, partner_noise=0.037, amplitude_cv=0.006, partner_model=partner_model)
    controller = Controller(person, PHYSICS, Task(), DEVICE, ("right",), np.random.default_rng(1))
    parts, scene, ball, speed, told, dt = parts_of(PHYSICS), pack_scene(PHYSICS)[0], 0.0, 0.0, [], 0.010
    for k in range(200):
        now = k * dt
        rest = equilibrium(0.010 * minimum_jerk((now - 1.0) / 0.3), 0.0, (ball,), parts, scene)
        glimpse = Glimpse(now, "running", rest.z, rest.theta, ball, 0.15, None, 0.0)
        assert controller.decide(now, glimpse, -rest.right) == ()
        told.append(float(controller.state["observed"]["surprise"][0]))
        speed -= PHYSICS.g * np.sin(rest.theta) * dt
        ball += speed * dt
    before, moving, seen = np.array(told[:105]), np.array(told[110:135]), np.array(told[170:])
    if partner_model == "mechanics":
        assert not np.any(told)
    elif partner_model == "sight":
        assert abs(np.mean(told[100:118])) < 5e-4, "nothing before it is seen"
        assert np.mean(told[126:138]) > 2.5e-3, "then where it leads, ahead of where it is"
        assert abs(np.mean(told[170:])) < 5e-4, "nothing once it has been seen"
    else:
        assert moving.max() > 0.006, "more than half of it is told"
        assert np.abs(before).max() < 0.4 * moving.max()
        assert np.abs(seen).max() < 0.4 * moving.max()
