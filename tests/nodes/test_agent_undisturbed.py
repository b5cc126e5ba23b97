"""Undisturbed ticks of an agent in compiled code equal the single steps, to the bit, in any sequence of answers."""

from collections.abc import Callable, Iterator
from dataclasses import astuple, replace
from typing import Any, ClassVar

import numpy as np
import pytest

from netboard.base.clock import Pacer
from netboard.base.config import Config
from netboard.base.tick import TICK_NS
from netboard.devices.safety.chain import Guard
from netboard.devices.simulated.virtual import VirtualTouch
from netboard.network.protocol import fixed
from netboard.network.protocol.codec import decode, encode
from netboard.network.protocol.joining import Goodbye, Welcome
from netboard.network.protocol.messages import PROTOCOL_VERSION, Message
from netboard.network.protocol.motion import Force, Heartbeat, Stylus
from netboard.network.transport import channels, sockets
from netboard.network.transport.fastpath import NO_FILE
from netboard.nodes.agent import agent as agent_module
from netboard.nodes.agent import motion_link
from netboard.nodes.agent.agent import Agent
from netboard.nodes.agent.undisturbed import ANSWERED, NEVER_DUE_NS, NOT_BEGUN, NOTHING_BEGUN, READ, Begun
from netboard.participants.submovement import Submovement

START_NS = 10**9
TICKS = 3000


def fixed_form(message: Force | Heartbeat) -> bytes:
    """The frame of an answer in its fixed form."""
    form = fixed.form_of(type(message))
    words = np.frombuffer(fixed.packer_of(type(message)).pack(*astuple(message)), np.int64)
    frame = np.zeros(form.size, np.uint8)
    fixed.write(frame, form, words)
    return frame.tobytes()


class Mover:
    """A stylus source that moves the hand every 10 ms."""

    identity: ClassVar[dict[str, str]] = {}
    file = NO_FILE

    def __init__(self, device: VirtualTouch) -> None:
        self.due_ns = 0
        self.steps: list[int] = []
        self._device, self._rng = device, np.random.default_rng(3)

    def begin(self, text: str) -> None:
        """Do nothing."""

    def step(self, now_ns: int, haptics: bool) -> None:
        """Move if it is time."""
        self._device.live(now_ns)
        if now_ns >= self.due_ns:
            self.due_ns = now_ns + 10_000_000
            self.steps.append(now_ns)
            rise = float(self._rng.normal(0.0, 0.004))
            self._device.command([Submovement("left", now_ns * 1e-9, 0.1, rise)])


class Simulated:
    """An agent and the server's end of its channel in simulated time, tick by tick."""

    def __init__(self, context: sockets.Context, patch: pytest.MonkeyPatch, config: Config, *, compiled: bool) -> None:
        endpoint = channels.Endpoint(f"inproc://motion-{id(self)}")
        self.router = sockets.motion_server(context, endpoint)
        connect = sockets.motion_agent
        with patch.context() as patched:
            patched.setattr(sockets, "motion_agent", lambda where, _, name: connect(where, endpoint, name))
            self.device = VirtualTouch("left", config)
            self.device.open()
            self.source = Mover(self.device)
            self.agent = Agent(config, "left", self.device, context, self.source)
        self.agent._warm()
        self.pacer, self.fast = Pacer(START_NS), self.agent._link.fast
        self.pacer.due_ns = START_NS
        self.run = self.agent._undisturbed_ticks() if compiled else None
        self.completed = 0
        self.received: list[Message] = []
        self.peer = b""

    def deliver(self, message: Message | bytes) -> None:
        """Send a message to the agent."""
        assert self.router.send(self.peer, message if isinstance(message, bytes) else encode(message))

    def tick(self, late_ns: int = 0) -> Begun:
        """Run a tick with the answers that have been delivered."""
        self.fast[0]["simulated_ns"] = self.pacer.due_ns + late_ns
        begun, reading, due_ns = NOTHING_BEGUN, None, self.pacer.due_ns
        if self.run is not None and self.agent._stop_seq is None:
            begun, reading = self.agent._run_undisturbed(self.run, self.pacer)
        if self.pacer.due_ns == due_ns:
            self.pacer.shift(TICK_NS + self.agent._tick(due_ns + TICK_NS, begun, reading))
        else:
            self.completed += 1
        while (received := self.router.receive()) is not None:
            self.peer = received[0]
            self.received.append(decode(received[1]))
        return begun

    def state(self) -> list[bytes]:
        """Everything that the agent and its device remember."""
        agent, link = self.agent, self.agent._link.state.copy()
        numbers = np.array([agent._seq, agent._safeguards, agent._rendered, self.pacer.due_ns])
        arrays = (link, agent._safety.chain, *self.device._parts, numbers)
        return [array.tobytes() for array in arrays]


