"""Controller of a simulated participant: an intermittent, predictive, delayed PD controller of the ball.

Wanted tilt ``theta* = clip((kp (p - target) + kd v) / g, +- max_tilt)`` with the predicted ball ``p'' = -g theta``;
expected tilt ``theta + sum of the remaining displacements of the right hand less those of the left / (2 l)``; the
participant acts where they differ by more than a threshold. Tilt is positive when the right end is up.

Every 10 ms the controller takes the ball as it was one visual delay ago, extrapolates it, and computes the tilt that
would bring it to rest in the target. It acts only if the expected tilt differs from this by more than a threshold and
the refractory time has passed. The action is one ballistic submovement of each own hand, which tilts the board and
moves it towards its neutral height. With one hand, the controller expects the partner to mirror most of its tilting and
to share its lifting, unless the force on its hand shows otherwise. In a bimanual block it moves both hands.

Each part can be switched off by a parameter: ``partner_model = "mechanics"`` (force tells nothing), ``mirror_rate = 0``
(the partner's share is not learned), ``novice = 1`` (no learning over trials), ``stranger = 1`` (the partner is known
from the start) and ``reading = 1`` (so is what the force tells).

`decide` is the controller as one kernel over records; `Controller` runs it for one live participant.

Rule 1: the inputs are a `Glimpse`, the force on its own hand, and the constants of the scene; nothing else.
Rule 2: time is an argument, and the state of the random numbers is part of its own, so that results are reproducible.
"""

from dataclasses import fields, replace
from math import exp, inf, isnan, log1p, nan, radians, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.compiled import Records, inlined, kernel, machine_code
from netboard.base.config import SIDES, Side
from netboard.base.tables.experiment import Task
from netboard.base.tables.scene import Physics
from netboard.base.tables.simulated import Participant, VirtualDevice
from netboard.participants.body.device_models import resolved
from netboard.participants.people.dyad_model import felt_noise
from netboard.participants.people.expectations import (
    BOTH,
    INTENT,
    INTENTS,
    board_height,
    commanded_share,
    delay_to_hand,
    expected_tilt,
    observe_partner,
    of_partner,
    partner_height_seen,
    shares_done,
)
from netboard.participants.people.muscles import CAPACITY
from netboard.participants.people.observer import OBSERVED, OBSERVER, pack_observer
from netboard.participants.people.senses import (
    PERCEPT,
    SENSES,
    Glimpse,
    ou_factors,
    perceive,
    store,
    write_glimpse,
)
from netboard.participants.people.submovement import Submovement
from netboard.participants.policy import SEEN
from netboard.physics.arithmetic.random_numbers import STREAM, coin, normal, pack_stream
from netboard.physics.arithmetic.simd import gathered, lane
from netboard.task.trials.state_machine import Phase, is_free

_LEVELLING = int(Phase.LEVELLING)

FORESIGHT_STEPS = 6
"""Number of integration steps of the ball's prediction [1]."""

_MIDDLES = tuple(step + 0.5 for step in range(FORESIGHT_STEPS))

CONSTANTS = np.dtype(
    [
        *((field.name, "<f8") for field in fields(Participant)),
        ("g", "<f8"),  # gravity [m/s2]
        ("l", "<f8"),  # control point to the board's centre [m]
        ("level_angle", "<f8"),  # tilt and height within which the board counts as level [rad, m]
        ("level_height", "<f8"),
        ("hands", "<i8"),  # 1: left, 2: right, 3: both
        ("felt_noise", "<f8"),  # standard deviation of a perceived force [N]
        ("observer", OBSERVER),
    ]
)
"""Constants of a participant: its own, and what it knows of scene and task."""

MOVE = np.dtype([("side", "<i8"), ("start", "<f8"), ("duration", "<f8"), ("displacement", "<f8")])
"""A new submovement [s, s, m]."""

