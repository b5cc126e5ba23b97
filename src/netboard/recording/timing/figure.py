"""Figure of a trace: the ticks around one as a timeline of three lanes, the lateness of all ticks, and when it was."""

from typing import TYPE_CHECKING, Any

import numpy as np

from netboard.base.config import SIDES, Side
from netboard.base.looks import BLUE, GREEN, MANY, PRINT_BODY, PRINT_SMALL, PRINT_TITLE, VERMILION
from netboard.recording.timing.causes import CAUSES
from netboard.recording.timing.stamps import UNKNOWN, Stamps, Times
from netboard.recording.timing.trace import MS, TimingTrace

if TYPE_CHECKING:
    from matplotlib.axes import Axes

TICKS_BEFORE, TICKS_AFTER = 6, 10
"""Ticks in the timeline before and after the one shown [1]."""

_LANES = {"left": 2.0, "server": 1.0, "right": 0.0}
_COLOURS = {"left": BLUE, "right": GREEN}
_LATE, _GRID = VERMILION, "0.85"
_MARKS = MANY


def draw(found: TimingTrace, name: str, row: int | None = None) -> Any:
    """Draw a trace. ``row``: the tick in the timeline; by default that of the worst episode."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12, 8.5), layout="constrained")
    timeline, histogram, course = figure.subplot_mosaic(
        [["timeline", "timeline"], ["histogram", "course"]], height_ratios=(1.25, 1.0)
    ).values()
    shown = _shown(found) if row is None else row
    _draw_timeline(timeline, found, shown)
    _draw_histogram(histogram, found)
    _draw_course(course, found)
    figure.suptitle(f"Timing of {name}")
    return figure


def _shown(found: TimingTrace) -> int:
    """Return the row of the worst tick of the worst episode; the latest tick if there is no episode."""
    late_ns = found.stamps.late_ns
    if not found.episodes:
        return int(np.argmax(late_ns))
    evidence = found.worst[0].evidence
    if not evidence.is_late:
        return evidence.first
    return evidence.first + int(np.argmax(late_ns[evidence.first : evidence.last + 1]))


def _draw_timeline(axis: "Axes", found: TimingTrace, shown: int) -> None:
    """Draw when samples were read and arrived, ticks began and forces were rendered."""
    stamps = found.stamps
    rows = np.arange(max(shown - TICKS_BEFORE, 0), min(shown + TICKS_AFTER + 1, stamps.tick.size))
    zero_ns = int(stamps.due_ns[shown] - stamps.moved_ns[shown])
    for row in rows:
        due = (stamps.due_ns[row] - zero_ns) * MS
        axis.axvline(due, color=_GRID, linewidth=1.0, zorder=0)
        axis.annotate(
            f"{stamps.tick[row]}",
            (due, 2.42),
            rotation=90,
            fontsize=PRINT_SMALL,
            ha="center",
            va="bottom",
            annotation_clip=True,
        )
    _draw_ticks(axis, stamps, rows, zero_ns, found.limit_ns)
    for side in SIDES:
        _draw_side(axis, stamps, side, rows, zero_ns)
    axis.axhline(_LANES["server"], color="0.6", linewidth=0.8, zorder=0)
    axis.set_yticks(list(_LANES.values()), ["left agent", "server", "right agent"])
    axis.set_ylim(-0.35, 2.95)
    axis.set_xlim((stamps.due_ns[rows[0]] - zero_ns) * MS - 1.0, (stamps.due_ns[rows[-1]] - zero_ns) * MS + 1.0)
    axis.set_xlabel(f"time since the deadline of tick {stamps.tick[shown]} [ms]; grey: deadlines")
    axis.set_title(_title(found, shown), loc="left", fontsize=PRINT_TITLE)
    axis.legend(loc="upper center", bbox_to_anchor=(0.5, -0.12), ncols=5, fontsize=PRINT_BODY, frameon=False)


def _title(found: TimingTrace, shown: int) -> str:
    """Name the cause of the tick in the timeline."""
    for one in found.episodes:
        if one.evidence.first <= shown <= one.evidence.last:
            side = f" ({one.evidence.side})" if one.evidence.side else ""
            trial = f", trial {one.trial}" if one.trial else ", outside trials"
            return f"{one.cause.title}{side}: {one.evidence.size_ns * MS:.2f} ms at {one.time:.3f} s{trial}"
    return "no stutter here"


def _draw_ticks(axis: "Axes", stamps: Stamps, rows: Times, zero_ns: int, limit_ns: int) -> None:
    """Draw the ticks in the server's lane, with their lateness."""
    lane, began = _LANES["server"], (stamps.began_ns[rows] - zero_ns) * MS
    late = stamps.late_ns[rows] > limit_ns
    due = (stamps.due_ns[rows] - stamps.moved_ns[rows] - zero_ns) * MS
    axis.hlines(
        np.full(int(late.sum()), lane), due[late], began[late], color=_LATE, linewidth=5, alpha=0.35, label="late"
    )
    axis.plot(began[~late], np.full(int((~late).sum()), lane), "|", color="black", markersize=16, label="tick begins")
    axis.plot(began[late], np.full(int(late.sum()), lane), "|", color=_LATE, markersize=16, markeredgewidth=2)


