"""Computed controls: attempts with haptics off, with what haptic forces alone would have changed in them.

In a control both hands keep the drive of their recorded movement, and their arms yield to a haptic force that the hands
did not feel (`netboard.analysis.measures.passive.yielding`). The measures that the hands alone determine are then
computed again. Those of the ball are not: people would have reacted to a ball that rolls otherwise.

Rule 1: a control is an entry of `CONTROLS`; a measure takes part if its group says so (`Group.of_hands`).
Rule 2: the board is in static equilibrium between the hands; only the change by a control is computed in this way.
Rule 3: each control has attempts with each arm, and the attempts without a force, with which they are compared.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import astuple, dataclass, replace
from math import nan
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.analysis.extraction.attempts import MODERN, PAPER
from netboard.analysis.extraction.details import THRESHOLDS, delays_of
from netboard.analysis.extraction.devices import DeviceMechanics, at
from netboard.analysis.extraction.settings import ControlSettings
from netboard.analysis.extraction.tables import PLACE, count, number, words
from netboard.analysis.extraction.trials import RATE, AttemptData, BlockData
from netboard.analysis.measures.cooperation import SEARCH_BACK
from netboard.analysis.measures.passive import Gains, PassiveHand, Yielding, yielding
from netboard.analysis.measures.signals import derivative
from netboard.base.config import SIDES, Config
from netboard.physics.scene.parameters import pack_scene, parts_of
from netboard.physics.scene.rendering import gains_of

DELAY = 20
"""Threshold of the delays that a control has [%]."""


@dataclass(frozen=True, slots=True)
class Arm:
    """Arm of an assumed stiffness [N/m] that holds the recorded device, or is without its mass and friction."""

    stiffness: float
    device: bool

    @property
    def name(self) -> str:
        """Name in tables."""
        return f"{self.stiffness:g} N/m, {self.holding}"

    @property
    def holding(self) -> str:
        """What it holds."""
        return "with the device" if self.device else "no friction"


def arms_of(settings: ControlSettings) -> tuple[Arm, ...]:
    """Return all arms: neither the stiffness of an arm is known nor how much friction a person compensates.

    The first two have the usual stiffness: with the device, and without friction.
    """
    return tuple(Arm(stiffness, device) for stiffness in settings.stiffnesses for device in (True, False))


@dataclass(frozen=True, slots=True)
class Statics:
    """The board at rest between the hands: gains of each hand's force [N/m], stiffness of the couplings, and arm l."""

    gains: tuple[Gains, Gains]
    couplings: tuple[float, float]
    arm: float


@dataclass(frozen=True, slots=True)
class UnfeltForce:
    """Attempt without a haptic force, the force that the hands would feel, and who yields to it."""

    take: AttemptData
    felt: NDArray[np.float64]
    gains: tuple[Gains, Gains]
    yields: tuple[bool, bool] = (True, True)


@dataclass(frozen=True, slots=True)
class Control:
    """A computed control.

    - `about`: what the hands feel, for tables and the report.
    - `every_arm`: whether it is computed with every arm, or only with those of the usual stiffness.
    - `unfelt`: function of an attempt, of another one of the block with the same target, and of the statics; None if
      the attempt does not allow it.
    """

    name: str
    about: str
    every_arm: bool
    unfelt: Callable[[AttemptData, AttemptData | None, Statics], UnfeltForce | None]


def _felt(take: AttemptData) -> NDArray[np.float64]:
    """Return the whole force that each hand would have felt: the reaction of its coupling, shape (2, n) [N]."""
    inside = slice(0, take.motion.p.size)
    scale = take.block.config.block.force_scale
    return -scale * np.array([take.force(side, inside) for side in SIDES])


def _scaled(take: AttemptData, gains: tuple[Gains, Gains]) -> tuple[Gains, Gains]:
    left, right = (Gains(*(take.block.config.block.force_scale * gain for gain in one)) for one in gains)
    return left, right


def _passive(take: AttemptData, other: AttemptData | None, statics: Statics) -> UnfeltForce:
    """Let both partners feel the whole force."""
    return UnfeltForce(take, _felt(take), _scaled(take, statics.gains))


