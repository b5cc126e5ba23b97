"""The contract of robot partners: each entry of the registry passes it, and so a new one does by its entry."""

from collections.abc import Callable, Iterator
from dataclasses import fields, replace
from functools import cache
from math import inf, nan
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from robot_pairs import PEOPLE, Pair
from scipy.linalg import solve_continuous_are

import rehearsed
from netboard.base.compiled import composed, kernel
from netboard.base.config import SIDES, Config, Side
from netboard.base.errors import ConfigError
from netboard.base.tick import TICK_SECONDS
from netboard.participants.body.stylus import ACTION
from netboard.participants.policy import OBSERVATION, SEEN
from netboard.participants.robots.augmented import AugmentedParameters, partner_filter
from netboard.participants.robots.board_model import (
    SEEN as VIEWED,
)
from netboard.participants.robots.board_model import (
    WATCHED,
    BoardParameters,
    X,
    board_model,
    design,
    kalman_gains,
    loop_growth,
    lqr_gains,
    seen_variance,
)
from netboard.participants.robots.game import best_response, costs_of
from netboard.participants.robots.lqg import PARTNERS, stable_latency_ms
from netboard.participants.robots.robot import HandPolicy, view_ticks
from netboard.participants.robots.sight import ball_gains
from netboard.participants.robots.steering import SteeringParameters, steering_latency_ms, steering_matrix
from netboard.participants.seat.block import Rehearsal
from netboard.participants.seat.closed_loop import is_shown
from netboard.participants.seat.partners import POLICIES, make_partner
from netboard.physics.stability.delayed_coupling import ROUNDING
from netboard.task.trials.state_machine import Phase

STEERING = sorted(name for name, target in POLICIES.items() if ".robots." in target)
ROBOTS = [*STEERING, "playback"]
SLACK = 1e-9
"""Rounding of a force [N]."""

LONG = 60_000
"""Ticks within which a pair completes two trials."""


GIVEN: dict[str, dict[str, str]] = {}
"""Parameters without which a robot cannot be made, by its name."""


@pytest.fixture(scope="module", autouse=True)
def _recorded_hand(tmp_path_factory: pytest.TempPathFactory) -> None:
    file = rehearsed.write(tmp_path_factory.mktemp("hand") / "block.mcap", rehearsed.rows())
    GIVEN["playback"] = {"file": str(file), "hand": "right"}


def robot(name: str, side: Side = "right", **options: Any) -> HandPolicy:
    config = Config()
    options = GIVEN.get(name, {}) | options
    policy = make_partner(name, replace(config, partners=replace(config.partners, **{side: options})), side)
    assert isinstance(policy, HandPolicy)
    return policy


def pair(left: str, right: str, **block: Any) -> Pair:
    """Two movers in a block, with the parameters that they need."""
    return Pair(left, right, partners={"left": GIVEN.get(left, {}), "right": GIVEN.get(right, {})}, **block)


def _decide(state: Any, constants: Any, observation: Any, actions: Any) -> None:
    raise NotImplementedError


def _decided(states: Any, constants: Any, observations: Any, actions: Any) -> None:
    _decide(states[0], constants[0], observations[0], actions)


@cache
def decided(name: str) -> Callable[..., None]:
    return composed(_decided, kernel, _decide=robot(name).decide)


def pull(action: NDArray[Any], z: float) -> float:
    """Force of a hand without its damping [N]."""
    return float(action["stiffness"] * (action["target"][2] - z) + action["force"][2])


def walks(side: Side, count: int, seed: int) -> Iterator[NDArray[Any]]:
    """Observations of a ball, a board and a hand that wander, seen from a side; both sides see mirror images."""
    rng = np.random.default_rng(seed)
    sign, place, o = (1.0 if side == "right" else -1.0), SIDES.index(side), np.zeros(1, OBSERVATION)
    o["seen"]["time"] = nan
    z = theta = p = height = 0.0
    for tick in range(count):
        z, theta, p, height = (0.999 * value + 0.002 * rng.standard_normal() for value in (z, theta, p, height))
        o["tick"], o["time"], o["start"] = tick, tick * TICK_SECONDS, tick * TICK_SECONDS
        if is_shown(np.array([9, 0]), tick):
            phase = Phase.LEVELLING if tick < 200 else Phase.RUNNING
            own = {"left": nan, "right": nan, side: height}
            o["seen"] = (tick * TICK_SECONDS, phase, z, sign * theta, sign * p, sign * 0.15, own["left"], own["right"])
        o["z"][0, place] = o["height"][0, place] = height
        o["felt"] = -0.3 + 0.1 * rng.standard_normal()
        yield o


