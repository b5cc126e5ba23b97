"""The report of an analysis in a real browser, at each size and in both themes, and what is outside of the window."""

import json
import re
import tempfile
from html import unescape
from pathlib import Path
from typing import NamedTuple

import numpy as np

from browser import DARK, LIGHT, opened  # type: ignore[import-not-found]
from declared_study import DECLARED, TWO, crossed_study  # type: ignore[import-not-found]
from netboard.analysis.report.html import write_report
from netboard.analysis.topics import primary
from netboard.analysis.topics.everything import drawn
from netboard.analysis.topics.figure import TopicFigure, new_figure
from netboard.base.looks import ThemeName
from report_studies import few_results, provenance_of  # type: ignore[import-not-found]

THEMES: dict[ThemeName, int] = {"dark": DARK, "light": LIGHT}

POLICY = re.compile(r'<meta http-equiv="Content-Security-Policy"[^>]*>')
"""What keeps scripts out of a report, and is left out of the copy that is measured."""

MEASURING = """<script>
const wide = document.documentElement.clientWidth;
const inside = one => one.getBoundingClientRect().right <= wide + 1;
const scrolled = one => ["auto", "hidden", "scroll"].includes(getComputedStyle(one).overflowX) && inside(one);
const outside = [...document.querySelectorAll("body *")].filter(one => {
  for (let at = one; at !== null; at = at.parentElement)
    if (at === one ? inside(at) : scrolled(at)) return false;
  return true;
});
document.title = JSON.stringify({
  size: [innerWidth, innerHeight],
  beyond: document.documentElement.scrollWidth - wide,
  outside: outside.slice(0, 5).map(one => one.tagName + " " + one.textContent.trim().slice(0, 40)),
  background: getComputedStyle(document.body).backgroundColor,
});
</script></body>"""
"""Asks the page for its size, for what no scrolling of a table reaches, and for its background."""


def made_report(folder: Path) -> Path:
    """Write the report of a synthetic study with a declared question, figures and results; return its path."""
    study = crossed_study(DECLARED, TWO)
    figure, (axes,) = new_figure(2.0)
    axes.plot(np.arange(5), np.arange(5) ** 2, "o-")
    learning = TopicFigure("learning", "The learning", "Synthetic.", figure)
    return write_report(folder, study, few_results(), [drawn(study, primary.picture), learning], provenance_of(study))


class MeasuredPage(NamedTuple):
    """What a browser says of a page."""

    size: list[int]  # of its window [px]
    beyond: int  # by which the page is wider than the window [px]
    outside: list[str]  # elements that are outside of the window, and that no scrolling of a table reaches
    background: str


def measured(report: Path, size: tuple[int, int], theme: ThemeName, picture: Path | None = None) -> MeasuredPage:
    """Open a copy of a report in a browser, and measure it; ``picture``: where to save a screenshot."""
    with tempfile.TemporaryDirectory() as place:
        copy = Path(place) / report.name
        page = POLICY.sub("", report.read_text(encoding="utf-8"))
        copy.write_text(page.replace("</body>", MEASURING), encoding="utf-8")
        dom = opened(f"file://{copy}", Path(place) / "profile", size=size, theme=THEMES[theme], picture=picture)
    title = re.search(r"<title>(.*?)</title>", dom)
    assert title is not None
    return MeasuredPage(**json.loads(unescape(title[1])))


def photograph(folder: Path, report: Path, size: tuple[int, int], theme: ThemeName) -> list[str]:
    """Save a screenshot of a report; return what of it is outside of the window."""
    name = f"report-{size[0]}x{size[1]}-{theme}.png"
    found = measured(report, size, theme, (folder / name).resolve())
    where = f"report {size[0]} x {size[1]}"
    return [f"{where}: {one}" for one in found.outside] + [f"{where}: {found.beyond} px too wide"] * bool(found.beyond)
