"""``netboard info``: summary of a recording."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from netboard.base.errors import RecordingError
from netboard.services.options import RECORDINGS, RecordingFile, examples

if TYPE_CHECKING:
    from netboard.base.terminal import FittedTable
    from netboard.recording.files.reader import Recording
    from netboard.recording.integrity.account import NumberRange
    from netboard.task.studies.factors import BlockFactor
    from netboard.task.trials.quality import Verdict

app = typer.Typer()


@app.command(rich_help_panel=RECORDINGS, epilog=examples("netboard info recordings/S01.mcap"))
def info(recording: RecordingFile) -> None:
    """Summarise a recording: provenance, trials, completion times, latencies, losses."""
    from rich.console import Console

    from netboard.recording.files.reader import Recording
    from netboard.recording.integrity.quality_check import judged
    from netboard.recording.replay.text import summary_of, summary_tables

    console = Console(highlight=False)
    with Recording(recording) as opened:
        console.print(provenance_table(opened))
        console.print(summary_tables(summary_of(opened)))
        console.print(quality_table(judged(opened)))
    console.print(account_table(recording))


def provenance_table(recording: "Recording") -> "FittedTable":
    """Return a table of the recording's provenance."""
    from netboard.base.config import parse
    from netboard.base.terminal import FittedTable
    from netboard.task.studies.factors import design_of, factors_of, role_of

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
        "ended": recording.end.get("ended", "unknown: the file was recovered"),
        "written by": f"netboard {said.get('netboard', '?')}, {said.get('python', '?')}, {said.get('platform', '?')}",
        "doctor": said.get("doctor", "?"),
        "configuration": said.get("config_sha256", "?"),
    }
    return FittedTable("", "", rows=rows.items(), title="Recording", header=False)


def _level(factor: "BlockFactor", trials: int) -> str:
    """Return the level of a factor in a block, with the level of each trial if it varies within the block."""
    if factor.scope != "trial":
        return f"{factor.summary}, {factor.of.type}"
    return f"{factor.summary}, {factor.of.type}, by trial: {' '.join(factor.level(k) for k in range(1, trials + 1))}"


def quality_table(verdicts: Sequence["Verdict"]) -> "FittedTable":
    """Return a table of the attempts that the configured quality rules flag, with the reasons."""
    from netboard.base.terminal import FittedTable, numbers
    from netboard.task.trials.quality import WORDS

    flagged = [verdict for verdict in verdicts if verdict.flags]
    title = f"Flagged attempts: {len(flagged)} of {len(verdicts)}"
    table = FittedTable(*numbers("trial", "attempt"), "outcome", "flag", "reason", title=title, header=bool(flagged))
    for verdict in flagged:
        words, sentences = "\n".join(verdict.flags), "\n".join(WORDS[word] for word in verdict.flags)
        table.add_row(str(verdict.trial), str(verdict.attempt), verdict.outcome, words, sentences)
    return table


def account_table(path: Path) -> "FittedTable":
    """Return a table that accounts for every tick of the session, in all parts in the same folder."""
    from netboard.base.terminal import FittedTable
    from netboard.recording.integrity.account import account_of, parts_of

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


def stretch_text(stretch: "NumberRange") -> str:
    """Return a range of tick or record numbers, how many they are, and why they are missing."""
    count = stretch.last - stretch.first + 1
    return f"{count}: {stretch.first} to {stretch.last}" + (f", {stretch.cause}" if stretch.cause else "")
