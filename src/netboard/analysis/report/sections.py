"""Sections on the study and its provenance: head, settings, software, recordings."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import pandas as pd

from netboard.analysis.extraction.settings import Readings
from netboard.analysis.extraction.study import Study, notes
from netboard.analysis.report.grids import Cell, Column, Grid, code, grid, name
from netboard.analysis.report.wording import amount, plural
from netboard.base.settings import Table, tables, to_toml


@dataclass(frozen=True, slots=True)
class Head:
    """Summary of a study in a few lines."""

    title: str
    facts: tuple[tuple[str, str], ...]
    warnings: tuple[str, ...]


def head(study: Study, provenance: Mapping[str, Any]) -> Head:
    """Return the head of a report."""
    blocks, trials = study.blocks, study.trials
    days = sorted({str(when)[:10] for when in blocks["opened_utc"]})
    successes = int((trials["outcome"] == "success").sum())
    facts = [
        ("Dyads", amount(len(study.dyads))),
        ("Recordings", f"{amount(len(blocks))}, {amount(blocks['duration'].sum() / 3600)} h"),
        (
            "Trials",
            f"{amount(len(study.counted))} counted of {amount(successes)} done, in {amount(len(trials))} attempts",
        ),
        ("Recorded", days[0] if len(days) == 1 else f"{days[0]} to {days[-1]}" if days else "never"),
    ]
    if "made_utc" in provenance:
        facts.append(("Analysed", str(provenance["made_utc"])))
    title = ", ".join(sorted(word for word in blocks["study"].unique() if word)) or "unnamed"
    return Head(title, tuple(facts), (*_warnings(blocks), *notes(study)))


def _warnings(blocks: pd.DataFrame) -> list[str]:
    """Return warnings of simulated participants and pilot recordings."""
    warnings = []
    if blocks["simulated"].all():
        warnings.append("Simulated participants: no person held a device. These results are no evidence about people.")
    elif blocks["simulated"].any():
        warnings.append(
            f"Simulated participants in {int(blocks['simulated'].sum())} of {plural(len(blocks), 'recording')}: "
            "their data are no evidence about people."
        )
    if blocks["pilot"].any():
        warnings.append(f"{int(blocks['pilot'].sum())} of {plural(len(blocks), 'recording')} are marked as pilots.")
    return warnings


def settings_grids(readings: Readings) -> tuple[Grid, ...]:
    """Return all settings of an analysis as tables; non-default values are marked."""
    return tuple(_settings(table, readings) for table in tables(Readings) if table.keys)


def _settings(table: Table, readings: Readings) -> Grid:
    node: Any = readings
    for step in table.path:
        node = getattr(node, step)
    rows, marked = [], set()
    for place, key in enumerate(table.keys):
        value, default = to_toml(getattr(node, key.name)), to_toml(key.default)
        unit = "" if key.unit in ("", "1") else key.unit
        if value != default:
            marked.add(place)
        rows.append((key.name, value, unit, f"changed; default: {default}" if value != default else "", key.text))
    columns = code("Setting"), code("Value"), Column("Unit"), code("Changed"), Column("What it decides")
    return Grid(f"[{table.name}] {table.text.splitlines()[0]}", columns, tuple(rows), frozenset(marked))


def software_grid(study: Study, versions: Mapping[str, str]) -> Grid:
    """Return the table of software versions."""
    recorded = sorted(study.blocks["netboard"].unique())
    rows: list[tuple[Cell, ...]] = [("netboard, which recorded", ", ".join(recorded))]
    rows += [(package, str(version)) for package, version in versions.items()]
    return grid("Software", [Column("What"), code("Version")], rows)


def recordings_grid(study: Study, known: Mapping[str, Mapping[str, Any]]) -> Grid:
    """Return the table of recordings with their SHA-256."""
    rows = []
    for recording, opened in study.blocks[["recording", "opened_utc"]].itertuples(index=False, name=None):
        file = known[recording]
        rows.append((recording, str(opened)[:19].replace("T", " "), str(file["file"]), str(file["sha256"])))
    columns = [name("Recording"), Column("Opened (UTC)"), code("File"), code("SHA-256")]
    return grid("All recordings of the study, each with the SHA-256 of its file", columns, rows)
