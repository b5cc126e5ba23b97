"""Stability limit of the loop: exact eigenvalues, the simulated service, and rules of thumb.

The loop is linear: no friction, no encoder steps, and motions too small to reach a limit. The simulation integrates its
stylus as the virtual device does, and is compared with a prediction that does the same. A second prediction has the
exact motion of a real device.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from evidence.coupling.distant_dyad import DistantDyad
from netboard.base.config import Config
from netboard.base.tables.scene import Physics
from netboard.base.tables.simulated import VirtualDevice
from netboard.base.tick import TICK_SECONDS
from netboard.benchmarks.harness.results import ResultPart
from netboard.benchmarks.harness.running import Tell
from netboard.devices.safety.virtual_coupling import REACH
from netboard.physics.stability.delayed_coupling import (
    FIXED,
    At,
    Loop,
    Mechanism,
    dominant_frequency,
    ends_of,
    is_stable,
    largest_delay,
)
from netboard.physics.stability.delayed_coupling import LONGEST as MAX_DELAY

HANDS = {
    "bare stylus": Mechanism(0.045, 0.1),
    "light finger": Mechanism(0.1, 0.5),
    "hand": Mechanism(0.2, 2.0),
    "arm": Mechanism(0.5, 5.0),
}
"""Mechanical models of the hand on the stylus, by name."""

SUBSTEPS = 4
"""Steps of the virtual device per tick [1]."""

STIFFEST = 10_000.0
"""Largest coupling stiffness that the configuration allows [N/m]."""

LOOSEST = 10.0
"""Stiffness below which the damper alone decides stability, so theory and simulation are not compared [N/m]."""

AGREED = 0.01
"""Largest relative difference between prediction and simulation [1]."""

NUDGE = 1e-5
"""Initial displacement of a simulation from rest [m]."""

DIVERGED, DECAYED = 1e-2, 1e-10
"""Displacement above which a motion is unstable, and below which it has decayed [m]."""

PERIODS = 24.0
"""Periods of a motion for which it is observed [1]."""

MIN_DURATION, MAX_DURATION = 1200, 24_000
"""Shortest and longest observation time [ms]."""

MIN_RATE = 2.0
"""Lower bound on the angular frequency of a motion [rad/s]."""


@dataclass(frozen=True)
class Case:
    """The conditions of one stability limit.

    - `end`: ``fixed``, or ``board`` for the paper's board with both hands on it.
    - `delay`: delay one way [ms].
    """

    hand: str
    at: At
    end: str
    delay: int


def scene(at: At, end: str, k: float = Physics().k_h) -> Physics:
    """Return the scene of a case: no ball, no gravity, solved exactly at any stiffness."""
    plain = Physics(k_h=k, balls=0, g=0.0, hold="zoh", method="etdrk4", substeps=1, coupling_at=at)
    return plain if end == "board" else replace(plain, board="hinged", I=1e9)


def loops_of(case: Case, k: float, substeps: int = SUBSTEPS) -> dict[str, Loop]:
    """Return the loops of a case, one for each mode of both hands."""
    ends = ends_of(Physics()) if case.end == "board" else {"fixed": FIXED}
    mechanism = replace(HANDS[case.hand], substeps=substeps)
    return {
        name: Loop(mechanism, end, k, Physics().c_h, case.delay, case.delay, case.at, "zoh", 1, REACH)
        for name, end in ends.items()
    }


def largest_stiffness(loop: Loop, start: float = 1.0, most: float = 1e6) -> float:
    """Return the stiffness up to which a loop is stable, to a hundredth of a per cent.

    Stiffnesses are raised by a fifth from the first one; then the limit is found by bisection. The result is 0 if
    the first is unstable, and infinite if all are stable.
    """
    stable, k = 0.0, start
    while is_stable(replace(loop, k=k)):
        stable, k = k, k * 1.2
        if stable >= most:
            return math.inf
    if stable == 0.0:
        return 0.0
    while k - stable > 1e-4 * stable:
        middle = 0.5 * (stable + k)
        stable, k = (middle, k) if is_stable(replace(loop, k=middle)) else (stable, middle)
    return stable


def passive_stiffness(mechanism: Mechanism, c: float) -> float:
    """Return the largest stiffness of a passive sampled-data wall without delay: b > K T / 2 + |B|.

    J. E. Colgate, G. G. Schenkel, Passivity of a class of sampled-data systems, J. Robotic Systems 14 (1997).
    """
    return max(0.0, 2.0 * (mechanism.damping - abs(c)) / TICK_SECONDS)


def ruled_stiffness(mechanism: Mechanism, c: float, delay: float) -> float:
    """Return the largest stable stiffness of a wall with a short delay: K < (b + B) / (T / 2 + t_d).

    J. J. Gil, E. Sanchez, T. Hulin, C. Preusche, G. Hirzinger, Stability boundary for haptic rendering: influence of
    damping and delay, J. Computing and Information Science in Engineering 9 (2009) 011005.
    """
    return (mechanism.damping + c) / (0.5 * TICK_SECONDS + delay)


def predicted(case: Case, substeps: int = SUBSTEPS, start: float = 1.0) -> tuple[float, str]:
    """Return the largest stable stiffness, and the mode that becomes unstable first."""
    limits = {
        name: largest_stiffness(loop, start, most=STIFFEST) for name, loop in loops_of(case, 1.0, substeps).items()
    }
    mode = min(limits, key=lambda name: limits[name])
    return limits[mode], mode


def simulated_is_stable(case: Case, k: float, mode: str) -> bool:
    """Return whether a small motion decays in the simulated service.

    - `mode`: ``tilt`` for hands that start in opposite directions; otherwise they start alike.
    """
    hand = HANDS[case.hand]
    device = VirtualDevice(mass=hand.mass, damping=hand.damping, friction=0.0, resolution=0.0)
    dyad = DistantDyad(Config(physics=scene(case.at, case.end, k), virtual=device), case.delay)
    dyad.settle()
    dyad.place(NUDGE, -NUDGE if mode == "tilt" else NUDGE)
    period = 2.0 * math.pi / max(dominant_frequency(loops_of(case, k)[mode]), MIN_RATE)
    quarter = int(min(max(PERIODS * 1000.0 * period, MIN_DURATION), MAX_DURATION)) // 4
    sizes = []
    for _ in range(4):
        dyad.heights.clear()
        dyad.run(quarter)
        heights = np.array(dyad.heights)
        sizes.append(float(np.ptp(heights[:, 0] - (heights[:, 1] if mode == "tilt" else 0.0))))
        if not sizes[-1] < DIVERGED:
            return False
        if sizes[-1] < DECAYED:
            return True
    return sizes[3] < sizes[1]


def simulated(case: Case, near: float, mode: str, precision: float = 5e-3) -> float:
    """Return the largest stable stiffness in the simulated service; NaN if over 10 % from the theoretical one [N/m]."""
    stable, unstable = near * (1.0 - AGREED), near * (1.0 + AGREED)
    if not simulated_is_stable(case, stable, mode):
        stable, unstable = 0.9 * near, stable
        if not simulated_is_stable(case, stable, mode):
            return math.nan
    elif simulated_is_stable(case, unstable, mode):
        stable, unstable = unstable, 1.1 * near
        if simulated_is_stable(case, unstable, mode):
            return math.nan
    while unstable - stable > precision * near:
        middle = 0.5 * (stable + unstable)
        stable, unstable = (middle, unstable) if simulated_is_stable(case, middle, mode) else (stable, middle)
    return 0.5 * (stable + unstable)


# --- parts of the study ------------------------------------------------------------------------------------------


DELAYS = (0, 1, 2, 3, 5, 10, 20, 40, 60)
QUICK_DELAYS = (1, 5)
MAPS: tuple[tuple[At, str], ...] = (("server", "fixed"), ("server", "board"), ("both", "board"))
"""Where the coupling is computed, and its far end. With "both" and a fixed end, delays have no effect."""


@dataclass(frozen=True)
class Limit:
    """One stability limit.

    - `exact`, `virtual`: largest stable stiffness with a real and with a virtual device, in theory [N/m].
    - `simulated`: that in the simulated service; NaN without a limit to compare [N/m].
    - `mode`: mode that becomes unstable first.
    """

    case: Case
    exact: float
    virtual: float
    simulated: float
    mode: str


def limits(hands: Sequence[str], delays: Sequence[int], tell: Tell, precision: float = 5e-3) -> list[Limit]:
    """Find all stability limits."""
    cases = [Case(hand, at, end, delay) for at, end in MAPS for hand in hands for delay in delays]
    found = []
    for i, case in enumerate(cases):
        tell(f"{case.hand}, {case.at}, {case.end}: {case.delay} ms", i / len(cases))
        virtual, mode = predicted(case)
        exact, _ = predicted(case, 0, 0.6 * virtual) if 0.0 < virtual < math.inf else predicted(case, 0)
        comparable = LOOSEST <= virtual < math.inf
        in_service = simulated(case, virtual, mode, precision) if comparable else math.nan
        found.append(Limit(case, exact, virtual, in_service, mode))
    return found


def limits_part(found: Sequence[Limit]) -> ResultPart:
    """Tabulate stability limits."""
    part = ResultPart(
        "limits",
        f"Largest stable stiffness with 2 N s/m, up to {STIFFEST:g} N/m, for equal delays both ways",
        "coupling at | end | hand | one way [ms] | theory, real device [N/m] | theory, virtual [N/m] | "
        "simulated service [N/m] | off | unstable first | Gil [N/m] | Colgate [N/m]",
    )
    for one in found:
        case, hand = one.case, HANDS[one.case.hand]
        ruled = ruled_stiffness(hand, Physics().c_h, 2e-3 * case.delay) if case.at == "server" else math.nan
        part.add(
            *(case.at, case.end, case.hand, case.delay, _stiffness(one.exact), _stiffness(one.virtual)),
            _stiffness(one.simulated),
            "-" if math.isnan(one.simulated) else f"{100 * (one.simulated / one.virtual - 1):+.2f} %",
            one.mode,
            _stiffness(ruled),
            _stiffness(passive_stiffness(hand, Physics().c_h)),
        )
    compared = [one for one in found if LOOSEST <= one.virtual < math.inf]
    off = [abs(one.simulated / one.virtual - 1.0) for one in compared]
    worst = math.inf if any(map(math.isnan, off)) else max(off, default=0.0)
    part.claim(
        f"the simulated service and the eigenvalues agree to {AGREED:.0%} in stiffness",
        bool(worst <= AGREED),
        f"at worst {worst:.2%} in {len(compared)} cases",
    )
    return part


def _stiffness(k: float) -> str:
    if math.isnan(k):
        return "-"
    return f"> {STIFFEST:g}" if math.isinf(k) else f"{k:.4g}"


def delays_part(hands: Sequence[str], tell: Tell) -> ResultPart:
    """Find the maximum stable delay of the paper's virtual coupling for each hand."""
    physics = Physics()
    part = ResultPart(
        "delays",
        "Largest stable delay one way, 200 N/m and 2 N s/m",
        "coupling at | end | hand | theory, real device [ms] | theory, virtual [ms] | and so it is simulated",
    )
    agreeing, checked = 0, 0
    for i, hand in enumerate(hands):
        for j, (at, end) in enumerate(MAPS):
            tell(f"largest delay: {hand}, {at}, {end}", (i + j / len(MAPS)) / len(hands))
            delays = {}
            for substeps in (0, SUBSTEPS):
                loops = loops_of(Case(hand, at, end, 0), physics.k_h, substeps)
                delays[substeps] = {name: largest_delay(loop) for name, loop in loops.items()}
            mode = min(delays[SUBSTEPS], key=lambda name: delays[SUBSTEPS][name])
            delay = delays[SUBSTEPS][mode]
            tried = [(delay, True), (delay + 1, False)] if delay < MAX_DELAY else [(delay, True)]
            right = [simulated_is_stable(Case(hand, at, end, w), physics.k_h, mode) == so for w, so in tried]
            agreeing, checked = agreeing + sum(right), checked + len(right)
            part.add(at, end, hand, _delay(min(delays[0].values())), _delay(delay), "yes" if all(right) else "no")
    part.claim(
        "the simulated service is stable at the largest delay, and not 1 ms beyond",
        agreeing == checked,
        f"{agreeing} of {checked}",
    )
    return part


def _delay(delay: int) -> str:
    return f">= {MAX_DELAY}" if delay >= MAX_DELAY else str(delay)
