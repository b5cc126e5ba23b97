"""Registry of backends: from a name in the configuration to a class.

A backend is imported only when it is used, so a missing vendor library does not affect the others. Other packages
register backends in the entry-point group ``netboard.devices``.
"""

from importlib import import_module
from importlib.metadata import EntryPoint, entry_points

from netboard.base.config import Config, Side
from netboard.base.errors import DeviceNotFound
from netboard.devices.contract.device import Device

GROUP = "netboard.devices"
"""Entry-point group of third-party backends."""

BACKENDS = {
    "falcon": "netboard.devices.falcon.device:Falcon",
    "mouse": "netboard.devices.mouse:MouseStylus",
    "openhaptics": "netboard.devices.touch.device:OpenHaptics",
    "playback": "netboard.devices.simulated.playback:Playback",
    "spacemouse": "netboard.devices.spacemouse:SpaceMouse",
    "virtual": "netboard.devices.simulated.virtual:VirtualTouch",
}
"""Built-in backends: name to module and class."""


def names() -> tuple[str, ...]:
    """Return the names of all backends, sorted."""
    return tuple(sorted({*BACKENDS, *_plugins()}))


def find(name: str) -> type[Device]:
    """Return the class of a backend."""
    plugins = _plugins()
    if name not in BACKENDS and name not in plugins:
        raise DeviceNotFound(f"there is no device backend {name!r}; there are: {', '.join(names())}")
    target = BACKENDS[name] if name in BACKENDS else plugins[name].value
    module, _, attribute = target.partition(":")
    try:
        backend = getattr(import_module(module), attribute)
    except (ImportError, AttributeError, OSError) as error:
        raise DeviceNotFound(f"the device backend {name!r} ({target}) cannot be loaded: {error}") from error
    if not (isinstance(backend, type) and issubclass(backend, Device)):
        raise DeviceNotFound(f"the device backend {name!r} ({target}) is not a netboard.devices.contract.device.Device")
    return backend


def make(side: Side, config: Config) -> Device:
    """Create the device of one side, not yet open."""
    agent = config.agents.left if side == "left" else config.agents.right
    return find(agent.device)(side, config)


def _plugins() -> dict[str, EntryPoint]:
    """Third-party backends by name."""
    return {point.name: point for point in entry_points(group=GROUP)}
