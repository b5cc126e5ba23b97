"""Output folder of an analysis: tables, data dictionary, settings, provenance, figures and report.

The tables are identical, byte for byte, for the same recordings and settings, on any machine and with any cache. No
file records the time or the machine of the analysis.
"""

import json
import platform
import shlex
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import asdict, replace
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

import pandas as pd

from netboard.analysis.extraction.exclusions import EXCLUSIONS
from netboard.analysis.extraction.fingerprint import fingerprint
from netboard.analysis.extraction.running import Extraction, LeftOut
from netboard.analysis.extraction.settings import resolve
from netboard.analysis.extraction.study import FIELDS_IN_STUDY, StudyData
from netboard.analysis.extraction.tables import TableKind, words, written
from netboard.analysis.extraction.workers import begun
from netboard.analysis.report.html import write_beginning, write_report
from netboard.analysis.topics.everything import NOT_COMPUTED, Shared, everything_of, primary_figure, study_in
from netboard.analysis.topics.figure import WrittenFigure
from netboard.analysis.topics.paper import COMPARISON, compare
from netboard.analysis.topics.performers import PEOPLE, people_of
from netboard.analysis.topics.result import RESULTS
from netboard.recording.export.formats import Progress
from netboard.recording.export.tabular import open_csv, open_parquet, write_dictionary

SOFTWARE = ("netboard", "numpy", "scipy", "numba", "pandas", "pyarrow", "matplotlib", "statsmodels")
"""Software whose versions are recorded."""

LEFT_OUT = (words("file", "file name of the recording"), words("why", "why it could not be measured"))
"""Columns of the table of recordings that were left out."""

PORTION = 20_000
"""Rows of a table that are written at a time [1]."""

RESULTS_TABLE = TableKind("results", "one reported number", RESULTS)
"""Table of the results."""

TABLES = (
    TableKind("blocks", "one recording", FIELDS_IN_STUDY["blocks"]),
    TableKind("trials", "one attempt at a trial", FIELDS_IN_STUDY["trials"]),
    TableKind("movements", "one movement of the board that begins in an attempt", FIELDS_IN_STUDY["movements"]),
    TableKind("controls", "one successful attempt with haptics off in a control", FIELDS_IN_STUDY["controls"]),
    TableKind("answers", "one answer of a participant to a question", FIELDS_IN_STUDY["answers"]),
    TableKind("paths", "one sample of the path of an attempt, each 20 ms", FIELDS_IN_STUDY["paths"]),
    TableKind("people", "one performer in one condition: a participant, or a dyad", PEOPLE),
    TableKind("exclusions", "one reason why an attempt is excluded", EXCLUSIONS),
    TableKind(
        "left_out", "one recording that could not be measured, is unfinished, or is a copy of another one", LEFT_OUT
    ),
    RESULTS_TABLE,
)
"""Tables of every analysis."""

BESIDE_THE_PAPER = TableKind(
    "comparison", "one statement of the paper, and the corresponding result of the study", COMPARISON
)
"""Optional table that compares the study with the paper."""

PLACES = "NAME.parquet and NAME.csv: a table, of all recordings; paths, which are long, as Parquet only"


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
) -> WrittenFigure | None:
    """Write all tables but those of results, the settings, and the beginning of the report; return its figure."""
    (tables := folder / "tables").mkdir()
    written = begun(executor, partial(write_measures, tables, shared, extracted.left_out), SHARES)
    progress("tables", 0, len(SHARES))
    _write_dictionary(tables, study, beside_the_paper=beside_the_paper)
    (folder / "settings.toml").write_text(resolve(study.readings), encoding="utf-8")
    text = json.dumps(origin, indent=1, ensure_ascii=False) + "\n"
    (folder / "provenance.json").write_text(text, encoding="utf-8")
    figure = primary_figure(study)
    write_beginning(folder, study, figure, origin)
    for done, _ in enumerate(written, start=1):
        progress("tables", done, len(SHARES))
    return None if figure is None else figure.written()


def write_second_part(
    folder: Path,
    study: StudyData,
    origin: Mapping[str, Any],
    executor: Executor | None,
    shared: Shared,
    progress: Progress,
    figure: WrittenFigure | None,
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


def write_tables(folder: Path, study: StudyData, results: pd.DataFrame, left_out: Sequence[LeftOut]) -> None:
    """Write every table as Parquet and CSV, and the data dictionary."""
    folder.mkdir()
    for names in SHARES:
        write_measures(folder, study, left_out, names)
    write_results(folder, results)
    _write_dictionary(folder, study)


def write_measures(folder: Path, shared: Shared, left_out: Sequence[LeftOut], names: Sequence[str]) -> None:
    """Write some tables, without those of results."""
    study = study_in(shared)
    for kind in _kinds(study, TABLES):
        if kind.name not in names:
            continue
        if kind.name == "paths":
            _write_paths(folder, kind, study)
        elif kind.name == "left_out":
            frame = pd.DataFrame([asdict(one) for one in left_out], columns=[field.name for field in LEFT_OUT])
            _write_table(folder, kind, frame)
        else:
            _write_table(folder, kind, people_of(study) if kind.name == "people" else _of_study(study, kind.name))


def write_results(folder: Path, results: pd.DataFrame, comparison: pd.DataFrame | None = None) -> None:
    """Write the results, and the comparison with the paper if there is one."""
    _write_table(folder, RESULTS_TABLE, results)
    if comparison is not None:
        _write_table(folder, BESIDE_THE_PAPER, comparison)


def _write_dictionary(folder: Path, study: StudyData, *, beside_the_paper: bool = False) -> None:
    """Write the data dictionary of all tables."""
    every = (*TABLES, BESIDE_THE_PAPER) if beside_the_paper else TABLES
    write_dictionary(folder, _kinds(study, every), PLACES)


SHARES = (
    ("paths",),
    ("movements",),
    ("trials",),
    ("blocks", "controls", "answers", "people", "exclusions", "left_out"),
)
"""Tables that one process writes after the other, the slowest ones first."""

OF_TRIALS = ("blocks", "trials", "movements", "controls", "paths", "people", "exclusions")
"""Tables with factor columns."""


def _kinds(study: StudyData, kinds: Sequence[TableKind]) -> list[TableKind]:
    """Return kinds of tables with the factor columns of the study."""
    return [
        replace(kind, fields=study.with_factor_fields(kind.fields)) if kind.name in OF_TRIALS else kind
        for kind in kinds
    ]


def _of_study(study: StudyData, name: str) -> pd.DataFrame:
    """Return a table of the study, with its factor columns."""
    frame: pd.DataFrame = getattr(study, name)
    return study.with_factors(frame) if name == "exclusions" else frame


def _write_paths(folder: Path, kind: TableKind, study: StudyData) -> None:
    """Write the paths, as Parquet only, one recording after the other."""
    with open_parquet(folder / f"{kind.name}.parquet", kind) as put:
        for recording in study.blocks["recording"]:
            put(written(study.with_factors(study.paths[recording]), kind.fields))


def _write_table(folder: Path, kind: TableKind, frame: pd.DataFrame) -> None:
    """Write a table in both formats, in portions of rows."""
    for ending, open_sheet in (("parquet", open_parquet), ("csv", open_csv)):
        with open_sheet(folder / f"{kind.name}.{ending}", kind) as put:
            for first in range(0, len(frame), PORTION):
                put(written(frame.iloc[first : first + PORTION], kind.fields))


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
