"""The report of a study: one page that needs nothing but itself, to be read from top to bottom or printed.

No script runs in it, and its own rules forbid it to load anything. What participants, experimenters and file systems
have named is text in it and nothing else. The same study gives the same bytes.
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
from netboard.analysis.figures.figure import Picture
from netboard.analysis.report.design import design, participants
from netboard.analysis.report.drawings import drawing
from netboard.analysis.report.numbers import comparison_grid, topics
from netboard.analysis.report.sections import head, recordings_grid, settings_grids, software_grid
from netboard.analysis.report.soundness import soundness
from netboard.analysis.report.summary import few, summary
from netboard.analysis.report.trials import HEIGHT, LEAD, LONGEST, listings, reach
from netboard.analysis.report.wording import css_text, visible
from netboard.base.errors import NetboardError

NAME = "report.html"
"""Of the file."""


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
        The tidy table of all results, with the columns of `netboard.analysis.results.result.RESULTS`.
    pictures : sequence of Picture
        The pictures, in the order in which they are read; results belong to one by its name.
    provenance : mapping
        Where it comes from. ``recordings``: of every recording of the study, by its name, a mapping with its ``file``,
        as a command takes it, and its ``sha256``. ``versions``: versions of software by name. Optional: ``left_out``,
        mappings of ``file`` and ``why``; ``handedness``, the dominant hand by pseudonym; ``command``, which analysed;
        ``made_utc``, when.
    comparison : DataFrame, optional
        The study beside the paper, a row for a statement: ``figure``, ``quantity``, ``group``, what is ``said``, the
        number ``reported``, its ``reported_sd`` and ``reported_of`` how many, the study's ``value`` with the columns of
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
    """Write the page."""
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
    """Load the page's template: all text is escaped, and what is not there is an error."""
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
    """Show what would not be seen in a text; what is markup already has been seen to."""
    return visible(value) if isinstance(value, str) and not isinstance(value, Markup) else value


def _write_new(path: Path, text: str) -> None:
    """Write a file that is not there yet: whole, or not at all."""
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        part.write_text(text, encoding="utf-8", newline="\n")
        if path.exists():
            raise NetboardError(f"{path}: is there already; expected a folder without a report")
        part.rename(path)
    except OSError as error:
        raise NetboardError(f"{path}: cannot be written: {error.strerror or error}") from error
    finally:
        with contextlib.suppress(OSError):
            part.unlink(missing_ok=True)
