"""The data dictionary of an export: every table, and every column with its type, unit and meaning, as JSON and CSV."""

import csv
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

from netboard.recording.export.tables import MISSING
from netboard.recording.format.channels import Field


class Described(Protocol):
    """A kind of table: what it is called, what a row is, and its columns."""

    @property
    def name(self) -> str:
        """What it is called."""

    @property
    def about(self) -> str:
        """What a row is."""

    @property
    def fields(self) -> tuple[Field, ...]:
        """Its columns, of the kinds ``integer``, ``number`` and ``string``."""


_TYPES = {"integer": "int64", "number": "float64", "string": "text"}


def write_dictionary(folder: Path, tables: Sequence[Described], places: str) -> None:
    """Write ``dictionary.json`` and ``dictionary.csv``.

    Parameters
    ----------
    places : str
        How the tables are laid out in files, in a sentence.
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
