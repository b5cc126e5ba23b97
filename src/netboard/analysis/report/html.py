"""The HTML report of a study: one self-contained page, for reading from top to bottom or for printing.

The page has no scripts, and its content security policy forbids loading anything. Names from participants,
experimenters and file systems are escaped text. The same study and provenance give the same bytes.

Figures are SVG with title and description, or PNG if the SVG would be huge. Element ids are made unique, so that
figures with the same marks do not share them.
"""

import base64
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from importlib.resources import files
from itertools import count
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pandas as pd
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from netboard.analysis.extraction.settings import Readings
from netboard.analysis.extraction.study import StudyData, notes
from netboard.analysis.report.controls import controls_section
from netboard.analysis.report.data_quality import data_quality
from netboard.analysis.report.design import design, participants
from netboard.analysis.report.grids import Cell, Grid, GridColumn, code, grid, name
from netboard.analysis.report.numbers import comparison_grid, families_grid, topics
from netboard.analysis.report.question import question
from netboard.analysis.report.summary import few, summary
from netboard.analysis.report.trials import HEIGHT, LEAD, LONGEST, listings, reach
from netboard.analysis.report.wording import amount, css_text, plural, visible
from netboard.analysis.topics import testing
from netboard.analysis.topics.figure import TopicFigure, WrittenFigure
from netboard.analysis.topics.primary import TOPIC
from netboard.base.files.new import new_file
from netboard.base.looks import DARK, LIGHT, ColourTheme
from netboard.base.settings import SettingsTable, tables, to_toml

NAME = "report.html"


def write_report(
    folder: Path,
    study: StudyData,
    results: pd.DataFrame,
    pictures: Sequence[TopicFigure | WrittenFigure],
    provenance: Mapping[str, Any],
    comparison: pd.DataFrame | None = None,
) -> Path:
    """Write the report of a study.

    Parameters
    ----------
    results : DataFrame
        Tidy table of all results, with the columns of `netboard.analysis.topics.result.RESULTS`.
    pictures : sequence of TopicFigure or WrittenFigure
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
    known = _known(study, provenance)
    drawings = drawings_of(pictures)
    titles = {one.name: one.title for one in drawings}
    page = _template().render(
        **_beginning(study, results, provenance, drawings),
        whole=True,
        summary=summary(results, titles),
        controls=controls_section(study),
        participants=participants(study, provenance.get("handedness", {})),
        data_quality=data_quality(study, provenance.get("left_out", ())),
        drawn={one.name for one in drawings if one.number},
        drawings=[one for one in drawings if one.name != TOPIC],
        families=families_grid(results),
        results=topics(results, titles | {testing.TOPIC: "Tests and their correction"}),
        comparison=None if comparison is None else comparison_grid(comparison),
        settings=settings_grids(study.readings),
        software=software_grid(study, provenance["versions"]),
        recordings=recordings_grid(study, known),
        listings=listings(study, {recording: str(one["file"]) for recording, one in known.items()}),
        scale={"height": HEIGHT, "reach": reach(study), "longest": LONGEST, "lead": LEAD},
    )
    return _written(folder, page)


def write_beginning(folder: Path, study: StudyData, picture: TopicFigure | None, provenance: Mapping[str, Any]) -> Path:
    """Write the beginning of a report: the question and its answer, with the figure of the primary outcome, if any."""
    _known(study, provenance)
    drawings = drawings_of([] if picture is None else [picture])
    return _written(folder, _template().render(**_beginning(study, None, provenance, drawings), whole=False))


def _known(study: StudyData, provenance: Mapping[str, Any]) -> Mapping[str, Mapping[str, Any]]:
    """Return the recordings of the provenance; refuse a study with another one."""
    known: Mapping[str, Mapping[str, Any]] = provenance["recordings"]
    unknown = sorted(set(study.blocks["recording"]) - set(known))
    if unknown:
        raise ValueError(f"provenance: no recording {unknown[0]!r}; expected every recording of the study")
    return known


def _beginning(
    study: StudyData, results: pd.DataFrame | None, provenance: Mapping[str, Any], drawings: "Sequence[Drawing]"
) -> dict[str, Any]:
    """Return what the beginning of the page shows."""
    top = head(study, provenance)
    return {
        "head": top,
        "question": question(study, results),
        "main": next((one for one in drawings if one.name == TOPIC), None),
        "running": Markup(css_text(f"netboard: study {top.title}")),
        "style": _style(),
        "few": few(study.counted["dyad"].nunique()),
        "design": design(study),
        "command": provenance.get("command", ""),
    }


def _written(folder: Path, page: str) -> Path:
    """Write the page, and return its path."""
    path = folder / NAME
    with new_file(path) as part:
        path.parent.mkdir(parents=True, exist_ok=True)
        part.write_text(page, encoding="utf-8", newline="\n")
    return path


def _style() -> Markup:
    """Return the style sheet: colours as on the reader's desktop, on paper always light; figures stay on white."""
    sheet = files("netboard.analysis.report").joinpath("pages/report.css").read_text(encoding="utf-8")
    dark = f"@media screen and (prefers-color-scheme: dark) {{ :root {{ {_roles(DARK)} }} }}"
    return Markup(f":root {{ color-scheme: light dark; {_roles(LIGHT)} }}\n{dark}\n{sheet}")