def _environment(take: AttemptData, other: AttemptData | None, statics: Statics) -> UnfeltForce:
    """Let both partners feel the whole force without the part of the other stylus' height."""
    left, right = _scaled(take, statics.gains)
    partners = np.array([left.partner * take.motion.right_z, right.partner * take.motion.left_z])
    alone = left._replace(partner=0.0), right._replace(partner=0.0)
    return UnfeltForce(take, _felt(take) + partners, alone)


def _recorded_partner(take: AttemptData, other: AttemptData | None, statics: Statics) -> UnfeltForce | None:
    """Move one side as in another trial, whatever the force; the other side feels the whole force.

    The sides take turns: the right one is played back in odd trials.
    """
    if other is None or other.trial.release != take.trial.release:
        return None
    length = min(take.motion.p.size, other.motion.p.size)
    played = take.attempt.trial % 2
    here, there = _shortened(take, length), _shortened(other, length)
    moved = np.zeros((2, 2, length))
    for row, suffix in enumerate(("z", "vz")):
        name = f"{SIDES[played]}_{suffix}"
        moved[row, played] = getattr(there.motion, name) - getattr(here.motion, name)
    both = displaced(here, Yielding(moved[0], moved[1]), statics)
    return UnfeltForce(both, _felt(both), _scaled(take, statics.gains), (played == 1, played == 0))


CONTROLS = (
    Control("passive", "both partners' arms yield to the whole force", True, _passive),
    Control("environment only", "the force without the part of the partner's hand", False, _environment),
    Control(
        "recorded partner",
        "the partner's hand is played back from another trial, and does not react",
        False,
        _recorded_partner,
    ),
)
"""All computed controls; the first one is the passive part of an effect."""

GROUPS = tuple(group for group in (*PAPER, *MODERN) if group.of_hands)
"""Measures that a control has."""

FIELDS = (
    *PLACE,
    words("control", "computed control: " + "; ".join(f"{one.name}: {one.about}" for one in CONTROLS)),
    words("arm", "arm that yields to the force; empty: without a force, for comparison"),
    number("friction", "mean Coulomb friction of the devices in it; NaN: without the device", "N"),
    *(field for group in GROUPS for field in group.fields),
    count("movements", f"number of cooperative movements of the board with a delay at {DELAY} %"),
    number(f"delay_{DELAY}", f"mean absolute delay at {DELAY} % in them", "s"),
)
"""Columns of the table of controls: one row for each successful attempt with haptics off, control and arm."""


def controls(name: str, block: BlockData, takes: Sequence[AttemptData]) -> Iterator[Mapping[str, Any]]:
    """Yield the rows of the controls of a recording; none if it has haptics, a robot or a board that is not coupled."""
    most = block.readings.controls.attempts
    if not most or not _is_possible(block.config):
        return
    statics = statics_of(block)
    known = [_cut(take) for take in takes if _is_known(take)]
    for place in np.unique(np.linspace(0, len(known) - 1, min(most, len(known))).round().astype(int)):
        take, others = known[place], (*known[place + 1 :], *known[:place])
        other = next((one for one in others if one.attempt.target == take.attempt.target), None)
        held = [at(block.mechanics[side], take.attempt.tick) for side in SIDES]
        where = {"recording": name, "trial": take.attempt.trial, "attempt": take.attempt.attempt}
        yield from (where | row for row in _of_attempt(take, other, statics, held))


def statics_of(block: BlockData) -> Statics:
    """Return the statics of a recording's scene."""
    physics = block.config.physics
    scene = pack_scene(physics)[0]
    left, right = (Gains(*gains[1:]) for gains in gains_of(parts_of(physics), scene))
    return Statics((left, right), (float(scene["k_left"]), float(scene["k_right"])), float(scene["l"]))


def _is_possible(config: Config) -> bool:
    """Return whether two people move a free board with haptics off, to which both are coupled."""
    scene, people = config.physics, config.block.left == config.block.right == "person"
    coupled = scene.coupling == "both" and scene.k_h > 0.0
    return people and coupled and scene.board == "free" and not config.block.haptics


def _is_known(take: AttemptData) -> bool:
    """Return whether an attempt has a completion, and no missing samples."""
    window, found = take.trial.window("whole"), take.motion
    whole = all(np.isfinite(values[window]).all() for values in (found.left_vz, found.right_vz, found.p, found.omega))
    return take.attempt.outcome == "success" and take.trial.completion is not None and whole


