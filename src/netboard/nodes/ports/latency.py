"""The sample-to-force latency of each hand: its limit, its measurement, and what happens beyond the limit.

The largest stable latency is that of the exact loop (`netboard.physics.stability.delayed_coupling`) with the scene's
virtual couplings and board and a device that nobody holds. That is the worst case: a hand on the stylus adds damping,
which stabilises the loop. The device is that of ``[virtual]``, unless the agent's device has a profile and the agent
sends its limit. The limit is computed when the scene is loaded or the agent starts, never in a loop. A hand's latency
may be half of it (`MARGIN`). Beyond that ``network.delay_action`` applies: the operator is warned, or the haptic
feedback is softened, or the trial is paused, which turns the forces off.

Softening scales the commanded force, or the coupling from which an agent computes it, but never the force on the board.
The stage does not depend on it, and a recording still verifies. Changes of the gain are logged.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from math import isnan, nan

import numpy as np

from netboard.base.config import SIDES, Config, Side
from netboard.devices.safety.virtual_coupling import REACH
from netboard.participants.body.device_models import resolved
from netboard.physics.stability.delayed_coupling import FIXED, LONGEST, Loop, Mechanism, ends_of, largest_round_trip

MARGIN = 2.0
"""Largest stable latency over the largest allowed one [1]."""

SHARE = 0.2
"""Weight of a new measurement in the smoothed latency [1]."""

RECOVERED_SHARE = 0.8
"""Share of the allowed latency below which a slow loop counts as fast enough again [1]."""

GAINS = (1.0, 0.8, 0.6, 0.45, 0.3, 0.2, 0.1, 0.05)
"""Gains for which limits are computed; the last is the smallest gain that is used [1]."""

MAX_GAIN_STEP = 0.02
"""Largest change of a gain between two checks [1]."""

CHECKS_TO_WAIT = 500
"""Checks for which no trial begins after a loop was too slow, if slow loops pause trials [1]."""

RECORDED_GAIN_CHANGE = 0.1
"""Change of a gain that is recorded [1]."""

DELAY_LIMIT = "delay_limit"
"""Detail of an agent's `Hello`: the largest stable latency with its own device, as in ``7 ms``."""


def loops_of(config: Config, device: Mechanism) -> list[Loop]:
    """Return the loops of a hand: at a board that the partner holds fast, and at a free board."""
    physics = config.physics
    ends = [FIXED, *ends_of(physics).values()] if physics.coupling != "none" else []
    plain = Loop(device, k=physics.k_h, c=physics.c_h, at=physics.coupling_at, hold=physics.hold, window=1, reach=REACH)
    return [replace(plain, end=end) for end in ends]


def limit_ns(loops: Sequence[Loop], gain: float = 1.0) -> int:
    """Return the largest round-trip delay with which all these loops are stable [ns]."""
    limit = LONGEST
    for loop in loops:
        limit = _largest_round_trip(replace(loop, gain=gain), limit)
    return 1_000_000 * max(limit, 0)


@cache
def _largest_round_trip(loop: Loop, most: int) -> int:
    """Return the largest stable round-trip delay up to a limit [ms]; blocks of a session have mostly the same loops.

    Beyond the limit of another loop none matters, and the longer a delay, the longer its eigenvalues take.
    """
    return largest_round_trip(loop, most)


def _limits(loops: Sequence[Loop], first_ns: int) -> list[int]:
    """Return the largest stable delay for each of `GAINS`; `np.interp` needs none smaller than the one before [ns]."""
    limits = [first_ns]
    for gain in GAINS[1:]:
        enough = limits[-1] >= LONGEST * 1_000_000
        limits.append(limits[-1] if enough else max(limit_ns(loops, gain), limits[-1]))
    return limits


