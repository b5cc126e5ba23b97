"""What a hand holds, in words: from what an agent states, and from older recordings."""

import pytest

from netboard.base.device_kind import KINDS_BEFORE, WORDS, DeviceKind, held_by
from netboard.devices.contract.registry import BACKENDS

MEASURED = {"profile_calibrated": "2026-01-02", "profile_identified": "2026-01-02"}


def test_device_is_described_with_kind_model_and_serial_number() -> None:
    held = held_by({"kind": "haptic", "model": "Touch", "serial": "4711", **MEASURED})
    assert held.text == "haptic device: Touch, serial 4711"
    assert not held.stand_in(haptics=True)


def test_haptic_device_that_was_never_measured_says_so() -> None:
    held = held_by({"kind": "haptic", "model": "Touch", "serial": "4711"})
    assert held.text.endswith("(never calibrated, mass not identified)")


@pytest.mark.parametrize(
    ("details", "kind"),
    [
        ({"kind": "simulated"}, DeviceKind.SIMULATED),
        ({"device": "virtual"}, DeviceKind.SIMULATED),
        ({"device": "mouse"}, DeviceKind.POINTER),
        ({"device": "of another lab"}, DeviceKind.UNDECLARED),
        ({"kind": "real, I promise"}, DeviceKind.UNDECLARED),
        ({}, DeviceKind.UNDECLARED),
    ],
)
def test_all_but_a_haptic_device_stands_in_for_one(details: dict[str, str], kind: DeviceKind) -> None:
    held = held_by(details)
    assert held.kind is kind
    assert held.stand_in(haptics=False)
    assert WORDS[kind] in held.text


def test_device_without_force_is_a_stand_in_only_where_force_is_needed() -> None:
    held = held_by({"kind": "input"})
    assert held.stand_in(haptics=True) == "without force"
    assert not held.stand_in(haptics=False)


def test_kinds_of_older_recordings_are_those_of_the_registry() -> None:
    assert {name: backend.kind for name, backend in BACKENDS.items() if name in KINDS_BEFORE} == KINDS_BEFORE
