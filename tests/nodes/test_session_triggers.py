"""Triggers of a session: what is sent to the box and when, what is recorded of it, and that the session never waits."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from fake_router import WELCOMES, FakeRouter, hello
from stepped_session import SteppedSession

from netboard.base.errors import WireError
from netboard.base.tables.triggers import Triggers
from netboard.base.tick import TICK_NS
from netboard.network.protocol.control import StatusRequest
from netboard.network.protocol.joining import Pong, Refusal
from netboard.network.protocol.triggers import (
    TRIGGER,
    TRIGGER_BOX,
    TRIGGER_INPUT,
    TRIGGER_LOST,
    BoxState,
    InputPulse,
    PulseReport,
    Trigger,
)
from netboard.network.transport import sockets
from netboard.nodes.ports.control_port import ControlPort
from netboard.nodes.ports.peer import ProbedPeer
from netboard.nodes.ports.trigger_peers import MAX_REPORTS, TriggerPeers
from netboard.nodes.server.stand_ins import TRIGGER_STAND_IN
from netboard.nodes.server.triggers import REPORT_NS, SessionTriggers
from netboard.task.trials.state_machine import Phase

BOX, OTHER = b"trigger@1", b"trigger@2"
READY = BoxState(True, "serial box at /dev/ttyACM0", False, "")
LOST = BoxState(False, "serial box at /dev/ttyACM0", False, "it was unplugged")
AHEAD_NS = 7_000_000_000
"""By which the clock of the box's machine is ahead [ns]."""


class Rig:
    """The triggers of a block whose box is connected over a router in memory."""

    def __init__(self, **settings: object) -> None:
        self.router = FakeRouter()
        self.peers = TriggerPeers(self.router)  # type: ignore[arg-type]
        self.peers.present = [BOX]
        self.peer = ProbedPeer(hello("trigger"), 0)
        self.triggers = SessionTriggers(self.peers)
        self.triggers.begin_block(Triggers(kind="serial", **settings))  # type: ignore[arg-type]
        self.report(READY)
        self.triggers.take_news(0)

    def report(self, report: BoxState | PulseReport | InputPulse, who: bytes = BOX) -> None:
        """Let a box report something."""
        self.peers.take(who, self.peer, report)

    def event(self, name: str, tick: int = 5) -> list[Trigger]:
        """Let an event happen at a tick, and return what is sent to the box."""
        self.triggers.event(name, {"trial": "1"}, tick, tick * TICK_NS, tick * TICK_NS)
        return [message for message in self.router.received_by(BOX) if isinstance(message, Trigger)]

    def share_clock(self) -> None:
        """Let the server learn the clock of the box's machine, to 100 us."""
        self.peer.answered(Pong(0, AHEAD_NS + 100_000, AHEAD_NS + 100_000), 200_000)


def test_event_with_a_code_is_sent_at_once_and_others_are_not() -> None:
    rig = Rig()
    assert rig.event("held", 9) == [Trigger(0, 9, 9 * TICK_NS, "held", 4)]
    assert rig.event("agent_joined") == []
    assert rig.event("fell", 10) == [Trigger(1, 10, 10 * TICK_NS, "fell", 5)]


def test_second_process_without_its_box_takes_no_part() -> None:
    rig = Rig()
    rig.peers.present = [OTHER, BOX]
    rig.report(LOST, OTHER)
    rig.triggers.take_news(0)
    assert rig.event("held") == [Trigger(0, 5, 5 * TICK_NS, "held", 4)]
    assert rig.router.received_by(OTHER) == []


def test_pulse_of_one_box_counts_although_another_made_none() -> None:
    rig = Rig()
    rig.peers.present = [OTHER, BOX]
    rig.report(READY, OTHER)
    rig.triggers.take_news(0)
    failed = PulseReport(0, 0, 0, 0, 0, 0, "it was unplugged")
    for last, name in ((PulseReport(0, 1, 2, 3, 0, 0, ""), TRIGGER), (replace(failed, number=1), TRIGGER_LOST)):
        rig.event("held")
        rig.report(replace(failed, number=last.number), OTHER)
        assert rig.triggers.take_news(0) == []
        rig.report(last)
        assert [news for news, _ in rig.triggers.take_news(0)] == [name]


