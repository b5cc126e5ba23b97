"""The device whose stylus a robot partner holds: its contract, its bits, and partners that fail."""

import json
from collections.abc import Iterator
from dataclasses import replace
from math import nan
from threading import Thread

import numpy as np
import pytest

from netboard.base.compiled import composed, inlined
from netboard.base.config import Config, Side
from netboard.base.errors import ConfigError, NetboardError
from netboard.devices.contract.device import Device
from netboard.devices.simulated.partner import RobotPartner
from netboard.participants.body.stylus import ACTION, HandMechanics
from netboard.participants.policy import Policy, identity_of
from netboard.participants.seat.block import Rehearsal
from netboard.participants.seat.partners import POLICIES
from netboard.testing.device import MS, DeviceContract

STATE = np.dtype([("updates", "<i8")])


def configured(name: str, config: Config | None = None) -> Config:
    config = config or Config()
    agent = replace(config.agents.left, device="partner", options={"partner": name})
    return replace(config, agents=replace(config.agents, left=agent))


class TestRobotPartner(DeviceContract):
    def make(self, config: Config) -> Device:
        return RobotPartner("left", config)

    def motor_force(self, device: Device) -> tuple[float, float, float]:
        assert isinstance(device, RobotPartner)
        x, y, z = device._written.tolist()
        return x, y, z


@inlined
def _hold_then_fail(state: np.void, k: np.void, observation: np.void, actions: np.ndarray) -> None:
    state["updates"] += 1
    actions[0]["stiffness"], actions[0]["damping"] = 100.0, 5.0
    actions[0]["target"][2] = 0.01
    if state["updates"] > 200:
        actions[0]["force"][2] = k


class Failing(Policy):
    """A partner that commands what is not a number after a while."""

    kind, sides, decide = "failing", ("left",), staticmethod(_hold_then_fail)
    constants = np.full(1, nan)

    def initial(self, seed: tuple[int, ...]) -> np.ndarray:
        return np.zeros(1, STATE)

    def hand(self) -> HandMechanics:
        return HandMechanics(mass=0.5, impedance=None)

    @property
    def identity(self) -> dict[str, str]:
        return identity_of(self.kind)


def failing(config: Config, side: Side) -> Policy:
    """Make the partner of this test."""
    return Failing()


class Strong(Failing):
    """A partner that commands more than a hand can do after a while."""

    constants = np.full(1, 100.0)


def strong(config: Config, side: Side) -> Policy:
    """Make the partner that is too strong."""
    return Strong()


@inlined
def _pause_once(state: np.void, k: np.void, observation: np.void, actions: np.ndarray) -> None:
    state["updates"] += 1
    if state["updates"] == 5:
        total = 0.0
        for i in range(300_000_000):
            total += np.sqrt(i + total)
        actions[0]["target"][0] = 1e-30 * total


class Slow(Failing):
    """A partner that takes a second for its fifth decision."""

    decide = staticmethod(_pause_once)


def slow(config: Config, side: Side) -> Policy:
    """Make the partner that is slow."""
    return Slow()


@inlined
def _raise_after_a_while(state: np.void, k: np.void, observation: np.void, actions: np.ndarray) -> None:
    state["updates"] += 1
    if state["updates"] > 50:
        raise ValueError("my policy failed")


class Raising(Failing):
    """A partner that raises after a while."""

    decide = staticmethod(_raise_after_a_while)


def raising(config: Config, side: Side) -> Policy:
    """Make the partner that raises."""
    return Raising()


@inlined
def _not_compilable(state: np.void, k: np.void, observation: np.void, actions: np.ndarray) -> None:
    actions[0]["force"][2] = float(json.dumps(1.0))


class Uncompiled(Failing):
    """A partner whose kernel is no code that Numba can compile."""

    decide = staticmethod(_not_compilable)


def uncompiled(config: Config, side: Side) -> Policy:
    """Make the partner that does not compile."""
    return Uncompiled()


class Plain(Failing):
    """A partner whose kernel is not compiled."""

    decide = staticmethod(lambda state, k, observation, actions: None)


def plain(config: Config, side: Side) -> Policy:
    """Make the partner whose kernel is not compiled."""
    return Plain()


class SeesTruth(Failing):
    """A partner that sees what no agent knows."""

    sees_truth = True


def sees_truth(config: Config, side: Side) -> Policy:
    """Make the other partner of this test."""
    return SeesTruth()


