"""The event log of a session: records before it is open are kept and not lost."""

import pytest

from netboard.network.protocol.codec import decode
from netboard.network.protocol.messages import Message
from netboard.network.protocol.records import ClockRecord, EventRecord, FrameRecord
from netboard.nodes.server.event_log import EventLog

FRAME = FrameRecord(0, "left", 7, 1, 2, 0)


class Kept:
    """What is recorded, in memory, as the log port takes it."""

    def __init__(self) -> None:
        self.messages: list[Message] = []

    def append(self, frame: bytes) -> int:
        self.messages.append(decode(frame))
        return len(self.messages) - 1


def told(kept: Kept) -> list[tuple[int, int, str]]:
    return [(event.seq, event.tick, event.name) for event in kept.messages if isinstance(event, EventRecord)]


def test_events_of_an_unopened_session_are_recorded_when_it_opens() -> None:
    kept = Kept()
    event_log = EventLog(kept)
    event_log.note(3, "agent_joined", {"side": "left"})
    event_log.record(FRAME)
    assert kept.messages == []
    event_log.opened = True
    event_log.note(9, "block_began", {})
    event_log.catch_up(9)
    event_log.catch_up(10)
    assert told(kept) == [(0, 9, "block_began"), (1, 9, "agent_joined")]


def test_an_open_session_records_all_in_its_order() -> None:
    kept = Kept()
    event_log = EventLog(kept)
    event_log.opened = True
    event_log.note(1, "start", {"trial": "1"})
    event_log.record(FRAME)
    event_log.note(2, "held", {})
    assert told(kept) == [(0, 1, "start"), (1, 2, "held")]
    assert kept.messages[1] == FRAME


def test_probes_are_numbered_on_from_port_to_port() -> None:
    kept = Kept()
    event_log = EventLog(kept)
    event_log.opened = True
    for _ in range(2):
        first = event_log.probes
        event_log.record_probes(ClockRecord(first + k, "agent.left", 0, 0, 0, 0, 0, 0, 0.0) for k in range(2))
    assert [probe.seq for probe in kept.messages] == [0, 1, 2, 3]


def test_a_stranger_has_no_power_over_the_terminal(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level("INFO")
    EventLog(Kept()).note(0, "agent_joined", {"name": "\x1b[2J", "config": "long"})
    assert caplog.messages == ["agent_joined name=?[2J"]


def test_the_log_sums_stalls_in_a_row_and_the_recording_has_each(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level("INFO")
    kept = Kept()
    event_log = EventLog(kept)
    event_log.opened = True
    for _ in range(11):
        event_log.note(1, "stood_still", {"milliseconds": "20"})
    event_log.note(2, "start", {"trial": "1"})
    event_log.note(3, "stood_still", {"milliseconds": "7"})
    event_log.note(4, "held", {})
    assert [line for line in caplog.messages if line.startswith("stood_still")] == [
        *(f"stood_still milliseconds={20 * times} times={times}" for times in (1, 2, 4, 8, 11)),
        "stood_still milliseconds=7 times=1",
    ]
    assert sum(name == "stood_still" for _, _, name in told(kept)) == 12