def _of_attempt(
    take: AttemptData, other: AttemptData | None, statics: Statics, held: Sequence[DeviceMechanics | None]
) -> Iterator[dict[str, Any]]:
    """Yield the rows of an attempt: for each control one without a force, and one for each arm."""
    recorded = _measured(take)
    for control in CONTROLS:
        unfelt = control.unfelt(take, other, statics)
        if unfelt is None:
            continue
        without = recorded if unfelt.take is take else _measured(unfelt.take)
        yield {"control": control.name, "arm": "", "friction": nan} | without
        yield from _with_arms(control, unfelt, statics, held)


def _with_arms(
    control: Control, unfelt: UnfeltForce, statics: Statics, held: Sequence[DeviceMechanics | None]
) -> Iterator[dict[str, Any]]:
    """Yield a row for each arm whose device is known."""
    settings = unfelt.take.block.readings.controls
    for arm in arms_of(settings)[: None if control.every_arm else 2]:
        hands = [_hand(arm, device, settings) for device in held]
        if None in hands:
            continue
        friction = float(np.mean([one.friction for one in hands if one is not None])) if arm.device else nan
        moved = _yielded(unfelt, hands)
        row = {"control": control.name, "arm": arm.name, "friction": friction}
        yield row | _measured(displaced(unfelt.take, moved, statics))


def _hand(arm: Arm, device: DeviceMechanics | None, settings: ControlSettings) -> PassiveHand | None:
    """Return an arm, with the device if it has it; None if its device is unknown."""
    hand = PassiveHand(settings.arm_mass, settings.arm_damping, arm.stiffness)
    if not arm.device:
        return hand
    return None if device is None else hand.holding(*astuple(device))


def _yielded(unfelt: UnfeltForce, hands: Sequence[PassiveHand | None]) -> Yielding:
    """Return the displacement of the arms from the release on; there is none before."""
    release, found = unfelt.take.trial.release, unfelt.take.motion
    rates = np.array([found.left_vz, found.right_vz])[:, release:]
    left, right = (hand if own else None for hand, own in zip(hands, unfelt.yields, strict=True))
    moved = yielding(unfelt.felt[:, release:], rates, RATE, (left, right), unfelt.gains)
    z, vz = (np.pad(values, ((0, 0), (release, 0))) for values in moved)
    return Yielding(z, vz)


def displaced(take: AttemptData, moved: Yielding, statics: Statics) -> AttemptData:
    """Return an attempt whose hands are elsewhere, with the forces and the tilt of the board at rest between them.

    The ball remains as recorded.
    """
    left, right = statics.gains
    forces = np.array(
        [
            left.own * moved.z[0] + left.partner * moved.z[1],
            right.own * moved.z[1] + right.partner * moved.z[0],
        ]
    )
    ends = moved.z - forces / np.array(statics.couplings)[:, None]
    tilt, found = (ends[1] - ends[0]) / (2.0 * statics.arm), take.motion
    motion = replace(
        found,
        left_z=found.left_z + moved.z[0],
        right_z=found.right_z + moved.z[1],
        left_vz=found.left_vz + moved.vz[0],
        right_vz=found.right_vz + moved.vz[1],
        theta=found.theta + tilt,
        omega=found.omega + take.block.slow(derivative(tilt, RATE), RATE),
    )
    changed = forces if take.changed is None else forces + take.changed
    return replace(take, motion=motion, segments=take.block.segments(motion), changed=changed)


def _cut(take: AttemptData) -> AttemptData:
    """Cut an attempt out up to its completion, with what a search for a delay needs before, and as much after it."""
    beside, done = round(SEARCH_BACK * RATE), take.trial.completion or take.trial.stop
    return take.within(max(0, take.trial.release - beside), min(done + beside, take.trial.stop))


def _shortened(take: AttemptData, length: int) -> AttemptData:
    """Return the first samples of an attempt."""
    return take if length == take.motion.p.size else take.within(0, length)


def _measured(take: AttemptData) -> dict[str, Any]:
    """Return the measures of an attempt that the hands alone determine."""
    row: dict[str, Any] = {}
    for group in GROUPS:
        row |= group.of(take)
    moved, found = delays_of(take)
    delays = np.abs(found.signed[moved.cooperative, THRESHOLDS.index(DELAY)])
    known = delays[np.isfinite(delays)]
    return row | {"movements": known.size, f"delay_{DELAY}": float(known.mean()) if known.size else nan}
