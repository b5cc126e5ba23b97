"""The data dictionary of an export: all tables, with type, unit and meaning of each column, as JSON and CSV."""

import csv
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

from netboard.recording.export.tables import MISSING
from netboard.recording.format.channels import Field


class Described(Protocol):
    """A kind of table with name, row meaning and columns."""

    @property
    def name(self) -> str:
        """Name of the table."""

    @property
    def about(self) -> str:
        """Meaning of a row."""

    @property
    def fields(self) -> tuple[Field, ...]:
        """Columns, of the kinds ``integer``, ``number`` and ``string``."""


_TYPES = {"integer": "int64", "number": "float64", "string": "text"}


def write_dictionary(folder: Path, tables: Sequence[Described], places: str) -> None:
    """Write ``dictionary.json`` and ``dictionary.csv``.

    Parameters
    ----------
    places : str
        Sentence on the arrangement of the tables in files.
    """
    described = {
        table.name: {
            "about": table.about,
            "columns": {
                field.name: {"type": _TYPES[field.kind], "unit": field.unit, "description": field.text}
                for field in table.fields
            },
        }
        for table in tables
    }
    whole = {"files": places, "missing": MISSING, "tables": described}
    text = json.dumps(whole, indent=1, ensure_ascii=False) + "\n"
    (folder / "dictionary.json").write_text(text, encoding="utf-8")
    with (folder / "dictionary.csv").open("x", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(("table", "column", "type", "unit", "description"))
        for table in tables:
            writer.writerows(
                (table.name, field.name, _TYPES[field.kind], field.unit, field.text) for field in table.fields
            )
