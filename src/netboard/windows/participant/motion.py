"""Where everything is at the moment of a paint: between the views and a little beyond them. Pure: time is an argument.

What moves is drawn where it is at that moment, not where the newest view had it some milliseconds ago: the rates of the
two newest views are carried on, for one interval between views at most. That adds no latency, unlike a walk from
one view to the next, which would be an interval behind. A phase is never overshot: across a change of phase, trial or
target nothing is carried on, and the ball stays on that side of the target's edge, and of the board's, where its phase
has it. Where no view comes for `SETTLED` intervals nothing moves any more: everything is where the newest view says.

The time of a view is the server's time of sending; what lies between that and this display's clock is taken from the
quickest view of late, so that a view that was held up on its way is not taken for a slow hand.
"""

from dataclasses import dataclass, replace

from netboard.base.config import Config
from netboard.base.tick import TICK_NS
from netboard.stage.view import View

MOST_TICKS = 40
"""Views further apart than this say nothing about rates: in between they were all the same [1]."""

SETTLED = 2.5
"""Without a view for so many intervals nothing moves [1]."""

SKEW = 1e-4
"""Two clocks may run apart at this rate [1]."""

NEW_CLOCK_NS = 1_000_000_000
"""A view that seems to have travelled so much longer than the quickest is from another clock [ns]."""

Rates = tuple[float, float, float, float, float, float]
"""Changes of z, theta, p, left, right and share in a nanosecond; 0 for what is not shown."""


@dataclass(frozen=True, slots=True)
class Motion:
    """What the newest views say of the motion.

    Attributes
    ----------
    rates : tuple of float or None
        Rates of z, theta, p, left, right and share; None where nothing is to be carried on [1/ns].
    interval_ns : int
        Time between the two newest views [ns].
    origin_ns : int
        Zero of the server's time, as the quickest view of late has it, on the display's clock [ns].
    """

    view: View
    rates: Rates | None
    interval_ns: int
    origin_ns: int

    def age(self, now_ns: int) -> int:
        """Time since the newest view was sent [ns]."""
        return now_ns - self.view.sent_ns - self.origin_ns

    def settled(self, now_ns: int) -> bool:
        """Tell whether nothing will change until another view comes."""
        return self.rates is None or self.age(now_ns) > SETTLED * self.interval_ns

    def at(self, now_ns: int, config: Config) -> View:
        """What is to be seen at a moment.

        Returns
        -------
        View
            The newest view, carried on to that moment as far as it may be.
        """
        if self.rates is None or self.settled(now_ns):
            return self.view
        view, ahead = self.view, max(0, min(self.age(now_ns), self.interval_ns))
        z, theta, p, left, right, share = self.rates
        return replace(
            view,
            z=view.z + ahead * z,
            theta=view.theta + ahead * theta,
            p=None if view.p is None else _kept(view.p + ahead * p, view, config),
            left=None if view.left is None else view.left + ahead * left,
            right=None if view.right is None else view.right + ahead * right,
            share=min(view.share + ahead * share, 1.0),
        )


def heard(motion: Motion | None, view: View, received_ns: int) -> Motion:
    """Take a view that has come."""
    origin = received_ns - view.sent_ns
    if motion is None:
        return Motion(view, None, 0, origin)
    before = motion.view
    elapsed = view.sent_ns - before.sent_ns
    if 0 <= origin - motion.origin_ns < NEW_CLOCK_NS:
        origin = min(origin, motion.origin_ns + round(SKEW * max(elapsed, 0)))
    ticks = view.tick - before.tick
    alike = (view.phase, view.trial, view.target, view.failures) == (
        before.phase,
        before.trial,
        before.target,
        before.failures,
    )
    if not alike or not 0 < ticks <= MOST_TICKS:
        return Motion(view, None, 0, origin)
    interval = ticks * TICK_NS
    rates = (
        (view.z - before.z) / interval,
        (view.theta - before.theta) / interval,
        _rate(view.p, before.p, interval),
        _rate(view.left, before.left, interval),
        _rate(view.right, before.right, interval),
        max(view.share - before.share, 0.0) / interval,
    )
    return Motion(view, rates if any(rates) else None, interval, origin)


def _rate(new: float | None, old: float | None, interval: int) -> float:
    """How fast something that may be hidden changes."""
    return 0.0 if new is None or old is None else (new - old) / interval


def _kept(p: float, view: View, config: Config) -> float:
    """Keep the ball where its phase has it: outside the target or inside, and on the board [m]."""
    half, edge = config.geometry.target_width / 2, config.task.fall_distance
    if view.phase == "holding":
        return min(max(p, view.target - half), view.target + half)
    if view.phase == "running" and view.p is not None:
        near, far = view.target - half, view.target + half
        p = min(p, near) if view.p <= near else max(p, far) if view.p >= far else p
    return min(max(p, -edge), edge)
