"""Linear extrapolation of the newest views to the time of a paint. Pure: time is an argument.

Board, ball and styluses are drawn where they are at the paint, not where the newest view had them some milliseconds
ago. The rates come from the two newest views; extrapolation ends after one interval between views. Unlike
interpolation, which would be an interval behind, this adds no latency. Nothing is extrapolated across a change of
phase, trial or target, and the ball never crosses the edge of the target or of the board before a view says so. Without
a view for `SETTLED` intervals, everything is drawn where the newest view has it.

A view carries the time at which the server sent it. The offset to this display's clock comes from the views with the
shortest delay, so that a view delayed by the network does not look like a slow movement.
"""

from dataclasses import dataclass, replace

from netboard.base.config import Config
from netboard.base.tick import TICK_NS
from netboard.stage.view import View

MAX_TICKS = 40
"""Views further apart than this give no rates: the server sends none while nothing changes [1]."""

SETTLED = 2.5
"""Extrapolation stops when no view has arrived for this many intervals [1]."""

SKEW = 1e-4
"""Largest assumed drift between the two clocks, as `netboard.network.protocol.clock_estimator.SKEW_PPM` [1]."""

NEW_CLOCK_NS = 1_000_000_000
"""A view with this much more delay than the quickest one comes from another clock [ns]."""

Rates = tuple[float, float, float, float, float, float]
"""Rates of z, theta, p, left, right and share; 0 for what is not shown [1/ns]."""


@dataclass(frozen=True, slots=True)
class ShownMotion:
    """The newest view, and the rates to extrapolate it with."""

    view: View
    rates: Rates | None  # None if nothing is extrapolated [1/ns]
    interval_ns: int  # time between the two newest views [ns]
    # zero of the server's clock on the display's clock, from the recent view with the shortest delay [ns]
    origin_ns: int

    def age(self, now_ns: int) -> int:
        """Time since the newest view was sent [ns]."""
        return now_ns - self.view.sent_ns - self.origin_ns

    def settled(self, now_ns: int) -> bool:
        """Whether nothing moves until another view arrives."""
        return self.rates is None or self.age(now_ns) > SETTLED * self.interval_ns

    def at(self, now_ns: int, config: Config) -> View:
        """Return the newest view, extrapolated to a time within the limits of this module."""
        if self.rates is None or self.settled(now_ns):
            return self.view
        view, ahead = self.view, max(0, min(self.age(now_ns), self.interval_ns))
        z, theta, p, left, right, share = self.rates
        return replace(
            view,
            z=view.z + ahead * z,
            theta=view.theta + ahead * theta,
            p=None if view.p is None else _bounded(view.p + ahead * p, view, config),
            left=None if view.left is None else view.left + ahead * left,
            right=None if view.right is None else view.right + ahead * right,
            share=min(view.share + ahead * share, 1.0),
        )


def motion_after(motion: ShownMotion | None, view: View, received_ns: int) -> ShownMotion:
    """Return the motion after another view has arrived."""
    origin = received_ns - view.sent_ns
    if motion is None:
        return ShownMotion(view, None, 0, origin)
    before = motion.view
    elapsed = view.sent_ns - before.sent_ns
    if 0 <= origin - motion.origin_ns < NEW_CLOCK_NS:
        origin = min(origin, motion.origin_ns + round(SKEW * max(elapsed, 0)))
    ticks = view.tick - before.tick
    changed = any(getattr(view, name) != getattr(before, name) for name in ("phase", "trial", "target", "failures"))
    if changed or not 0 < ticks <= MAX_TICKS:
        return ShownMotion(view, None, 0, origin)
    interval = ticks * TICK_NS
    rates = (
        (view.z - before.z) / interval,
        (view.theta - before.theta) / interval,
        _rate(view.p, before.p, interval),
        _rate(view.left, before.left, interval),
        _rate(view.right, before.right, interval),
        max(view.share - before.share, 0.0) / interval,
    )
    return ShownMotion(view, rates if any(rates) else None, interval, origin)


def _rate(new: float | None, old: float | None, interval: int) -> float:
    """Rate of a quantity that may be hidden [1/ns]."""
    return 0.0 if new is None or old is None else (new - old) / interval


def _bounded(p: float, view: View, config: Config) -> float:
    """Limit the ball to where its phase allows: outside or inside the target, and on the board [m]."""
    half, edge = config.geometry.target_width / 2, config.task.fall_distance
    if view.phase == "holding":
        return min(max(p, view.target - half), view.target + half)
    if view.phase == "running" and view.p is not None:
        near, far = view.target - half, view.target + half
        p = min(p, near) if view.p <= near else max(p, far) if view.p >= far else p
    return min(max(p, -edge), edge)
