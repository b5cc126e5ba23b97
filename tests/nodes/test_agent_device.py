"""The agent and its device: unplugged and plugged in again, stopped by a button, enabled by a button."""

import gc
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import TypeAlias, final

import pytest

from netboard.base.clock import now_ns
from netboard.base.config import Config
from netboard.base.errors import DeviceLost, DeviceNotFound
from netboard.base.safeguards import Safeguard
from netboard.base.tick import TICK_NS
from netboard.devices.contract import profile
from netboard.devices.contract.device import Device, DeviceInfo, Reading
from netboard.network.protocol.codec import decode, encode
from netboard.network.protocol.joining import Goodbye, Hello, Welcome
from netboard.network.protocol.messages import PROTOCOL_VERSION, Message
from netboard.network.protocol.motion import Heartbeat, Stylus
from netboard.network.transport import channels, sockets
from netboard.network.transport.ports import free_port
from netboard.nodes.agent.agent import AgentNode

TIMEOUT = 60.0
"""Timeout, far above the usual time even on a busy machine [s]."""
LONG_TIMEOUTS = {"stale_after_ms": 1000.0, "disarm_after_ms": 10_000.0}
"""With these, a short stall of the machine does not remove the force."""

Step: TypeAlias = tuple[Callable[[], bool], Callable[[], None]]


@final
class Pluggable(Device):
    """A device with buttons that can be unplugged."""

    plugged = True
    lose_once = False
    open_attempts = 0
    buttons = 0
    ready = True
    force = (0.0, 0.0, 0.0)

    def _open(self) -> DeviceInfo:
        self.open_attempts += 1
        if not self.plugged:
            raise DeviceNotFound("it is not plugged in")
        return DeviceInfo("pluggable", "7", 3.0, 1.0, 0.0)

    def _read(self, now_ns: int) -> Reading:
        self._require_plugged()
        return Reading(now_ns, 0.001, 0.0, 0.01, 0.0, 0.0, 0.0, self.buttons, self.ready)

    def _write(self, fx: float, fy: float, fz: float) -> None:
        self._require_plugged()
        self.force = (fx, fy, fz)

    def _close(self) -> None:
        self.force = (0.0, 0.0, 0.0)

    def _require_plugged(self) -> None:
        lost, self.lose_once = self.lose_once, False
        if lost or not self.plugged:
            raise DeviceLost("it was unplugged")


class Server:
    """The server's end of the channel, which permits arming with every heartbeat."""

    def __init__(self, context: sockets.Context, config: Config) -> None:
        self.router = sockets.motion_server(context, channels.addresses(config.network).listen(channels.MOTION))
        self.received: list[Message] = []
        self.may_arm = True
        self.connected = True
        self.missed = 0
        self._tick = 0

    def answer(self) -> None:
        """Receive all messages, welcome each agent, and answer each sample with a heartbeat, or lose all messages."""
        while (received := self.router.receive()) is not None:
            agent, message = received[0], decode(received[1])
            if not self.connected:
                self.missed += 1
                continue
            self.received.append(message)
            self._tick += 1
            if isinstance(message, Hello):
                self.router.send(agent, encode(Welcome("session", PROTOCOL_VERSION, 0, "")))
            elif isinstance(message, Stylus):
                heartbeat = Heartbeat(self._tick, now_ns(), message.seq, 300_000, self.may_arm)
                self.router.send(agent, encode(heartbeat))

    def received_of(self, kind: type[Message]) -> list[Message]:
        return [message for message in self.received if isinstance(message, kind)]


class Rig:
    """An agent that follows a script of conditions and actions."""

    def __init__(self, context: sockets.Context, **options: int) -> None:
        config = Config()
        agents = replace(config.agents, left=replace(config.agents.left, **options))
        safety = replace(config.safety, arm_time=0.01, **LONG_TIMEOUTS)
        network = replace(config.network, port=free_port(), transport="ipc")
        self.config = replace(config, agents=agents, network=network, safety=safety)
        self.device = Pluggable("left", self.config)
        self.device.open()
        self.server = Server(context, self.config)
        self.agent = AgentNode(self.config, "left", self.device, context)

    def run(self, *script: Step) -> None:
        steps = list(script)
        end = time.monotonic() + TIMEOUT

        def stopping() -> bool:
            assert time.monotonic() < end, f"timed out {len(steps)} steps before the end"
            self.server.answer()
            if steps and steps[0][0]():
                _, action = steps.pop(0)
                action()
            return not steps

        self.agent.run(stopping)
        self.server.answer()
        self.server.router.close_after_goodbye()

    def samples(self) -> list[int]:
        """Safeguards of the samples."""
        return [message.safeguards for message in self.server.received_of(Stylus) if isinstance(message, Stylus)]

    def reports(self, safeguards: int) -> bool:
        """Whether the newest sample has exactly these safeguards."""
        return self.samples()[-1:] == [safeguards]

    def armed(self) -> bool:
        """Whether the newest sample has the device armed."""
        return any(bits & Safeguard.ARMED for bits in self.samples()[-1:])


@pytest.fixture
def new_rig() -> Iterator[Callable[..., Rig]]:
    interval = sys.getswitchinterval()
    with sockets.open_context() as context:
        yield lambda **options: Rig(context, **options)
    gc.enable()  # the agent's loop disables it
    gc.unfreeze()
    sys.setswitchinterval(interval)


def nothing() -> None:
    """Do nothing."""