@pytest.mark.parametrize("name", ROBOTS)
class TestRobot:
    def test_any_observation_gives_finite_actions_and_a_bounded_force(self, name: str) -> None:
        policy, rng = robot(name), np.random.default_rng(1)
        state, action, o = policy.initial((1,)), np.zeros(2, ACTION), np.zeros(1, OBSERVATION)
        odd = (nan, inf, -inf, 0.0, 1e300, -1e300, 1e-300)
        for tick in range(3000):
            o["tick"], o["time"] = tick, tick * TICK_SECONDS
            for field in SEEN.names or ():
                o["seen"][field] = rng.choice(odd) if rng.random() < 0.2 else rng.normal(0.0, 0.1)
            if rng.random() < 0.8:
                o["seen"]["time"], o["seen"]["phase"] = o["time"], rng.integers(-1, 8)
            for field in ("height", "z", "vz", "force"):
                o[field] = rng.choice(odd) if rng.random() < 0.1 else rng.normal(0.0, 0.05, (1, 2))
            o["felt"] = rng.choice(odd) if rng.random() < 0.2 else rng.normal(0.0, 1.0)
            decided(name)(state, policy.constants, o, action)
            hand, height = action[1], float(o["z"][0, 1])
            numbers = [*hand["target"], *hand["force"], hand["stiffness"], hand["damping"]]
            assert np.isfinite(numbers).all(), (tick, hand)
            assert not action[0]["stiffness"], "it moves its own hand only"
            if abs(height) < 1.0:
                assert abs(pull(hand, height)) <= policy.parameters.max_force + SLACK

    def test_recovers_from_views_that_are_not_finite(self, name: str) -> None:
        policy = robot(name)
        for spoilt in (False, True):
            state, action = policy.initial((1,)), np.zeros(2, ACTION)
            for tick, o in enumerate(walks("right", 3000, 4)):
                if spoilt and 500 <= tick < 600:
                    o["seen"]["p"] = o["seen"]["theta"] = nan
                decided(name)(state, policy.constants, o, action)
                assert np.isfinite(action["target"]).all()
        assert abs(action[1]["target"][2] - o["z"][0, 1]) > 0.0

    def test_left_and_right_are_mirror_images(self, name: str) -> None:
        done = {}
        for side in SIDES:
            policy, done[side] = robot(name, side), []
            state, action = policy.initial((1,)), np.zeros(2, ACTION)
            for o in walks(side, 3000, 2):
                decided(name)(state, policy.constants, o, action)
                done[side].append(action[SIDES.index(side)].copy())
        assert np.array(done["left"]).tobytes() == np.array(done["right"]).tobytes()
        assert np.ptp(np.array(done["left"])["target"][:, 2]) > 1e-3

    @pytest.mark.slow
    def test_same_seed_gives_the_same_bits(self, name: str) -> None:
        one, two = (pair("person", name, trials=1).run(LONG) for _ in range(2))
        assert one.tobytes() == two.tobytes()

    @pytest.mark.slow
    @pytest.mark.parametrize("fault", ["lets go", "freezes", "pushes against", "twice as strong", "late"])
    def test_survives_its_partner(self, name: str, fault: str) -> None:
        block = pair("person", name, trials=20)
        limit, worst = min(3.0, block.config.safety.max_force), [0.0]
        before = np.zeros(200, ACTION)

        def disturb(tick: int, actions: NDArray[Any], bodies: NDArray[Any]) -> None:
            person, own = actions[0], bodies[1]
            worst[0] = max(worst[0], abs(pull(actions[1], own["device"]["z"])))
            assert np.isfinite(own["stylus"]["place"]).all()
            if fault == "late":
                wanted = actions[0].copy()
                actions[0] = before[tick % 200]
                before[tick % 200] = wanted
            if tick < 2500:
                return
            if fault == "lets go":
                person["stiffness"], person["damping"], person["force"] = 0.0, 0.0, 0.0
            elif fault == "freezes":
                person["target"], person["force"] = 0.01, 0.0
            elif fault == "pushes against":
                person["force"][2] += 2.0 if tick // 700 % 2 else -2.0
            elif fault == "twice as strong":
                person["stiffness"] *= 2.0
                person["force"] *= 2.0

        rows = block.run(12_000, disturb)
        assert 0.0 < worst[0] <= limit + SLACK
        assert np.abs(rows["right_rendered"]).max() <= block.config.safety.max_force
        assert np.isfinite(rows["z"]).all()
        assert np.isfinite(rows["right_sent_z"]).all()

    def test_each_parameter_has_a_source(self, name: str) -> None:
        policy = robot(name)
        assert sorted(policy.sources) == sorted(field.name for field in fields(policy.parameters))

    def test_wrong_parameters_are_refused(self, name: str) -> None:
        with pytest.raises(ConfigError, match=r"\[partners.right\] made_up"):
            robot(name, made_up=1.0)
        with pytest.raises(ConfigError, match=r"\[partners.right\] hand_mass: found -1"):
            robot(name, hand_mass=-1.0)

    def test_hand_that_is_unstable_at_the_delay_of_its_loop_is_refused(self, name: str) -> None:
        with pytest.raises(ConfigError, match=r"stable up to a latency of \d+ ms, expected at least 80 ms|at least 60"):
            robot(name, hand_mass=0.02, hand_stiffness=5.0, hand_damping=0.1, loop_latency_ms=40.0)

    def test_parameters_are_recorded(self, name: str) -> None:
        identity = robot(name, max_force=1.5).identity
        assert identity["policy"] == robot(name).kind
        assert '"max_force": 1.5' in identity["policy_parameters"]
        assert identity["policy_sha256"] != robot(name).identity["policy_sha256"]


