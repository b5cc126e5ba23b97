"""Releases of a stylus 10 mm from rest, methods that tolerate a long delay, and their cost.

The releases have friction, encoder steps, and every limit of the safety chain. Friction damps a small motion but not a
large one, so a loop that is stable for small motions may still oscillate.

Passivity control and coupling in both (the server and the agent) are part of netboard. Wave variables are here for
comparison only: a loop of the virtual device and a fixed end with the paper's virtual coupling, which exchange wave
variables instead of positions and forces.

G. Niemeyer, J.-J. E. Slotine, Stable adaptive teleoperation, IEEE J. Oceanic Engineering 16 (1991).
"""

import math
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from evidence.coupling.boundary import HANDS, Case, loops_of, scene
from evidence.coupling.distant_dyad import DistantDyad, simulation_config
from netboard.base.config import Config
from netboard.base.tables.rig import Safety
from netboard.base.tables.scene import Physics
from netboard.base.tables.simulated import VirtualDevice
from netboard.base.tick import START_NS, TICK_NS, TICK_SECONDS
from netboard.benchmarks.harness.results import ResultPart, Value
from netboard.benchmarks.harness.running import Tell
from netboard.devices.simulated.virtual import VirtualTouch
from netboard.participants.body.device_models import resolved
from netboard.physics.stability.delayed_coupling import At, is_stable

RELEASE_HEIGHT = 0.010
"""Distance from rest at the release [m]."""

MOVE_MS, HOLD_MS = 300, 200
"""Durations of the movement to that position, and of the hold there [ms]."""

SECONDS = 4
"""Observation time after the release [s]."""

QUIET = 0.5e-3
"""Peak-to-peak movement below which a stylus counts as at rest: some encoder steps [m]."""

FRICTION = resolved(VirtualDevice()).friction

DELAYS = (0, 1, 2, 3, 4, 5, 10, 20, 40)
QUICK_DELAYS = (2, 10)


@dataclass(frozen=True)
class Release:
    """Outcome of a release.

    - `swing`: peak-to-peak movement in the last second [m].
    - `rest`: settling time, to within `QUIET` of the final position; infinite if it did not settle [s].
    - `cut`: the safety chain cut the force because the stylus was too fast.
    """

    swing: float
    rest: float
    cut: bool

    @property
    def quiet(self) -> bool:
        """Whether the stylus settled without a cut of the force."""
        return self.swing < QUIET and not self.cut

    def __str__(self) -> str:
        if self.cut:
            return "cut by the safety chain"
        return f"rests in {self.rest:.2f} s" if self.quiet else f"{self.swing * 1e3:.1f} mm"


class Loop(Protocol):
    """A simulated loop of the left hand."""

    heights: list[tuple[float, float]]
    forces: list[tuple[float, float]]
    cut: bool

    def settle(self) -> None:
        """Simulate until the loop is ready."""

    def place(self, left: float, right: float) -> None:
        """Place the styluses at heights [m]."""

    def run(self, ticks: int) -> None:
        """Simulate a duration [ms]."""


def move_along_path(loop: Loop, height: Callable[[int], float], ticks: int) -> None:
    """Move the left stylus along a path."""
    for t in range(ticks):
        loop.place(height(t), 0.0)
        loop.run(1)


def move_and_release(loop: Loop) -> Release:
    """Move the left stylus away, hold it until the server has received this, and release it."""
    loop.settle()
    move_along_path(loop, lambda t: RELEASE_HEIGHT * smooth(t / MOVE_MS), MOVE_MS + HOLD_MS)
    start = len(loop.heights)
    loop.run(1000 * SECONDS)
    heights = np.array(loop.heights)[start:, 0]
    away = np.flatnonzero(np.abs(heights - heights[-1]) > QUIET)
    rest = (int(away[-1]) + 1) * 1e-3 if len(away) else 0.0
    swing = float(np.ptp(heights[-1000:]))
    return Release(swing, rest if swing < QUIET else float("inf"), loop.cut)


def smooth(share: float) -> float:
    """Return the completed share of a smooth movement after a share of its duration, from 0 to 1 [1]."""
    s = min(max(share, 0.0), 1.0)
    return s * s * s * (10.0 - 15.0 * s + 6.0 * s * s)


