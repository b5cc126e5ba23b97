"""An agent and the server's end of its channel in simulated time, tick by tick, by compiled runs or single steps."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import astuple, replace
from typing import Any

import numpy as np
import pytest

from netboard.base.clock import Pacer
from netboard.base.config import Config
from netboard.base.tick import TICK_NS
from netboard.devices.contract.device import Device
from netboard.network.protocol import fixed
from netboard.network.protocol.codec import decode, encode
from netboard.network.protocol.joining import Welcome
from netboard.network.protocol.messages import PROTOCOL_VERSION, Message
from netboard.network.protocol.motion import Force, Heartbeat, Point
from netboard.network.transport import channels, sockets
from netboard.nodes.agent import agent as agent_module
from netboard.nodes.agent import motion_link
from netboard.nodes.agent.agent import AgentNode, StylusSource
from netboard.nodes.agent.agent_runs import NOTHING_BEGUN, Begun

START_NS = 10**9


def fixed_form(message: Force | Heartbeat | Point) -> bytes:
    """The frame of an answer in its fixed form."""
    form = fixed.form_of(type(message))
    words = np.frombuffer(fixed.packer_of(type(message)).pack(*astuple(message)), np.int64)
    frame = np.zeros(form.size, np.uint8)
    fixed.write(frame, form, words)
    return frame.tobytes()


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


class SteppedAgent:
    """An agent of an open device, and the router that its frames go to."""

    def __init__(
        self,
        context: sockets.Context,
        config: Config,
        device: Device,
        source: StylusSource | None,
        memory: Callable[[], list[np.ndarray[Any, Any]]],
        *,
        compiled: bool,
    ) -> None:
        endpoint = channels.Endpoint(f"inproc://motion-{id(self)}")
        self.router = sockets.motion_server(context, endpoint)
        connect = sockets.motion_agent
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(sockets, "motion_agent", lambda where, _, name: connect(where, endpoint, name))
            self.agent = AgentNode(config, "left", device, context, source)
        self.agent._warm()
        self.device, self._memory = device, memory
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
        with simulated_time(self):
            if self.run is not None:
                begun, reading = self.agent._run_undisturbed(self.run, self.pacer)
            if self.pacer.due_ns == due_ns:
                self.pacer.shift(TICK_NS + self.agent._tick(due_ns + TICK_NS, begun, reading))
            else:
                self.completed += 1
        while (received := self.router.receive()) is not None:
            self.peer = received[0]
            self.received.append(decode(received[1]))
        return begun

    def close(self) -> None:
        """Close both ends."""
        self.agent._link._path.close()
        self.agent._link._socket.close()
        self.router.socket.close()

    def enter_session(self) -> None:
        """Let the server welcome the agent."""
        self.tick()
        self.deliver(Welcome("session", PROTOCOL_VERSION, 0, ""))

    @property
    def stop_seq(self) -> int:
        """First sample that tells of an emergency stop that the server may not know."""
        return int(self.agent._arming.state[0]["stop_seq"])

    def state(self) -> list[bytes]:
        """Everything that the agent and its device remember."""
        agent = self.agent
        numbers = np.array([agent._seq, agent._safeguards, agent._rendered, self.pacer.due_ns])
        arrays = (agent._link.state, *agent._rules, *self._memory(), numbers)
        return [array.tobytes() for array in arrays]


@contextmanager
def simulated_time(one: SteppedAgent) -> Iterator[None]:
    """Give Python's steps the simulated time of an agent, in runs of one tick."""
    with pytest.MonkeyPatch.context() as patch:
        for module in (agent_module, motion_link):
            patch.setattr(module, "now_ns", lambda: int(one.fast[0]["simulated_ns"]))
        patch.setattr(agent_module, "MAX_TICKS", 1)
        yield