@pytest.mark.slow
@pytest.mark.parametrize("name", STEERING)
@pytest.mark.parametrize("force", ["full", "none"])
@pytest.mark.parametrize("partner", ["person", "still", "itself"])
def test_robot_that_steers_completes_trials_at_both_sides(name: str, partner: str, force: str) -> None:
    other = name if partner == "itself" else partner
    for left, right in ((name, other), (other, name)):
        block = Pair(left, right, force=force)
        block.run(LONG)
        assert block.state["successes"][0] == 2
        assert block.state["failures"][0] <= 1


@pytest.mark.slow
def test_pair_in_python_equals_a_rehearsal() -> None:
    pair = Pair("person", "follower", trials=1)
    rows = pair.run(LONG)
    rehearsed = np.concatenate([piece.copy() for piece in Rehearsal(pair.config, PEOPLE).pieces()])
    assert rows.tobytes() == rehearsed.tobytes()


@pytest.mark.slow
def test_shared_control_leads_a_still_partner_and_follows_an_active_one() -> None:
    roles = {}
    for partner in ("still", "person"):
        pair, seen = Pair(partner, "shared", trials=3), []

        def note(tick: int, *_: Any, pair: Pair = pair, seen: list[float] = seen) -> None:
            if pair.state["phase"][0] in (Phase.RUNNING, Phase.HOLDING):
                seen.append(float(pair.seats["right"].state["role"][0]))

        pair.run(LONG, note)
        roles[partner] = float(np.mean(seen))
    assert roles["person"] < roles["still"] - 0.1


def test_gains_of_the_ball_are_those_of_the_tracking_index() -> None:
    # Kalata (IEEE Trans. Aerosp. Electron. Syst. 20:174, 1984): the stationary filter in closed form.
    period, parameters = 0.009, robot("leader").parameters
    index = parameters.ball_noise * period**2 / parameters.sight_noise
    r = (4.0 + index - np.sqrt(8.0 * index + index**2)) / 4.0
    alpha = 1.0 - r * r
    beta = 2.0 * (2.0 - alpha) - 4.0 * np.sqrt(1.0 - alpha)
    assert ball_gains(parameters, period) == pytest.approx([alpha, beta / period], rel=1e-6)