@pytest.fixture
def _partners(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    for made in (failing, strong, slow, raising, uncompiled, plain, sees_truth):
        monkeypatch.setitem(POLICIES, made.__name__, f"{__name__}:{made.__name__}")
    return


@pytest.mark.usefixtures("_partners")
@pytest.mark.parametrize(
    ("name", "why"),
    [("failing", "commanded what is not a number"), ("strong", "commanded a force of more than 50 N")],
)
def test_partner_that_commands_the_impossible_lets_go_and_the_device_is_not_ready(name: str, why: str) -> None:
    device = RobotPartner("left", configured(name))
    device.open()
    readings = [device.read(k * MS) for k in range(1, 400)]
    ready = [reading.ready for reading in readings]
    failed = ready.index(False)
    assert 190 < failed < 210
    assert not any(ready[failed:])
    assert all(np.isfinite(reading[1:7]).all() for reading in readings)
    assert readings[failed - 1].z == pytest.approx(0.01, abs=1e-3)
    assert device.fault == f"the robot partner '{name}' {why}, and has let go of the stylus"
    updates = device._policy_state["updates"][0]
    device.read(400 * MS)
    assert device._policy_state["updates"][0] == updates, "who has let go is not asked again"
    device.play(*device.prepared(configured(name)))
    assert device.fault == ""
    assert device.read(401 * MS).ready


@pytest.mark.usefixtures("_partners")
def test_other_threads_see_a_decision_that_takes_long_and_can_make_the_partner_let_go() -> None:
    device = RobotPartner("left", configured("slow"))
    device.open()
    for k in range(1, 4):
        device.read(k * MS)
    assert device.decision is None
    reading = Thread(target=lambda: [device.read(k * MS) for k in range(4, 10)])
    reading.start()
    while device.decision is None and reading.is_alive():
        pass
    assert device.decision is not None
    device.let_go()
    reading.join()
    assert device.decision is None
    assert device.fault.startswith("the robot partner 'slow' takes longer to decide than the millisecond that it has")
    assert not device.read(10 * MS).ready


@pytest.mark.usefixtures("_partners")
def test_partner_that_sees_the_true_state_is_refused() -> None:
    with pytest.raises(ConfigError, match="'sees_truth' sees the true state of the scene, which"):
        RobotPartner("left", configured("sees_truth"))


@pytest.mark.usefixtures("_partners")
def test_partner_that_does_not_compile_is_refused_in_one_line() -> None:
    words = r"^the robot partner 'uncompiled' cannot be used: Unknown attribute 'dumps' .* \(File .*, line \d+\)$"
    with pytest.raises(ConfigError, match=words):
        RobotPartner("left", configured("uncompiled"))


@pytest.mark.usefixtures("_partners")
@pytest.mark.parametrize(
    ("name", "why"), [("raising", "ValueError: my policy failed"), ("uncompiled", "Unknown attribute 'dumps'")]
)
def test_rehearsal_names_a_partner_that_fails(name: str, why: str) -> None:
    config = replace(Config(), block=replace(Config().block, left=name, trials=1))
    rehearsal = Rehearsal(config, {"A": config.participant, "B": config.participant})
    with pytest.raises(NetboardError, match=f"the robot partner '{name}' has failed: {why}"):
        list(rehearsal.pieces())


@pytest.mark.usefixtures("_partners")
def test_partner_whose_kernel_is_plain_python_is_refused() -> None:
    with pytest.raises(ConfigError, match="'plain' has a kernel `decide` in plain Python, expected one"):
        RobotPartner("left", configured("plain"))


def test_unknown_partner_is_refused() -> None:
    with pytest.raises(ConfigError, match="no robot partner 'nobody'"):
        RobotPartner("left", configured("nobody"))


def _decide(state: np.void, constants: np.void, observation: np.void, actions: np.ndarray) -> None:
    raise NotImplementedError


def _offline(state: np.ndarray, constants: np.ndarray, observation: np.ndarray, actions: np.ndarray) -> None:
    _decide(state[0], constants[0], observation[0], actions)


@pytest.mark.slow
def test_partner_acts_alike_live_and_offline() -> None:
    """The live device with the views of a rehearsal; then the kernel alone with the same observations: equal bits."""
    config = Config()
    config = replace(config, block=replace(config.block, left="robot", trials=1))
    rehearsal = Rehearsal(config, {"A": config.participant, "B": config.participant})
    seen = [
        rehearsal._seats[0].observation["seen"].copy() for _, _ in zip(range(4000), rehearsal.pieces(1), strict=False)
    ]
    device = RobotPartner("left", configured("robot", config))
    device.open()
    policy, state = device.prepared(config)
    device.play(policy, state)
    holder, tick = device._stylus.held.holder, -2
    observed, acted = [], []
    device.tell(1.0)
    for k, view in enumerate(seen, start=1):
        holder.observation["seen"] = view
        device.write(0.0, 0.0, 0.1 * np.sin(0.01 * k))
        device.read(k * MS)
        device.live(k * MS)
        if holder.observation["tick"][0] > tick:
            tick = holder.observation["tick"][0]
            observed.append(holder.observation.copy())
            acted.append(holder.actions[:1].tobytes())
    assert len(acted) > 3900
    assert len(set(acted)) > 1000
    actions, constants = np.zeros(2, ACTION), policy.constants
    state = policy.initial((config.block.seed, config.block.number))
    offline = composed(_offline, _decide=policy.decide)
    for observation, action in zip(observed, acted, strict=True):
        offline(state, constants, observation, actions)
        assert actions[:1].tobytes() == action
