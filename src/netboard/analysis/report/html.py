"""The HTML report of a study: one self-contained page, for reading from top to bottom or for printing.

The page has no scripts, and its content security policy forbids loading anything. Names from participants,
experimenters and file systems are escaped text. The same study and provenance give the same bytes.
"""

import contextlib
import os
from collections.abc import Mapping, Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any

import pandas as pd
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from netboard.analysis.extraction.study import Study
from netboard.analysis.report.design import design, participants
from netboard.analysis.report.drawings import drawing
from netboard.analysis.report.numbers import comparison_grid, topics
from netboard.analysis.report.sections import head, recordings_grid, settings_grids, software_grid
from netboard.analysis.report.soundness import soundness
from netboard.analysis.report.summary import few, summary
from netboard.analysis.report.trials import HEIGHT, LEAD, LONGEST, listings, reach
from netboard.analysis.report.wording import css_text, visible
from netboard.analysis.topics.figure import Picture
from netboard.base.errors import NetboardError

NAME = "report.html"
"""Name of the report file."""


def write_report(
    folder: Path,
    study: Study,
    results: pd.DataFrame,
    pictures: Sequence[Picture],
    provenance: Mapping[str, Any],
    comparison: pd.DataFrame | None = None,
) -> Path:
    """Write the report of a study.

    Parameters
    ----------
    results : DataFrame
        Tidy table of all results, with the columns of `netboard.analysis.topics.result.RESULTS`.
    pictures : sequence of Picture
        Figures in reading order; results belong to a figure by its name.
    provenance : mapping
        Provenance. ``recordings``: for every recording of the study, by name, a mapping with its ``file``, as a command
        takes it, and its ``sha256``. ``versions``: versions of software by name. Optional: ``left_out``, mappings of
        ``file`` and ``why``; ``handedness``, the dominant hand by pseudonym; ``command`` of the analysis; ``made_utc``,
        its time.
    comparison : DataFrame, optional
        Comparison with the paper, one row for each statement: ``figure``, ``quantity``, ``group``, what is ``said``,
        the number ``reported``, its ``reported_sd`` or total ``reported_of``, the study's ``value`` with the columns of
        a result, and the ``verdict``.
    """
    known = provenance["recordings"]
    unknown = sorted(set(study.blocks["recording"]) - set(known))
    if unknown:
        raise ValueError(f"provenance: no recording {unknown[0]!r}; expected every recording of the study")
    text = _page(study, results, pictures, provenance, comparison)
    path = folder / NAME
    _write_new(path, text)
    return path


def _page(
    study: Study,
    results: pd.DataFrame,
    pictures: Sequence[Picture],
    provenance: Mapping[str, Any],
    comparison: pd.DataFrame | None,
) -> str:
    """Return the page."""
    drawings = [drawing(picture) for picture in pictures]
    titles = {one.name: one.title for one in drawings}
    top = head(study, provenance)
    known = provenance["recordings"]
    page: str = _template().render(
        head=top,
        running=Markup(css_text(f"netboard: study {top.title}")),
        style=Markup(files("netboard.analysis.report").joinpath("pages/report.css").read_text(encoding="utf-8")),
        summary=summary(results, titles),
        few=few(len(study.dyads)),
        design=design(study),
        participants=participants(study, provenance.get("handedness", {})),
        soundness=soundness(study, provenance.get("left_out", ())),
        drawn=set(titles),
        drawings=[(one, Markup(one.svg)) for one in drawings],
        results=topics(results, titles),
        comparison=None if comparison is None else comparison_grid(comparison),
        settings=settings_grids(study.readings),
        software=software_grid(study, provenance["versions"]),
        recordings=recordings_grid(study, known),
        command=provenance.get("command", ""),
        listings=listings(study, {recording: str(one["file"]) for recording, one in known.items()}),
        scale={"height": HEIGHT, "reach": reach(study), "longest": LONGEST, "lead": LEAD},
    )
    return page


def _template() -> Any:
    """Load the page template: all text is escaped, and an undefined name is an error."""
    pages = Environment(
        loader=PackageLoader("netboard.analysis.report", "pages"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        finalize=_shown,
    )
    return pages.get_template("report.html.jinja")


def _shown(value: Any) -> Any:
    """Make invisible characters of a text visible; markup is left as it is."""
    return visible(value) if isinstance(value, str) and not isinstance(value, Markup) else value


def _write_new(path: Path, text: str) -> None:
    """Write a new file, completely or not at all."""
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        part.write_text(text, encoding="utf-8", newline="\n")
        if path.exists():
            raise NetboardError(f"{path}: already exists; expected a folder without a report")
        part.rename(path)
    except OSError as error:
        raise NetboardError(f"{path}: cannot be written: {error.strerror or error}") from error
    finally:
        with contextlib.suppress(OSError):
            part.unlink(missing_ok=True)