@pytest.mark.parametrize("role", [0.5, 1.0])
def test_latency_of_leading_agrees_with_the_phase_margin(role: float) -> None:
    # The open loop, role lead (s2 + kd s + kp) / s3, is 1 in modulus at w; its phase margin over w is the latency.
    p = SteeringParameters()
    w = np.linspace(0.1, 60.0, 600_000)
    s = 1j * w
    loop = role * p.lead * (s * s + p.kd * s + p.kp) / s**3
    place = np.flatnonzero(np.abs(loop) > 1.0)[-1]
    margin = (np.angle(loop[place]) % (2.0 * np.pi) - np.pi) % (2.0 * np.pi)
    assert steering_latency_ms(p, role) == pytest.approx(1e3 * margin / w[place], abs=2.0)
    assert np.abs(np.linalg.eigvals(steering_matrix(p, role, 24))).max() < 1.0 + ROUNDING
    assert np.abs(np.linalg.eigvals(steering_matrix(p, role, 200))).max() > 1.0 + ROUNDING


def test_gains_that_do_not_steer_stably_are_refused() -> None:
    with pytest.raises(ConfigError, match=r"steers stably up to a latency of \d+ ms, expected at least 82 ms"):
        robot("leader", lead=40.0, kp=16.0, kd=8.0, max_tilt_deg=10.0, view_delay=0.03)


BOARD = BoardParameters()


@pytest.mark.parametrize("free", [False, True])
def test_gains_of_the_whole_board_are_those_of_the_riccati_equations_iterated(free: bool) -> None:
    config = Config()
    model = board_model(config, BOARD, "left", free)
    step, seen = model.watched[:, :WATCHED], np.eye(WATCHED)[list(VIEWED)]
    spread = model.noise
    for _ in range(3000):
        for _ in range(view_ticks(config)):
            spread = step @ spread @ step.T + model.noise
        gains = np.linalg.solve(seen @ spread @ seen.T + seen_variance(config, BOARD), seen @ spread).T
        spread = spread - gains @ seen @ spread
        spread = 0.5 * (spread + spread.T)
    assert kalman_gains(config, BOARD, model) == pytest.approx(gains, rel=1e-4, abs=1e-6)
    found = lqr_gains(BOARD, model, free)
    closed = model.advance - np.outer(model.command, found)
    kept = [place for name, place in X.items() if free or name not in ("p", "vp")]
    assert np.abs(np.linalg.eigvals(closed[np.ix_(kept, kept)])).max() < 1.0
    if free:  # the cost of a state under these gains is least: no other gain does better
        start = np.zeros(len(X))
        start[X["p"]] = 0.1
        costs = [cost_of(model, found * factor, start) for factor in (0.98, 1.0, 1.02)]
        assert costs[1] < min(costs[0], costs[2])


def cost_of(model: Any, gains: NDArray[Any], x: NDArray[Any]) -> float:
    """Quadratic cost of the way from a state to rest."""
    total = 0.0
    weights = {
        "p": BOARD.p_scale,
        "vp": BOARD.vp_scale,
        "z": BOARD.z_scale,
        "tilt": np.radians(BOARD.tilt_scale_deg),
    }
    for _ in range(20_000):
        speed = -gains @ x
        total += sum((x[X[name]] / scale) ** 2 for name, scale in weights.items()) + (speed / BOARD.speed_scale) ** 2
        x = model.advance @ x + model.command * speed
    return float(total)


def test_rest_of_the_whole_board_is_an_equilibrium_of_its_model() -> None:
    for free in (False, True):
        model = board_model(Config(), BOARD, "right", free)
        for given in ((1.0, 0.15, 0.0), (1.0, -0.15, 0.01)):
            x = model.rest @ np.array(given)
            moved = model.advance @ x + model.weight
            moved[X["aim"]] = x[X["aim"]]  # which fades, and is not at rest
            assert moved == pytest.approx(x, abs=1e-5)
            assert x[X["tilt"]] == 0.0


