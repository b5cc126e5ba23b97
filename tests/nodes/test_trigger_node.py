"""The process of a trigger box: pulses at once, a report for each, and a box that is lost and comes back."""

from collections import deque
from collections.abc import Callable, Iterator
from typing import ClassVar

import pytest

from fakes import FakeClock
from netboard.base.errors import DeviceLost, DeviceNotFound, DeviceTimeout
from netboard.base.tables.triggers import Triggers
from netboard.devices.triggers.simulated import SimulatedBox
from netboard.network.protocol.codec import decode, encode
from netboard.network.protocol.joining import Goodbye, Hello, Welcome
from netboard.network.protocol.messages import PROTOCOL_VERSION, Message
from netboard.network.protocol.triggers import BoxState, InputPulse, PulseReport, Trigger
from netboard.nodes.trigger.node import MAX_INPUT_PER_SECOND, RETRY_NS, SECOND_NS, TriggerNode


class ControlLine:
    """The node's end of the control channel in memory; each wait advances the clock by a millisecond."""

    def __init__(self, clock: FakeClock) -> None:
        self.sent: list[Message] = []
        self.inbox: deque[bytes] = deque()
        self._clock = clock

    def wait(self, seconds: float) -> bool:
        self._clock.advance(0.001)
        return bool(self.inbox)

    def receive(self) -> bytes | None:
        return self.inbox.popleft() if self.inbox else None

    def send(self, frame: bytes) -> bool:
        self.sent.append(decode(frame))
        return True


class FragileBox(SimulatedBox):
    """A simulated box that can be unplugged."""

    gone = False
    failures = 0  # writes that fail from now on

    def open(self) -> None:
        if self.gone:
            raise DeviceNotFound("no such port")
        super().open()

    def write(self, code: int) -> None:
        if self.gone:
            raise DeviceLost("it was unplugged")
        if self.failures:
            self.failures -= 1
            raise DeviceTimeout("it takes no bytes")
        super().write(code)


class Rig:
    """A node in a session, with a box."""

    boxes: ClassVar[list[FragileBox]] = []

    def __init__(self, **settings: object) -> None:
        self.clock = FakeClock()
        self.line = ControlLine(self.clock)
        self.box = FragileBox(Triggers(kind="simulated", **settings))  # type: ignore[arg-type]
        self.boxes.append(self.box)
        self.node = TriggerNode(self.box, self.line, self.clock)
        self.node.run(self.counted(3))
        self.node = TriggerNode(self.box, self.line, self.clock)
        self.line.sent.clear()
        self.step(2)

    def counted(self, steps: int) -> Callable[[], bool]:
        """Return a request to stop that comes after some steps."""
        left = iter([False] * steps)
        return lambda: next(left, True)

    def step(self, times: int = 1) -> None:
        """Let the node take its turns."""
        for _ in range(times):
            self.node.step()

    def receive(self, message: Message) -> None:
        """Let the server send a message."""
        self.line.inbox.append(encode(message))
        self.step()

    def sent(self, kind: type[Message]) -> list[Message]:
        """Return and clear what the node has sent of a kind."""
        found = [message for message in self.line.sent if isinstance(message, kind)]
        self.line.sent = [message for message in self.line.sent if not isinstance(message, kind)]
        return found


@pytest.fixture(autouse=True)
def closed_boxes() -> Iterator[None]:
    yield
    while Rig.boxes:
        Rig.boxes.pop().close()


WELCOME = Welcome("session", PROTOCOL_VERSION, 0, "")


def test_node_joins_as_a_trigger_box_and_says_what_it_has() -> None:
    rig = Rig()
    (hello, *_) = rig.sent(Hello)
    assert isinstance(hello, Hello)
    assert (hello.role, hello.details) == ("trigger", {"box": "simulated trigger box, no hardware"})
    rig.sent(BoxState)
    rig.receive(WELCOME)
    assert rig.sent(BoxState) == [BoxState(True, rig.box.text, True, "")]


def test_trigger_is_written_in_the_turn_in_which_it_arrives() -> None:
    rig = Rig()
    rig.receive(Trigger(4, 100, 1, "held", 4))
    assert rig.box.lines == 4
    rig.step(6)
    assert rig.box.lines == 0
    (report,) = rig.sent(PulseReport)
    assert isinstance(report, PulseReport)
    assert (report.number, report.fault, report.edge_ns) == (4, "", 0)
    assert report.received_ns <= report.began_ns < report.ended_ns