STATE = np.dtype(
    [
        ("senses", SENSES),
        ("percept", PERCEPT),
        ("intents", INTENT, (INTENTS,)),
        ("intent_count", "<i8"),
        ("observed", OBSERVED),
        ("moved", "<f8"),  # own displacement by the submovements that are complete [m]
        ("mirrored", "<f8"),  # displacement of the partner expected of them [m]
        ("decision_time", "<f8"),  # time of the last decision [s]
        ("ready", "<f8"),  # earliest time of the next action [s]
        ("threshold", "<f8"),  # tilt error that triggers the next submovement [rad]
        ("phase", "<f8"),  # phase seen at the last decision
        ("mirror", "<f8"),  # share of own tilting that the partner is expected to mirror [1]
        ("practice", "<f8"),  # attempts done [1]
        ("random", STREAM),  # its random numbers
        ("learning_factor", "<f8"),  # of noise, threshold and reaction time; 1: trained [1]
        ("acquaintance", "<f8"),  # dyadic attempts done [1]
        ("strangeness", "<f8"),  # factor of the uncertainty about the partner; 1: known [1]
        ("felt_trials", "<f8"),  # of these with a force that tells of the partner [1]
        ("reading", "<f8"),  # share of what the force tells that is understood [1]
    ]
)
"""State of a controller."""


_WORDS = {"plan": inf}
"""How a word in place of a number is packed: without a plan, all is learned; other words are not used as numbers."""


def pack_constants(
    person: Participant, physics: Physics, task: Task, virtual: VirtualDevice, sides: tuple[Side, ...]
) -> NDArray[Any]:
    """Return the constants of a participant, packed for the kernels: ndarray of CONSTANTS, shape (1,) [SI]."""
    if not sides or len(set(sides)) != len(sides):
        raise ValueError(f"a participant moves one hand or two different ones, not {sides}")
    packed = np.zeros(1, CONSTANTS)
    for field in fields(Participant):
        value = getattr(person, field.name)
        packed[field.name] = _WORDS.get(value, nan) if isinstance(value, str) else value
    packed["g"], packed["l"] = physics.g, physics.l
    packed["level_angle"], packed["level_height"] = radians(task.level_angle_deg), task.level_height
    packed["hands"] = sum(1 << SIDES.index(side) for side in sides)
    packed["felt_noise"] = felt_noise(person, physics, resolved(virtual))
    if len(sides) == 1:
        packed["observer"] = pack_observer(
            replace(person, practice="plan", acquaintance="plan", felt_trials="plan"), physics, virtual, sides[0]
        )
    return packed


def initial_state(constants: NDArray[Any], rng: np.random.Generator) -> NDArray[Any]:
    """Return the state of a participant at the start: ndarray of STATE, shape (1,) [SI].

    Parameters
    ----------
    constants : ndarray of CONSTANTS, shape (1,)
        Its constants, from `pack_constants`.
    """
    state = np.zeros(1, STATE)
    state["random"] = pack_stream(rng)
    machine_code(_initialise, state, constants)(state, constants)
    return state


@kernel
def _initialise(states: Records, constants: Records) -> None:
    """Begin: draw the first noises and the first threshold."""
    state, k = states[0], constants[0]
    senses = state["senses"]
    state["mirror"], state["practice"] = k["mirror"], k["practice"]
    factor = state["learning_factor"] = learned(k["novice"], k["practice"], k["learning_trials"])
    state["acquaintance"], state["felt_trials"] = k["acquaintance"], k["felt_trials"]
    _know_partner(state, k)
    senses["noise_p"] = factor * k["position_noise"] * normal(state["random"])
    senses["noise_v"] = factor * k["velocity_noise"] * normal(state["random"])
    senses["noise_theta"] = factor * radians(k["tilt_noise_deg"]) * normal(state["random"])
    state["observed"]["noise"] = factor * k["felt_noise"] * normal(state["random"])
    state["decision_time"] = state["ready"] = -inf
    state["threshold"] = _draw_threshold(state, k)


