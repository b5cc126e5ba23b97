"""The report of a study as one HTML file: its numbers and its pictures."""

from collections.abc import Iterator, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

import pandas as pd

from netboard.figures.picture import Picture, as_bytes
from netboard.measuring.study import Study


def write_report(
    folder: Path,
    study: Study,
    results: pd.DataFrame,
    pictures: Sequence[Picture],
    provenance: Mapping[str, Any],
    comparison: pd.DataFrame | None = None,
) -> Path:
    """Write the report.

    Parameters
    ----------
    folder : Path
        Where to.
    study : Study
        The study.
    results : DataFrame
        The columns of `netboard.findings.results.RESULTS`.
    pictures : sequence of Picture
        The pictures.
    provenance : mapping
        Where all of it comes from.
    comparison : DataFrame, optional
        The study beside the paper, a row for a statement.

    Returns
    -------
    Path
        The report.
    """
    path = folder / "report.html"
    tables = [results] if comparison is None else [results, comparison]
    path.write_text("\n".join(_parts(study, tables, pictures, provenance)) + "\n", encoding="utf-8")
    return path


def _parts(
    study: Study, tables: Sequence[pd.DataFrame], pictures: Sequence[Picture], provenance: Mapping[str, Any]
) -> Iterator[str]:
    yield '<!doctype html>\n<html lang="en">\n<meta charset="utf-8">\n<title>netboard: a study</title>'
    yield f"<p>{len(study.blocks)} recordings, {len(study.counted)} trials. {escape(provenance['command'])}</p>"
    for picture in pictures:
        yield f"<h2>{escape(picture.title)}</h2>"
        if picture.figure is not None:
            drawn = as_bytes(picture.figure, "svg").decode()
            yield drawn[drawn.index("<svg") :]
        yield f"<p>{escape(picture.caption)}</p>"
    yield from (table.to_html(index=False) for table in tables)
    yield "</html>"