@pytest.fixture
def make(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., Simulated]]:
    """Makes agents; the newest one that ticks sets the simulated time of Python's steps."""
    current: list[Simulated] = []

    def now_ns() -> int:
        return int(current[0].fast[0]["simulated_ns"])

    monkeypatch.setattr(agent_module, "now_ns", now_ns)
    monkeypatch.setattr(motion_link, "now_ns", now_ns)
    monkeypatch.setattr(agent_module, "MAX_TICKS", 1)
    with sockets.open_context() as context:

        def new(config: Config, *, compiled: bool = True) -> Simulated:
            made = Simulated(context, monkeypatch, config, compiled=compiled)
            tick = made.tick

            def timed(late_ns: int = 0) -> Begun:
                current[:] = [made]
                return tick(late_ns)

            made.tick = timed  # type: ignore[method-assign]
            timed()
            made.deliver(Welcome("session", PROTOCOL_VERSION, 0, ""))
            return made

        yield new


def config_of(**safety: float) -> Config:
    config = Config()
    return replace(config, safety=replace(config.safety, arm_time=0.05, **safety))


def answers(number: int, seq: int, rng: np.random.Generator) -> list[Message | bytes]:
    """What the server sends in a tick: mostly one force; sometimes none, two, a heartbeat or another form.

    For some time it sends a heartbeat every fourth tick only, as in a trial without haptic feedback.
    """
    force = Force(2 * number, number, seq, float(0.4 * np.sin(number / 40)), int(rng.integers(-100_000, 700_000)))
    if number < 20 or 1500 < number < 1530:
        return [Heartbeat(2 * number, number, seq, 300_000, True)]
    if 2200 < number < 2700:
        beat = Heartbeat(2 * number, number, seq, int(rng.integers(-100_000, 700_000)), number > 2300)
        return [] if number % 4 else [encode(beat) if number % 20 == 0 else fixed_form(beat)]
    match rng.integers(24):
        case 0:
            return []
        case 1:
            return [fixed_form(replace(force, force=100.0)), fixed_form(replace(force, tick=2 * number + 1))]
        case 2:
            return [fixed_form(replace(force, tick=2 * number - 3)), fixed_form(force)]
        case 3:
            return [force]
        case 4:
            return [fixed_form(force), b"\xc1", encode(replace(force, tick=2 * number + 1))]
        case 5:
            return [fixed_form(replace(force, force=float("nan")))] if number == 2000 else [b"", fixed_form(force)]
        case 6:
            return [Heartbeat(2 * number, number, seq, 0, True)]
    return [fixed_form(force)]


def test_undisturbed_ticks_equal_the_single_steps(make: Callable[..., Simulated]) -> None:
    both = [make(config_of(), compiled=compiled) for compiled in (True, False)]
    rng = np.random.default_rng(5)
    for number in range(TICKS):
        sent, late_ns = answers(number, number + 1, rng), int(rng.integers(0, 200_000))
        if rng.integers(300) == 0:
            late_ns = 30 * TICK_NS  # a stall
        for one in both:
            for message in sent:
                one.deliver(message)
            one.tick(late_ns)
        assert both[0].state() == both[1].state(), number
    first, second = both
    assert first.received == second.received
    assert first.agent._ring.rows.tobytes() == second.agent._ring.rows.tobytes()
    samples = [message for message in first.received if isinstance(message, Stylus)]
    assert len(samples) == TICKS - 1  # the first came before the welcome
    assert first.source.steps == second.source.steps
    assert 0.6 * TICKS < first.completed < TICKS
    assert {bool(sample.rendered) for sample in samples} == {True, False}
    assert len({sample.safeguards for sample in samples}) > 2