@kernel
def learned(novice: float, practice: float, trials: float) -> float:
    """Return the learning factor ``novice ** exp(-practice / trials)``, from `novice` down to 1 [1].

    The logarithm of the level decays exponentially with the number of trials, as in Heathcote, Brown and Mewhort
    (Psychon. Bull. Rev. 7:185, 2000), who find exponential rather than power laws in individual learners.

    Parameters
    ----------
    novice : float
        Factor before the first trial [1].
    practice : float
        Number of trials done [1].
    trials : float
        Trials over which the logarithm falls to 1/e [1].
    """
    return float(novice ** exp(-practice / trials))


@kernel
def decide(state: np.void, k: np.void, now: float, glimpse: np.void, felt: float, moves: NDArray[Any]) -> int:
    """Take in display and force; return the number of new submovements, 0 most of the time [1].

    The caller keeps the interval `DECISION_INTERVAL` between two calls.

    Parameters
    ----------
    moves : ndarray of MOVE, shape (2,)
        New submovements, written.
    """
    dt = min(now - state["decision_time"], 1.0)
    state["decision_time"] = now
    senses, seen = state["senses"], state["percept"]
    store(senses, now, glimpse, felt)
    _renew_noise(state, k, dt)
    if not perceive(senses, now - k["visual_delay"], k["velocity_span"], seen):
        return 0
    _detect_release(state, k, felt)
    _drop_completed(state, k, seen["time"] - delay_to_hand(k))
    if k["observer"]["informed"] or k["observer"]["sight"]:
        observe_partner(state, k, now)
    if now < state["ready"] or not _has_room(state):
        return 0
    if seen["phase"] == _LEVELLING:
        return _level(state, k, now, moves)
    if is_free(seen["phase"]):
        return _steer(state, k, now, moves)
    return 0


@inlined
def _renew_noise(state: np.void, k: np.void, dt: float) -> None:
    """Renew the errors of perception: coloured Gaussian noise (Ornstein-Uhlenbeck)."""
    senses, random, factor = state["senses"], state["random"], state["learning_factor"]
    keep, fresh = ou_factors(k["noise_time"], dt)
    state["observed"]["noise"] = keep * state["observed"]["noise"] + factor * k["felt_noise"] * fresh * normal(random)
    senses["noise_p"] = keep * senses["noise_p"] + factor * k["position_noise"] * fresh * normal(random)
    senses["noise_v"] = keep * senses["noise_v"] + factor * k["velocity_noise"] * fresh * normal(random)
    tilt_noise = factor * radians(k["tilt_noise_deg"])
    senses["noise_theta"] = keep * senses["noise_theta"] + tilt_noise * fresh * normal(random)


@inlined
def _has_room(state: np.void) -> bool:
    """Return whether each hand can begin another submovement."""
    count, right = state["intent_count"], 0
    for i in range(count):
        right += state["intents"][i]["side"]
    return bool(max(right, count - right) < CAPACITY)


@inlined
def _detect_release(state: np.void, k: np.void, felt: float) -> None:
    """Once the release of the ball is seen, count the attempt and wait for a reaction time."""
    phase = state["percept"]["phase"]
    if is_free(phase) and not is_free(state["phase"]):
        state["learning_factor"] = learned(k["novice"], state["practice"], k["learning_trials"])
        _know_partner(state, k)
        state["practice"] += 1.0
        state["acquaintance"] += 1.0
        state["felt_trials"] += 0.0 if isnan(felt) else k["observer"]["informed"]
        reaction = (
            state["learning_factor"] * k["reaction_time"] * max(0.0, 1.0 + k["reaction_cv"] * normal(state["random"]))
        )
        state["ready"] = state["percept"]["time"] + reaction
    state["phase"] = phase


@inlined
def _know_partner(state: np.void, k: np.void) -> None:
    """Set how uncertain the partner is, and how much of what the force tells is understood, by the trials together."""
    state["strangeness"] = learned(k["stranger"], state["acquaintance"], k["learning_trials"])
    unread = 0.0 if k["observer"]["sight"] else 1.0 - k["reading"]
    state["reading"] = 1.0 - unread * exp(-state["felt_trials"] / k["learning_trials"])


