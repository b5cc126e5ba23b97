"""Power of a study as tables, a figure and sentences, with its assumptions."""

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from math import isfinite
from pathlib import Path
from textwrap import fill
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from netboard.analysis.cohort.decisions import CohortDecision
from netboard.analysis.cohort.power import PERMUTATION, T_TEST, Power, Role
from netboard.analysis.topics.figure import as_bytes, beside, new_figure
from netboard.base.config import Config
from netboard.base.errors import writing
from netboard.base.files.cells import CsvWriter
from netboard.base.files.new import refuse_existing
from netboard.base.looks import BLACK, BLUE, FIGURE_STYLE, GREEN, GREY, ORANGE, PINK, PRINT_FINE, SKY, VERMILION
from netboard.base.plural import plural
from netboard.base.settings import tables
from netboard.base.tables.simulated import Participant
from netboard.participants.people.population import LETTERS, person_of

ENOUGH = 0.8
"""Power that is usually asked for, which the lower limit of its confidence interval must reach [1]."""

ROLES: dict[Role, str] = {
    "primary": "the primary contrast",
    "secondary": "a secondary test that is adjusted for the primary one and by Holm's method",
    "exploratory": "exploratory and not corrected",
}
"""Roles of a test, in a sentence."""

SHOWN = 1000
"""Participants drawn to describe the distribution of each parameter [1]."""

COLOURS = (BLUE, VERMILION, GREEN, ORANGE, SKY, PINK, BLACK)
MARKERS = "osD^vPX"
"""Markers of the contrasts, in the order of their colours."""

ACROSS = 2
"""Panels in a row [1]."""

SPREAD = 0.6
"""Horizontal distance between the first and the last contrast [dyads]."""

COLUMNS = (
    ("role", "primary, secondary or exploratory"),
    ("measure", ""),
    ("contrast", ""),
    ("test", ""),
    ("dyads", "1"),
    ("trials", "per condition; 0: all"),
    ("studies", "1"),
    ("unit", ""),
    ("scale", "difference or ratio"),
    ("effect", "unit; mean of the cohort"),
    ("deviation", "SD of the dyads' differences; of logarithms for a ratio"),
    ("power", "1"),
    ("power_low", "1, Wilson 95 %"),
    ("power_high", "1, Wilson 95 %"),
    ("false_positives", "1"),
    ("false_positives_low", "1, Wilson 95 %"),
    ("false_positives_high", "1, Wilson 95 %"),
    ("width", "unit; mean width of the confidence interval; for a ratio upper over lower limit"),
    ("width_error", "unit; Monte Carlo standard error"),
    ("least_p", "1; smallest p that the test can have; nan or null: no limit"),
    ("unconverged", "1; share of the studies whose fit of a model did not converge"),
)
"""Columns of the table, with what they are."""


@dataclass(frozen=True, slots=True)
class Assumptions:
    """Assumptions of the power analysis.

    - `studies`, `dyads`: virtual studies of the cohort, and dyads in each [1].
    - `decision`: what the cohort can decide of the declared analysis.
    - `parameters`: parameter, unit, median and limits of the central 95 % of the simulated participants [their units].
    - `posterior`: SHA-256 of the posterior of whose draws the usual participants of the studies are; None if they are
      all equal.
    - `assurance`: SHA-256 of the posterior over whose draws an assurance is averaged; None without one.
    """

    study: str
    netboard: str
    config_sha256: str
    seed: int
    studies: int
    dyads: int
    alpha: float
    parameters: Sequence[tuple[str, str, float, float, float]]
    decision: CohortDecision
    posterior: str | None = None
    assurance: str | None = None

    @property
    def virtual_studies(self) -> str:
        """The number of studies, with its noun."""
        return plural(self.studies, "virtual study", "virtual studies")

    def rows(self) -> Iterator[tuple[str, str]]:
        """Yield each assumption with its value."""
        yield "plan", self.study
        yield "cohort", f"{self.virtual_studies} of {plural(self.dyads, 'dyad')}, seed {self.seed}"
        yield "participants", f"simulated, of netboard {self.netboard}, configuration {self.config_sha256[:12]}"
        if self.posterior is not None:
            drawn = f"a draw of the posterior {self.posterior[:12]} in each virtual study, so that power is assurance"
            yield "usual participant", f"{drawn}; the distributions below are without it"
        if self.assurance is not None:
            yield (
                "assurance",
                f"power of a cohort with a draw of the posterior {self.assurance[:12]} in each virtual study",
            )
        yield "distributions", f"median, and central 95 % of {SHOWN} participants; other parameters are constant"
        for name, unit, middle, low, high in self.parameters:
            if low != high:
                shown = f" {unit}" if unit not in ("", "1") else ""
                yield name, f"{middle:.3g} ({low:.3g} to {high:.3g}){shown}"
        yield "dyads", "independent; a study of fewer dyads is a part of a virtual study, with its counterbalancing"
        yield "false positives", "no effect by construction: the cohort's mean effect is subtracted"
        yield "significance level", f"{self.alpha:g}, two-sided"
        yield "declared analysis", self.decision.text
        if self.decision.scores:
            yield "primary contrast", "its p is compared with the level as it is"
            rule = "the larger of the primary p and of Holm's p over all secondary tests is compared with the level"
            yield "secondary tests", rule
        for name in self.decision.missing:
            yield f"secondary outcome {name}", "has no values in a cohort: its tests count with a p of 1"
        yield "exploratory contrasts", "not corrected for several tests; none of them decides anything"

    def __str__(self) -> str:
        return (
            f"{self.virtual_studies} of the plan {self.study} with {plural(self.dyads, 'simulated dyad')} each "
            f"(netboard {self.netboard}, configuration {self.config_sha256[:12]}, seed {self.seed})"
        )