def test_filter_and_regulator_together_have_the_eigenvalues_of_both() -> None:
    # The separation principle: with views that are as late as believed, and the partner as believed.
    config = Config()
    believed = design(config, BOARD)
    model, step = believed.model, believed.model.watched[:, :WATCHED]
    controlled = np.abs(np.linalg.eigvals(model.advance - np.outer(model.command, believed.regulator)))
    seen = np.eye(WATCHED)[list(VIEWED)]
    watching = np.linalg.matrix_power(step, believed.ticks) @ (np.eye(WATCHED) - believed.gains @ seen)
    slowest = max(controlled.max() ** believed.ticks, np.abs(np.linalg.eigvals(watching)).max())
    assert loop_growth(believed, model, 0) == pytest.approx(slowest, rel=1e-6)


def test_late_views_and_too_strong_a_regulator_are_unstable() -> None:
    assert all(stable_latency_ms(Config(), BOARD, partner) >= 30 for partner in PARTNERS)
    eager = replace(BOARD, speed_scale=10.0, p_scale=0.002, vp_scale=10.0, tilt_scale_deg=90.0)
    believed = design(Config(), eager)
    assert loop_growth(believed, believed.model, 0) <= 1.0
    assert loop_growth(believed, believed.model, 100) > 1.0


def test_views_that_are_too_late_for_the_filter_of_the_board_are_refused() -> None:
    with pytest.raises(ConfigError, match=r"the LQG steers stably up to a latency of \d+ ms, expected at least 62 ms"):
        robot("lqg", view_delay=0.02)


@pytest.mark.parametrize("partner", [(0.0, 0.0), (1.0, 2.0), (4.0, 4.0)])
def test_best_response_solves_the_riccati_equation_beside_the_partner(partner: tuple[float, float]) -> None:
    l1, l2 = partner
    a, b, cost = np.array([[0.0, 1.0], [-l1, -l2]]), np.array([[0.0], [1.0]]), np.diag([16.0, 8.0])
    value = solve_continuous_are(a, b, cost, np.eye(1))
    assert best_response(l1, l2, 16.0, 8.0) == pytest.approx((b.T @ value)[0])
    assert best_response(0.0, 0.0, 16.0, 8.0) == pytest.approx((4.0, 4.0))


def test_costs_of_a_partner_are_those_to_which_its_gains_are_the_best_response() -> None:
    gains = (3.0, 2.5)
    partner = best_response(*gains, 5.0, 6.0)
    assert costs_of(*partner, *gains) == pytest.approx((5.0, 6.0))


@pytest.mark.slow
def test_follower_moves_on_a_ball_that_has_stopped() -> None:
    pair = Pair("follower", "person", trials=12)  # without the integral, trial 12 takes 47 s
    pair.run(84_000)
    assert pair.state["successes"][0] == 12


@pytest.mark.slow
def test_game_does_less_beside_a_partner_who_does_more() -> None:
    gains = {}
    for partner in ("still", "leader"):
        pair = Pair(partner, "game", trials=3)
        pair.run(LONG)
        gains[partner] = float(pair.seats["right"].state["gains"][0, 0])
    assert gains["leader"] < gains["still"]


def test_filter_of_the_partner_is_stationary_and_trusts_a_surer_partner_more() -> None:
    parameters = AugmentedParameters()
    advance, gains, variance = partner_filter(parameters, 200.0)
    noise = np.diag([0.0, 0.0, parameters.aim_sd**2 * (1.0 - advance[2, 2] ** 2)])
    error = (parameters.force_noise / 200.0) ** 2 + parameters.sight_noise**2
    after = np.diag([0.0, 0.0, parameters.aim_sd**2])
    for _ in range(5000):
        before = advance @ after @ advance.T + noise
        found = before[:, 0] / (before[0, 0] + error)
        after = before - np.outer(found, before[0])
    assert gains == pytest.approx(found, rel=1e-4)
    assert variance == pytest.approx(after[2, 2], rel=1e-4)
    weights = [float(robot("augmented", force_noise=f).constants["partner"]["weight"][0]) for f in (0.01, 0.5)]
    assert weights[0] < weights[1]