@inlined
def _drop_completed(state: np.void, k: np.void, shown: float) -> None:
    """Forget the intents whose whole effect has been seen, and learn from the partner's movement during each."""
    intents, kept = state["intents"], 0
    for i in range(state["intent_count"]):
        intent = intents[i]
        share = commanded_share(intent, shown)
        if share < 1.0:
            if kept < i:
                to = intents[kept]
                to["side"], to["start"], to["duration"] = intent["side"], intent["start"], intent["duration"]
                to["displacement"], to["turn"] = intent["displacement"], intent["turn"]
                to["mirrored"], to["partner"] = intent["mirrored"], intent["partner"]
            intents[kept]["shown"] = share
            kept += 1
            continue
        state["moved"] += intent["displacement"]
        state["mirrored"] += of_partner(intent)
        if k["hands"] != BOTH and is_free(state["percept"]["phase"]):
            _learn_partner(state, k, intent)
    state["intent_count"] = kept


@inlined
def _learn_partner(state: np.void, k: np.void, intent: np.void) -> None:
    """Correct the share that the partner is expected to mirror, by what it did during an own movement (delta rule).

    The partner is expected to lift the board as far as oneself, and to mirror a share of the turn.
    """
    rise = partner_height_seen(state, k, intent["side"]) - intent["partner"]
    if isnan(rise) or intent["turn"] == 0.0:
        return
    share = (intent["displacement"] - intent["turn"] - rise) / intent["turn"]
    mirror = state["mirror"] + k["mirror_rate"] * (share - state["mirror"])
    state["mirror"] = min(max(mirror, 0.0), 1.0)


@inlined
def _draw_threshold(state: np.void, k: np.void) -> float:
    """Draw the tilt error that triggers the next submovement: log-normal, limited by `threshold_limit` [rad]."""
    spread = sqrt(log1p(k["threshold_cv"] ** 2))
    drawn = state["learning_factor"] * k["threshold_deg"] * exp(spread * normal(state["random"]))
    return radians(min(drawn, k["threshold_limit"] * k["max_tilt_deg"]))


@inlined
def _steer(state: np.void, k: np.void, now: float, moves: NDArray[Any]) -> int:
    """Write the submovements that steer the ball; none if the tilt error is below the threshold."""
    expected = expected_tilt(state, k)
    error = _wanted_tilt(state, k, expected) - expected
    if abs(error) <= state["threshold"]:
        return 0
    lift = -k["centring"] * board_height(state, k)
    return _act(state, k, now, error, lift, moves)


@inlined
def _wanted_tilt(state: np.void, k: np.void, expected: float) -> float:
    """Return the tilt that takes the predicted ball to the target: the PD law [rad]."""
    if k["g"] == 0.0:
        return 0.0
    ball, speed = _predict_ball(state, k, expected)
    most = radians(k["max_tilt_deg"])
    wanted = (k["kp"] * (ball - state["percept"]["target"]) + k["kd"] * speed) / k["g"]
    return float(min(max(wanted, -most), most))


@inlined
def _predict_ball(state: np.void, k: np.void, expected: float) -> tuple[float, float]:
    """Predict the ball `lookahead` visual delays after it was seen, without new actions [m, m/s]."""
    seen = state["percept"]
    dt = k["lookahead"] * k["visual_delay"] / FORESIGHT_STEPS
    ball, speed = seen["p"], seen["v"]
    shares = shares_done(state, k, seen["time"] + gathered(_MIDDLES, FORESIGHT_STEPS) * dt)
    pulls = -k["g"] * (seen["theta"] + shares * (expected - seen["theta"]))
    for step in range(FORESIGHT_STEPS):
        pull = lane(pulls, step)
        ball += speed * dt + pull * dt * dt / 2.0
        speed += pull * dt
    return ball, speed


