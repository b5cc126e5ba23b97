"""The event log of a session: records before it is open are held and not lost."""

import logging

import pytest

from netboard.network.protocol.codec import decode
from netboard.network.protocol.messages import Message
from netboard.network.protocol.records import ClockRecord, EventRecord, FrameRecord
from netboard.nodes.server.event_log import EventLog, line_of

FRAME = FrameRecord(0, "left", 7, 1, 2, 0)


class RecordSink:
    """Stores records in memory in place of the log port."""

    def __init__(self) -> None:
        self.messages: list[Message] = []

    def append(self, frame: bytes) -> int:
        self.messages.append(decode(frame))
        return len(self.messages) - 1


def events_in(sink: RecordSink) -> list[tuple[int, int, str]]:
    return [(event.seq, event.tick, event.name) for event in sink.messages if isinstance(event, EventRecord)]


def test_events_of_an_unopened_session_are_recorded_when_it_opens() -> None:
    sink = RecordSink()
    event_log = EventLog(sink)
    event_log.note(3, "agent_joined", {"side": "left"})
    event_log.record(FRAME)
    assert sink.messages == []
    event_log.opened = True
    event_log.note(9, "block_began", {})
    event_log.record_held(9)
    event_log.record_held(10)
    assert events_in(sink) == [(0, 9, "block_began"), (1, 9, "agent_joined")]


def test_open_session_records_everything_in_order() -> None:
    sink = RecordSink()
    event_log = EventLog(sink)
    event_log.opened = True
    event_log.note(1, "start", {"trial": "1"})
    event_log.record(FRAME)
    event_log.note(2, "held", {})
    assert events_in(sink) == [(0, 1, "start"), (1, 2, "held")]
    assert sink.messages[1] == FRAME


def test_probe_numbers_continue_across_ports() -> None:
    sink = RecordSink()
    event_log = EventLog(sink)
    event_log.opened = True
    for _ in range(2):
        first = event_log.probes
        event_log.record_probes(ClockRecord(first + k, "agent.left", 0, 0, 0, 0, 0, 0, 0.0) for k in range(2))
    assert [probe.seq for probe in sink.messages] == [0, 1, 2, 3]


def test_control_characters_of_peers_are_not_logged(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level("INFO")
    EventLog(RecordSink()).note(0, "agent_joined", {"name": "\x1b[2J", "config": "long"})
    assert caplog.messages == ["agent_joined name=?[2J"]


def test_log_sums_consecutive_stalls_and_the_recording_has_each(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level("INFO")
    sink = RecordSink()
    event_log = EventLog(sink)
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
    assert sum(name == "stood_still" for _, _, name in events_in(sink)) == 12


def test_printed_event_leaves_out_what_fills_the_screen(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO)
    EventLog(RecordSink()).note(3, "agent_joined", {"side": "left", "policy_parameters": "{}", "config": "[block]"})
    assert caplog.messages == ["agent_joined side=left"]


def test_refusal_is_a_sentence_in_the_process_log() -> None:
    details = {"channel": "motion", "peer": "agent.left@vm:7", "reason": "it has not joined yet", "times": "3"}
    said = "refused on the channel motion: peer=agent.left@vm:7: it has not joined yet (so far 3 times)"
    assert line_of("refused", details) == said
    assert line_of("agent_left", {"side": "left", "reason": "fell silent"}) == "agent_left side=left reason=fell silent"