def test_rig_without_a_box_sends_nothing_and_misses_nothing() -> None:
    rig = Rig()
    rig.triggers.begin_block(Triggers())
    assert rig.event("held") == []
    assert (rig.triggers.missing, rig.triggers.trouble, rig.triggers.take_news(10**12)) == ((), "", [])


def test_pulse_is_recorded_with_its_time_on_the_servers_clock() -> None:
    rig = Rig(loopback=True)
    rig.share_clock()
    rig.event("held", 9)
    began_ns = AHEAD_NS + 9_700_000
    rig.report(PulseReport(0, began_ns - 100_000, began_ns, began_ns + 5_000_000, began_ns + 800_000, 50_000, ""))
    ((name, details),) = rig.triggers.take_news(20_000_000)
    assert name == TRIGGER
    assert float(details.pop("bound_us")) == pytest.approx(100, abs=1)
    assert int(details.pop("pulse_ns")) == pytest.approx(9_700_000, abs=100)  # the estimate rounds, and allows a drift
    assert details == {
        "event": "held",
        "event_tick": "9",
        "code": "4",
        "latency_us": "700.0",
        "waited_us": "50.0",
        "received_us": "600.0",
        "width_us": "5000.0",
        "loopback_us": "800.0",
    }
    assert not rig.triggers.awaited(20_000_000)


def test_pulse_that_did_not_come_back_is_named() -> None:
    rig = Rig(loopback=True)
    rig.event("held")
    rig.report(PulseReport(0, 1, 2, 3, 0, 0, ""))
    ((_, details),) = rig.triggers.take_news(0)
    assert details["loopback_us"] == "lost"


def test_every_event_without_a_pulse_is_recorded_with_the_reason() -> None:
    rig = Rig()
    rig.event("held")
    rig.report(PulseReport(0, 1, 0, 0, 0, 0, "it was unplugged"))
    rig.event("fell")
    assert rig.triggers.awaited(5 * TICK_NS)
    rig.router.disconnected.add(BOX)
    rig.event("next")
    news = rig.triggers.take_news(5 * TICK_NS + 2 * REPORT_NS)
    assert [(name, details["event"], details["reason"]) for name, details in news] == [
        (TRIGGER_LOST, "next", "the trigger box takes no messages"),
        (TRIGGER_LOST, "held", "it was unplugged"),
        (TRIGGER_LOST, "fell", "the trigger box has not reported"),
    ]
    assert rig.triggers.notice == "3 events had no pulse"


def test_pulses_that_are_made_one_after_the_other_are_lost_only_once_all_before_them_could_have_ended() -> None:
    rig = Rig(width=1.0, gap=0.5)
    pulse_ns = 1_500_000_000
    rig.event("held", 0)
    rig.event("next", 0)
    assert rig.triggers.awaited(REPORT_NS + 2 * pulse_ns - 1)
    assert not rig.triggers.awaited(REPORT_NS + 2 * pulse_ns)
    assert rig.triggers.take_news(REPORT_NS + pulse_ns - 1) == []
    rig.report(PulseReport(0, 1, 2, 1_000_000_002, 0, 0, ""))
    assert [name for name, _ in rig.triggers.take_news(REPORT_NS + pulse_ns)] == [TRIGGER]
    rig.report(PulseReport(1, 1, pulse_ns, 2_500_000_000, 0, 0, ""))
    assert [name for name, _ in rig.triggers.take_news(REPORT_NS + 2 * pulse_ns - 1)] == [TRIGGER]
    rig.event("fell", 0)
    ((name, details),) = rig.triggers.take_news(REPORT_NS + pulse_ns)
    assert (name, details["reason"]) == (TRIGGER_LOST, "the trigger box has not reported")


