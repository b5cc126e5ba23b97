"""Explanation of one trial's measures: its traces, with the events that the measures find in them.

All marks come from the same calls that fill the tables (`analysis.extraction`), with the same settings. Time is
relative to the release of the ball.
"""

from collections.abc import Callable

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from netboard.analysis.extraction.attempts import classes_of, peaks_of, strategy_of
from netboard.analysis.extraction.details import THRESHOLDS, delays_of
from netboard.analysis.extraction.trials import RATE, AttemptData
from netboard.analysis.measures.cooperation import SEARCH_BACK
from netboard.analysis.measures.movements import Movement
from netboard.analysis.measures.signals import derivative, runs
from netboard.analysis.topics.figure import CLASS_COLOURS, TopicFigure, new_figure
from netboard.base.config import SIDES
from netboard.base.looks import BLACK, BLUE, FIGURE_STYLE, GREEN, GREY, ORANGE, PRINT_SMALL, PRINT_TITLE, VERMILION

MM, DEG = 1e3, float(np.degrees(1.0))
HANDS = {"left": BLUE, "right": VERMILION}
_STYLES = {"left": "-", "right": "--"}
_KINDS = {
    Movement.COOPERATIVE: "cooperative",
    Movement.COMPETITIVE: "competitive",
    Movement.LEFT_ONLY: "single",
    Movement.RIGHT_ONLY: "single",
    Movement.STILL: "still",
}
_ROOM = 0.15


def _whole(take: AttemptData) -> tuple[slice, NDArray[np.float64]]:
    """Return the samples of an attempt, and their times."""
    window = take.trial.window("whole")
    return window, np.arange(window.stop - window.start) / RATE


def draw_completion(axes: Axes, take: AttemptData) -> str:
    """Draw the ball's position and the target; return the explanation."""
    window, time = _whole(take)
    half, target = take.block.config.geometry.target_width / 2, take.trial.target
    axes.axhspan((target - half) * MM, (target + half) * MM, color=GREEN, alpha=0.2, lw=0)
    axes.plot(time, take.raw("p")[window] * MM, color=BLACK)
    axes.set_ylabel("ball [mm]")
    if not np.isfinite(take.completion):
        return f"not completed: {take.attempt.outcome}"
    hold = take.block.config.task.hold_time
    axes.axvline(take.completion, color=GREEN, ls=":")
    axes.axvspan(take.completion, take.completion + hold, color=GREEN, alpha=0.12, lw=0)
    return f"{take.completion:.3f} s; from there on the ball stays in the target for {hold:g} s"


def draw_peaks(axes: Axes, take: AttemptData) -> str:
    """Draw the ball's speed with its peaks; return the explanation."""
    window, time = _whole(take)
    how = take.block.readings.peaks
    speed = take.motion.speed[window] * MM
    axes.plot(time, np.abs(take.motion.vp[window]) * MM, color=GREY, lw=0.7)
    axes.plot(time, speed, color=BLACK)
    every, counted = peaks_of(take, "whole"), peaks_of(take, how.window)
    axes.plot(time[every.samples], speed[every.samples], "o", mfc="white", mec=GREY, ms=4)
    axes.plot(time[counted.samples], speed[counted.samples], "o", color=VERMILION, ms=4)
    if np.isfinite(take.completion):
        axes.axvline(take.completion, color=GREEN, ls=":")
    axes.set_ylabel("ball [mm/s]")
    where = "to the completion" if how.window == "to_completion" else "in the whole trial"
    return f"{counted.count} {where}, {every.count} with the hold; grey: before the {_slow(take)} filter"


def _slow(take: AttemptData) -> str:
    return f"{take.block.readings.filters.slow:g} Hz"


def draw_classes(axes: Axes, take: AttemptData) -> str:
    """Draw the styluses' velocities and a strip of the movement classes; return the explanation."""
    window, time = _whole(take)
    for side in SIDES:
        velocity = getattr(take.motion, f"{side}_vz")[window]
        axes.plot(time, velocity * MM, color=HANDS[side], ls=_STYLES[side], label=side)
    limit = take.block.readings.movements.still_below * MM
    for level in (-limit, limit):
        axes.axhline(level, color=GREY, lw=0.6)
    low, high = axes.get_ylim()
    axes.set_ylim(low - _ROOM * (high - low), high + 1.5 * _ROOM * (high - low))  # the strip, and the legend
    classes = classes_of(take)
    texts = []
    for name, colour in CLASS_COLOURS.items():
        own = np.isin(classes, [kind for kind, word in _KINDS.items() if word == name])
        spans = [(first / RATE, (stop - first) / RATE) for first, stop in runs(own)]
        strip = low - _ROOM * (high - low), 0.6 * _ROOM * (high - low)
        axes.broken_barh(spans, strip, color=colour, lw=0, label=name)
        texts.append(f"{name} {own.mean():.0%}" if own.size else f"{name} unknown")
    axes.set_ylabel("styluses [mm/s]")
    axes.legend(loc="upper right", ncols=6, fontsize=PRINT_SMALL)
    return ", ".join(texts) + f" of the time; lines: {limit:g} mm/s"