def test_motors_of_a_lost_device_that_is_back_are_still_warm(new_rig: Callable[..., Rig]) -> None:
    rig = new_rig()
    lost, attempts = rig.agent._safety, rig.device.open_attempts

    def pull() -> None:
        lost.chain[0]["mean"] = 0.85  # as after some seconds at the continuous force
        rig.device.plugged = False

    def plug_in() -> None:
        rig.device.plugged = True

    rig.run(
        (lambda: bool(rig.samples()), pull),
        (lambda: rig.device.open_attempts > attempts, plug_in),
        (lambda: rig.agent._safety is not lost, nothing),
    )
    assert 0.5 < rig.agent._safety.chain[0]["mean"] <= 0.85


def test_agent_waits_until_the_profile_of_a_found_device_is_valid(new_rig: Callable[..., Rig], tmp_path: Path) -> None:
    rig = new_rig()
    rig.device._profiles = tmp_path
    damaged = profile.file_of(tmp_path, "7")

    def lose_and_damage() -> None:
        damaged.write_text("[placement]\nscale = 0\n")
        rig.device.lose_once = True

    def mend() -> None:
        assert len(rig.server.received_of(Hello)) == 1, "it joined with a damaged profile"
        damaged.unlink()

    rig.run(
        (lambda: bool(rig.samples()), lose_and_damage),
        (lambda: rig.device.open_attempts > 2, mend),
        (lambda: len(rig.server.received_of(Hello)) > 1, nothing),
    )


@pytest.mark.slow
def test_unplugged_device_is_searched_for_and_reconnected(new_rig: Callable[..., Rig]) -> None:
    rig = new_rig()
    device, received = rig.device, rig.server.received

    def pull() -> None:
        device.plugged = False

    def plug_in() -> None:
        assert device.force == (0.0, 0.0, 0.0)
        assert [m.reason for m in received if isinstance(m, Goodbye)] == ["the device is lost: it was unplugged"]
        received.clear()
        device.plugged = True

    rig.run(
        (lambda: rig.armed() and device.force != (0.0, 0.0, 0.0), pull),
        (lambda: device.open_attempts > 2 and bool(rig.server.received_of(Goodbye)), plug_in),
        (lambda: bool(rig.server.received_of(Hello)) and rig.armed(), nothing),
    )
    assert device.force == (0.0, 0.0, 0.0)


@pytest.mark.slow
def test_stop_button_cuts_the_force_until_the_server_disarms(new_rig: Callable[..., Rig]) -> None:
    rig = new_rig(stop_buttons=2)
    device = rig.device

    def press() -> None:
        device.buttons = 2

    def release_button() -> None:
        assert device.force == (0.0, 0.0, 0.0)
        device.buttons = 0
        rig.server.received.clear()

    def disarm() -> None:
        assert set(rig.samples()) == {Safeguard.STOPPED}
        rig.server.may_arm = False

    def permit_arming() -> None:
        rig.server.may_arm = True

    rig.run(
        (rig.armed, press),
        (lambda: rig.reports(Safeguard.STOPPED), release_button),
        (lambda: len(rig.samples()) >= 20, disarm),
        (lambda: rig.reports(0), permit_arming),
        (rig.armed, nothing),
    )


@pytest.mark.slow
@pytest.mark.parametrize("unplugged", [False, True])
def test_stop_that_the_server_has_missed_lasts_until_it_has_received_it(
    new_rig: Callable[..., Rig], unplugged: bool
) -> None:
    rig = new_rig(stop_buttons=2, consent_buttons=1)
    device, server = rig.device, rig.server
    device.buttons = 1

    def disconnect_and_press() -> None:
        server.connected = False
        device.buttons = 3

    def let_go() -> None:
        server.missed = 0
        device.buttons, device.plugged = 0, not unplugged

    def connect() -> None:
        server.received.clear()
        server.connected = True
        device.buttons, device.plugged = 1, True

    rig.run(
        (lambda: rig.armed() and device.force != (0.0, 0.0, 0.0), disconnect_and_press),
        (lambda: server.missed > 10, let_go),
        (lambda: device.open_attempts > 2 if unplugged else server.missed > 10, connect),
        (lambda: len(rig.samples()) > 20, nothing),
    )
    assert set(rig.samples()[2:]) == {Safeguard.STOPPED}


@pytest.mark.slow
def test_no_force_without_consent_or_while_not_ready(new_rig: Callable[..., Rig]) -> None:
    rig = new_rig(consent_buttons=1)
    device = rig.device

    def consent() -> None:
        assert set(rig.samples()) == {Safeguard.NOT_READY}
        device.buttons = 1

    def dock() -> None:
        device.ready = False

    rig.run(
        (lambda: len(rig.samples()) >= 20, consent),
        (rig.armed, dock),
        (lambda: rig.reports(Safeguard.NOT_READY), nothing),
    )
    assert device.force == (0.0, 0.0, 0.0)


@pytest.mark.slow
def test_server_can_disarm_a_device(new_rig: Callable[..., Rig]) -> None:
    rig = new_rig()

    def forbid() -> None:
        rig.server.may_arm = False

    rig.run((rig.armed, forbid), (lambda: rig.reports(0), nothing))
    armed = [bool(bits & Safeguard.ARMED) for bits in rig.samples()]
    assert sum(before and not after for before, after in pairwise(armed)) == 1, "it is not armed again"


def test_tick_ends_although_the_server_floods_the_agent_with_undecodable_frames() -> None:
    with sockets.open_context() as context:
        rig = Rig(context)
        frames = iter(range(1_000_000))
        rig.agent._kernels.await_limited_force = lambda *_: (1 + next(frames) % 2, 0.0, 0.0, 0.0, 0)
        rig.agent._tick(now_ns() + TICK_NS)
        rig.agent._link.leave("done")
        rig.server.router.close_after_goodbye()
    assert next(frames) > 0