def distributions(config: Config, seed: int) -> Iterator[tuple[str, str, float, float, float]]:
    """Yield the distribution of each parameter of the participants, from a sample of `SHOWN`.

    - yields: parameter, unit, median, and the limits of the central 95 %; these are equal for a constant [its unit].
    """
    people = [person_of(config.participant, seed, dyad + 1, LETTERS[0]) for dyad in range(SHOWN)]
    (units,) = ({key.name: key.unit for key in table.keys} for table in tables(Config) if table.name == "participant")
    for field in fields(Participant):
        values = [getattr(person, field.name) for person in people]
        if all(isinstance(value, int | float) and not isinstance(value, bool) for value in values):
            low, middle, high = (float(value) for value in np.percentile(values, (2.5, 50.0, 97.5)))
            yield field.name, units.get(field.name, "1"), middle, low, high


def sentence(found: Sequence[Power], assumptions: Assumptions) -> str:
    """Return a sentence for a methods section on one test of one contrast, by increasing number of dyads.

    It is on the smallest number of dyads with enough power beyond the Monte Carlo error, or on the largest one.
    """
    enough = next((one for one in found if one.power.low >= ENOUGH), None)
    one = enough or found[-1]
    trials = f" and {plural(one.trials, 'trial')} per condition" if one.trials else ""
    reached = "" if enough else f", whose lower limit is below {ENOUGH:g} with each simulated number of dyads"
    unit = f" {one.unit}" if one.unit != "1" else ""
    wide = ""
    if one.test != PERMUTATION and isfinite(one.width):  # a permutation test has no interval of its own
        span = f"spans a factor of {one.width:.3g}" if one.scale == "ratio" else f"is {one.width:.3g}{unit} wide"
        wide = f"; its {100 * (1 - assumptions.alpha):g} % confidence interval {span} on average"
    return (
        f"With {plural(one.dyads, 'dyad')}{trials}, a {one.test} of {one.measure} ({one.contrast}; {one.scale} "
        f"{one.effect:.3g}{unit}), {ROLES[one.role]}, at the level {assumptions.alpha:g} has a power of "
        f"{one.power.value:.2f} (95 % Monte Carlo confidence interval {one.power.low:.2f} to {one.power.high:.2f})"
        f"{reached}{wide}. "
        f"{_limits(one, assumptions.alpha)}Simulated: {assumptions}."
    )


def _limits(one: Power, alpha: float) -> str:
    """Return sentences on a test that cannot reject, and on fits that did not converge; empty for neither."""
    found = []
    if one.impossible(alpha):
        least = f"its smallest possible p is {one.least_p:.3g}"
        found.append(f"It cannot reject at this level: {least} with {plural(one.dyads, 'dyad')}. ")
    if one.unconverged:
        found.append(f"In {100.0 * one.unconverged:.3g} % of the studies the fit did not converge. ")
    return "".join(found)


