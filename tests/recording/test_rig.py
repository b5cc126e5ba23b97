"""What a recording says of its rig: from the events of agents and displays, and from the operator's words."""

from dataclasses import replace

import pytest

from netboard.base.config import Config
from netboard.base.tables.experiment import Block
from netboard.network.protocol.records import EventRecord
from netboard.recording.format.rig import REHEARSED, rig_of
from netboard.recording.format.summary import Attempt

TOUCH = {"side": "left", "device": "openhaptics", "kind": "haptic", "model": "Touch", "serial": "7"}
VIRTUAL = {"side": "right", "device": "virtual", "kind": "simulated", "model": "virtual Touch", "serial": "v"}
DISPLAY = {"side": "right", "name": "lab:1", "platform": "offscreen"}
CONFIRMED = {"what": "right device simulated", "words": "right device simulated, it is broken", "by": "lab:2"}


def events(*found: tuple[str, int, dict[str, str]]) -> list[EventRecord]:
    return [EventRecord(seq, tick, tick, name, details) for seq, (name, tick, details) in enumerate(found)]


def attempt(began: int) -> Attempt:
    return Attempt(1, 1, 1, "success", began, began + 10, began + 20, 0.01, 0.01)


def test_rig_names_each_device_and_what_stood_in_with_its_confirmation() -> None:
    found = events(
        ("agent_joined", 0, TOUCH),
        ("agent_present", 1, VIRTUAL),
        ("display_present", 1, DISPLAY),
        ("stand_in_confirmed", 3, CONFIRMED),
    )
    rig = rig_of(Config(), {}, found, (attempt(5),))
    assert rig.hands["left"] == ("haptic device: Touch, serial 7 (never calibrated, mass not identified)",)
    assert rig.hands["right"] == ("simulated, no device: virtual Touch, serial v",)
    assert (rig.unseen, rig.simulated) == (("right",), ("right",))
    assert rig.stand_ins == {
        "right device simulated": 'confirmed by lab:2: "right device simulated, it is broken"',
        "right display off screen": "",
    }
    assert rig.stand_ins_in_words.endswith("right display off screen (not confirmed)")


@pytest.mark.parametrize(("replaced_at", "hands"), [(3, 1), (50, 2)])
def test_device_that_was_replaced_before_the_first_attempt_does_not_count(replaced_at: int, hands: int) -> None:
    found = events(("agent_joined", 0, VIRTUAL), ("agent_joined", replaced_at, TOUCH | {"side": "right"}))
    rig = rig_of(Config(), {}, found, (attempt(5),))
    assert len(rig.hands["right"]) == hands
    assert bool(rig.stand_ins) == (hands == 2)
    assert rig.simulated == ()


def test_hand_that_the_server_moves_needs_no_device() -> None:
    config = replace(Config(), block=Block(left="still", right="robot"))
    rig = rig_of(config, {}, events(("agent_joined", 0, VIRTUAL)), ())
    assert rig.hands == {"left": ("held still by the server",), "right": ("robot partner, moved by the server",)}
    assert not rig.stand_ins


def test_robot_partner_of_a_block_is_no_stand_in() -> None:
    config = replace(Config(), block=Block(right="robot"))
    own, seated = VIRTUAL | {"side": "right"}, VIRTUAL | {"side": "right", "kind": "robot", "partner": "robot"}
    rig = rig_of(config, {}, events(("agent_joined", 0, own), ("agent_joined", 1, seated)), ())
    assert rig.hands["right"] == ("robot partner, no device: robot",)
    assert "right" not in rig.simulated
    assert not rig.stand_ins


def test_rehearsal_names_the_robot_partners_of_both_sides() -> None:
    rig = rig_of(replace(Config(), block=Block(left="leader", right="robot")), {"rehearsed": "true"}, (), ())
    assert rig.hands == {"left": ("robot partner, no device: leader",), "right": ("robot partner, no device: robot",)}
    assert rig.simulated == ()


def test_rehearsal_has_simulated_participants_and_no_stand_ins() -> None:
    rig = rig_of(Config(), {"rehearsed": "true"}, (), ())
    assert set(rig.hands.values()) == {(REHEARSED,)}
    assert rig.simulated == ("left", "right")
    assert not rig.stand_ins
