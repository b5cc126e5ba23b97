"""Summary of a recording for people: provenance, trials, completion times, latencies, losses."""

from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from netboard.base.config import parse
from netboard.base.errors import RecordingError
from netboard.base.terminal import FittedTable, numbers
from netboard.recording.files.reader import Recording
from netboard.recording.integrity.account import NumberRange, account_of, parts_of
from netboard.recording.integrity.quality_check import judged
from netboard.recording.replay.text import summary_of, summary_tables
from netboard.task.studies.factors import BlockFactor, design_of, factors_of, role_of
from netboard.task.trials.quality import WORDS, Verdict


def main(path: Path) -> int:
    """Print the summary of a recording."""
    console = Console(highlight=False)
    with Recording(path) as recording:
        console.print(provenance_table(recording))
        console.print(summary_tables(summary_of(recording)))
        console.print(quality_table(judged(recording)))
    console.print(account_table(path))
    return 0


def provenance_table(recording: Recording) -> FittedTable:
    """Return a table of the recording's provenance."""
    config = parse(recording.config_text, f"{recording.path} (its configuration)")
    block, design = config.block, design_of(config)
    said = recording.metadata
    rows = {
        "file": f"{recording.path} ({recording.path.stat().st_size / 1e6:.1f} MB)",
        "session": f"{said.get('name', '?')}, dyad {said.get('dyad', '?')}, run {said.get('session', '?')}",
        "pilot": said.get("pilot", "?"),
        "recorded": said.get("opened_utc", "?"),
        "block": f"{block.configuration}, haptics {'on' if block.haptics else 'off'}, {block.trials} trials",
        "role": role_of(config) + (f", kind {design.kind}" if design.kind else ""),
        **{f"factor {one.name}": _level(one, block.trials) for one in factors_of(config)},
        "ended": recording.end.get("ended", "not known: the file was recovered"),
        "written by": f"netboard {said.get('netboard', '?')}, {said.get('python', '?')}, {said.get('platform', '?')}",
        "doctor": said.get("doctor", "?"),
        "configuration": said.get("config_sha256", "?"),
    }
    table = FittedTable("", "", title="Recording", header=False)
    for name, value in rows.items():
        table.add_row(name, value)
    return table


def _level(factor: BlockFactor, trials: int) -> str:
    """Return the level of a factor in a block, with the level of each trial if it varies within the block."""
    if factor.scope != "trial":
        return f"{factor.summary}, {factor.of.type}"
    return f"{factor.summary}, {factor.of.type}, by trial: {' '.join(factor.level(k) for k in range(1, trials + 1))}"


def quality_table(verdicts: Sequence[Verdict]) -> FittedTable:
    """Return a table of the attempts that the configured quality rules flag, with the reasons."""
    flagged = [verdict for verdict in verdicts if verdict.flags]
    title = f"Flagged attempts: {len(flagged)} of {len(verdicts)}"
    table = FittedTable(*numbers("trial", "attempt"), "outcome", "flag", "meaning", title=title, header=bool(flagged))
    for verdict in flagged:
        words, sentences = "\n".join(verdict.flags), "\n".join(WORDS[word] for word in verdict.flags)
        table.add_row(str(verdict.trial), str(verdict.attempt), verdict.outcome, words, sentences)
    return table


def account_table(path: Path) -> FittedTable:
    """Return a table that accounts for every tick of the session, in all parts in the same folder."""
    table = FittedTable("", "", title="Account of the session", header=False)
    try:
        account = account_of(parts_of(path))
    except RecordingError as error:
        table.add_row("not possible", str(error))
        return table
    for part in account.parts:
        table.add_row(part.path.name, part.ended or "recovered")
    for what, ranges in (
        ("ticks present", account.present),
        ("ticks lost", account.lost),
        ("ticks unexplained", account.unexplained),
        ("records lost", account.lost_records),
        ("records unexplained", account.unexplained_records),
    ):
        table.add_row(what, "\n".join(range_text(one) for one in ranges) or "none")
    table.add_row("pauses", "\n".join(f"tick {pause.tick}: {pause.cause or 'unexplained'}" for pause in account.pauses))
    return table


def range_text(one: NumberRange) -> str:
    """Return a range of tick or record numbers, how many they are, and why they are missing."""
    count = one.last - one.first + 1
    return f"{count}: {one.first} to {one.last}" + (f", {one.cause}" if one.cause else "")