def rendering(make: Callable[..., Simulated], **safety: float) -> Simulated:
    """An agent whose device is armed and renders forces."""
    one = make(config_of(**safety))
    for number in range(200):
        beat = Heartbeat(number, number, number + 1, 300_000, True)
        one.deliver(beat if number < 20 else fixed_form(Force(number, number, number + 1, 0.1, 300_000)))
        one.tick()
    assert one.agent._rendered > 0.05
    return one


def force_after(one: Simulated) -> bytes:
    seq = one.agent._seq
    return fixed_form(Force(10_000 + seq, seq, seq, 0.1, 300_000))


def test_tick_with_a_force_is_complete_without_single_steps(make: Callable[..., Simulated]) -> None:
    one = rendering(make)
    one.source.due_ns = NEVER_DUE_NS
    one.deliver(force_after(one))
    before = one.completed
    assert one.tick() == NOTHING_BEGUN
    assert one.completed == before + 1


def test_tick_without_an_answer_is_complete_without_single_steps(make: Callable[..., Simulated]) -> None:
    one = rendering(make)
    one.source.due_ns = NEVER_DUE_NS
    before = one.completed
    one.tick()
    assert one.agent._rendered > 0.05  # the force of the last tick is still fresh
    one.deliver(fixed_form(Heartbeat(20_000, 0, one.agent._seq, 300_000, True)))
    for _ in range(10):
        one.tick()
    assert one.agent._rendered == 0.0
    assert one.completed == before + 11
    one.deliver(fixed_form(Heartbeat(20_001, 0, one.agent._seq, 300_000, False)))
    one.tick()
    assert one.tick().stage == NOT_BEGUN
    assert one.agent._safety.guard == Guard.RELEASING


def test_force_fades_when_the_server_falls_silent(make: Callable[..., Simulated]) -> None:
    one = rendering(make)
    for _ in range(1000):
        one.tick()
    assert one.device.felt == 0.0
    assert one.tick().stage == NOT_BEGUN  # silent for so long that the agent says hello


def test_goodbye_of_the_server_in_the_middle_of_a_tick_is_handled(make: Callable[..., Simulated]) -> None:
    one = rendering(make)
    one.source.due_ns = NEVER_DUE_NS
    one.deliver(force_after(one))
    one.deliver(Goodbye("the session is over"))
    begun = one.tick()
    assert (begun.stage, begun.came > 0) == (ANSWERED, True)
    assert one.tick().stage == NOT_BEGUN  # no session: nothing may be sent


def test_late_tick_ends_although_answers_wait_in_both_ways(make: Callable[..., Simulated]) -> None:
    both = [make(config_of(), compiled=compiled) for compiled in (True, False)]
    for number in range(100):
        for one in both:
            one.source.due_ns = NEVER_DUE_NS
            beat = Heartbeat(number, number, number + 1, 300_000, True)
            one.deliver(beat if number < 20 else fixed_form(Force(number, number, number + 1, 0.1, 300_000)))
            one.tick()
    for one in both:
        due_ns = one.pacer.due_ns
        for tick in range(1000, 1004):
            one.deliver(fixed_form(Force(tick, 0, one.agent._seq - 1, 0.1, 700_000)))
        one.tick(1_500_000)
        assert one.agent._link.state["words"][0, 0] == 1000
        assert one.pacer.due_ns == due_ns + TICK_NS + 5_000
    assert both[0].state() == both[1].state()


def test_position_beyond_the_stops_or_not_a_number_is_not_ready(make: Callable[..., Simulated]) -> None:
    one = rendering(make)
    one.device._hand.state["place"][0, 2] = float("nan")
    assert one.tick().stage == READ


@pytest.mark.parametrize(("reading", "stops"), [({"ready": False}, 0), ({"buttons": 1}, 1)])
def test_device_that_is_not_in_order_is_left_to_the_single_steps(
    make: Callable[..., Simulated], monkeypatch: pytest.MonkeyPatch, reading: dict[str, Any], stops: int
) -> None:
    one = rendering(make)
    run, seen = one.run, one.device.read(one.pacer.due_ns)._replace(**reading)
    assert run is not None
    one.run = lambda *arguments: (arguments[0], Begun(READ, -1, 0), tuple(seen))
    monkeypatch.setattr(one.device, "agent", replace(one.device.agent, stop_buttons=stops))
    one.deliver(force_after(one))
    assert one.tick().stage == READ
    assert (one.agent._stop_seq is not None) == bool(stops)
