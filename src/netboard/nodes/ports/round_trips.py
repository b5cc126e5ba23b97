"""How long the loop of each hand may take, how long it takes, and what is done when it takes too long.

The limit is that of the exact loop (`netboard.physics.stability.delayed_coupling`) with the couplings and the board of
the scene and a device that nobody holds: the worst there is, for whoever holds it steadies it. The device is that of
``[virtual]``, unless an agent that has a profile of its own says how much its device stands. It is looked for when the
scene is loaded, or when the agent starts, never in a loop. A hand's loop may take half of that (`MARGIN`). Beyond it
``network.delay_action`` counts: the operator is warned, or what the hand feels is softened, or the trial is paused, so
that nothing is felt.

Softening scales the force that is sent, or the coupling that an agent computes its own from, never what the board
feels: the stage knows nothing of it, and a recording verifies as ever. The gain goes to the log as it changes.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import isnan, nan

import numpy as np

from netboard.base.config import SIDES, Config, Side
from netboard.devices.safety.virtual_coupling import REACH
from netboard.participants.device_models import resolved
from netboard.physics.stability.delayed_coupling import (
    FIXED,
    LONGEST,
    Loop,
    Mechanism,
    ends_of,
    largest_round_trip,
)

MARGIN = 2.0
"""A loop may take the largest stable delay over this [1]."""

SHARE = 0.2
"""Share of a new measurement in what counts as the delay of late [1]."""

BACK = 0.8
"""A loop that was too slow is quick enough again below this share of what is allowed [1]."""

GAINS = (1.0, 0.8, 0.6, 0.45, 0.3, 0.2, 0.1, 0.05)
"""Gains whose limits are looked for; no hand is made to feel less than the last [1]."""

PACE = 0.02
"""A gain changes by at most so much at a look [1]."""

REST = 500
"""After a loop was too slow no trial begins for so many looks, where trials are paused for it [1]."""

TOLD = 0.1
"""It is recorded each time it has changed by so much [1]."""


DELAY_LIMIT = "delay_limit"
"""Detail of an agent's `Hello`: the largest stable delay with its own device, as in ``7 ms``."""


def loops_of(config: Config, device: Mechanism) -> list[Loop]:
    """Return what a hand's loop can be like: at a board that a partner holds fast, and on the free board."""
    physics = config.physics
    ends = [FIXED, *ends_of(physics).values()] if physics.coupling != "none" else []
    plain = Loop(
        device,
        k=physics.k_h,
        c=physics.c_h,
        at=physics.coupling_at,
        hold=physics.hold,
        window=1,
        reach=REACH,
    )
    return [replace(plain, end=end) for end in ends]


def limit_ns(loops: Sequence[Loop], gain: float = 1.0) -> int:
    """Return the largest delay there and back with which all of some loops are stable."""
    softened = [replace(loop, gain=gain) for loop in loops]
    return 1_000_000 * max(min((largest_round_trip(loop) for loop in softened), default=LONGEST), 0)


def _limits(loops: Sequence[Loop], first_ns: int) -> list[int]:
    """Return the largest stable delay for each of `GAINS`, none smaller than the one before [ns]."""
    limits = [first_ns]
    for gain in GAINS[1:]:
        enough = limits[-1] >= LONGEST * 1_000_000
        limits.append(limits[-1] if enough else max(limit_ns(loops, gain), limits[-1]))
    return limits


