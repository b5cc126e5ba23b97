"""Lightweight peers follow the protocol: their frames equal those of the codec, and they answer as required."""

from collections import Counter
from typing import TypeVar

import numpy as np
import pytest

from evidence.loop.light_peers import LightAgent, LightDyad, LightLogger
from netboard.base.config import SIDES, Config, parse
from netboard.base.safeguards import Safeguard
from netboard.base.tick import TICK, TICK_NS
from netboard.network.protocol import fixed
from netboard.network.protocol.codec import decode, encode
from netboard.network.protocol.joining import Hello, Ping, Pong, Welcome
from netboard.network.protocol.messages import PROTOCOL_VERSION, Message
from netboard.network.protocol.motion import Force, Heartbeat, Stylus
from netboard.network.protocol.records import EventRecord, LogAck, LogBatch, LogRequest, TickRecord
from netboard.network.transport import channels, endpoints, poller, sockets
from netboard.network.transport.ports import free_port
from netboard.task.trials.state_machine import Phase

TIMEOUT = 60.0
WELCOME = Welcome("session", PROTOCOL_VERSION, 0, "")


T = TypeVar("T", bound=Message)


class Server:
    """A minimal server end of a channel."""

    def __init__(self, router: endpoints.Router) -> None:
        self.router = router
        self.peer = b""

    def wait(self, seconds: float = TIMEOUT) -> bool:
        return poller.wait_readable(self.router.socket, seconds)

    def receive_kind(self, kind: type[T]) -> T:
        """Receive the next message of a kind; a peer may send Hello more than once."""
        while self.wait():
            received = self.router.receive()
            assert received is not None
            self.peer, frame = received
            message = decode(frame)
            if isinstance(message, kind):
                return message
            assert isinstance(message, Hello)
        raise AssertionError(f"no {kind.__name__} came")

    def send(self, message: Message | bytes) -> None:
        assert self.router.send(self.peer, message if isinstance(message, bytes) else encode(message))


@pytest.fixture
def config() -> Config:
    return parse("", "test", (f"network.port={free_port()}",))


def motion_of(config: Config, context: sockets.Context) -> Server:
    where = channels.addresses(config.network)
    return Server(sockets.motion_server(context, where.listen(channels.MOTION)))


def take_until(agent: LightAgent, counts: Counter[str], what: str) -> None:
    before = counts[what]
    while counts[what] == before:
        assert poller.wait_readable(agent.socket, TIMEOUT)
        agent.receive(counts)


def test_light_agent_follows_the_agent_protocol(config: Config) -> None:
    with sockets.open_context() as context:
        motion = motion_of(config, context)
        agent, counts = LightAgent(config, "left", context), Counter[str]()
        while motion.peer == b"":  # nothing is queued for a server before the link is up
            agent.send(0.0, 0.0)
            if motion.wait(0.1):
                hello = motion.receive_kind(Hello)
        assert (hello.role, hello.side, hello.protocol) == ("agent", "left", PROTOCOL_VERSION)
        assert motion.peer.startswith(b"agent.left@")
        motion.send(WELCOME)
        motion.send(Heartbeat(4, 111, -1, 250_000, True))
        take_until(agent, counts, "beats")
        agent.send(0.01, 0.2)
        sample = motion.receive_kind(Stylus)
        assert (sample.z, sample.vz, sample.force_tick, sample.force_sent_ns) == (0.01, 0.2, 4, 111)
        assert sample.safeguards == Safeguard.ARMED
        assert 0 < sample.force_received_ns <= sample.stamp_ns <= sample.sent_ns
        words = np.zeros(len(fixed.FORCE.markers), np.int64)
        words[:3], words[4] = (5, 222, 0), 310_000
        force = np.zeros(fixed.FORCE.size, np.uint8)
        fixed.write(force, fixed.FORCE, words)
        assert decode(force.tobytes()) == Force(5, 222, 0, 0.0, 310_000)
        motion.send(force.tobytes())
        take_until(agent, counts, "forces")
        assert (agent.link.lead_ns, counts["beats"], counts["forces"]) == (310_000, 1, 1)
        agent.send(0.0, 0.0)
        following = motion.receive_kind(Stylus)
        assert (following.seq, following.force_tick) == (sample.seq + 1, 5)


def test_both_agents_of_a_dyad_send_hello_first(config: Config) -> None:
    with sockets.open_context() as context:
        motion = motion_of(config, context)
        dyad = LightDyad(config, context, moving=True)
        greeted: set[str] = set()
        at_ns = 0
        while greeted != set(SIDES):
            dyad.send(at_ns)
            at_ns += 500 * TICK_NS
            if motion.wait(0.1):
                greeted.add(motion.receive_kind(Hello).side)


def test_light_logger_acknowledges_and_keeps_only_tick_lateness(config: Config) -> None:
    with sockets.open_context() as context:
        where = channels.addresses(config.network)
        server = Server(sockets.log_server(context, where.listen(channels.LOG)))
        logger, counts = LightLogger(config, context), Counter[str]()
        now = 0
        while server.peer == b"":
            logger.poll(now, counts)
            now += 500 * TICK_NS
            if server.wait(0.1):
                server.receive_kind(Hello)
        server.send(WELCOME)
        rows, running = np.zeros(3, TICK), Phase.RUNNING
        rows["time_ns"], rows["late_ns"], rows["phase"] = (10, 20, 30), (1, 2, -3), running
        event = encode(EventRecord(0, 0, 0, "start", {}))
        records = tuple(encode(TickRecord(row.tobytes())) for row in rows)
        server.send(LogBatch(40, 0, (*records, event)))
        while counts["records"] == 0:
            logger.poll(now, counts)
        logger.poll(now, counts)
        assert server.receive_kind(LogRequest) == LogRequest(-1)
        assert server.receive_kind(LogAck).durable == 44
        server.send(Ping(77))
        while not server.wait(0.01):
            logger.poll(now, counts)
        assert server.receive_kind(Pong).ping_ns == 77
        assert np.concatenate(logger.late).tolist() == [[10, 1, running], [20, 2, running], [30, -3, running]]
        assert (counts["batches"], counts["records"]) == (1, 4)
