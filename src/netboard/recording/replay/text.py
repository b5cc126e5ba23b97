"""Text and tables of a recording for the terminal."""

from math import isnan

from rich.console import Group, RenderableType

from netboard.base.terminal import FittedTable, numbers
from netboard.recording.files.reader import Recording
from netboard.recording.format.summary import Attempt, Spread, Summary, summarise
from netboard.recording.integrity.verification import Verification
from netboard.recording.replay.loaded import Reel
from netboard.recording.replay.position import clock

_SIDES = {-1: "left", 0: "unknown", 1: "right"}


def summary_of(recording: Recording) -> Summary:
    """Summarise an open recording."""
    return summarise(recording.ticks(), recording.events(), recording.clocks(), recording.frames(), recording.remarks())


def summary_tables(summary: Summary) -> RenderableType:
    """Return tables of trials, timing and losses."""
    return Group(_trials(summary.attempts), _timing(summary), _counts(summary))


def verdict_line(verdict: Verification) -> str:
    """Return the result of a verification in one line, with rich markup."""
    gaps = f", across {verdict.gaps} gaps" if verdict.gaps else ""
    if verdict.identical:
        return f"[green]verified: all {verdict.checked} ticks are identical to the bit{gaps}[/green]"
    return (
        f"[red]not identical: tick {verdict.tick}, {verdict.field}: recorded {verdict.recorded!r}, "
        f"computed {verdict.computed!r} (first difference, after {verdict.checked} ticks{gaps})[/red]"
    )


def _trials(attempts: tuple[Attempt, ...]) -> FittedTable:
    table = FittedTable(*numbers("trial", "attempt"), "target", "outcome", *numbers("completion time"), title="Trials")
    for a in attempts:
        time = f"{a.completion:.3f} s" if a.outcome == "success" else "-"
        table.add_row(str(a.trial), str(a.attempt), _SIDES[a.target], a.outcome, time)
    return table


def _timing(summary: Summary) -> FittedTable:
    table = FittedTable("", *numbers("50 %", "99 %", "99.9 %", "largest"), title="Timing")
    spreads = {
        "tick begins late by": summary.lateness,
        "left: stylus read to force rendered": summary.left.loop,
        "right: stylus read to force rendered": summary.right.loop,
        **{f"{peer}: network round trip": trip for peer, trip in summary.round_trips.items()},
    }
    for name, spread in spreads.items():
        table.add_row(name, *_milliseconds(spread))
    return table


def _milliseconds(spread: Spread) -> tuple[str, ...]:
    if spread.count == 0:
        return ("-",) * 4
    return tuple(f"{value * 1e3:.3f} ms" for value in (spread.p50, spread.p99, spread.p999, spread.largest))


def _counts(summary: Summary) -> FittedTable:
    completions = summary.completions
    mean = f"{sum(completions) / len(completions):.3f} s" if completions else "-"
    table = FittedTable("", *numbers(""), title="Counts", header=False)
    rows = {
        "duration": f"{summary.duration:.3f} s",
        "ticks": f"{summary.ticks}",
        "ticks missing": f"{summary.missing_ticks}",
        "records lost": f"{summary.lost_records}",
        "late ticks (> 0.5 ms)": f"{summary.late_ticks}",
        "successful trials": f"{len(completions)}",
        "failed attempts": f"{summary.failures}",
        "mean completion time": mean,
    }
    for side, counts in (("left", summary.left), ("right", summary.right)):
        never = isnan(counts.largest_force)
        rows[f"{side}: ticks without a fresh sample"] = f"{counts.stale_ticks}"
        rows[f"{side}: samples no tick used"] = f"{counts.skipped_samples}"
        rows[f"{side}: ticks with a limited force"] = f"{counts.limited_ticks}"
        rows[f"{side}: largest force rendered"] = "-" if never else f"{counts.largest_force:.3f} N"
        rows[f"{side}: ticks of unknown rendered force"] = "all" if never else f"{counts.unknown_ticks}"
    for station, shown in summary.displays.items():
        rows[f"{station} display: frames shown"] = f"{shown.frames}"
        rows[f"{station} display: views dropped"] = f"{shown.dropped}"
    for name, value in rows.items():
        table.add_row(name, value)
    return table


def marks_table(reel: Reel) -> FittedTable:
    """Return a table of trials and events with their times."""
    table = FittedTable(*numbers("time", "tick", "trial"), "kind", "what", title=f"{reel.name}: {clock(reel.length)}")
    for mark in reel.marks:
        style = "bold" if mark.kind == "trial" else ""
        table.add_row(f"{mark.time:.3f} s", str(mark.tick), str(mark.trial), mark.kind, mark.label, style=style)
    return table
