"""The device models: the default is the Touch, and each value can be overridden."""

from dataclasses import replace
from typing import get_args, get_type_hints

import pytest

from netboard.base.config import Config, parse
from netboard.base.tables.simulated import VirtualDevice
from netboard.participants.device_models import MODELS, DeviceModel, resolved

MECHANICS = ("mass", "friction", "damping", "resolution", "max_force", "continuous_force", "workspace")
FLAWS = ("cable_stiffness", "cable_damping", "tip_share", "thermal_time")


def test_the_configuration_names_all_models() -> None:
    assert set(get_args(get_type_hints(VirtualDevice)["model"])) == set(MODELS)


def test_the_default_is_a_touch_without_flaws() -> None:
    own = resolved(VirtualDevice())
    assert [getattr(own, name) for name in MECHANICS] == [0.045, 0.26, 0.1, 0.055e-3, 3.3, 0.88, 0.075]
    assert (own.cable_stiffness, own.thermal_time) == (0.0, 0.0)


@pytest.mark.parametrize("model", MODELS)
def test_what_is_written_wins_over_the_model(model: str) -> None:
    bare = resolved(VirtualDevice(model=model))
    for name in ("mass", "friction", "damping", "resolution", "workspace"):
        there = resolved(VirtualDevice(model=model, **{name: 0.00123}))
        estimates = tuple(key for key in bare.estimates if key != name)
        assert there == replace(bare, **{name: 0.00123}, estimates=estimates)


def test_zero_is_a_number_like_any_other() -> None:
    own = resolved(VirtualDevice(friction=0.0, damping=0.0, resolution=0.0))
    assert (own.friction, own.damping, own.resolution) == (0.0, 0.0, 0.0)


def test_motors_give_no_more_for_ever_than_for_a_short_time() -> None:
    assert resolved(VirtualDevice(max_force=0.5)).continuous_force == 0.5


@pytest.mark.parametrize("model", MODELS.values(), ids=MODELS)
def test_every_number_of_a_model_could_be_written_into_the_configuration(model: DeviceModel) -> None:
    names = (*MECHANICS, *FLAWS)
    text = "[virtual]\n" + "\n".join(f"{name} = {getattr(model, name)!r}" for name in names)
    own = resolved(parse(text).virtual)
    assert [getattr(own, name) for name in names] == [getattr(model, name) for name in names]
    assert set(model.estimates) <= set(names)
    assert model.source


def test_a_configuration_keeps_the_word() -> None:
    text = '[virtual]\nmodel = "falcon"\ncable_stiffness = "model"\nmass = 0.3'
    virtual = parse(text).virtual
    assert (virtual.mass, virtual.friction, virtual.cable_stiffness) == (0.3, "model", "model")
    assert resolved(virtual).cable_stiffness == MODELS["falcon"].cable_stiffness
    assert Config().virtual.model == "touch"
