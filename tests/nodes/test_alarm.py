"""Emergency stops; each trip of a device's safety chain is reported once."""

from netboard.base.safeguards import PARTNER_LET_GO, TRIP_CAUSES, Safeguard
from netboard.nodes.ports.emergency import RELEASE, REPEAT_INTERVAL_NS, STOP, EmergencyStop
from netboard.nodes.ports.samples import STOPPED, TRIPPED

FINE = {"left": 0, "right": 0}


def test_every_safety_trip_has_a_description() -> None:
    no_trip = {Safeguard.ARMED, Safeguard.RAMPING, Safeguard.CLAMPED, Safeguard.SLEWED}
    assert set(TRIP_CAUSES) == set(Safeguard) - no_trip


def test_emergency_stop_holds_until_released() -> None:
    alarm = EmergencyStop()
    assert alarm.halt("by an operator") == [(STOP, {"reason": "by an operator"})]
    assert alarm.halt("again") == []
    assert alarm.halted == "by an operator"
    assert alarm.release() == [(RELEASE, {})]
    assert alarm.halted == ""
    assert alarm.release() == []


def test_stop_button_of_either_device_triggers_the_emergency_stop() -> None:
    for found, side in ((STOPPED, "left"), (STOPPED << 1, "right")):
        alarm = EmergencyStop()
        assert alarm.poll(found, FINE, 0) == [(STOP, {"reason": f"emergency stop at the {side} device"})]
        assert alarm.poll(found, FINE, 1) == []


def test_safety_trip_is_reported_with_its_cause_at_intervals() -> None:
    alarm = EmergencyStop()
    bits = {"left": Safeguard.ARMED.value, "right": (Safeguard.TOO_FAST | Safeguard.STALE).value}
    events = alarm.poll(TRIPPED << 1, bits, 0)
    assert [name for name, _ in events] == ["safeguard"] * 2
    assert {event["cause"] for _, event in events} == {TRIP_CAUSES[Safeguard.TOO_FAST], TRIP_CAUSES[Safeguard.STALE]}
    assert {event["side"] for _, event in events} == {"right"}
    assert alarm.poll(TRIPPED << 1, bits, REPEAT_INTERVAL_NS - 1) == []
    assert len(alarm.poll(TRIPPED << 1, bits, REPEAT_INTERVAL_NS)) == 2
    assert alarm.halted == ""


def test_reason_for_a_disarmed_device_is_its_latest_trip() -> None:
    alarm = EmergencyStop()
    alarm.poll(TRIPPED, {"left": Safeguard.NOT_READY.value, "right": 0}, 0)
    assert alarm.why("left", 1) == f" ({TRIP_CAUSES[Safeguard.NOT_READY]})"
    assert alarm.why("right", 1) == ""
    assert alarm.why("left", REPEAT_INTERVAL_NS) == ""


def test_device_of_a_robot_partner_that_is_not_ready_has_been_let_go() -> None:
    alarm = EmergencyStop()
    alarm.robots = frozenset(("right",))
    bits = {"left": Safeguard.NOT_READY.value, "right": Safeguard.NOT_READY.value}
    causes = {event["side"]: event["cause"] for _, event in alarm.poll(TRIPPED | TRIPPED << 1, bits, 0)}
    assert causes == {"left": TRIP_CAUSES[Safeguard.NOT_READY], "right": PARTNER_LET_GO}
    assert alarm.why("right", 1) == f" ({PARTNER_LET_GO})"
