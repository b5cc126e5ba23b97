"""Text and tables of a recording for the terminal."""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from math import isnan
from pathlib import Path

from rich.console import Group, RenderableType
from rich.text import Text

from netboard.base.errors import RecordingError
from netboard.base.plural import plural
from netboard.base.terminal.output import FittedTable, numbers
from netboard.network.protocol.records import STOPPED
from netboard.recording.files.offline_writer import TARGET_SIDES
from netboard.recording.files.reader import Recording
from netboard.recording.format.rig import RecordedRig, rig_of
from netboard.recording.format.summary import Attempt, DurationSpread, RecordingSummary, summarise
from netboard.recording.integrity.account import NumberRange, account_of, parts_of
from netboard.recording.integrity.quality_check import losses_among
from netboard.recording.integrity.stream_check import not_exact
from netboard.recording.integrity.verification import Verification
from netboard.recording.replay.loaded import LoadedRecording
from netboard.recording.replay.position import clock
from netboard.task.studies.factors import BlockFactor, design_of, factors_of, role_of, trial_role
from netboard.task.trials.exclusion import rule_of
from netboard.task.trials.quality import FLAGS, Verdict
from netboard.task.trials.state_machine import EMERGENCY_STOP


def summary_of(recording: Recording) -> RecordingSummary:
    """Summarise an open recording."""
    return summarise(recording.ticks(), recording.events(), recording.clocks(), recording.frames(), recording.remarks())


def summary_tables(summary: RecordingSummary, recording: Recording, verdicts: Sequence[Verdict]) -> RenderableType:
    """Return tables of trials, timing and losses; ``verdicts``: on the quality of the attempts."""
    return Group(_trials(summary.attempts, recording, verdicts), _timing(summary), _counts(summary))


def verification_line(result: Verification) -> Text:
    """Return the result of a verification in one line."""
    gaps = f", across {plural(result.gaps, 'gap')}" if result.gaps else ""
    if result.identical:
        return Text(f"verified: all {result.checked} ticks are identical to the bit{gaps}", "green")
    return Text(
        f"not identical: tick {result.tick}, {result.field}: recorded {result.recorded!r}, "
        f"computed {result.computed!r} (first difference, after {result.checked} ticks{gaps})",
        "red",
    )


def _trials(attempts: tuple[Attempt, ...], recording: Recording, verdicts: Sequence[Verdict]) -> FittedTable:
    numbered, completion = numbers("trial", "attempt"), numbers("completion time")
    title = "; ".join(filter(None, ("Trials", losses_among(verdicts, recording.config, recording.metadata).text)))
    table = FittedTable(*numbered, "target", "outcome", *completion, "role", "in the analysis", title=title)
    rule = rule_of(recording.config, recording.metadata)
    flags = {(one.trial, one.attempt): one.flags for one in verdicts}
    stops = [event.tick for event in recording.events() if event.name == STOPPED]
    for a in attempts:
        time = f"{a.completion:.3f} s" if a.outcome == "success" else "-"
        outcome = EMERGENCY_STOP if any(a.tick <= tick <= a.stop for tick in stops) else a.outcome
        counts = rule.consequence(a.outcome, flags.get((a.trial, a.attempt), ())) or "counts"
        role = trial_role(recording.config, a.trial)
        words = TARGET_SIDES[a.target], outcome.replace("_", " "), time, role, counts
        table.add_row(str(a.trial), str(a.attempt), *words)
    return table


def _timing(summary: RecordingSummary) -> FittedTable:
    table = FittedTable("", *numbers("50 %", "99 %", "99.9 %", "largest"), title="Timing")
    spreads = {
        "tick start relative to its deadline": summary.lateness,
        "left: stylus read to force rendered": summary.left.loop,
        "right: stylus read to force rendered": summary.right.loop,
        **{f"{peer}: network round trip": trip for peer, trip in summary.round_trips.items()},
    }
    for name, spread in spreads.items():
        table.add_row(name, *_milliseconds(spread))
    return table


def _milliseconds(spread: DurationSpread) -> tuple[str, ...]:
    if spread.count == 0:
        return ("-",) * 4
    return tuple(f"{value * 1e3:.3f} ms" for value in (spread.p50, spread.p99, spread.p999, spread.largest))


def _counts(summary: RecordingSummary) -> FittedTable:
    completions = summary.completions
    mean = f"{sum(completions) / len(completions):.3f} s" if completions else "-"
    table = FittedTable("", *numbers(""), title="Counts", header=False)
    rows = {
        "duration": f"{summary.duration:.3f} s",
        "ticks": f"{summary.ticks}",
        "ticks missing": f"{summary.missing_ticks}",
        "records lost": f"{summary.lost_records}",
        "deadline misses (> 0.5 ms)": f"{summary.late_ticks}",
        "successful trials": f"{len(completions)}",
        "failed attempts": f"{summary.failures}",
        "mean completion time": mean,
    }
    for side, counts in (("left", summary.left), ("right", summary.right)):
        never = isnan(counts.largest_force)
        rows[f"{side}: ticks without a fresh sample"] = f"{counts.stale_ticks}"
        rows[f"{side}: samples that no tick used"] = f"{counts.skipped_samples}"
        rows[f"{side}: ticks with a limited force"] = f"{counts.limited_ticks}"
        rows[f"{side}: largest force rendered"] = "-" if never else f"{counts.largest_force:.3f} N"
        rows[f"{side}: ticks with unknown rendered force"] = "all" if never else f"{counts.unknown_ticks}"
    for station, shown in summary.displays.items():
        rows[f"{station} display: frames shown"] = f"{shown.frames}"
        rows[f"{station} display: views dropped"] = f"{shown.dropped}"
    for name, value in rows.items():
        table.add_row(name, value)
    return table


