"""Output folder of an analysis: tables, data dictionary, settings, provenance, figures and report.

The tables are identical, byte for byte, for the same recordings and settings, on any machine and with any cache. No
file records the time or the machine of the analysis.
"""

import json
import platform
import shlex
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import asdict
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

import pandas as pd

from netboard.analysis.extraction.fingerprint import fingerprint
from netboard.analysis.extraction.running import Extraction
from netboard.analysis.extraction.settings import resolve
from netboard.analysis.extraction.study import Shared, StudyData
from netboard.analysis.extraction.tables import TableKind
from netboard.analysis.extraction.workers import begun
from netboard.analysis.report.html import write_beginning, write_report
from netboard.analysis.report.tables import RESULTS_TABLE, SHARES, describe_tables, write_measures, write_table
from netboard.analysis.topics.everything import NOT_COMPUTED, everything_of, primary_figure
from netboard.analysis.topics.figure import TopicFigure, WrittenFigure
from netboard.analysis.topics.paper import COMPARISON, compare
from netboard.recording.export.formats import Progress

SOFTWARE = ("netboard", "numpy", "scipy", "numba", "pandas", "pyarrow", "matplotlib", "statsmodels")
"""Software whose versions are recorded."""

BESIDE_THE_PAPER = TableKind(
    "comparison", "one statement of the paper, and the corresponding result of the study", COMPARISON
)
"""Optional table that compares the study with the paper."""


def write_first_part(
    folder: Path,
    study: StudyData,
    extracted: Extraction,
    origin: Mapping[str, Any],
    executor: Executor | None,
    shared: Shared,
    progress: Progress,
    *,
    beside_the_paper: bool = False,
) -> TopicFigure | None:
    """Write all tables but those of results, the settings, and the beginning of the report; return its figure."""
    (tables := folder / "tables").mkdir()
    written = begun(executor, partial(write_measures, tables, shared, extracted.left_out), SHARES)
    progress("tables", 0, len(SHARES))
    describe_tables(tables, study, (BESIDE_THE_PAPER,) if beside_the_paper else ())
    (folder / "settings.toml").write_text(resolve(study.readings), encoding="utf-8")
    text = json.dumps(origin, indent=1, ensure_ascii=False) + "\n"
    (folder / "provenance.json").write_text(text, encoding="utf-8")
    figure = primary_figure(study)
    write_beginning(folder, study, figure, origin)
    for done, _ in enumerate(written, start=1):
        progress("tables", done, len(SHARES))
    return figure


def write_second_part(
    folder: Path,
    study: StudyData,
    origin: Mapping[str, Any],
    executor: Executor | None,
    shared: Shared,
    progress: Progress,
    figure: TopicFigure | None,
    *,
    beside_the_paper: bool = False,
) -> tuple[tuple[str, ...], float]:
    """Write the results, all figures and the whole report; return warnings, and the peak memory of a process [B]."""
    results, figures, peak = everything_of(study, shared, executor, figure, progress)
    comparison = compare(study) if beside_the_paper else None
    (tables := folder / "tables").mkdir()
    write_results(tables, results, comparison)
    _write_figures(folder / "figures", figures)
    progress("report", 1, 2)
    write_report(folder, study, results, figures, origin, comparison)
    lost = results[results["quantity"] == NOT_COMPUTED]
    warnings = (
        *(f"{topic} could not be computed: {why}" for topic, why in zip(lost["topic"], lost["note"], strict=True)),
        *(f"figures/{one.name}: {one.caption}" for one in figures if one.failed),
    )
    return warnings, peak


def write_results(folder: Path, results: pd.DataFrame, comparison: pd.DataFrame | None = None) -> None:
    """Write the results, and the comparison with the paper if there is one."""
    write_table(folder, RESULTS_TABLE, results)
    if comparison is not None:
        write_table(folder, BESIDE_THE_PAPER, comparison)


def _write_figures(folder: Path, figures: Sequence[WrittenFigure]) -> None:
    """Write each figure in all formats; the reason for a missing figure replaces it."""
    folder.mkdir()
    for figure in figures:
        for kind, file in figure.files.items():
            (folder / f"{figure.name}.{kind}").write_bytes(file)


def provenance(extracted: Extraction, command: Sequence[str]) -> dict[str, Any]:
    """Return the provenance of an analysis, without time and machine: command, versions, hash of the code, and data.

    ``recordings`` by name, each with its ``file`` name and ``sha256``; ``left_out``, with ``file`` and ``why`` of each;
    ``handedness`` of the participants by pseudonym.
    """
    return {
        "command": shlex.join(command),
        "versions": {name: version(name) for name in SOFTWARE} | {"python": platform.python_version()},
        "code_sha256": fingerprint(),
        "recordings": {
            source.run.path.stem: {"file": str(source.run.path), "sha256": source.sha256}
            for source in sorted(extracted.sources, key=lambda source: source.run.path.stem)
        },
        "left_out": [asdict(one) for one in extracted.left_out],
        "handedness": dict(sorted(_hands(extracted))),
    }


def _hands(extracted: Extraction) -> Iterator[tuple[str, str]]:
    """Yield pseudonym and dominant hand of each participant."""
    for source in extracted.sources:
        for person in source.run.people:
            yield person.label, person.handedness