def test_lost_box_is_recorded_once_and_named_until_it_is_back() -> None:
    rig = Rig()
    rig.report(LOST)
    rig.report(LOST)
    assert [name for name, _ in rig.triggers.take_news(0)] == [TRIGGER_BOX]
    assert rig.triggers.notice == "the trigger box is not ready: it was unplugged"
    assert rig.triggers.missing == ("the trigger box",)
    rig.report(READY)
    ((_, details),) = rig.triggers.take_news(0)
    assert details == {"box": "serial box at /dev/ttyACM0", "ready": "true"}
    assert rig.triggers.notice == ""
    rig.peers.present = []
    assert rig.triggers.trouble == "the trigger box is not ready: netboard trigger is not connected"
    rig.triggers.begin_block(Triggers(kind="serial", required=False))
    assert rig.triggers.missing == ()


def test_input_pulse_is_recorded_with_its_time_on_the_servers_clock() -> None:
    rig = Rig()
    rig.share_clock()
    rig.report(InputPulse(3, AHEAD_NS + 42))
    ((name, details),) = rig.triggers.take_news(0)
    assert (name, details["code"]) == (TRIGGER_INPUT, "3")
    assert int(details["pulse_ns"]) == pytest.approx(42, abs=100)


def test_report_of_an_unknown_trigger_is_ignored_and_too_many_are_refused() -> None:
    rig = Rig()
    rig.report(PulseReport(99, 1, 2, 3, 0, 0, ""))
    assert rig.triggers.take_news(0) == []
    for _ in range(MAX_REPORTS):
        rig.report(LOST)
    with pytest.raises(WireError, match="too many messages"):
        rig.report(LOST)


# --- in a session ------------------------------------------------------------------------------------------------


@pytest.fixture
def stepped(tmp_path: Path, context: sockets.Context) -> Iterator[SteppedSession]:
    made = SteppedSession(tmp_path, context, "triggers.kind=simulated", pilot=False)
    made.state.ports.control.triggers._router = FakeRouter()  # type: ignore[assignment]
    yield made
    made.close()


def plug_in(stepped: SteppedSession) -> FakeRouter:
    """Connect a simulated box, and return the router that sends to it."""
    peers = stepped.state.ports.control.triggers
    peers.present = [BOX]
    peers.take(BOX, ProbedPeer(hello("trigger"), 0), BoxState(True, "simulated trigger box, no hardware", True, ""))
    for name, details in stepped.state.triggers.take_news(0):
        stepped.state.note(name, details)
    stepped.state.missing = stepped.state.find_missing()
    router = peers._router
    assert isinstance(router, FakeRouter)
    return router


def test_block_waits_for_its_box_and_a_real_session_for_the_word_that_it_is_simulated(
    stepped: SteppedSession,
) -> None:
    assert stepped.do("open", '{"consent": true}')[0]
    assert stepped.do("arm")[0]
    assert stepped.do("start") == (False, "cannot start: waiting for the trigger box")
    plug_in(stepped)
    accepted, reason = stepped.do("start")
    assert not accepted
    assert TRIGGER_STAND_IN in reason
    assert stepped.do("confirm", TRIGGER_STAND_IN)[0]
    assert stepped.do("start")[0]


def test_events_of_a_trial_are_sent_with_their_own_ticks(stepped: SteppedSession) -> None:
    assert stepped.do("open", '{"pilot": true}')[0]
    router = plug_in(stepped)
    stepped.start()
    stepped.succeed()
    stepped.tick(2)
    sent = {message.event: message.tick for message in router.received_by(BOX) if isinstance(message, Trigger)}
    recorded = {event.name: event.tick for event in stepped.events() if event.name in sent}
    assert list(sent) == ["start", "level", "entered", "held", "next"]
    assert sent == recorded
    stepped.state.ports.control.triggers.present = []  # it is unplugged: the trial goes on
    stepped.until(Phase.RUNNING)


def test_trigger_box_may_report_and_nothing_else() -> None:
    router = FakeRouter()
    port = ControlPort(router, WELCOMES)  # type: ignore[arg-type]
    for message in (hello("trigger"), READY, StatusRequest()):
        router.send_from(BOX, message)
    while port.drain(lambda: 0):
        pass
    assert port.triggers.present == [BOX]
    assert [timed.report for timed in port.triggers.reports()] == [READY]
    assert Refusal("a trigger may not send StatusRequest") in router.received_by(BOX)
    port.pump(10**11)
    assert port.triggers.present == []  # it has fallen silent