def _roles(theme: ColourTheme) -> str:
    """Return the colours of a theme as CSS variables, named after their roles."""
    return " ".join(f"--{role.replace('_', '-')}: {colour};" for role, colour in asdict(theme).items())


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


def _shown(value: object) -> Any:
    """Make invisible characters of a text visible; markup is left as it is."""
    return visible(value) if isinstance(value, str) and not isinstance(value, Markup) else value


# --- head, settings, software, recordings ----------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Head:
    """Summary of a study in a few lines."""

    title: str
    facts: tuple[tuple[str, str], ...]
    warnings: tuple[str, ...]


def head(study: StudyData, provenance: Mapping[str, Any]) -> Head:
    """Return the head of a report."""
    blocks, trials = study.blocks, study.trials
    days = sorted({str(when)[:10] for when in blocks["opened_utc"]})
    own = trials[trials["recording"].isin(study.analysed["recording"])]
    successes = int((own["outcome"] == "success").sum())
    others = len(trials) - len(own)
    practice = f"; {plural(others, 'attempt')} in blocks that are not analysed, as for practice" if others else ""
    counted = f"{amount(len(study.counted))} counted of {amount(successes)} done, in {plural(len(own), 'attempt')}"
    facts = [
        ("Dyads", amount(len(study.dyads))),
        ("Recordings", f"{amount(len(blocks))}, {amount(blocks['duration'].sum() / 3600)} h"),
        ("Trials", f"{counted}{practice}"),
        ("Recorded", days[0] if len(days) == 1 else f"{days[0]} to {days[-1]}" if days else "never"),
    ]
    if "made_utc" in provenance:
        facts.append(("Analysed", str(provenance["made_utc"])))
    title = ", ".join(sorted(word for word in blocks["study"].unique() if word)) or "unnamed"
    return Head(title, tuple(facts), (*_warnings(blocks), *notes(study)))


def _warnings(blocks: pd.DataFrame) -> list[str]:
    def share(column: str) -> str:
        return f"{amount(int(blocks[column].sum()))} of {plural(len(blocks), 'recording')}"

    warnings = []
    if blocks["simulated"].all():
        warnings.append("Simulated participants: no person held a device. These results are no evidence about people.")
    elif blocks["simulated"].any():
        warnings.append(f"Simulated participants in {share('simulated')}: their data are no evidence about people.")
    real = blocks[(blocks["stand_ins"] != "") & (blocks["pilot"] == 0)]
    if len(real):
        what = ", ".join(dict.fromkeys(one for words in real["stand_ins"] for one in words.split("; ")))
        warnings.append(f"Stand-ins for a haptic device or a screen in {plural(len(real), 'recording')}: {what}.")
    if blocks["pilot"].any():
        warnings.append(f"{share('pilot')} are marked as pilots.")
    return warnings


def settings_grids(readings: Readings) -> tuple[Grid, ...]:
    """Return all settings of an analysis as tables; non-default values are marked."""
    return tuple(_settings(table, readings) for table in tables(Readings) if table.keys)


