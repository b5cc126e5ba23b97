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
    """Parameters of one haptic device.

    Attributes
    ----------
    name : str
        Name that the maker gives it.
    mass : float
        Apparent mass at the stylus [kg].
    friction : float
        Coulomb friction of the mechanism [N].
    damping : float
        Viscous damping of the mechanism [N s/m].
    resolution : float
        Encoder resolution at the stylus; 0 for no quantisation [m].
    max_force : float
        Peak force of the motors [N].
    continuous_force : float
        Largest continuous force of the motors [N].
    workspace : float
        Radius of the workspace [m].
    cable_stiffness : float
        Stiffness between motors and stylus; 0 for rigid cables [N/m].
    cable_damping : float
        Damping between motors and stylus [N s/m].
    tip_share : float
        Share of the mass that is on the stylus side of the cables [1].
    thermal_time : float
        Thermal time constant of the motors; 0 for motors that do not heat up [s].
    source : str
        Source of the values.
    estimates : tuple of str
        Names of the parameters that are estimates, because no source publishes them.
    """

    name: str
    mass: float
    friction: float
    damping: float
    resolution: float
    max_force: float
    continuous_force: float
    workspace: float
    cable_stiffness: float
    cable_damping: float
    tip_share: float
    thermal_time: float
    source: str
    estimates: tuple[str, ...]


_ALWAYS = ("damping", "cable_damping", "tip_share", "thermal_time")
"""Parameters that no maker publishes."""

_SHEET = "maker's data sheet, as commonly quoted; max_force, workspace: CHAI3D's device table"

_TOUCH = DeviceModel(
    name="Touch",
    mass=0.045,
    friction=0.26,
    damping=0.1,
    resolution=0.055e-3,
    max_force=3.3,
    continuous_force=0.88,
    workspace=0.075,
    cable_stiffness=1020.0,
    cable_damping=0.7,
    tip_share=0.5,
    thermal_time=100.0,
    source=f"{_SHEET}; cable_stiffness: the softest of three axes",
    estimates=_ALWAYS,
)

MODELS: Mapping[str, DeviceModel] = {
    "touch": _TOUCH,
    "omni": replace(_TOUCH, name="PHANTOM Omni", workspace=0.10),
    "touch_x": DeviceModel(
        name="Touch X (PHANTOM Desktop)",
        mass=0.045,
        friction=0.06,
        damping=0.05,
        resolution=0.023e-3,
        max_force=7.9,
        continuous_force=1.75,
        workspace=0.10,
        cable_stiffness=1480.0,
        cable_damping=0.8,
        tip_share=0.5,
        thermal_time=100.0,
        source=f"{_SHEET}; cable_stiffness: the softest of three axes",
        estimates=_ALWAYS,
    ),
    "premium_1_5": DeviceModel(
        name="PHANTOM Premium 1.5",
        mass=0.075,
        friction=0.04,
        damping=0.05,
        resolution=0.03e-3,
        max_force=8.5,
        continuous_force=1.4,
        workspace=0.12,
        cable_stiffness=3500.0,
        cable_damping=1.6,
        tip_share=0.5,
        thermal_time=100.0,
        source=_SHEET,
        estimates=_ALWAYS,
    ),
    "premium_3_0": DeviceModel(
        name="PHANTOM Premium 3.0",
        mass=0.159,
        friction=0.2,
        damping=0.1,
        resolution=0.02e-3,
        max_force=22.0,
        continuous_force=3.0,
        workspace=0.25,
        cable_stiffness=1000.0,
        cable_damping=1.3,
        tip_share=0.5,
        thermal_time=100.0,
        source=_SHEET,
        estimates=_ALWAYS,
    ),
    "falcon": DeviceModel(
        name="Novint Falcon",
        mass=0.25,
        friction=0.5,
        damping=1.0,
        resolution=0.0635e-3,
        max_force=8.9,
        continuous_force=3.0,
        workspace=0.05,
        cable_stiffness=3000.0,
        cable_damping=2.7,
        tip_share=0.5,
        thermal_time=100.0,
        source="maker's data sheet, as commonly quoted: 8.9 N, 400 dpi, a workspace of 4 inches",
        estimates=("mass", "friction", "continuous_force", "cable_stiffness", *_ALWAYS),
    ),
    "omega_3": DeviceModel(
        name="Force Dimension omega.3",
        mass=0.2,
        friction=0.1,
        damping=0.5,
        resolution=0.01e-3,
        max_force=12.0,
        continuous_force=12.0,
        workspace=0.08,
        cable_stiffness=14_500.0,
        cable_damping=5.4,
        tip_share=0.5,
        thermal_time=100.0,
        source="maker's data sheet, as commonly quoted: 12 N, 0.01 mm, 14.5 N/mm, a workspace 160 mm wide",
        estimates=("mass", "friction", *_ALWAYS),
    ),
}
"""Devices, by their names in ``virtual.model``."""

_OWN = frozenset(field.name for field in fields(VirtualDevice)) & {field.name for field in fields(DeviceModel)}


def resolved(device: VirtualDevice) -> DeviceModel:
    """Return the parameters of the simulated device: values of the configuration override those of its model.

    Parameters
    ----------
    device : VirtualDevice
        The table ``[virtual]`` of the configuration.

    Returns
    -------
    DeviceModel
        The model with the configured values.
    """
    model = MODELS[device.model]
    written = {key: value for key in _OWN if (value := getattr(device, key)) != "model"}
    there = replace(model, **written, estimates=tuple(key for key in model.estimates if key not in written))
    return replace(there, continuous_force=min(there.continuous_force, there.max_force))
