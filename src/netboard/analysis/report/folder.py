"""Output folder of an analysis: tables, data dictionary, settings, provenance, figures and report.

The tables are identical, byte for byte, for the same recordings and settings, on any machine and with any cache. No
file records the time or the machine of the analysis.
"""

import json
import platform
import shlex
from collections.abc import Iterator, Sequence
from dataclasses import asdict, replace
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
from netboard.analysis.report.html import write_report
from netboard.analysis.topics.everything import NOT_COMPUTED, pictures, results_of
from netboard.analysis.topics.figure import TopicFigure, as_bytes
from netboard.analysis.topics.paper import COMPARISON, compare
from netboard.analysis.topics.performers import PEOPLE, people_of
from netboard.analysis.topics.result import RESULTS
from netboard.recording.export.formats import Progress
from netboard.recording.export.tabular import open_csv, open_parquet, write_dictionary

SOFTWARE = ("netboard", "numpy", "scipy", "numba", "pandas", "pyarrow", "matplotlib", "statsmodels")
"""Software whose versions are recorded."""

KINDS = ("svg", "pdf", "png")
"""File formats of each figure."""

LEFT_OUT = (words("file", "file name of the recording"), words("why", "why it could not be measured"))
"""Columns of the table of recordings that were left out."""

PORTION = 20_000
"""Rows of a table that are written at a time [1]."""


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
    TableKind("results", "one reported number", RESULTS),
)
"""Tables of every analysis."""

BESIDE_THE_PAPER = TableKind(
    "comparison", "one statement of the paper, and the corresponding result of the study", COMPARISON
)
"""Optional table that compares the study with the paper."""

PLACES = "NAME.parquet and NAME.csv: a table, of all recordings; paths, which are long, as Parquet only"


def write_analysis(
    folder: Path,
    study: StudyData,
    extracted: Extraction,
    command: Sequence[str],
    progress: Progress,
    *,
    beside_the_paper: bool = False,
) -> tuple[str, ...]:
    """Write all files of an analysis: the tables first, then figures and report."""
    progress("numbers", 0, 3)
    results = results_of(study)
    comparison = compare(study) if beside_the_paper else None
    origin = provenance(extracted, command)
    (folder / "settings.toml").write_text(resolve(study.readings), encoding="utf-8")
    text = json.dumps(origin, indent=1, ensure_ascii=False) + "\n"
    (folder / "provenance.json").write_text(text, encoding="utf-8")
    write_tables(folder / "tables", study, results, extracted.left_out, comparison)
    progress("figures", 1, 3)
    drawn = list(pictures(study))
    _write_pictures(folder / "figures", drawn)
    progress("report", 2, 3)
    write_report(folder, study, results, drawn, origin, comparison)
    progress("report", 3, 3)
    lost = results[results["quantity"] == NOT_COMPUTED]
    return (
        *(f"{topic} could not be computed: {why}" for topic, why in zip(lost["topic"], lost["note"], strict=True)),
        *(f"figures/{picture.name}: {picture.caption}" for picture in drawn if picture.failed),
    )


def write_tables(
    folder: Path,
    study: StudyData,
    results: pd.DataFrame,
    left_out: Sequence[LeftOut],
    comparison: pd.DataFrame | None = None,
) -> None:
    """Write every table as Parquet and CSV, and the data dictionary."""
    folder.mkdir()
    others = {
        "results": results,
        "people": people_of(study),
        "left_out": pd.DataFrame([asdict(one) for one in left_out], columns=[field.name for field in LEFT_OUT]),
        "comparison": comparison,
    }
    every = TABLES if comparison is None else (*TABLES, BESIDE_THE_PAPER)
    kinds = [
        replace(kind, fields=study.with_factor_fields(kind.fields)) if kind.name in OF_TRIALS else kind
        for kind in every
    ]
    for kind in kinds:
        if kind.name == "paths":
            _write_paths(folder, kind, study)
        else:
            _write_table(folder, kind, others[kind.name] if kind.name in others else _of_study(study, kind.name))
    write_dictionary(folder, kinds, PLACES)


OF_TRIALS = ("blocks", "trials", "movements", "controls", "paths", "people", "exclusions")
"""Tables with factor columns."""


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


def _write_pictures(folder: Path, drawn: Sequence[TopicFigure]) -> None:
    """Write each figure in all formats; a missing figure is replaced by the reason."""
    folder.mkdir()
    for picture in drawn:
        shown = picture.shown
        for kind in KINDS:
            (folder / f"{picture.name}.{kind}").write_bytes(as_bytes(shown, kind))


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