def test_pulse_that_comes_back_is_reported_with_its_edge_and_others_as_input() -> None:
    rig = Rig(loopback=True)
    rig.receive(Trigger(0, 1, 1, "held", 4))
    rig.step(7)
    (report,) = rig.sent(PulseReport)
    assert isinstance(report, PulseReport)
    assert report.edge_ns > 0
    rig.box.write(9)  # a pulse that the node has not made
    rig.step()
    (pulse,) = rig.sent(InputPulse)
    assert isinstance(pulse, InputPulse)
    assert pulse.code == 9


def test_floating_input_reports_a_few_pulses_a_second_and_counts_the_others(caplog: pytest.LogCaptureFixture) -> None:
    rig = Rig()
    for _ in range(10):
        rig.box._ends[1].send(bytes([1] * 15))
        rig.step()
    assert len(rig.sent(InputPulse)) == MAX_INPUT_PER_SECOND
    assert f"after {MAX_INPUT_PER_SECOND} in a second: does the input line float?" in caplog.text
    rig.receive(Trigger(0, 1, 1, "held", 4))
    rig.step(6)
    assert [report.fault for report in rig.sent(PulseReport) if isinstance(report, PulseReport)] == [""]
    rig.clock.advance(SECOND_NS * 1e-9)
    rig.box._ends[1].send(b"\x01")
    rig.step()
    assert len(rig.sent(InputPulse)) == 1


def test_lost_box_fails_its_triggers_in_words_and_is_opened_again() -> None:
    rig = Rig()
    rig.sent(BoxState)
    rig.box.gone = True
    rig.receive(Trigger(0, 1, 1, "held", 4))
    rig.receive(Trigger(1, 2, 2, "next", 7))
    faults = [(one.number, one.fault) for one in rig.sent(PulseReport) if isinstance(one, PulseReport)]
    assert faults == [(0, "it was unplugged"), (1, "it was unplugged")]
    assert rig.sent(BoxState) == [BoxState(False, rig.box.text, True, "it was unplugged")]
    rig.clock.advance(RETRY_NS * 1e-9)
    rig.step()
    assert rig.sent(BoxState) == [BoxState(False, rig.box.text, True, "no such port")]
    rig.box.gone = False
    rig.clock.advance(RETRY_NS * 1e-9)
    rig.step()
    assert rig.sent(BoxState) == [BoxState(True, rig.box.text, True, "")]
    rig.receive(Trigger(2, 3, 3, "level", 1))
    assert rig.box.lines == 1


def test_stopped_node_leaves_the_lines_low() -> None:
    rig = Rig()
    rig.box.close()  # which the node opens again
    rig.line.inbox.append(encode(Trigger(0, 1, 1, "held", 4)))
    rig.node.run(rig.counted(1))
    assert rig.box.lines == 0
    assert rig.sent(Goodbye) == [Goodbye("the trigger box was stopped")]


def test_code_does_not_stay_on_the_lines_if_the_end_of_its_pulse_cannot_be_written() -> None:
    rig = Rig()
    rig.receive(Trigger(0, 1, 1, "held", 4))
    rig.box.failures = 1
    rig.step(6)
    assert rig.box.lines == 0
    assert [one.fault for one in rig.sent(PulseReport) if isinstance(one, PulseReport)] == ["it takes no bytes"]


def test_box_that_takes_no_code_at_all_is_said_to_show_one(caplog: pytest.LogCaptureFixture) -> None:
    rig = Rig()
    rig.receive(Trigger(0, 1, 1, "held", 4))
    rig.box.failures = 2
    rig.step(6)
    assert "may still show a code: it takes no bytes" in caplog.text


def test_error_of_the_node_leaves_the_lines_low() -> None:
    rig = Rig()
    rig.box.close()  # which the node opens again
    rig.line.inbox.append(encode(Trigger(0, 1, 1, "held", 4)))
    turns = iter([False])
    with pytest.raises(StopIteration):
        rig.node.run(lambda: next(turns))
    assert rig.box.lines == 0
    assert rig.box.file < 0