def _settings(table: SettingsTable, readings: Readings) -> Grid:
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
    columns = code("Setting"), code("Value"), GridColumn("Unit"), code("Changed"), GridColumn("What it decides")
    return Grid(f"[{table.name}] {table.text.splitlines()[0]}", columns, tuple(rows), frozenset(marked))


def software_grid(study: StudyData, versions: Mapping[str, str]) -> Grid:
    """Return the table of software versions."""
    recorded = sorted(study.blocks["netboard"].unique())
    rows: list[tuple[Cell, ...]] = [("netboard, which recorded", ", ".join(recorded))]
    rows += [(package, str(version)) for package, version in versions.items()]
    return grid("Software", [GridColumn("What"), code("Version")], rows)


def recordings_grid(study: StudyData, known: Mapping[str, Mapping[str, Any]]) -> Grid:
    """Return the table of recordings with their SHA-256."""
    rows = []
    for recording, opened in study.blocks[["recording", "opened_utc"]].itertuples(index=False, name=None):
        file = known[recording]
        rows.append((recording, str(opened)[:19].replace("T", " "), str(file["file"]), str(file["sha256"])))
    columns = [name("Recording"), GridColumn("Opened (UTC)"), code("File"), code("SHA-256")]
    return grid("All recordings of the study, each with the SHA-256 of its file", columns, rows)


# --- figures ---------------------------------------------------------------------------------------------------------


MAX_SVG = 400_000
"""Largest SVG file that is embedded; larger figures are embedded as PNG, in bytes [1]."""

_SVG = "http://www.w3.org/2000/svg"
_HREF = "{http://www.w3.org/1999/xlink}href"
_DROPPED = {f"{{{_SVG}}}metadata", f"{{{_SVG}}}style", f"{{{_SVG}}}title"}


@dataclass(frozen=True, slots=True)
class Drawing:
    """A figure prepared for the page; without a figure the number is 0, and the caption is the reason."""

    name: str
    title: str
    caption: str
    number: int = 0
    svg: Markup = Markup()  # noqa: RUF009  # immutable
    png: str = ""


def drawings_of(pictures: Iterable[TopicFigure | WrittenFigure]) -> list[Drawing]:
    """Prepare figures for the page, numbered from 1; what could not be drawn has no number."""
    number = count(1)
    return [drawing(one, 0 if one.absent else next(number)) for one in pictures]


def drawing(picture: TopicFigure | WrittenFigure, number: int) -> Drawing:
    """Prepare a figure for the page."""
    words = picture.name, visible(picture.title), visible(picture.caption)
    if picture.absent:
        return Drawing(*words)
    file = picture.file("svg")
    if len(file) > MAX_SVG:
        data = base64.b64encode(picture.file("png")).decode("ascii")
        return Drawing(*words, number, png=f"data:image/png;base64,{data}")
    return Drawing(*words, number, svg=Markup(_inline(file, *words)))


def _inline(file: bytes, name: str, title: str, caption: str) -> str:
    """Return an SVG file as an HTML element."""
    root = ElementTree.fromstring(file)
    for parent in root.iter():
        for child in [child for child in parent if child.tag in _DROPPED]:
            parent.remove(child)
    for element in root.iter():
        element.attrib = dict(_attributes(element.attrib, name))
        element.tag = element.tag.removeprefix(f"{{{_SVG}}}")
    for place, (tag, text) in enumerate((("title", title), ("desc", caption))):
        label = ElementTree.Element(tag, {"id": f"{name}-{tag}"})
        label.text, label.tail = text, "\n"
        root.insert(place, label)
    root.attrib = {
        "viewBox": root.attrib["viewBox"],
        "role": "img",
        "aria-labelledby": f"{name}-title",
        "aria-describedby": f"{name}-desc",
    }
    return ElementTree.tostring(root, encoding="unicode")


def _attributes(found: dict[str, str], name: str) -> Iterator[tuple[str, str]]:
    """Yield the attributes of an element with unique ids and without external links."""
    for key, value in found.items():
        if key == "id":
            yield "id", f"{name}-{value}"
        elif key == _HREF:
            if value.startswith("#"):
                yield "href", f"#{name}-{value[1:]}"
            elif value.startswith("data:image/"):
                yield "href", value
        elif not key.startswith("{"):
            yield key, re.sub(r"url\(#", f"url(#{name}-", value)
