"""The devices of a recording, as reported by the agents when they joined."""

from dataclasses import dataclass

from netboard.base.config import SIDES, Config, Side
from netboard.recording.files.reader import Recording

MAKERS = {"falcon": "Novint", "openhaptics": "3D Systems", "spacemouse": "3Dconnexion"}
"""Manufacturer of each backend's devices."""


@dataclass(frozen=True, slots=True)
class HandDevice:
    """A device held in a recording."""

    side: Side
    backend: str
    maker: str
    model: str
    serial: str


def devices_of(config: Config, recording: Recording) -> tuple[HandDevice, ...]:
    """Return the devices of a recording, left before right."""
    told = {event.details.get("side"): event.details for event in recording.events() if event.name == "agent_joined"}
    found = []
    for side in SIDES:
        backend, details = getattr(config.agents, side).device, told.get(side, {})
        found.append(
            HandDevice(side, backend, MAKERS.get(backend, ""), details.get("model", ""), details.get("serial", ""))
        )
    return tuple(found)
