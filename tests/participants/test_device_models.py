"""Device models: the Touch is the default, and each value can be overridden."""

from dataclasses import replace
from typing import get_args, get_type_hints

import pytest

from netboard.base.config import Config, parse
from netboard.base.tables.simulated import VirtualDevice
from netboard.participants.body.device_models import MODELS, DeviceModel, resolved

MECHANICS = ("mass", "friction", "damping", "resolution", "max_force", "continuous_force", "workspace")
IMPERFECTIONS = ("cable_stiffness", "cable_damping", "tip_share", "thermal_time")


def test_configuration_options_include_every_model() -> None:
    assert set(get_args(get_type_hints(VirtualDevice)["model"])) == set(MODELS)


def test_default_device_is_a_touch_with_rigid_cables_and_no_thermal_limit() -> None:
    device = resolved(VirtualDevice())
    assert [getattr(device, name) for name in MECHANICS] == [0.045, 0.26, 0.1, 0.055e-3, 3.3, 0.88, 0.075]
    assert (device.cable_stiffness, device.thermal_time) == (0.0, 0.0)


@pytest.mark.parametrize("model", MODELS)
def test_configured_value_overrides_the_model(model: str) -> None:
    bare = resolved(VirtualDevice(model=model))
    for name in ("mass", "friction", "damping", "resolution", "workspace"):
        found = resolved(VirtualDevice(model=model, **{name: 0.00123}))
        estimates = tuple(key for key in bare.estimates if key != name)
        assert found == replace(bare, **{name: 0.00123}, estimates=estimates)


def test_configured_zero_overrides_the_model() -> None:
    device = resolved(VirtualDevice(friction=0.0, damping=0.0, resolution=0.0))
    assert (device.friction, device.damping, device.resolution) == (0.0, 0.0, 0.0)


def test_continuous_force_is_capped_by_the_maximum_force() -> None:
    assert resolved(VirtualDevice(max_force=0.5)).continuous_force == 0.5


@pytest.mark.parametrize("model", MODELS.values(), ids=MODELS)
def test_every_value_of_a_model_is_a_valid_configuration_value(model: DeviceModel) -> None:
    names = (*MECHANICS, *IMPERFECTIONS)
    text = "[virtual]\n" + "\n".join(f"{name} = {getattr(model, name)!r}" for name in names)
    device = resolved(parse(text).virtual)
    assert [getattr(device, name) for name in names] == [getattr(model, name) for name in names]
    assert set(model.estimates) <= set(names)
    assert model.source


def test_configuration_keeps_the_word_model_until_it_is_resolved() -> None:
    text = '[virtual]\nmodel = "falcon"\ncable_stiffness = "model"\nmass = 0.3'
    virtual = parse(text).virtual
    assert (virtual.mass, virtual.friction, virtual.cable_stiffness) == (0.3, "model", "model")
    assert resolved(virtual).cable_stiffness == MODELS["falcon"].cable_stiffness
    assert Config().virtual.model == "touch"
