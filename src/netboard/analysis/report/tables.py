"""Tables of an analysis as files.

They are identical, byte for byte, for the same recordings and settings, on any machine and with any cache. This module
does not load what computes the results and draws the figures, so a process that only writes tables starts fast.
"""

from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path

import pandas as pd

from netboard.analysis.extraction.exclusions import EXCLUSIONS
from netboard.analysis.extraction.running import LeftOut
from netboard.analysis.extraction.study import FIELDS_IN_STUDY, Shared, StudyData, study_in
from netboard.analysis.extraction.tables import TableKind, words, written
from netboard.analysis.topics.performers import PEOPLE, people_of
from netboard.analysis.topics.result import RESULTS
from netboard.recording.export.tabular import open_csv, open_parquet, write_dictionary

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

PLACES = "NAME.parquet and NAME.csv: a table, of all recordings; paths, which are long, as Parquet only"
"""Where the tables are."""

SHARES = (
    ("paths",),
    ("movements",),
    ("trials",),
    ("blocks", "controls", "answers", "people", "exclusions", "left_out"),
)
"""Tables that one process writes after the other, the slowest ones first."""


def write_tables(folder: Path, study: StudyData, results: pd.DataFrame, left_out: Sequence[LeftOut]) -> None:
    """Write every table as Parquet and CSV, and the data dictionary."""
    folder.mkdir()
    for names in SHARES:
        write_measures(folder, study, left_out, names)
    write_table(folder, RESULTS_TABLE, results)
    describe_tables(folder, study)


def describe_tables(folder: Path, study: StudyData, more: Sequence[TableKind] = ()) -> None:
    """Write the data dictionary of all tables, and of some more."""
    write_dictionary(folder, kinds_in(study, (*TABLES, *more)), PLACES)


def write_measures(folder: Path, shared: Shared, left_out: Sequence[LeftOut], names: Sequence[str]) -> None:
    """Write some tables, without those of results."""
    study = study_in(shared)
    for kind in kinds_in(study, TABLES):
        if kind.name not in names:
            continue
        if kind.name == "paths":
            _write_paths(folder, kind, study)
        elif kind.name == "left_out":
            frame = pd.DataFrame([asdict(one) for one in left_out], columns=[field.name for field in LEFT_OUT])
            write_table(folder, kind, frame)
        else:
            write_table(folder, kind, people_of(study) if kind.name == "people" else _of_study(study, kind.name))


OF_TRIALS = ("blocks", "trials", "movements", "controls", "paths", "people", "exclusions")
"""Tables with factor columns."""


def kinds_in(study: StudyData, kinds: Sequence[TableKind]) -> list[TableKind]:
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


def write_table(folder: Path, kind: TableKind, frame: pd.DataFrame) -> None:
    """Write a table in both formats, in portions of rows."""
    for ending, open_sheet in (("parquet", open_parquet), ("csv", open_csv)):
        with open_sheet(folder / f"{kind.name}.{ending}", kind) as put:
            for first in range(0, len(frame), PORTION):
                put(written(frame.iloc[first : first + PORTION], kind.fields))