def releases_part(delays: Sequence[int], tell: Tell) -> ResultPart:
    """Release a bare stylus with several delays."""
    part = ResultPart(
        "releases",
        "A bare stylus let go 10 mm from rest, 200 N/m and 2 N s/m, encoder steps and limits on: swing in the last "
        "second, or time to rest",
        "one way [ms] | server, fixed end: theory | no friction | friction 0.26 N | "
        "both, paper's board: theory | no friction  | friction 0.26 N ",
    )
    bare = HANDS["bare stylus"]
    slick, rough = (VirtualDevice(mass=bare.mass, damping=bare.damping, friction=f) for f in (0.0, FRICTION))
    quiet: dict[tuple[str, str], list[int]] = {}
    for i, delay in enumerate(delays):
        tell(f"releases: {delay} ms one way", i / len(delays))
        row: list[Value] = [delay]
        for at in ("server", "both"):
            case = Case("bare stylus", at, "fixed" if at == "server" else "board", delay)
            stable = all(is_stable(loop) for loop in loops_of(case, Physics().k_h).values())
            row.append("stable" if stable else "unstable")
            for name, device in (("no friction", slick), ("friction", rough)):
                config = Config(physics=scene(at, case.end), virtual=device)
                found = move_and_release(DistantDyad(config, delay))
                row.append(str(found))
                if found.quiet:
                    quiet.setdefault((at, name), []).append(delay)
        part.add(*row)
    furthest = {key: max(found) for key, found in quiet.items()}
    part.claim(
        "with both a stylus comes to rest further from its server than with the server alone",
        all(furthest[("both", name)] > furthest[("server", name)] for name in ("no friction", "friction")),
        ", ".join(f"{at}, {name}: {delay} ms" for (at, name), delay in furthest.items()),
    )
    return part


IMPEDANCE = 1.0
"""Wave impedance, suited to a device of 45 g at the frequencies of a hand [N s/m]."""

FREQUENCIES = (1.0, 5.0)
"""Frequencies at which the rendered stiffness and damping are measured [Hz]."""

AMPLITUDE = 0.005
"""Amplitude of the hand's movement in that measurement [m]."""

IMMOVABLE = 1e4
"""Mass of the stylus in that measurement, so large that forces do not move it [kg]."""

CYCLES = 3
"""Measured cycles, after one for the transient [1]."""

NAMES = ("server alone", "with passivity control", "wave variables", "both")


class Waves:
    """The left hand coupled to a fixed end by wave variables.

    - `delay`: delay one way [ms].
    """

    def __init__(self, config: Config, delay: int) -> None:
        self.heights: list[tuple[float, float]] = []
        self.forces: list[tuple[float, float]] = []
        self.cut = False
        self._k, self._c = config.physics.k_h, config.physics.c_h
        self._device = VirtualTouch("left", simulation_config(config))
        self._device.open()
        self._up, self._down = deque([0.0] * delay), deque([0.0] * delay)
        self._height = self._there = 0.0
        self._number = 0

    def settle(self) -> None:
        """Simulate until the device is ready."""
        self.run(10)

    def place(self, left: float, right: float) -> None:
        """Place the stylus at a height."""
        self._device.put(left)

    def run(self, ticks: int) -> None:
        """Simulate a duration."""
        root = math.sqrt(2.0 * IMPEDANCE)
        for _ in range(ticks):
            reading = self._device.read(START_NS + self._number * TICK_NS)
            self._number += 1
            rate, self._height = (reading.z - self._height) / TICK_SECONDS, reading.z
            back = self._down.popleft() if self._down else 0.0
            resisting = IMPEDANCE * rate - root * back
            self._up.append((IMPEDANCE * rate + resisting) / root)
            self._down.append(self._reflected(self._up.popleft(), root))
            self._device.write(0.0, 0.0, -resisting)
            self.heights.append((reading.z, 0.0))
            self.forces.append((-resisting, 0.0))

    def _reflected(self, wave: float, root: float) -> float:
        """Move the server's end of the coupling by a wave, and return the reflected wave."""
        rate = (root * wave - self._k * self._there) / (IMPEDANCE + self._k * TICK_SECONDS + self._c)
        self._there += TICK_SECONDS * rate
        return (IMPEDANCE * rate - (root * wave - IMPEDANCE * rate)) / root


def make_loop(name: str, device: VirtualDevice, delay: int) -> Loop:
    """Return one of the loops of `NAMES`, with a fixed end."""
    at: At = "both" if name == "both" else "server"
    safety = Safety(passivity=name == "with passivity control")
    config = Config(physics=scene(at, "fixed"), virtual=device, safety=safety)
    return Waves(config, delay) if name == "wave variables" else DistantDyad(config, delay)


# --- releases ----------------------------------------------------------------------------------------------------


def remedies_part(delays: Sequence[int], tell: Tell) -> ResultPart:
    """Release a bare stylus with each method."""
    part = ResultPart(
        "remedies",
        "A bare stylus let go 10 mm from rest at a fixed end, 200 N/m and 2 N s/m: time to rest, or swing in the last "
        "second",
        ("one way [ms]", "friction", *NAMES),
    )
    quiet: dict[tuple[str, float], list[int]] = {}
    for i, delay in enumerate(delays):
        for j, friction in enumerate((0.0, FRICTION)):
            tell(f"remedies: {delay} ms one way", (i + j / 2) / len(delays))
            outcomes = []
            for name in NAMES:
                found = move_and_release(make_loop(name, VirtualDevice(friction=friction), delay))
                outcomes.append(str(found))
                if found.quiet:
                    quiet.setdefault((name, friction), []).append(delay)
            part.add(delay, f"{friction:g} N", *outcomes)
    stable = quiet.get(("with passivity control", 0.0), [])
    part.claim(
        "with passivity control a bare stylus without friction comes to rest 20 ms from its server",
        bool(stable) and max(stable) >= min(20, max(delays)),
        f"at {', '.join(map(str, stable))} ms of {', '.join(map(str, delays))}",
    )
    return part


