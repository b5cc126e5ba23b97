"""Parameters of haptic devices, for the simulated device.

A device is one mass per axis, with friction, damping, motors that saturate and heat up, quantised encoders, and
compliant cables. Real devices differ between axes and over their workspace. These are the makers' figures at the usual
place; `DeviceModel.estimates` names those that no maker publishes and that are estimated. This project has measured
none of them: to use the true values of a device, measure them and write them into ``[virtual]``.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace

from netboard.base.tables.simulated import VirtualDevice


@dataclass(frozen=True, slots=True)
class DeviceModel:
    """Parameters of one haptic device [SI], with their source; no source publishes the estimates."""

    name: str  # the maker's
    mass: float  # apparent, at the stylus
    friction: float  # Coulomb friction of the mechanism
    damping: float  # viscous, of the mechanism
    resolution: float  # of the encoders, at the stylus; 0: no quantisation
    max_force: float  # peak force of the motors
    continuous_force: float
    workspace: float  # radius
    cable_stiffness: float  # between motors and stylus; 0: rigid cables
    cable_damping: float
    tip_share: float  # share of the mass that is on the stylus side of the cables
    thermal_time: float  # time constant of the motors; 0: they do not heat up
    source: str
    estimates: tuple[str, ...]


_UNPUBLISHED = ("damping", "cable_damping", "tip_share", "thermal_time")
"""Parameters that no maker publishes."""

_QUOTED = "maker's data sheet, as commonly quoted"
_SHEET = f"{_QUOTED}; max_force, workspace: CHAI3D's device table"
_SOFTEST = f"{_SHEET}; cable_stiffness: the softest of three axes"

_NUMBERS = (
    *("mass", "friction", "damping", "resolution", "max_force", "continuous_force", "workspace"),
    *("cable_stiffness", "cable_damping", "tip_share", "thermal_time"),
)

_ROWS: Mapping[str, tuple[str, tuple[float, ...], str, tuple[str, ...]]] = {
    # In each row: name, `_NUMBERS`, source, and parameters that are estimated besides `_UNPUBLISHED`.
    "touch": ("Touch", (0.045, 0.26, 0.1, 0.055e-3, 3.3, 0.88, 0.075, 1020.0, 0.7, 0.5, 100.0), _SOFTEST, ()),
    "omni": ("PHANTOM Omni", (0.045, 0.26, 0.1, 0.055e-3, 3.3, 0.88, 0.10, 1020.0, 0.7, 0.5, 100.0), _SOFTEST, ()),
    "touch_x": (
        "Touch X (PHANTOM Desktop)",
        (0.045, 0.06, 0.05, 0.023e-3, 7.9, 1.75, 0.10, 1480.0, 0.8, 0.5, 100.0),
        _SOFTEST,
        (),
    ),
    "premium_1_5": (
        "PHANTOM Premium 1.5",
        (0.075, 0.04, 0.05, 0.03e-3, 8.5, 1.4, 0.12, 3500.0, 1.6, 0.5, 100.0),
        _SHEET,
        (),
    ),
    "premium_3_0": (
        "PHANTOM Premium 3.0",
        (0.159, 0.2, 0.1, 0.02e-3, 22.0, 3.0, 0.25, 1000.0, 1.3, 0.5, 100.0),
        _SHEET,
        (),
    ),
    "falcon": (
        "Novint Falcon",
        (0.25, 0.5, 1.0, 0.0635e-3, 8.9, 3.0, 0.05, 3000.0, 2.7, 0.5, 100.0),
        f"{_QUOTED}: 8.9 N, 400 dpi, a workspace of 4 inches",
        ("mass", "friction", "continuous_force", "cable_stiffness"),
    ),
    "omega_3": (
        "Force Dimension omega.3",
        (0.2, 0.1, 0.5, 0.01e-3, 12.0, 12.0, 0.08, 14_500.0, 5.4, 0.5, 100.0),
        f"{_QUOTED}: 12 N, 0.01 mm, 14.5 N/mm, a workspace 160 mm wide",
        ("mass", "friction"),
    ),
}

MODELS = {
    key: DeviceModel(
        name, **dict(zip(_NUMBERS, values, strict=True)), source=source, estimates=(*estimates, *_UNPUBLISHED)
    )
    for key, (name, values, source, estimates) in _ROWS.items()
}
"""Devices, by their names in ``virtual.model``."""

_OWN = frozenset(field.name for field in fields(VirtualDevice)) & {field.name for field in fields(DeviceModel)}


def resolved(device: VirtualDevice) -> DeviceModel:
    """Return the parameters of the simulated device: values of the configuration override those of its model."""
    model = MODELS[device.model]
    written = {key: value for key in _OWN if (value := getattr(device, key)) != "model"}
    found = replace(model, **written, estimates=tuple(key for key in model.estimates if key not in written))
    return replace(found, continuous_force=min(found.continuous_force, found.max_force))