def by_test(found: Sequence[Power]) -> dict[tuple[Role, str, str, str, int], list[Power]]:
    """Return the powers of each role, measure, contrast, test and number of trials, by increasing number of dyads."""
    lines: dict[tuple[Role, str, str, str, int], list[Power]] = {}
    for one in found:
        lines.setdefault((one.role, one.measure, one.contrast, one.test, one.trials), []).append(one)
    return {key: sorted(own, key=lambda one: one.dyads) for key, own in lines.items()}


def flat(one: Power) -> dict[str, Any]:
    """Return the row of a power."""
    row = {name: getattr(one, name) for name, _ in COLUMNS if hasattr(one, name)}
    for name in ("power", "false_positives"):
        rate = row[name]
        row |= {name: rate.value, f"{name}_low": rate.low, f"{name}_high": rate.high}
    return {name: row[name] for name, _ in COLUMNS}


def least_rows(found: Sequence[Power], alpha: float) -> Iterator[tuple[str, str]]:
    """Yield the smallest possible p of each exact test by number of dyads, and whether it is above the level."""
    least = {(one.role, one.test, one.dyads): one for one in found if isfinite(one.least_p)}
    for (role, test, dyads), one in least.items():
        above = f"; above {alpha:g}, so the test cannot reject" if one.impossible(alpha) else ""
        adjusted = " adjusted" if role == "secondary" else ""
        name = f"smallest possible{adjusted} p, {role} {test}, {plural(dyads, 'dyad')}"
        yield name, f"{one.least_p:.3g}{above}"


def parts(found: Sequence[Power], assumptions: Assumptions, assured: Sequence[Power] = ()) -> list[dict[str, Any]]:
    """Return the tables of a page: the assumptions, and power, false positives and precision by number of dyads.

    - `assured`: powers of studies whose usual participants are drawn from a posterior.
    """
    about = [list(row) for row in (*assumptions.rows(), *least_rows(found, assumptions.alpha))]
    monte_carlo = "with 95 % Monte Carlo confidence intervals"
    precise = [one for one in found if one.test != PERMUTATION]
    width = "Mean width of the confidence interval; of a ratio: upper over lower limit"
    return [
        {"name": "about", "title": "Assumptions", "columns": ["", "value"], "rows": about, "verdicts": []},
        _by_size("power", f"Power, {monte_carlo}", found, lambda one: one.power),
        *([_by_size("assurance", f"Assurance, {monte_carlo}", assured, lambda one: one.power)] if assured else []),
        _by_size("false-positives", f"False-positive rate, {monte_carlo}", found, lambda one: one.false_positives),
        _by_size("precision", width, precise, lambda one: f"{one.width:.3g}"),
    ]


def _by_size(name: str, title: str, found: Sequence[Power], cell: Callable[[Power], object]) -> dict[str, Any]:
    """Return a table with a row for each test, and a column for each number of dyads."""
    rows, sizes = [], sorted({one.dyads for one in found})
    for (role, measure, contrast, test, trials), own in by_test(found).items():
        cells = {one.dyads: str(cell(one)) for one in own}
        unit = "" if own[0].unit == "1" else f" {own[0].unit}"
        head = [role, measure, contrast, test, trials or "all", f"{own[0].effect:.3g}{unit}"]
        rows.append([*head, *(cells.get(size, "") for size in sizes)])
    columns = ["role", "measure", "contrast", "test", "trials", "ratio or difference"]
    columns += [plural(size, "dyad") for size in sizes]
    return {"name": name, "title": title, "columns": columns, "rows": rows, "verdicts": []}


