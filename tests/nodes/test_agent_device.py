"""The agent and its device: pulled out and put in again, stopped by a button, held by consent."""

import gc
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import final

import pytest

from netboard import channels, sockets
from netboard.clock import now_ns
from netboard.config import Config
from netboard.devices.base import Device, DeviceInfo, Reading
from netboard.errors import DeviceLost, DeviceNotFound
from netboard.nodes.agent import Agent
from netboard.wire.codec import decode, encode
from netboard.wire.meeting import Goodbye, Hello, Welcome
from netboard.wire.messages import PROTOCOL_VERSION, Message
from netboard.wire.motion import Beat, Safeguard, Stylus


@final
class Pluggable(Device):
    """A device that can be pulled out, with buttons."""

    there = True
    looked_for = 0
    buttons = 0
    ready = True
    force = (0.0, 0.0, 0.0)

    def _open(self) -> DeviceInfo:
        self.looked_for += 1
        if not self.there:
            raise DeviceNotFound("it is not there")
        return DeviceInfo("pluggable", "7", 3.0, 1.0, 0.0)

    def _read(self, now_ns: int) -> Reading:
        self._answer()
        return Reading(now_ns, 0.001, 0.0, 0.01, 0.0, 0.0, 0.0, self.buttons, self.ready)

    def _write(self, fx: float, fy: float, fz: float) -> None:
        self._answer()
        self.force = (fx, fy, fz)

    def _close(self) -> None:
        self.force = (0.0, 0.0, 0.0)

    def _answer(self) -> None:
        if not self.there:
            raise DeviceLost("somebody pulled it out")


class Server:
    """The server's end, which lets the device be armed with every beat."""

    def __init__(self, context: sockets.Context, config: Config) -> None:
        self.router = sockets.motion_server(context, channels.addresses(config.network).listen(channels.MOTION))
        self.heard: list[Message] = []
        self.may_arm = True
        self._tick = 0

    def answer(self) -> None:
        """Take everything, welcome everybody, answer every sample with a beat."""
        while (received := self.router.receive()) is not None:
            agent, message = received[0], decode(received[1])
            self.heard.append(message)
            self._tick += 1
            if isinstance(message, Hello):
                self.router.send(agent, encode(Welcome("session", PROTOCOL_VERSION, 0, "")))
            elif isinstance(message, Stylus):
                beat = Beat(self._tick, now_ns(), message.seq, 300_000, self.may_arm)
                self.router.send(agent, encode(beat))

    def heard_of(self, kind: type[Message]) -> list[Message]:
        return [message for message in self.heard if isinstance(message, kind)]


class Rig:
    """An agent that runs for so many looks at whether it should stop, with a script of what happens meanwhile."""

    def __init__(self, context: sockets.Context, port: int, **options: int) -> None:
        config = Config()
        agents = replace(config.agents, left=replace(config.agents.left, **options))
        safety = replace(config.safety, arm_time=0.01)
        network = replace(config.network, port=port, transport="ipc")
        self.config = replace(config, agents=agents, network=network, safety=safety)
        self.device = Pluggable("left", self.config)
        self.device.open()
        self.server = Server(context, self.config)
        self.agent = Agent(self.config, "left", self.device, context)
        self.bits: list[int] = []

    def run(self, looks: int, script: dict[int, Callable[[], None]]) -> None:
        done = 0

        def stopping() -> bool:
            nonlocal done
            self.server.answer()
            script.get(done, lambda: None)()
            done += 1
            return done > looks

        self.agent.run(stopping)
        self.server.answer()
        self.server.router.close_after_goodbye()

    def safeguards(self) -> int:
        """What the newest sample says."""
        newest = self.server.heard_of(Stylus)[-1]
        assert isinstance(newest, Stylus)
        return newest.safeguards


@pytest.fixture
def new_rig(unused_port: int) -> Iterator[Callable[..., Rig]]:
    interval = sys.getswitchinterval()
    with sockets.open_context() as context:
        yield lambda **options: Rig(context, unused_port, **options)
    gc.enable()  # what a steady loop has switched off
    gc.unfreeze()
    sys.setswitchinterval(interval)


@pytest.fixture
def unused_port() -> int:
    return 23_510


def test_a_device_that_is_pulled_out_is_looked_for_and_comes_back(new_rig: Callable[..., Rig]) -> None:
    rig = new_rig()
    device = rig.device

    def pull() -> None:
        assert device.force != (0.0, 0.0, 0.0)
        device.there = False

    def plug_in() -> None:
        assert device.looked_for > 1
        assert device.force == (0.0, 0.0, 0.0)
        device.there = True

    rig.run(400, {200: pull, 204: plug_in})
    (reason,) = [m.reason for m in rig.server.heard_of(Goodbye) if isinstance(m, Goodbye)][:1]
    assert reason == "the device is lost: somebody pulled it out"
    assert len(rig.server.heard_of(Hello)) == 2
    assert rig.safeguards() & Safeguard.ARMED
    assert device.force == (0.0, 0.0, 0.0)


def test_a_stop_button_cuts_the_force_at_once_until_the_server_has_disarmed(new_rig: Callable[..., Rig]) -> None:
    rig = new_rig(stop_buttons=2)
    device = rig.device

    def press() -> None:
        assert rig.safeguards() & Safeguard.ARMED
        device.buttons = 2

    def let_go() -> None:
        assert rig.safeguards() == Safeguard.STOPPED
        assert device.force == (0.0, 0.0, 0.0)
        device.buttons = 0

    def still_off() -> None:
        assert rig.safeguards() == Safeguard.STOPPED
        rig.server.may_arm = False

    def released() -> None:
        assert rig.safeguards() == 0
        rig.server.may_arm = True

    rig.run(300, {100: press, 110: let_go, 130: still_off, 150: released})
    assert rig.safeguards() & Safeguard.ARMED


def test_without_consent_or_while_not_ready_there_is_no_force(new_rig: Callable[..., Rig]) -> None:
    rig = new_rig(consent_buttons=1)
    device = rig.device

    def consent() -> None:
        assert rig.safeguards() == Safeguard.NOT_READY
        device.buttons = 1

    def dock() -> None:
        assert rig.safeguards() & Safeguard.ARMED
        device.ready = False

    rig.run(200, {50: consent, 150: dock})
    assert rig.safeguards() == Safeguard.NOT_READY
    assert device.force == (0.0, 0.0, 0.0)


def test_the_server_can_disarm_a_device(new_rig: Callable[..., Rig]) -> None:
    rig = new_rig()

    def forbid() -> None:
        assert rig.safeguards() & Safeguard.ARMED
        rig.server.may_arm = False

    rig.run(200, {100: forbid})
    assert rig.safeguards() == 0