class Delays:
    """The watch over the loops of both hands.

    Attributes
    ----------
    limit_ns : int
        The largest stable delay [ns].
    notice, trouble : str
        What the operator should know, and why a trial cannot go on; or empty.
    """

    def __init__(self, config: Config) -> None:
        device = resolved(config.virtual)
        loops = loops_of(config, Mechanism(device.mass, device.damping))
        self._own_ns = self.limit_ns = limit_ns(loops)
        self._limits_ns = dict.fromkeys(SIDES, self._own_ns)
        self.gains = np.ones(len(SIDES))
        self.notice = self.trouble = ""
        self.news: list[tuple[str, dict[str, str]]] = []
        self._action = config.network.delay_action
        self._allowed = self.limit_ns / MARGIN
        self._late = [nan] * len(SIDES)
        self._slow = [False] * len(SIDES)
        self._told = [1.0] * len(SIDES)
        self._resting = 0
        self._hint = "" if config.physics.coupling_at == "both" else ', or set physics.coupling_at = "both"'
        if self._action == "soften":
            self._allowances = np.array(_limits(loops, self.limit_ns)) / MARGIN
        self._coupling_at = config.physics.coupling_at
        self._tell()

    def know(self, side: Side, details: Mapping[str, str]) -> None:
        """Take what an agent says of its own device when it joins."""
        said = re.fullmatch(r"([0-9]{1,4}(?:[.][0-9]+)?) ms", details.get(DELAY_LIMIT, ""))
        self._limits_ns[side] = round(float(said[1]) * 1e6) if said else self._own_ns
        limit_ns = min(self._limits_ns.values())
        if limit_ns != self.limit_ns:
            self.limit_ns, self._allowed = limit_ns, limit_ns / MARGIN
            self._tell()

    def _tell(self) -> None:
        """Record how large a delay is stable."""
        told = {"limit": _ms(self.limit_ns), "allowed": _ms(self._allowed), "coupling": self._coupling_at}
        self.news.append(("delay_limit", told))

    @property
    def late(self) -> list[float]:
        """Delay of the loop of each hand of late, NaN where it is not known [s]."""
        return [ns * 1e-9 for ns in self._late]

    def look(self, loops_ns: Sequence[int], *, felt: bool) -> None:
        """Take new measurements, and act.

        Parameters
        ----------
        loops_ns : sequence of int
            The newest delay of each hand's loop, 0 for none yet [ns].
        felt : bool
            The hands are given forces just now; only then do loops have a delay.
        """
        for place, (side, loop_ns) in enumerate(zip(SIDES, loops_ns, strict=True)):
            if not felt or loop_ns <= 0:
                self._forget(place)
                continue
            before = self._late[place]
            self._late[place] = loop_ns if isnan(before) else before + SHARE * (loop_ns - before)
            self._judge(place, side)
        slow = [side for side, is_slow in zip(SIDES, self._slow, strict=True) if is_slow]
        self.notice = self._words(slow[0]) if slow else ""
        self.trouble = self.notice if self._action == "disarm" else ""
        self._resting = REST if self.trouble else max(self._resting - 1, 0)

    @property
    def lacking(self) -> tuple[str, ...]:
        """What a block needs of the loops and has not had just now."""
        return ("a quicker network",) if self._resting else ()

    def _forget(self, place: int) -> None:
        """Know nothing of a loop that is not closed."""
        self._late[place], self._slow[place] = nan, False
        self.gains[place] = self._told[place] = 1.0

    def _judge(self, place: int, side: str) -> None:
        """See whether a loop is too slow, and soften it if that is wanted."""
        late = self._late[place]
        if late > self._allowed or (self._slow[place] and late > BACK * self._allowed):
            if not self._slow[place]:
                self._slow[place] = True
                self.news.append(("loop_too_slow", {"side": side, "delay": _ms(late), "allowed": _ms(self._allowed)}))
        elif self._slow[place]:
            self._slow[place] = False
            self.news.append(("loop_in_time", {"side": side, "delay": _ms(late)}))
        if self._action == "soften":
            self._soften(place, side, late)

    def _soften(self, place: int, side: str, late: float) -> None:
        """Move the gain of a hand towards what its delay allows."""
        share = self.limit_ns / self._own_ns if self._own_ns else 1.0
        wanted = float(np.interp(late, share * self._allowances, GAINS))
        gain = self.gains[place] + min(max(wanted - self.gains[place], -PACE), PACE)
        self.gains[place] = gain
        if abs(gain - self._told[place]) >= TOLD or (gain == 1.0) != (self._told[place] == 1.0):
            self._told[place] = gain
            self.news.append(("softened", {"side": side, "gain": f"{gain:.3f}", "delay": _ms(late)}))

    def _words(self, side: Side) -> str:
        """Tell an operator."""
        late = self._late[SIDES.index(side)]
        return (
            f"the {side} hand's loop takes {_ms(late)}, more than the {_ms(self._allowed)} that are safe with what is "
            f"coupled here: use a shorter or quieter network{self._hint}"
        )


def _ms(ns: float) -> str:
    """Write a delay."""
    return f"{ns * 1e-6:.3g} ms"
