"""The peers of a running session, as a table for the terminal."""

from math import isnan

from rich.console import Group, RenderableType
from rich.text import Text

from netboard.base.plural import plural
from netboard.base.terminal.output import FittedTable, numbers
from netboard.network.protocol.control import Status


def status_tables(status: Status) -> RenderableType:
    """Return tables of the session's state and its peers' connections."""
    return Group(*_lines(status), _links(status), *_loops(status))


def _lines(status: Status) -> list[Text]:
    lines = [
        Text(f"session {status.session[:8]}   {status.phase}, trial {status.trial} of {status.trials}", style="bold"),
        Text(f"block {status.block} of {status.blocks}: {status.label or status.condition}"),
        Text(
            f"tick {status.tick}   {status.successes} done, {status.failures} failed   "
            f"{status.late_ticks} deadline misses"
        ),
    ]
    if status.pending:
        lines.append(Text(status.pending))
    if status.waiting_for and "waiting for" not in status.notice:  # often the notice says it already
        lines.append(Text("waiting for " + ", ".join(status.waiting_for), style="yellow"))
    if status.notice:
        lines.append(Text(status.notice, style="yellow"))
    lines += [
        Text(f"refused so far, {plural(n, 'time')}: {where}: {why}", style="dim") for where, why, n in status.refused
    ]
    return lines


def _links(status: Status) -> FittedTable:
    measured = numbers("heard", "round trip", "clock known to", "drift", "messages", "lost")
    table = FittedTable("peer", "host:process", "version", *measured, title="Peers")
    for link in status.links:
        table.add_row(
            link.peer,
            link.name,
            link.version,
            f"{_milliseconds(link.age)} ago",
            _milliseconds(link.round_trip),
            _milliseconds(link.clock_bound),
            "-" if isnan(link.drift_ppm) else f"{link.drift_ppm:+.1f} ppm",
            f"{link.rate:.0f} Hz",
            str(link.lost),
        )
    return table


def _loops(status: Status) -> list[Text]:
    """Return each hand's sample-to-force latency, and the largest with which its device is stable by itself."""
    return [
        Text(f"{what}: latency {_milliseconds(late)} to the force, stable to {_milliseconds(most)} without a hand")
        for what, late, most in status.loops
    ]


def _milliseconds(seconds: float) -> str:
    return "-" if isnan(seconds) else f"{seconds * 1e3:.2f} ms"