def _draw_side(axis: "Axes", stamps: Stamps, side: Side, rows: Times, zero_ns: int) -> None:
    """Draw the samples of a side on their way to the server, and the forces on their way back."""
    one, lane, server = stamps.sides[side], _LANES[side], _LANES["server"]
    colour, edge = _COLOURS[side], server + (0.12 if lane > server else -0.12)
    fresh = rows[one.fresh[rows]]
    read, arrived, began = ((ns[fresh] - zero_ns) * MS for ns in (one.read_ns, one.arrived_ns, stamps.began_ns))
    label = "stylus read, sample arrives" if side == "left" else None
    axis.plot(read, np.full(fresh.size, lane), "o", color=colour, markersize=5)
    axis.plot(np.stack([read, arrived]), np.tile([[lane], [edge]], fresh.size), color=colour, linewidth=1.2)
    axis.plot([], [], "-o", color=colour, markersize=5, label=label)
    known = one.rendered_ns[fresh] != UNKNOWN
    rendered = (one.rendered_ns[fresh][known] - zero_ns) * MS
    places = np.tile([[edge], [lane]], int(known.sum()))
    axis.plot(np.stack([began[known], rendered]), places, color=colour, linewidth=1.0, linestyle=":")
    axis.plot(rendered, np.full(rendered.size, lane), "s", color=colour, markersize=5, markerfacecolor="white")
    axis.plot([], [], ":s", color=colour, markerfacecolor="white", label="force sent, rendered" if label else None)
    gone = rows[(one.seq[rows] >= 0) & ~one.fresh[rows]]
    axis.plot(
        (stamps.began_ns[gone] - zero_ns) * MS,
        np.full(gone.size, edge),
        "x",
        color=_LATE,
        label="no new sample" if label else None,
    )


def _draw_histogram(axis: "Axes", found: TimingTrace) -> None:
    """Draw the distribution of the starts of ticks relative to their deadlines."""
    late = found.stamps.late_ns * MS
    high = max(float(late.max()), found.limit_ns * MS * 1.2)
    bins = np.linspace(min(float(late.min()), -0.6), min(high, 3.0), 120)
    axis.hist(np.clip(late, bins[0], bins[-1]), bins.tolist(), color="0.55", log=True)
    axis.axvline(found.limit_ns * MS, color=_LATE, linewidth=1.2, label=f"limit, {found.limit_ns * MS:g} ms")
    lateness = next(iter(found.spreads.values()))
    for value, style in ((lateness.p50, "-"), (lateness.p99, "--"), (lateness.p999, ":")):
        axis.axvline(min(value * 1e3, bins[-1]), color="black", linewidth=1.0, linestyle=style)
    axis.plot([], [], color="black", label="50, 99 (dashed), 99.9 % (dotted)")
    beyond = f"; last bar: up to {high:.1f} ms" if high > bins[-1] else ""
    axis.set_xlabel(f"tick begins after its deadline [ms]{beyond}")
    axis.set_ylabel("ticks [1]")
    axis.legend(
        loc="best", fontsize=PRINT_BODY, frameon=False
    )  # named: Matplotlib warns of its default on a slow machine


def _draw_course(axis: "Axes", found: TimingTrace) -> None:
    """Draw when episodes happened, by cause."""
    for cause, colour in zip(CAUSES, _MARKS, strict=True):
        mine = [one for one in found.episodes if one.cause is cause]
        if mine:
            sizes = [max(one.evidence.size_ns * MS, 1e-2) for one in mine]
            axis.plot([one.time for one in mine], sizes, "o", color=colour, markersize=4, label=cause.title)
    duration = float(found.stamps.due_ns[-1] - found.stamps.due_ns[0]) * 1e-9
    axis.set_xlim(0.0, max(duration, 1e-3))
    axis.set_xlabel("time since the first tick [s]")
    axis.set_ylabel("size of the episode [ms]")
    axis.grid(True, alpha=0.3)
    if found.episodes:
        axis.set_yscale("log")
        axis.legend(loc="upper center", bbox_to_anchor=(0.5, -0.14), ncols=3, fontsize=PRINT_BODY, frameon=False)
    else:
        axis.text(0.5, 0.5, "no stutter", transform=axis.transAxes, ha="center")
