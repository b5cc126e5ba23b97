"""A dyad far from its server, in simulated time: the parts of a session with network delays between them.

The stage, the server's peers, the fixed-form messages, the virtual devices, the agent's copy of the virtual coupling,
its passivity control and its safety chain are those of a session and run in the same order. Only sockets and clocks are
omitted. Every millisecond each agent reads its stylus, and at the same moment the server computes its tick from the
samples that have arrived. Network delays are whole milliseconds; clock offsets are zero and known.
"""

from collections import deque
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.config import SIDES, Config, Side
from netboard.base.safeguards import Safeguard
from netboard.base.tables.rig import Agent, Agents, Fixture
from netboard.base.tables.scene import Physics
from netboard.base.tick import START_NS, TICK, TICK_NS, TICK_WORDS
from netboard.devices.safety.chain import Guard, SafetyChain
from netboard.devices.safety.passivity import Passivity
from netboard.devices.safety.virtual_coupling import hand_force
from netboard.devices.simulated.virtual import VirtualTouch
from netboard.network.protocol import fixed
from netboard.network.protocol.motion import Force, Point, Stylus
from netboard.nodes.ports import samples
from netboard.stage.stage import Stage, make_stage
from netboard.task.trials.state_machine import Cause

TIMEOUT_NS = 1_000_000_000
"""Sample timeout, long enough that no sample is stale [ns]."""

READY = 10
"""Ticks until both devices are armed and the trial runs, with a margin [1]."""

ARM_TIME = 1e-3
"""Duration of the force ramp; it ends within the first armed tick [s]."""

_COMMAND = TICK_WORDS["command"]
_STYLUS, _FORCE, _POINT = (fixed.packer_of(message) for message in (Stylus, Force, Point))


@cache
def _stage(physics: Physics) -> Stage:
    """Return the stage of a scene, which is built only once."""
    return make_stage(Config(physics=physics))


def simulation_config(config: Config) -> Config:
    """Return a configuration for a simulation: released styluses, no pauses."""
    free = Agent(options={"held": False})
    return replace(
        config,
        safety=replace(config.safety, arm_time=ARM_TIME, mean_force=config.safety.max_force),
        agents=Agents(left=free, right=free),
        fixture=Fixture(0.0, 0.0),
    )


class Station:
    """One side: device, agent, and the messages under way to the server and back."""

    def __init__(self, side: Side, config: Config, delay: int) -> None:
        self.device = VirtualTouch(side, config)
        self.rendered = 0.0
        self.safeguards = 0
        self.sent: deque[NDArray[np.uint8]] = deque()
        self.answers: deque[NDArray[np.uint8]] = deque()
        self._delay = delay
        most = self.device.open().max_force
        self._safety = SafetyChain(config.safety, most, most)  # a run is too short to wear motors
        self._passivity = Passivity() if config.safety.passivity else None
        self._newest: Force | Point | None = None
        self._force = np.zeros(len(fixed.FORCE.markers), np.int64)
        self._point = np.zeros(len(fixed.POINT.markers), np.int64)
        self._sample = np.zeros(len(fixed.STYLUS.markers), np.int64)

    def read(self, number: int, now_ns: int) -> None:
        """Read the stylus and send it."""
        self.reading = self.device.read(now_ns)
        x, y, z, vx, vy, vz = self.reading[1:7]
        _STYLUS.pack_into(
            self._sample.data,
            0,
            *(number, now_ns, x, y, z, vx, vy, vz, 0, self.safeguards, self.rendered, -1, 0, 0, now_ns, 0),
        )
        frame = np.zeros(fixed.STYLUS.size, np.uint8)
        fixed.write(frame, fixed.STYLUS, self._sample)
        self.sent.append(frame)
        if self._passivity is not None:
            self._passivity.remember(number, z)
        if self._safety.guard is Guard.DISARMED:
            self._safety.arm()

    def arriving(self) -> NDArray[np.uint8] | None:
        """Return the sample that arrives at the server now, if any."""
        return self.sent.popleft() if len(self.sent) > self._delay else None

    def render(self, now_ns: int) -> None:
        """Receive the answer that arrives now, if any, and render a force."""
        if len(self.answers) > self._delay:
            self._receive(self.answers.popleft())
        limited = self._safety.step(now_ns, (0.0, 0.0, self._wanted(now_ns)), now_ns, self.reading[4:7])
        self.device.write(limited.fx, limited.fy, limited.fz)
        self.rendered = limited.fz
        self.safeguards = int(limited.safeguards)

    def _receive(self, frame: NDArray[np.uint8]) -> None:
        if fixed.read(frame, fixed.FORCE, self._force):
            self._newest = Force(*_FORCE.unpack(self._force.data))
        elif fixed.read(frame, fixed.POINT, self._point):
            self._newest = Point(*_POINT.unpack(self._point.data))

    def _wanted(self, now_ns: int) -> float:
        """Return the force on the hand that the agent commands."""
        message, reading = self._newest, self.reading
        if isinstance(message, Point):
            return hand_force(message, now_ns, reading)
        if message is None:
            return 0.0
        if self._passivity is None:
            return message.force
        return self._passivity.step(message.force, message.stylus_seq, reading.z, reading.vz, self.rendered)