def write(folder: Path, found: Sequence[Power], assumptions: Assumptions, assured: Sequence[Power] = ()) -> None:
    """Write power.csv, power.json, power.png, power.svg and methods.txt."""
    refuse_existing(folder / "power.csv")
    with writing(folder):
        folder.mkdir(parents=True, exist_ok=True)
        with (folder / "power.csv").open("x", encoding="utf-8", newline="") as file:
            writer = CsvWriter(file)
            writer.row(name for name, _ in COLUMNS)
            writer.rows(flat(one).values() for one in found)
        whole = {
            "assumptions": dict(assumptions.rows()),
            "columns": dict(COLUMNS),
            "rows": [_plain(flat(one)) for one in found],
            "assurance": [_plain(flat(one)) for one in assured],
            "parts": parts(found, assumptions, assured),
        }
        with (folder / "power.json").open("x", encoding="utf-8") as file:
            file.write(json.dumps(whole, indent=1, ensure_ascii=False, allow_nan=False) + "\n")
        with (folder / "methods.txt").open("x", encoding="utf-8") as file:
            file.writelines(f"{sentence(own, assumptions)}\n" for own in by_test(found).values())
        figure = draw(found, assumptions.alpha, str(assumptions))
        for kind in ("png", "svg"):
            with (folder / f"power.{kind}").open("xb") as image:
                image.write(as_bytes(figure, kind))


def _plain(row: Mapping[str, Any]) -> dict[str, Any]:
    """Return a row for JSON, which has no NaN."""
    return {name: None if isinstance(value, float) and not isfinite(value) else value for name, value in row.items()}


@mpl.rc_context(FIGURE_STYLE)
def draw(found: Sequence[Power], alpha: float, assumptions: str) -> Figure:
    """Draw power (filled) and false-positive rate (hollow, dashed) against dyads, a panel for each measure.

    The declared tests, if there are any, else the t tests of the exploratory contrasts.
    """
    declared = [one for one in found if one.role != "exploratory"]
    found = declared or [one for one in found if one.test == T_TEST]
    kind = f"{found[0].test}, as the report decides it" if declared else f"{T_TEST}, exploratory"
    measures = list(dict.fromkeys(one.measure for one in found))
    contrasts = list(dict.fromkeys((one.contrast, one.trials) for one in found))
    rows = -(-len(measures) // ACROSS)
    figure, axes = new_figure(1.1 + 2.0 * rows, min(ACROSS, len(measures)), rows)
    for place, panel in enumerate(axes):
        panel.set_visible(place < len(measures))
    for panel, measure in zip(axes, measures, strict=False):
        for which, key in enumerate(contrasts):
            own = [one for one in found if (one.measure, one.contrast, one.trials) == (measure, *key)]
            shift = beside(len(contrasts), SPREAD)[which]
            _lines(panel, sorted(own, key=lambda one: one.dyads), which, _name(*key), shift)
        _frame(panel, measure, sorted({one.dyads for one in found}), alpha)
    handles, names = axes[0].get_legend_handles_labels()
    figure.legend(handles, names, loc="outside upper center", ncols=2)
    legend = (
        f"Filled: power; hollow: false positives; both of the {kind}, with 95 % Monte Carlo confidence intervals. "
        f"Grey: the significance level {alpha:g}, and a power of {ENOUGH:g}. Marks are shifted, so that none covers "
        "another. "
    )
    figure.supxlabel(fill(f"{legend}{assumptions[:1].upper()}{assumptions[1:]}.", 130), fontsize=PRINT_FINE)
    return figure


def _lines(axes: Axes, own: Sequence[Power], which: int, name: str, shift: float) -> None:
    """Draw one contrast, shifted so that it does not cover others."""
    colour, marker = COLOURS[which % len(COLOURS)], MARKERS[which % len(MARKERS)]
    for rates, face, line, label in (
        ([one.power for one in own], colour, "-", name),
        ([one.false_positives for one in own], "white", "--", f"_{name}, false positives"),
    ):
        values = [rate.value for rate in rates]
        bars = [[rate.value - rate.low for rate in rates], [rate.high - rate.value for rate in rates]]
        axes.errorbar(
            [one.dyads + shift for one in own],
            values,
            bars,
            color=colour,
            marker=marker,
            markerfacecolor=face,
            markersize=4,
            linestyle=line,
            linewidth=0.9,
            label=label,
        )


def _frame(axes: Axes, measure: str, sizes: Sequence[int], alpha: float) -> None:
    """Set title and axes of a panel."""
    for height in (alpha, ENOUGH):
        axes.axhline(height, color=GREY, linewidth=0.6, zorder=0)
    axes.set_title(measure, loc="left")
    axes.set_xticks(sizes)
    axes.set_ylim(0.0, 1.02)
    axes.set_xlabel("dyads [1]")
    axes.set_ylabel("share of studies [1]")


def _name(contrast: str, trials: int) -> str:
    return f"{contrast}, {plural(trials, 'trial')}" if trials else contrast