class LatencySupervisor:
    """Supervises the sample-to-force latency of both hands.

    ``limit_ns``: largest stable latency [ns]. ``notice``: what the operator should know, or empty. ``trouble``: why a
    trial cannot go on, or empty.
    """

    def __init__(self, config: Config) -> None:
        device = resolved(config.virtual)
        loops = loops_of(config, Mechanism(device.mass, device.damping))
        self._configured_ns = self.limit_ns = limit_ns(loops)
        self._limits_ns = dict.fromkeys(SIDES, self._configured_ns)
        self.gains = np.ones(len(SIDES))
        self.notice = self.trouble = ""
        self.news: list[tuple[str, dict[str, str]]] = []
        self._action = config.network.delay_action
        self._allowed_ns = self.limit_ns / MARGIN
        self._latencies_ns = [nan] * len(SIDES)
        self._slow = [False] * len(SIDES)
        self._recorded_gains = [1.0] * len(SIDES)
        self._checks_to_wait = 0
        self._hint = "" if config.physics.coupling_at == "both" else ', or set physics.coupling_at = "both"'
        if self._action == "soften":
            self._allowances = np.array(_limits(loops, self.limit_ns)) / MARGIN
        self._coupling_at = config.physics.coupling_at
        self._record_limit()

    def take_limit(self, side: Side, details: Mapping[str, str]) -> None:
        """Take the limit of an agent's device from the details with which the agent joins."""
        # A peer's text: a short pattern, because int and float take any number of digits, infinity and NaN.
        limit = re.fullmatch(r"([0-9]{1,4}(?:[.][0-9]+)?) ms", details.get(DELAY_LIMIT, ""))
        self._limits_ns[side] = round(float(limit[1]) * 1e6) if limit else self._configured_ns
        limit_ns = min(self._limits_ns.values())
        if limit_ns != self.limit_ns:
            self.limit_ns, self._allowed_ns = limit_ns, limit_ns / MARGIN
            self._record_limit()

    def _record_limit(self) -> None:
        details = {"limit": _ms(self.limit_ns), "allowed": _ms(self._allowed_ns), "coupling": self._coupling_at}
        self.news.append((DELAY_LIMIT, details))

    @property
    def latencies(self) -> list[float]:
        """Smoothed latency of each hand, NaN if not known [s]."""
        return [ns * 1e-9 for ns in self._latencies_ns]

    def poll(self, loops_ns: Sequence[int], *, haptics: bool) -> None:
        """Take new measurements, and act on them.

        ``loops_ns``: newest latency of each hand, 0 if not yet known [ns]. ``haptics``: whether haptic feedback is on;
        only then is there a latency.
        """
        for place, (side, loop_ns) in enumerate(zip(SIDES, loops_ns, strict=True)):
            if not haptics or loop_ns <= 0:
                self._reset(place)
                continue
            before = self._latencies_ns[place]
            self._latencies_ns[place] = loop_ns if isnan(before) else before + SHARE * (loop_ns - before)
            self._judge(place, side)
        slow = [side for side, is_slow in zip(SIDES, self._slow, strict=True) if is_slow]
        self.notice = self._notice_for(slow[0]) if slow else ""
        self.trouble = self.notice if self._action == "disarm" else ""
        self._checks_to_wait = CHECKS_TO_WAIT if self.trouble else max(self._checks_to_wait - 1, 0)

    @property
    def missing(self) -> tuple[str, ...]:
        """What a block waits for while a loop was too slow recently."""
        return ("a shorter sample-to-force latency",) if self._checks_to_wait else ()

    def _reset(self, place: int) -> None:
        """Forget the latency of a loop that is not closed; its gain is needed when it is closed again."""
        self._latencies_ns[place], self._slow[place] = nan, False

    def _judge(self, place: int, side: str) -> None:
        """Check whether a loop is too slow, and soften it if so configured."""
        latency_ns, allowed_ns = self._latencies_ns[place], self._allowed_ns
        if latency_ns > allowed_ns or (self._slow[place] and latency_ns > RECOVERED_SHARE * allowed_ns):
            if not self._slow[place]:
                self._slow[place] = True
                details = {"side": side, "delay": _ms(latency_ns), "allowed": _ms(allowed_ns)}
                self.news.append(("loop_too_slow", details))
        elif self._slow[place]:
            self._slow[place] = False
            self.news.append(("loop_in_time", {"side": side, "delay": _ms(latency_ns)}))
        if self._action == "soften":
            self._adjust_gain(place, side, latency_ns)

    def _adjust_gain(self, place: int, side: str, latency_ns: float) -> None:
        """Move a hand's gain towards the one that its latency allows."""
        share = self.limit_ns / self._configured_ns if self._configured_ns else 1.0
        wanted = float(np.interp(latency_ns, share * self._allowances, GAINS))
        gain = self.gains[place] + min(max(wanted - self.gains[place], -MAX_GAIN_STEP), MAX_GAIN_STEP)
        self.gains[place] = gain
        recorded = self._recorded_gains[place]
        if abs(gain - recorded) >= RECORDED_GAIN_CHANGE or (gain == 1.0) != (recorded == 1.0):
            self._recorded_gains[place] = gain
            self.news.append(("softened", {"side": side, "gain": f"{gain:.3f}", "delay": _ms(latency_ns)}))

    def _notice_for(self, side: Side) -> str:
        took, allowed = _ms(self._latencies_ns[SIDES.index(side)]), _ms(self._allowed_ns)
        return (
            f"the sample-to-force latency of the {side} hand is {took}, above the limit of {allowed} for this virtual "
            f"coupling: use a shorter or quieter network{self._hint}"
        )


def _ms(ns: float) -> str:
    return f"{ns * 1e-6:.3g} ms"