def marks_table(recording: LoadedRecording) -> FittedTable:
    """Return a table of trials and events with their times."""
    table = FittedTable(
        *numbers("time", "tick", "trial"), "kind", "what", title=f"{recording.name}: {clock(recording.length)}"
    )
    for mark in recording.marks:
        style = "bold" if mark.kind == "trial" else ""
        table.add_row(f"{mark.time:.3f} s", str(mark.tick), str(mark.trial), mark.kind, mark.label, style=style)
    return table


def provenance_table(recording: Recording) -> FittedTable:
    """Return a table of the recording's provenance."""
    config = recording.config
    block, design = config.block, design_of(config)
    known = defaultdict(lambda: "?", recording.metadata)
    rig = rig_of(config, recording.metadata, recording.events(), recording.attempts())
    rows = {
        "devices": _devices(rig),
        **({"stand-ins": rig.stand_ins_in_words} if rig.stand_ins else {}),
        "file": f"{recording.path} ({recording.path.stat().st_size / 1e6:.1f} MB)",
        "session": f"{known['name']}, dyad {known['dyad']}, run {known['session']}",
        "pilot": known["pilot"],
        **({"origin": origin} if (origin := _origin(known)) else {}),
        **({"not bit-exact": where} if (where := "\n".join(not_exact(recording.remarks()))) else {}),
        "recorded": known["opened_utc"],
        "block": f"{block.configuration}, haptics {'on' if block.haptics else 'off'}, {plural(block.trials, 'trial')}",
        "role": role_of(config) + (f", kind {design.kind}" if design.kind else ""),
        **{f"factor {one.name}": _level(one, block.trials) for one in factors_of(config)},
        "ended": recording.end.get("ended", "unknown: the file was recovered"),
        "written by": f"netboard {known['netboard']}, {known['python']}, {known['platform']}",
        "doctor": known["doctor"],
        "configuration": known["config_sha256"],
    }
    return FittedTable("", "", rows=rows.items(), title="Recording", header=False)


def _devices(rig: RecordedRig) -> str:
    """Return what the hands held, and which displays nobody saw, one side a line."""
    lines = [f"{side}: {', then '.join(held) or 'not recorded'}" for side, held in rig.hands.items()]
    return "\n".join((*lines, *(f"{side} display: drawn off screen, nobody saw it" for side in rig.unseen)))


def _origin(metadata: Mapping[str, str]) -> str:
    """Return how a recording was made; empty for one of a live session."""
    words = {
        "rehearsed": "a rehearsal with simulated participants",
        "what_if": "a counterfactual of {source}: {what_if}",
        "imported": "imported from {imported_from}, {imported}",
    }
    return "; ".join(text.format_map(metadata) for key, text in words.items() if key in metadata)


def _level(factor: BlockFactor, trials: int) -> str:
    """Return the level of a factor in a block, with the level of each trial if it varies within the block."""
    if factor.scope != "trial":
        return f"{factor.summary}, {factor.of.type}"
    return f"{factor.summary}, {factor.of.type}, by trial: {' '.join(factor.level(k) for k in range(1, trials + 1))}"


def quality_table(verdicts: Sequence[Verdict]) -> FittedTable:
    """Return a table of the attempts that the configured quality rules flag, with the reasons."""
    flagged = [verdict for verdict in verdicts if verdict.flags]
    title = f"Flagged attempts: {len(flagged)} of {len(verdicts)}"
    table = FittedTable(*numbers("trial", "attempt"), "outcome", "flag", "reason", title=title, header=bool(flagged))
    for verdict in flagged:
        words, sentences = "\n".join(verdict.flags), "\n".join(FLAGS[word] for word in verdict.flags)
        table.add_row(str(verdict.trial), str(verdict.attempt), verdict.outcome, words, sentences)
    return table


def account_table(path: Path) -> FittedTable:
    """Return a table that accounts for every tick of the session, in all parts in the same folder."""
    table = FittedTable("", "", title="Ticks and records of the session", header=False)
    try:
        account = account_of(parts_of(path))
    except RecordingError as error:
        table.add_row("not possible", str(error))
        return table
    for part in account.parts:
        table.add_row(part.path.name, part.ended or "recovered")
    for what, stretches in (
        ("ticks present", account.present),
        ("ticks lost", account.lost),
        ("ticks unexplained", account.unexplained),
        ("records lost", account.lost_records),
        ("records unexplained", account.unexplained_records),
    ):
        table.add_row(what, "\n".join(stretch_text(stretch) for stretch in stretches) or "none")
    table.add_row("pauses", "\n".join(f"tick {pause.tick}: {pause.cause or 'unexplained'}" for pause in account.pauses))
    return table


def stretch_text(stretch: NumberRange) -> str:
    """Return a range of tick or record numbers, how many they are, and why they are missing."""
    count = stretch.last - stretch.first + 1
    return f"{count}: {stretch.first} to {stretch.last}" + (f", {stretch.cause}" if stretch.cause else "")
