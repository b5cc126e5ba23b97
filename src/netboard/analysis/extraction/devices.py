"""Mechanics of each hand's device in a recording: apparent mass, damping and friction.

Values identified for the device itself come first, then the data of its model. A mouse or an imported table has
neither.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from math import isnan, nan

from netboard.base.config import SIDES, Config, Side
from netboard.participants.body.device_models import MODELS, DeviceModel, resolved
from netboard.recording.files.reader import Recording
from netboard.recording.format.summary import agents_of


@dataclass(frozen=True, slots=True)
class DeviceMechanics:
    """Mass [kg], viscous damping [N s/m] and Coulomb friction [N] that a device adds to the hand that holds it."""

    mass: float
    damping: float
    friction: float


Held = tuple[tuple[int, DeviceMechanics | None], ...]
"""The mechanics of a side's devices in turn, each with the first tick of its use."""


def always(mechanics: DeviceMechanics | None) -> dict[Side, Held]:
    """Return the same mechanics for both sides and all ticks."""
    return dict.fromkeys(SIDES, ((0, mechanics),))


def at(held: Held, tick: int) -> DeviceMechanics | None:
    """Return the mechanics of a side's device at a tick; before the first device was there, those of that one."""
    return next((mechanics for first, mechanics in reversed(held) if first <= tick), held[0][1])


def mechanics_of(config: Config, recording: Recording) -> dict[Side, Held]:
    """Return the mechanics of all devices of a recording."""
    metadata = recording.metadata
    if metadata.get("imported") == "measured":
        return always(None)
    if "rehearsed" in metadata or metadata.get("imported") == "simulated":
        return always(simulated_mechanics(config))
    agents = agents_of(recording.events())
    return {
        side: tuple((tick, _reported_mechanics(config, side, about)) for tick, about in agents.get(side) or [(0, {})])
        for side in SIDES
    }


def _reported_mechanics(config: Config, side: Side, details: Mapping[str, str]) -> DeviceMechanics | None:
    """Return the mechanics that an agent reported for its device."""
    model = _model_of(details.get("model", ""))
    if details.get("device", config.agents.of(side).device) == "virtual":
        return simulated_mechanics(config)
    names = ("profile_mass", "profile_damping", "profile_friction")
    own = [_number(details.get(name, "")) for name in names]
    if not any(map(isnan, own)):
        return DeviceMechanics(*own)
    return None if model is None else DeviceMechanics(model.mass, model.damping, model.friction)


def simulated_mechanics(config: Config) -> DeviceMechanics:
    """Return the mechanics of the simulated device of a configuration."""
    device = resolved(config.virtual)
    return DeviceMechanics(device.mass, device.damping, device.friction)


def _model_of(name: str) -> DeviceModel | None:
    """Find a device model by the device's name: the longest model name that it contains, without the maker's name."""
    words = _plain(name)
    found = [
        (len(known), model)
        for key, model in MODELS.items()
        for known in {_plain(key), _plain(model.name.partition("(")[0])}
        if known and known in words
    ]
    return max(found, key=lambda one: one[0])[1] if found else None


def _plain(name: str) -> str:
    return "".join(letter for letter in name.lower() if letter.isalnum())


def _number(words: str) -> float:
    """Return the value of a text such as ``0.26 +- 0.01 N``; NaN without a number."""
    try:
        return float(words.partition(" ")[0])
    except ValueError:
        return nan