class DistantDyad:
    """Both sides, and the server.

    - `delay`: delay of a sample to the server, and of the answer to it [ms].
    - `heights`, `forces`: of both styluses, for each millisecond since both were ready [m, N].
    - `cut`: whether a safety chain has cut a force since then, because the stylus was too fast.
    """

    def __init__(self, config: Config, delay: int) -> None:
        config = simulation_config(config)
        self._delay = delay
        self.stations = [Station(side, config, delay) for side in SIDES]
        self.heights: list[tuple[float, float]] = []
        self.forces: list[tuple[float, float]] = []
        self.cut = False
        self._both = config.physics.coupling_at == "both"
        self._ends = samples.ends_of(config.physics)
        self._stage = _stage(config.physics)
        self._state = self._stage.initial()
        self._rows = np.zeros(1, TICK)
        self._row = self._rows.view(np.int64).reshape(-1)
        self._samples = np.zeros((len(SIDES), samples.WORDS), np.int64)
        for sample in self._samples:
            samples.empty(sample)
            sample[samples.CLOCK_KNOWN] = 1
        self._sample = np.zeros(samples.SAMPLE_WORDS, np.int64)
        form = fixed.POINT if self._both else fixed.FORCE
        self._form, self._words = form, np.zeros(len(form.markers), np.int64)
        self._gains = np.ones(len(SIDES))
        self._number = 0

    def run(self, ticks: int) -> None:
        """Simulate a duration [ms]."""
        for _ in range(ticks):
            self._tick(START_NS + self._number * TICK_NS)
            self._number += 1

    def settle(self) -> None:
        """Simulate until both devices are armed, a trial runs, and all messages under way have arrived."""
        self.run(READY + 4 * self._delay)
        self.heights.clear()
        self.forces.clear()
        self.cut = False

    def place(self, left: float, right: float) -> None:
        """Place both styluses at heights, at rest."""
        for station, height in zip(self.stations, (left, right), strict=True):
            station.device.put(height)

    def _tick(self, now_ns: int) -> None:
        for station in self.stations:
            station.read(self._number, now_ns)
        self._serve(now_ns)
        for station in self.stations:
            station.render(now_ns)
        left, right = self.stations
        self.heights.append((left.reading.z, right.reading.z))
        self.forces.append((left.rendered, right.rendered))
        self.cut |= not left.safeguards & right.safeguards & Safeguard.ARMED

    def _serve(self, now_ns: int) -> None:
        for sample, station in zip(self._samples, self.stations, strict=True):
            frame = station.arriving()
            if frame is not None:
                samples.take_frame(sample, frame, self._sample, now_ns, now_ns)
        samples.fill(self._row, self._samples, self._number, now_ns, 0, TIMEOUT_NS)
        self._row[_COMMAND] = int(Cause.START) if self._number == 0 else int(Cause.NONE)
        self._stage.advance(self._state, self._rows)
        for place, station in enumerate(self.stations):
            station.answers.append(self._answer(place, now_ns))

    def _answer(self, place: int, now_ns: int) -> NDArray[np.uint8]:
        """Write the frame that one side receives after a tick."""
        words: Any = self._words
        if self._both:
            samples.write_point(words, self._row, self._samples, self._gains, place, self._ends, now_ns)
        else:
            samples.write_force(words, self._row, self._row, self._samples, self._gains, place, now_ns)
        frame = np.zeros(self._form.size, np.uint8)
        fixed.write(frame, self._form, words)
        return frame