def draw_movements(axes: Axes, take: AttemptData) -> str:
    """Draw the board's angular velocity with its movements; return the explanation."""
    window, time = _whole(take)
    moved = delays_of(take)[0]
    for first, stop, together in zip(take.own_segments.first, take.own_segments.stop, moved.cooperative, strict=True):
        span = ((first - take.trial.release) / RATE, (stop - take.trial.release) / RATE)
        axes.axvspan(*span, color=GREEN if together else ORANGE, alpha=0.25, lw=0)
    axes.plot(time, derivative(take.motion.theta, RATE)[window] * DEG, color=GREY, lw=0.7)
    axes.plot(time, take.motion.omega[window] * DEG, color=BLACK)
    limit = take.block.readings.segments.least_rate_deg
    for level in (-limit, limit):
        axes.axhline(level, color=GREY, lw=0.6)
    axes.set_ylabel("board [deg/s]")
    count, together = len(take.own_segments), int(moved.cooperative.sum())
    return f"{count}, of which {together} cooperative (green); grey: before the {_slow(take)} filter"


def draw_delay(axes: Axes, take: AttemptData) -> str:
    """Draw the largest cooperative movement with the delay thresholds; return the explanation."""
    moved, found = delays_of(take)
    turns = take.own_segments
    axes.set_ylabel("styluses [mm/s]")
    if not moved.cooperative.any():
        return "no cooperative movement"
    k = int(np.argmax(np.where(moved.cooperative, np.abs(turns.angle), 0.0)))
    first, stop = max(int(turns.first[k]) - round(SEARCH_BACK * RATE), 0), int(turns.stop[k])
    time = (np.arange(first, stop) - take.trial.release) / RATE
    axes.axvspan((turns.first[k] - take.trial.release) / RATE, time[-1], color=GREEN, alpha=0.15, lw=0)
    how, peaks = take.block.readings.delays, {"left": found.left_peak[k], "right": found.right_peak[k]}
    for side, went in (("left", moved.left[k]), ("right", moved.right[k])):
        own = getattr(take.motion, f"{side}_vz")[first:stop]
        own = np.abs(own) if how.velocity == "magnitude" else np.sign(went) * own
        axes.plot(time, own * MM, color=HANDS[side], ls=_STYLES[side], label=side)
    levels = peaks if how.threshold == "own_peak" else {"": min(peaks.values())}
    for side, peak in levels.items():
        for percent in THRESHOLDS:
            axes.axhline(percent / 100 * peak * MM, color=HANDS.get(side, GREY), lw=0.6, label=f"_{side} {percent} %")
    axes.legend(loc="upper left")
    delays = ", ".join(f"{value * MM:.0f}" if np.isfinite(value) else "none" for value in found.signed[k])
    at = ", ".join(f"{percent}" for percent in THRESHOLDS)
    whose = "each side's own peak" if how.threshold == "own_peak" else "the slower side's peak"
    return f"left minus right {delays} ms at {at} % of {whose} (lines), largest movement"


def draw_braking(axes: Axes, take: AttemptData) -> str:
    """Draw the tilt with the initial and the first braking movement; return the explanation."""
    window, time = _whole(take)
    axes.axhline(0.0, color=GREY, lw=0.6)
    axes.plot(time, -take.trial.side * take.motion.theta[window] * DEG, color=BLACK)
    axes.set_ylabel("tilt to target [deg]")
    found = strategy_of(take, take.block.readings.strategy.braking)
    for onset, colour, word in ((found.initial, ORANGE, "initial"), (found.onset, VERMILION, "braking")):
        if np.isfinite(onset):
            axes.axvline(onset, color=colour, ls=":")
            axes.annotate(
                word,
                (onset, 1.0),
                (3, 0),
                xycoords=("data", "axes fraction"),
                textcoords="offset points",
                color=colour,
                fontsize=PRINT_SMALL,
                va="top",
            )
    if not np.isfinite(found.onset):
        return "no braking movement"
    return (
        f"at {found.onset:.3f} s, {found.distance * MM:.0f} mm before the target's midpoint, "
        f"{found.velocity * MM:.0f} mm/s towards it"
    )


PANELS: dict[str, tuple[str, Callable[[Axes, AttemptData], str]]] = {
    "completion": ("Completion time", draw_completion),
    "peaks": ("Number of peaks", draw_peaks),
    "classes": ("Movement classes", draw_classes),
    "movements": ("Movements of the board", draw_movements),
    "delay": ("Delay", draw_delay),
    "braking": ("First braking movement", draw_braking),
}
"""Parts of the sheet by name: title and drawing function."""


@mpl.rc_context(FIGURE_STYLE)
def panel(take: AttemptData, name: str) -> Figure:
    """Draw one part as a figure of its own."""
    figure, (axes,) = new_figure(2.0)
    _draw(axes, take, name)
    return figure


@mpl.rc_context(FIGURE_STYLE)
def sheet(take: AttemptData) -> TopicFigure:
    """Draw all parts on one sheet."""
    figure, places = new_figure(1.75 * len(PANELS), rows=len(PANELS))
    for axes, name in zip(places, PANELS, strict=True):
        _draw(axes, take, name)
    where = f"trial {take.attempt.trial}, attempt {take.attempt.attempt}"
    figure.suptitle(f"{where}: {take.attempt.outcome}", fontsize=PRINT_TITLE)
    caption = "How each measure of one attempt is computed; time starts at the release of the ball."
    return TopicFigure("trial", where, caption, figure)


def _draw(axes: Axes, take: AttemptData, name: str) -> None:
    """Draw a part with its title and its explanation."""
    title, draw = PANELS[name]
    explanation = draw(axes, take)
    axes.set_title(f"{title}: {explanation}", loc="left", fontsize=PRINT_SMALL)
    axes.set_xlabel("time from the release [s]")
    if name != "delay":
        axes.set_xlim(-0.05, take.attempt.duration + 0.05)