# --- rendered stiffness ------------------------------------------------------------------------------------------


def rendered(name: str, delay: int, frequency: float) -> tuple[float, float]:
    """Return the stiffness and damping that are rendered to a hand in sinusoidal movement."""
    loop = make_loop(name, VirtualDevice(mass=IMMOVABLE, damping=0.0, friction=0.0), delay)
    loop.settle()
    cycle = round(1000 / frequency)
    start = len(loop.heights)
    move_along_path(loop, lambda t: AMPLITUDE * math.sin(2.0 * math.pi * t / cycle), (CYCLES + 1) * cycle)
    heights, forces = (np.array(kept)[start + cycle :, 0] for kept in (loop.heights, loop.forces))
    turns = np.exp(-2j * math.pi * np.arange(len(heights)) / cycle)
    ratio = -(forces @ turns) / (heights @ turns)
    return float(ratio.real), float(ratio.imag / (2.0 * math.pi * frequency))


def transparency_part(delays: Sequence[int], tell: Tell) -> ResultPart:
    """Measure the stiffness and damping that the virtual coupling renders to a hand."""
    part = ResultPart(
        "transparency",
        "Stiffness and damping felt at a fixed end by a hand that moves 5 mm either way [N/m, N s/m]; ideal: 200, 2.00",
        ("one way [ms]", "frequency [Hz]", *NAMES),
    )
    for i, delay in enumerate(delays):
        for frequency in FREQUENCIES:
            tell(f"rendered stiffness: {delay} ms, {frequency:g} Hz", i / len(delays))
            found = [rendered(name, delay, frequency) for name in NAMES]
            part.add(delay, frequency, *(f"{k:.0f}, {c:.2f}" for k, c in found))
    stiffness, damping = rendered("both", max(delays), FREQUENCIES[0])
    physics = Physics()
    right = abs(stiffness / physics.k_h - 1.0) < 0.03 and abs(damping / physics.c_h - 1.0) < 0.15
    part.claim(
        "with both a hand feels the coupling itself at any distance",
        right,
        f"{stiffness:.0f} N/m and {damping:.2f} N s/m at {max(delays)} ms, {FREQUENCIES[0]:g} Hz",
    )
    return part


# --- in everyday use ---------------------------------------------------------------------------------------------

SUBMOVEMENT = 313
"""Duration of a movement, that of the simulated participants [ms]."""

PAUSE = 200
"""Rest of the hand after a movement [ms]."""


def everyday_part(delays: Sequence[int], tell: Tell) -> ResultPart:
    """Measure the effect of passivity control on forces in ordinary movements, on the paper's board."""
    part = ResultPart(
        "everyday",
        "Movements of 5 to 20 mm by both hands on the paper's board: force with passivity control less force without",
        "one way [ms] | force, rms [N] | difference, rms, of that [1] | largest difference [N]",
    )
    for i, delay in enumerate(delays):
        tell(f"everyday movements: {delay} ms", i / len(delays))
        plain, limited = (_play_movements(delay, passivity=passivity) for passivity in (False, True))
        off = limited - plain
        scale = float(np.sqrt(np.mean(plain**2)))
        part.add(delay, scale, float(np.sqrt(np.mean(off**2))) / scale, float(np.abs(off).max()))
    nearest = part.rows[0]
    part.claim(
        "next to its server passivity control changes an everyday force by less than 5 %",
        bool(float(nearest[2]) < 0.05),
        f"{float(nearest[2]):.2%} rms at {nearest[0]} ms",
    )
    return part


def _play_movements(delay: int, *, passivity: bool) -> NDArray[np.float64]:
    """Simulate movements of both hands, and return the forces on them."""
    device = VirtualDevice(mass=IMMOVABLE, damping=0.0, friction=0.0)
    config = Config(physics=scene("server", "board"), virtual=device, safety=Safety(passivity=passivity))
    dyad = DistantDyad(config, delay)
    dyad.settle()
    rng = np.random.default_rng(1)
    at = np.zeros(2)
    for _ in range(20):
        aim = np.clip(rng.choice((-1.0, 1.0), 2) * rng.uniform(0.005, 0.020, 2), -0.03, 0.03)
        for t in range(SUBMOVEMENT + PAUSE):
            here = at + (aim - at) * smooth(t / SUBMOVEMENT)
            dyad.place(float(here[0]), float(here[1]))
            dyad.run(1)
        at = aim
    return np.array(dyad.forces)
