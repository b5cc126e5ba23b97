"""The peers of a running session, as a table for the terminal."""

from math import isnan

from rich.console import Group, RenderableType
from rich.text import Text

from netboard.base.plural import plural
from netboard.base.process.display_server import unseen
from netboard.base.terminal.output import FittedTable, numbers
from netboard.network.protocol.control import FORM_AWAITED, RecordingStatus, Status
from netboard.nodes.ports.emergency import AWAITING_RELEASE
from netboard.nodes.ports.waiting import in_words
from netboard.recording.format.disk import SLOW_SYNC_S, STALLED_SYNC_S
from netboard.task.journal.lost import WILL_BE_EXCLUDED


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
    lines += _rig(status)
    lines += [_recording(recording) for recording in status.recordings if recording.file]
    if status.pending:
        lines.append(Text(status.pending))
    if status.waiting_for and "waiting for" not in status.notice:  # often the notice says it already
        lines.append(Text(f"waiting for {in_words(status.waiting_for)}", style="yellow"))
    if status.notice:
        lines.append(Text(status.notice, style="yellow"))
    if step := next_step(status):
        lines.append(Text(step, style="yellow"))
    lines += [
        Text(f"refused so far, {plural(n, 'time')}: {where}: {why}", style="dim") for where, why, n in status.refused
    ]
    return lines


def next_step(status: Status) -> str:
    """Return the command with which the session goes on, if it waits for the operator; else an empty text."""
    steps = []
    if AWAITING_RELEASE in status.waiting_for:
        steps.append("to release the emergency stop: netboard control emergency_release")
    elif status.phase == "paused" and not status.waiting_for:
        steps.append("to resume: netboard control resume")
    if status.lost and WILL_BE_EXCLUDED in status.notice:
        these = "that trial" if len(status.lost) == 1 else f"those {len(status.lost)} trials"
        steps.append(f"to repeat {these}: netboard control repeat_lost")
        if status.phase == "finished":
            over = "end" if status.block == status.blocks else "next"
            steps.append(f"to continue without: netboard control {over}")
    if FORM_AWAITED in status.notice:
        steps.append("to go on without the answers: netboard control skip_form")
    return "; ".join(steps)


def _rig(status: Status) -> list[Text]:
    """Return what the hands hold, how the displays are drawn, and what of it stands in for the real thing."""
    kind = "REAL" if status.real else "pilot, not for the study" if status.pilot else "no consent, not for the study"
    lines = [Text(f"session {status.name} of dyad {status.dyad}: {kind}")]
    lines += [Text(f"{device.side} hand: {device.text}") for device in status.devices]
    for side, platform in status.displays:
        hidden = "drawn off screen, where nobody sees it" if unseen(platform) else f"drawn on {platform or 'a screen'}"
        lines.append(Text(f"{side} display: {hidden}", style="yellow" if unseen(platform) else ""))
    if status.real:
        said = {True: "confirmed in words", False: "NOT confirmed in words"}
        lines += [Text(f"{words}: {said[confirmed]}", style="yellow") for words, confirmed in status.stand_ins]
    return lines


def _recording(recording: RecordingStatus) -> Text:
    """Return what a logger writes, and how long its disk takes: yellow if that is slow, red if it is stalled."""
    style = "red" if recording.age > STALLED_SYNC_S else "yellow" if recording.age > SLOW_SYNC_S else ""
    size = f"{recording.written_bytes / 1e6:.1f} MB, {recording.free_bytes / 1e9:.1f} GB free"
    return Text(f"recording {recording.file}   {size}   reaches the disk within {recording.age:.1f} s", style=style)


def _links(status: Status) -> FittedTable:
    measured = numbers("heard", "round trip", "clock error below", "drift", "messages", "lost")
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
        Text(
            f"{what}: sample-to-force latency {'not measured' if isnan(late) else _milliseconds(late)} "
            f"(with no hand on it, the stylus is stable up to {_milliseconds(most)})"
        )
        for what, late, most in status.loops
    ]


def _milliseconds(seconds: float) -> str:
    return "-" if isnan(seconds) else f"{seconds * 1e3:.2f} ms"
