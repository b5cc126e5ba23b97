"""Results of integrity checks and the catalogue of sessions: text for a terminal, and values for JSON."""

from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from rich.text import Text

from netboard.base.plural import plural
from netboard.base.terminal.errors import harmless
from netboard.base.terminal.output import Cell, FittedTable, numbers
from netboard.base.tick import TICK_SECONDS
from netboard.recording.files.copies import NO_REPEATS, Conflict, CopiesFound
from netboard.recording.integrity.catalogue import CatalogueEntry, in_order
from netboard.recording.integrity.severity import RESULTS, CheckFinding, CheckReport, Severity

COLOURS = {Severity.SOUND: "green", Severity.LOSS: "yellow", Severity.DAMAGE: "red"}
"""Colour of each severity on a terminal."""


def in_words(report: CheckReport, whole: bool) -> Text:
    """Return the result of a check and its evidence."""
    text = Text(f"{report.path}: ").append(report.result, COLOURS[report.severity])
    text.append(f", {plural(report.ticks, 'tick')}")
    if report.excluded:
        text.append("; ").append(report.excluded, "yellow")
    for finding in report.findings:
        if whole or finding.severity != Severity.SOUND:
            text.append(f"\n  {finding.part:13}", COLOURS[finding.severity]).append(f" {finding.text}")
    return text


def in_total(reports: Sequence[CheckReport], took: float) -> str:
    """Return a summary of two lines: results and speed."""
    counts = ", ".join(
        f"{count} {RESULTS[severity]}"
        for severity in Severity
        if (count := sum(report.severity == severity for report in reports))
    )
    ticks = sum(report.ticks for report in reports)
    words = f"{plural(len(reports), 'recording')}: {counts}; {ticks} ticks read in {took:.1f} s, {_times(ticks, took)}"
    again, computing = _computed(reports)
    if again:
        words += f"\n{plural(again, 'tick')} computed again in {computing:.2f} s, {_times(again, computing)}"
    return words


def _times(ticks: int, took: float) -> str:
    """Return how many times faster than real time something was."""
    return f"{ticks * TICK_SECONDS / took:.0f} x real time"


def _computed(reports: Sequence[CheckReport]) -> tuple[int, float]:
    """Return the number of recomputed ticks, and the time that took [s]."""
    again = sum(report.replay.checked for report in reports if report.replay is not None)
    return again, sum(report.computing for report in reports)


def with_conflicts(report: CheckReport, conflicts: Sequence[Conflict]) -> CheckReport:
    """Add to a report that another recording claims to be the same one, and is not."""
    found = [str(one) for one in conflicts if report.path in (one.one, one.other)]
    return replace(
        report, findings=(*report.findings, *(CheckFinding(Severity.DAMAGE, text, "identity") for text in found))
    )


def as_data(reports: Sequence[CheckReport], took: float, repeats: CopiesFound = NO_REPEATS) -> dict[str, Any]:
    """Return the reports for JSON."""
    again, computing = _computed(reports)
    return {
        "verdict": RESULTS[max(report.severity for report in reports)],
        "recordings": [
            {
                "path": str(report.path),
                "verdict": report.result,
                "ticks": report.ticks,
                "excluded": report.excluded,
                "findings": [
                    {"part": one.part, "grade": one.severity.name.lower(), "text": one.text} for one in report.findings
                ],
                "replay": None if report.replay is None else _plain(asdict(report.replay)),
            }
            for report in reports
        ],
        "copies": [{"path": str(one.path), "of": str(one.of), "why": one.why} for one in repeats.copies],
        "conflicts": [str(one) for one in repeats.conflicts],
        "seconds": took,
        "ticks_computed": again,
        "computing_seconds": computing,
    }


def _plain(replay: dict[str, Any]) -> dict[str, Any]:
    """Convert numpy's numbers and non-finite numbers to what JSON knows."""
    return {
        "identical": replay["tick"] is None,
        **{
            name: value if isinstance(value, int | str | None) else repr(float(value)) for name, value in replay.items()
        },
    }


QUICK = (
    "Quick results, from what each file states about itself: the ticks are not examined, so stalls and missing or "
    "changed data may be unnoticed. netboard sessions --check examines everything."
)
"""Caption of a table of quick results."""


def sessions_table(entries: Sequence[CatalogueEntry], folder: Path, caption: str = "") -> FittedTable:
    """Return a table of the files, grouped by session."""
    counts = numbers("trials\nlost", "length\nsize")
    table = FittedTable("block, condition\nfile", *counts, "verdict", title=f"Sessions in {folder}", caption=caption)
    for (dyad, session), group in in_order(entries):
        study = ", ".join(sorted({entry.study for entry in group if entry.study})) or "no study"
        pilot = ", pilot" if any(entry.pilot for entry in group) else ""
        day = min((entry.opened[:10] for entry in group if entry.opened), default="date unknown")
        table.end_section()
        whose = f"{dyad} {session}" if dyad else "unknown dyad"
        head = Text(whose, "bold").append(f", {day}, {study}{pilot}", "not bold")
        if what := ", ".join(dict.fromkeys(words for entry in group for words in entry.stand_ins)):
            head.append(f", with {what}", "yellow")
        table.add_row(head)
        for entry in group:
            table.add_row(*_file_row(entry, folder))
    return table


def _file_row(entry: CatalogueEntry, folder: Path) -> list[Cell]:
    trials = f"{entry.done} of {entry.trials}" if entry.trials else f"{entry.done}"
    what = f"{entry.block} of {entry.blocks}" if entry.blocks else entry.kind
    why = harmless("; ".join(filter(None, (entry.why, entry.excluded))))
    known = entry.kind in ("recording", "journal") and entry.verdict != RESULTS[Severity.DAMAGE]
    colour = COLOURS[Severity(RESULTS.index(entry.verdict))]
    name = str(entry.path.relative_to(folder)).replace("\n", "\\n")
    return [
        harmless(f"{', '.join(filter(None, (what, entry.condition)))}\n{name}"),
        (trials if known else "-") + f"\n{entry.lost}",
        (f"{entry.duration / 60:.1f} min" if entry.duration is not None else "-") + f"\n{entry.size / 1e6:.1f} MB",
        Text(entry.verdict, colour).append(f"\n{why}" if why else "", "default"),
    ]


def sessions_in_total(entries: Sequence[CatalogueEntry]) -> str:
    """Return a summary of one line."""
    recordings = [entry for entry in entries if entry.kind != "journal"]
    counts = ", ".join(
        f"{count} {verdict}" for verdict in RESULTS if (count := sum(e.verdict == verdict for e in recordings))
    )
    hours = sum(e.duration or 0.0 for e in recordings if not e.copy_of) / 3600
    size, copies = sum(e.size for e in recordings) / 1e9, sum(bool(e.copy_of) for e in recordings)
    if copies:
        counts += f"; {plural(copies, 'copy', 'copies')}, not counted"
    sessions = len({(entry.dyad, entry.session) for entry in entries})
    files = f"{plural(sessions, 'session')}, {plural(len(recordings), 'file')}"
    return f"{files} ({counts}), {hours:.2f} h, {size:.2f} GB"
