"""Undisturbed ticks of an agent in compiled code equal the single steps, to the bit, in any sequence of answers."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any, ClassVar

import numpy as np
import pytest
from stepped_agent import SteppedAgent, answers, fixed_form

from netboard.base.config import Config
from netboard.base.safeguards import Safeguard
from netboard.base.tick import TICK_NS
from netboard.devices.safety.chain import Guard
from netboard.devices.simulated.virtual import VirtualTouch
from netboard.network.protocol.codec import encode
from netboard.network.protocol.joining import Goodbye
from netboard.network.protocol.motion import Force, Heartbeat, Point, Stylus
from netboard.network.transport import sockets
from netboard.network.transport.waiting import NO_FILE
from netboard.nodes.agent.agent_runs import ANSWERED, NEVER_DUE_NS, NOT_BEGUN, NOTHING_BEGUN, Begun, RunProgress
from netboard.participants.people.submovement import Submovement

TICKS = 3000


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


def remembered(device: VirtualTouch) -> list[np.ndarray[Any, Any]]:
    """Everything that a simulated device remembers."""
    state, window, held = device._parts
    *mechanics, holder = held
    return [state, window, *mechanics, *holder]


class Simulated(SteppedAgent):
    """An agent of a virtual device."""

    device: VirtualTouch

    def __init__(self, context: sockets.Context, config: Config, *, compiled: bool) -> None:
        device = VirtualTouch("left", config)
        device.open()
        self.source = Mover(device)
        super().__init__(context, config, device, self.source, lambda: remembered(device), compiled=compiled)


@pytest.fixture
def make() -> Iterator[Callable[..., Simulated]]:
    """Makes agents in a session."""
    every: list[Simulated] = []
    with sockets.open_context() as context:

        def new(config: Config, *, compiled: bool = True) -> Simulated:
            made = Simulated(context, config, compiled=compiled)
            every.append(made)
            made.enter_session()
            return made

        yield new
        for one in every:
            one.close()


def config_of(**safety: Any) -> Config:
    config = Config()
    return replace(config, safety=replace(config.safety, arm_time=0.05, **safety))


@pytest.mark.parametrize("passivity", [False, True])
def test_undisturbed_ticks_equal_the_single_steps(make: Callable[..., Simulated], passivity: bool) -> None:
    both = [make(config_of(passivity=passivity), compiled=compiled) for compiled in (True, False)]
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


def rendering(make: Callable[..., Simulated], *, compiled: bool = True) -> Simulated:
    """An agent whose device is armed and renders forces."""
    one = make(config_of(), compiled=compiled)
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
    one.tick()
    assert one.completed == before + 13
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


def test_late_tick_ends_although_old_answers_wait_in_both_ways(make: Callable[..., Simulated]) -> None:
    """A peer that repeats an answer for ever does not hold an agent."""
    both = [rendering(make, compiled=compiled) for compiled in (True, False)]
    for one in both:
        one.source.due_ns = NEVER_DUE_NS
        for _ in range(5):
            one.deliver(fixed_form(Force(199, 199, 200, 0.1, 300_000)))
        one.deliver(force_after(one))
        one.tick(1_500_000)
        assert one.agent._link.state["words"][0, 0] == 199
        one.tick()
        assert one.agent._link.state["words"][0, 0] > 199
    assert both[0].state() == both[1].state()


def test_first_point_of_a_tick_that_python_continues_is_rendered_alike(make: Callable[..., Simulated]) -> None:
    """An agent renders by itself from the tick after its first point; within that tick, it renders each newer one."""
    both = [rendering(make, compiled=compiled) for compiled in (True, False)]
    for number in range(20):
        for one in both:
            seq = one.agent._seq
            point = Point(20_000 + 3 * number, 0, seq, 0, 0.002, 0.1, 200.0, 2.0, 300_000)
            # Python reads the other form of the second one, after the compiled run has rendered the first.
            one.deliver(fixed_form(point))
            one.deliver(encode(replace(point, tick=point.tick + 1, z=0.004)))
            one.tick()
            assert one.agent._link.state["words"][0, 0] == point.tick + 1
        assert both[0].state() == both[1].state(), number
        for one in both:
            one.deliver(fixed_form(Force(point.tick + 2, 0, seq, 0.1, 300_000)))
            one.tick()
        assert both[0].state() == both[1].state(), number
    assert both[0].received == both[1].received


def test_position_that_is_not_a_number_is_not_ready_in_both_ways(make: Callable[..., Simulated]) -> None:
    both = [rendering(make, compiled=compiled) for compiled in (True, False)]
    for one in both:
        one.device._stylus.held.stylus["place"][0, 2] = float("nan")
        for _ in range(3):
            one.deliver(force_after(one))
            one.tick()
        newest = one.received[-1]
        assert isinstance(newest, Stylus)
        assert newest.safeguards & Safeguard.NOT_READY
        assert newest.rendered == 0.0
        assert one.agent._safety.guard in {Guard.FAULT, Guard.DISARMED}
    assert both[0].state() == both[1].state()


def test_whole_run_is_followed_by_another_without_single_steps(
    make: Callable[..., Simulated], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Unless the server was silent: the single steps tell when it answers again."""
    one = make(config_of())
    agent, calls = one.agent, list[str]()

    def run(
        progress: RunProgress, begun: Begun, reading: Any, stop: int, *source: int
    ) -> tuple[RunProgress, Begun, Any]:
        calls.append("run")
        whole = len(calls) < 3
        return progress._replace(seq=stop if whole else progress.seq), begun, reading

    def tick(*_: Any) -> int:
        calls.append("single steps")
        return 0

    monkeypatch.setattr(agent, "_undisturbed_ticks", lambda: run)
    monkeypatch.setattr(agent, "_tick", tick)
    ends = iter([False, False, False, True])
    agent._serve(lambda: next(ends))
    assert calls == ["run", "run", "run", "single steps"]
    agent._link.server_silent = True
    ends = iter([False, True])
    agent._serve(lambda: next(ends))
    assert calls[4:] == ["single steps"]
