"""Device mechanics from a recording: identified values, else those of the model, else none."""

from dataclasses import dataclass, field, replace
from typing import Any

import pytest

from netboard.analysis.extraction.devices import Mechanics, mechanics_of
from netboard.base.config import Config
from netboard.participants.device_models import MODELS, resolved


@dataclass
class Joined:
    details: dict[str, str]
    name: str = "agent_joined"


@dataclass
class Said:
    """A recording, as far as its devices go."""

    joined: list[Joined] = field(default_factory=list)
    metadata: dict[str, str] = field(default_factory=dict)

    def events(self) -> tuple[Joined, ...]:
        return tuple(self.joined)


def found(config: Config, recording: Any) -> dict[str, Mechanics | None]:
    return dict(mechanics_of(config, recording))


def with_device(backend: str) -> Config:
    config = Config()
    side = replace(config.agents.left, device=backend)
    return replace(config, agents=replace(config.agents, left=side, right=side))


def touch(side: str, **details: str) -> Joined:
    return Joined({"side": side, "device": "openhaptics", "model": "Touch", **details})


def test_what_was_identified_counts_most_then_the_model() -> None:
    profile = {
        "profile_mass": "0.05 +- 0.001 kg",
        "profile_damping": "0.2 +- 0.01 N s/m",
        "profile_friction": "0.3 +- 0.02 N",
    }
    both = found(with_device("openhaptics"), Said([touch("left", **profile), touch("right")]))
    assert both["left"] == Mechanics(0.05, 0.2, 0.3)
    assert both["right"] == Mechanics(0.045, 0.1, 0.26)


@pytest.mark.parametrize(("name", "model"), [("Touch X", "touch_x"), ("Falcon", "falcon"), ("PHANTOM Omni", "omni")])
def test_a_model_is_known_by_what_the_device_calls_itself(name: str, model: str) -> None:
    joined = Joined({"side": "left", "device": "openhaptics", "model": name})
    known = MODELS[model]
    left = found(with_device("openhaptics"), Said([joined]))["left"]
    assert left == Mechanics(known.mass, known.damping, known.friction)


def test_simulated_devices_have_the_figures_of_the_configuration() -> None:
    config = Config()
    config = replace(config, virtual=replace(config.virtual, model="falcon", friction=0.4))
    own = resolved(config.virtual)
    expected = Mechanics(own.mass, own.damping, 0.4)
    for recording in (Said(), Said(metadata={"rehearsed": "true"}), Said(metadata={"imported": "simulated"})):
        assert found(config, recording) == {"left": expected, "right": expected}


def test_of_a_mouse_or_of_an_imported_table_nothing_is_known() -> None:
    assert found(with_device("mouse"), Said([Joined({"side": "left", "device": "mouse", "model": "mouse"})])) == {
        "left": None,
        "right": None,
    }
    assert found(Config(), Said(metadata={"imported": "measured"})) == {"left": None, "right": None}
