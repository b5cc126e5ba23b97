"""Registry of trigger boxes: one entry for each, from its word in ``[triggers] kind`` to its class.

A box is imported only when it is used. Other packages register boxes in the entry-point group ``netboard.triggers``,
under the same kind of target.
"""

from inspect import isabstract

from netboard.base import plugins
from netboard.base.errors import ConfigError
from netboard.base.tables.triggers import Triggers
from netboard.devices.triggers.box import TriggerBox

GROUP = "netboard.triggers"
"""Entry-point group of third-party boxes."""

BOXES = {
    "labjack": "netboard.devices.triggers.labjack:LabJackBox",
    "parallel": "netboard.devices.triggers.parallel:ParallelPort",
    "serial": "netboard.devices.triggers.serial_port:SerialBox",
    "simulated": "netboard.devices.triggers.simulated:SimulatedBox",
}
"""Module and class of each built-in box."""


def names() -> tuple[str, ...]:
    """Return the kinds of all boxes, sorted."""
    return plugins.names(GROUP, BOXES)


def make(triggers: Triggers) -> TriggerBox:
    """Return the box of a rig, not yet open; raise `ConfigError` if this machine has no such box."""
    found = plugins.load(GROUP, triggers.kind, BOXES, "trigger box", ConfigError)
    if not (isinstance(found, type) and issubclass(found, TriggerBox)) or isabstract(found):
        raise ConfigError(
            f"the trigger box {triggers.kind!r} is {found!r}, expected a netboard.devices.triggers.box.TriggerBox"
        )
    if triggers.loopback and not found.has_input:
        raise ConfigError(f"[triggers] loopback: found true, expected false: a {triggers.kind} box has no input")
    return found(triggers)


def require_known(triggers: Triggers) -> None:
    """Refuse a rig whose trigger box this machine does not know, or that cannot do what is asked of it."""
    if not triggers.declared:
        return
    try:
        make(triggers)
    except ConfigError as error:
        where = "" if str(error).startswith("[triggers]") else "[triggers] kind: "
        raise ConfigError(f"{where}{error}") from None
