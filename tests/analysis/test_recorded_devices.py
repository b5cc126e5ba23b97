"""Device mechanics from a recording: identified values, else those of the model, else none."""

from dataclasses import dataclass, field, replace
from typing import Any

import pytest

from netboard.analysis.extraction.devices import DeviceMechanics, at, mechanics_of
from netboard.base.config import Config
from netboard.participants.body.device_models import MODELS, resolved


@dataclass
class Joined:
    details: dict[str, str]
    name: str = "agent_joined"
    tick: int = 0


@dataclass
class FakeRecording:
    """A recording, reduced to what describes its devices."""

    joined: list[Joined] = field(default_factory=list)
    metadata: dict[str, str] = field(default_factory=dict)

    def events(self) -> tuple[Joined, ...]:
        return tuple(self.joined)


def found(config: Config, recording: Any) -> dict[str, DeviceMechanics | None]:
    return {side: at(held, 0) for side, held in mechanics_of(config, recording).items()}


def with_device(backend: str) -> Config:
    config = Config()
    side = replace(config.agents.left, device=backend)
    return replace(config, agents=replace(config.agents, left=side, right=side))


def touch(side: str, **details: str) -> Joined:
    return Joined({"side": side, "device": "openhaptics", "model": "Touch", **details})


def test_identified_mechanics_take_precedence_over_the_model() -> None:
    profile = {
        "profile_mass": "0.05 +- 0.001 kg",
        "profile_damping": "0.2 +- 0.01 N s/m",
        "profile_friction": "0.3 +- 0.02 N",
    }
    both = found(with_device("openhaptics"), FakeRecording([touch("left", **profile), touch("right")]))
    assert both["left"] == DeviceMechanics(0.05, 0.2, 0.3)
    assert both["right"] == DeviceMechanics(0.045, 0.1, 0.26)


@pytest.mark.parametrize(("name", "model"), [("Touch X", "touch_x"), ("Falcon", "falcon"), ("PHANTOM Omni", "omni")])
def test_model_is_recognised_by_the_name_of_the_device(name: str, model: str) -> None:
    joined = Joined({"side": "left", "device": "openhaptics", "model": name})
    known = MODELS[model]
    left = found(with_device("openhaptics"), FakeRecording([joined]))["left"]
    assert left == DeviceMechanics(known.mass, known.damping, known.friction)


def test_simulated_devices_use_the_configured_mechanics() -> None:
    config = Config()
    config = replace(config, virtual=replace(config.virtual, model="falcon", friction=0.4))
    own = resolved(config.virtual)
    expected = DeviceMechanics(own.mass, own.damping, 0.4)
    for recording in (
        FakeRecording(),
        FakeRecording(metadata={"rehearsed": "true"}),
        FakeRecording(metadata={"imported": "simulated"}),
    ):
        assert found(config, recording) == {"left": expected, "right": expected}


def test_mouse_and_imported_table_have_no_mechanics() -> None:
    assert found(
        with_device("mouse"), FakeRecording([Joined({"side": "left", "device": "mouse", "model": "mouse"})])
    ) == {
        "left": None,
        "right": None,
    }
    assert found(Config(), FakeRecording(metadata={"imported": "measured"})) == {"left": None, "right": None}


def test_device_replaced_in_a_block_counts_from_then_on() -> None:
    """So it does not describe the trials before; an agent that is present as the block begins did not join in it."""
    first = Joined({"side": "left", "device": "openhaptics", "model": "Touch"}, "agent_present", 10)
    second = Joined({"side": "left", "device": "falcon", "model": "Falcon"}, "agent_joined", 5000)
    left = mechanics_of(with_device("openhaptics"), FakeRecording([first, second]))["left"]  # type: ignore[arg-type]
    touch_model, falcon = MODELS["touch"], MODELS["falcon"]
    for tick, model in ((0, touch_model), (4999, touch_model), (5000, falcon), (9000, falcon)):
        assert at(left, tick) == DeviceMechanics(model.mass, model.damping, model.friction)