@inlined
def _level(state: np.void, k: np.void, now: float, moves: NDArray[Any]) -> int:
    """Write the submovements that level the board at its neutral height; none if it is level."""
    error, height = -expected_tilt(state, k), board_height(state, k)
    tilted, off = abs(error) > k["level_margin"] * k["level_angle"], abs(height) > k["level_margin"] * k["level_height"]
    if not tilted and not off:
        return 0
    count = _act(state, k, now, error if tilted else 0.0, -height if off else 0.0, moves)
    state["ready"] = now + moves[count - 1]["duration"] + delay_to_hand(k) + k["visual_delay"]
    return count


@kernel
def _act(state: np.void, k: np.void, now: float, turn: float, lift: float, moves: NDArray[Any]) -> int:
    """Write one submovement of each own hand that tilts and lifts the board [rad, m]; return how many."""
    state["threshold"] = _draw_threshold(state, k)
    duration = k["movement_time"] * exp(k["movement_cv"] * normal(state["random"]))
    scale = 1.0 + state["learning_factor"] * k["amplitude_cv"] * normal(state["random"])
    wait = uneven = 0.0
    late = -1
    if k["hands"] == BOTH:
        late = coin(state["random"])
        wait = abs(k["bimanual_async"] * normal(state["random"]))
        uneven = k["bimanual_amplitude_cv"] / 2.0 * normal(state["random"])
    partner_error = min(max(state["strangeness"] * k["partner_noise"] * normal(state["random"]), -1.0), 1.0)
    count = 0
    for side in range(2):
        if not k["hands"] & (1 << side):
            continue
        sign = 2.0 * side - 1.0
        share = sign * k["l"] * turn
        start = now + (wait if side == late else 0.0)
        if state["intent_count"] == INTENTS:
            raise ValueError("a simulated participant has too many submovements under way")
        intent = state["intents"][state["intent_count"]]
        intent["side"], intent["start"], intent["duration"] = side, start, duration
        intent["displacement"], intent["turn"] = share + lift, share
        intent["mirrored"] = state["mirror"] * share * (1.0 + partner_error)
        intent["partner"] = partner_height_seen(state, k, side)
        state["intent_count"] += 1
        move = moves[count]
        move["side"], move["start"], move["duration"] = side, start, duration
        move["displacement"] = (share + lift) * scale * (1.0 + sign * uneven)
        count += 1
    state["ready"] = now + k["refractory"]
    return count


@kernel
def _decide(states: Records, constants: Records, now: float, shown: Records, felt: float, moves: NDArray[Any]) -> int:
    """Run `decide` for arrays of one record, which Python hands over much faster than records."""
    return decide(states[0], constants[0], now, shown[0], felt, moves)


class Controller:
    """Controller of one simulated participant."""

    def __init__(
        self,
        person: Participant,
        physics: Physics,
        task: Task,
        virtual: VirtualDevice,
        sides: tuple[Side, ...],
        rng: np.random.Generator,
    ) -> None:
        self.constants = pack_constants(person, physics, task, virtual, sides)
        self.state = initial_state(self.constants, rng)
        self._glimpse = np.zeros(1, SEEN)
        self._moves = np.zeros(2, MOVE)
        # The look-up of the kernel by the types of its arguments would take longer than a decision.
        self._decide = machine_code(_decide, self.state, self.constants, 0.0, self._glimpse, 0.0, self._moves)

    def decide(self, now: float, glimpse: Glimpse | None, felt: float | None) -> tuple[Submovement, ...]:
        """Take in display and force, and return new submovements; empty most of the time.

        The caller keeps the interval `DECISION_INTERVAL` between two calls.
        """
        write_glimpse(glimpse, self._glimpse)
        force = nan if felt is None else felt
        count = self._decide(self.state, self.constants, now, self._glimpse, force, self._moves)
        return tuple(
            Submovement(SIDES[move["side"]], float(move["start"]), float(move["duration"]), float(move["displacement"]))
            for move in self._moves[:count]
        )
