"""``netboard bench analysis --sensitivity``: open questions answered otherwise, singly, in pairs, all at once; noise.

All recordings are measured by the default readings and by each alternative; what is made of the trials is done anew
from the same tables. Disturbances are paired: each attempt with itself, undisturbed.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from netboard.errors import RecordingError
from netboard.export.runs import Run, runs_of
from netboard.measuring.readings import Readings
from netboard.measuring.recordings import Measured
from netboard.measuring.study import Study, study_of
from netboard.sensitivity import multiverse
from netboard.sensitivity.again import Fulfilled, Wish, fulfil_all
from netboard.sensitivity.disturbances import DISTURBANCES
from netboard.sensitivity.numbers import STATEMENTS, Numbers, numbers
from netboard.sensitivity.readings import AMBIGUITIES, PAIRS, Alternative, Ambiguity, ambiguity, readings_of
from netboard.studies.results import Folder, Part, Value
from netboard.studies.running import Tell

PATHS, QUICK_PATHS = (8, 8, 4), (3, 4, 4)
"""Sets of filters, of measures for each, of summaries for each of these [1]."""

DISTURBED_DYADS = 2
"""Of so many dyads one recording in each condition is disturbed [1]."""

WORKERS = 2

LEAST = 1e-6
"""What changes by less has not changed, as a share [1]."""

SMALL = 0.01
"""A number that changes by more has moved, as a share [1]."""


@dataclass(frozen=True)
class Asked:
    """What is measured.

    Attributes
    ----------
    runs : tuple of Run
        The recordings.
    settings : tuple of str
        Settings of all readings: how many trials the first and the last are.
    base : Readings
        The default readings.
    singles : tuple of tuple
        Question and alternative.
    pairs : tuple of tuple
        Two questions.
    paths : Paths
        Paths through all questions.
    """

    runs: tuple[Run, ...]
    settings: tuple[str, ...]
    base: Readings
    singles: tuple[tuple[Ambiguity, Alternative], ...]
    pairs: tuple[tuple[Ambiguity, Ambiguity], ...]
    paths: multiverse.Paths

    @property
    def others(self) -> tuple[Readings, ...]:
        """All other readings: of singles, then of pairs, then of paths."""
        one = [readings_of(other.settings, self.settings) for _, other in self.singles]
        two = [
            readings_of((*a.alternatives[0].settings, *b.alternatives[0].settings), self.settings)
            for a, b in self.pairs
        ]
        return (*one, *two, *self.paths.measured)


def asked(recordings: Sequence[Path], *, quick: bool) -> Asked:
    """Say what is measured.

    Parameters
    ----------
    recordings : sequence of Path
        The recordings.
    quick : bool
        The short form: fewer paths.

    Raises
    ------
    RecordingError
        If there are none, or none of the two configurations.
    """
    runs = runs_of(recordings)
    trials: dict[tuple[str, str], int] = {}
    for run in runs:
        block = run.config.block
        who = block.configuration, f"{run.session}{block.performer}{block.force}"
        trials[who] = trials.get(who, 0) + block.trials
    if {name for name, _ in trials} != {"bimanual", "dyadic"}:
        raise RecordingError("expected recordings of bimanual and of dyadic blocks, as the paper's plan has them")
    ends = max(min(30, min(trials.values()) // 2), 1)
    settings = (f"summaries.ends={ends}", f"summaries.group={max(ends, 3)}")
    return Asked(
        runs,
        settings,
        readings_of((), settings),
        tuple((one, other) for one in AMBIGUITIES for other in one.alternatives),
        tuple((ambiguity(one), ambiguity(other)) for one, other in PAIRS),
        multiverse.draw(settings, *(QUICK_PATHS if quick else PATHS)),
    )


def chosen(runs: Sequence[Run]) -> set[Path]:
    """Choose the recordings that are disturbed: the first of each condition of the first dyads.

    Parameters
    ----------
    runs : sequence of Run
        The recordings.
    """
    dyads = sorted({run.config.session.dyad for run in runs})[:DISTURBED_DYADS]
    first: dict[tuple[str, str, str], Path] = {}
    for run in runs:
        block, dyad = run.config.block, run.config.session.dyad
        if dyad in dyads:
            first.setdefault((dyad, block.configuration, block.force), run.path)
    return set(first.values())


def study(recordings: Sequence[Path], folder: Folder, tell: Tell, *, quick: bool) -> Iterator[Part]:
    """Run the parts of the study, one after the other.

    Parameters
    ----------
    recordings : sequence of Path
        The recordings.
    folder : Folder
        Where figures go.
    tell : callable
        Hears how far it is.
    quick : bool
        The short form.

    Yields
    ------
    Part
        What was found.
    """
    wanted = asked(recordings, quick=quick)
    found = _measured(wanted, tell)
    tell("summing up", 0.9)
    default = numbers(_study(wanted.base, [one.base for one in found]))
    others = [
        numbers(_study(readings, [one.others[number] for one in found]))
        for number, readings in enumerate(wanted.others[: len(wanted.singles) + len(wanted.pairs)])
    ]
    singles, pairs = others[: len(wanted.singles)], others[len(wanted.singles) :]
    yield about_part(wanted, found)
    yield numbers_part(default, singles)
    yield readings_part(wanted, default, singles)
    yield headlines_part(wanted, default, singles)
    yield moved_part(wanted, default, singles)
    yield pairs_part(wanted, default, singles, pairs)
    paths = _paths(wanted, found, len(others), tell)
    yield paths_part(default, paths, wanted.paths.count)
    yield statements_part(default, singles, paths)
    if find_spec("matplotlib") is not None:
        alone = [_values(one) for one in singles]
        folder.save(multiverse.draw_paths(_values(default), paths, alone), "analysis-paths")
    disturbed = [one for one in found if one.disturbed]
    yield disturbances_part(disturbed)
    yield all_disturbances_part(disturbed)
    yield forms_part(disturbed)
    yield wrong_way_part(_study(wanted.base, [one.base for one in found]))


def _measured(wanted: Asked, tell: Tell) -> list[Fulfilled]:
    """Measure all recordings in all ways."""
    disturbed = chosen(wanted.runs)
    wishes = []
    for run in wanted.runs:
        shaken = DISTURBANCES if run.path in disturbed else ()
        by = tuple(readings_of(one.settings, wanted.settings) for one in shaken)
        wishes.append(Wish(run, wanted.base, wanted.others, shaken, by))
    total = len(wishes)
    # Those that take longest first, so that no process is alone with one in the end.
    order = sorted(range(total), key=lambda number: not wishes[number].disturbances)
    done = fulfil_all(
        [wishes[number] for number in order],
        min(WORKERS, total),
        lambda count: tell(f"{count} of {total} recordings", 0.9 * count / total),
    )
    by_number = dict(zip(order, done, strict=True))
    return [by_number[number] for number in range(total)]


def _study(readings: Readings, measured: Sequence[Measured]) -> Study:
    return study_of(measured, readings)


def _paths(wanted: Asked, found: Sequence[Fulfilled], first: int, tell: Tell) -> list[dict[str, float]]:
    """Sum up on all paths."""
    values = []
    for number, ways in enumerate(wanted.paths.summed_up):
        tell("paths", 0.9 + 0.1 * number / len(wanted.paths.summed_up))
        tables = [one.others[first + number] for one in found]
        values += [_values(numbers(_study(readings, tables))) for readings in ways]
    return values


def _values(found: Numbers) -> dict[str, float]:
    return {name: one.value for name, one in found.items()}


def change(before: float, after: float) -> float:
    """Return how far a number has moved, as a share of what it was.

    Parameters
    ----------
    before, after : float
        The number [any].

    Returns
    -------
    float
        The change; NaN if it is not known, and infinite from 0 [1].
    """
    if math.isnan(before) and math.isnan(after):
        return 0.0
    if before == after:
        return 0.0
    return (after - before) / abs(before) if before else math.copysign(math.inf, after)


def signed(share: float) -> str:
    """Write a change in percent.

    Parameters
    ----------
    share : float
        The change [1].
    """
    if math.isnan(share):
        return "none left"
    if abs(share) < LEAST:
        return "0"
    return f"{100 * share:+.2g} %" if math.isfinite(share) else "from 0"


# --- parts of the study -------------------------------------------------------------------------------------------


def about_part(wanted: Asked, found: Sequence[Fulfilled]) -> Part:
    """Say of what all of it is.

    Parameters
    ----------
    wanted : Asked
        What was asked for.
    found : sequence of Fulfilled
        What was measured.
    """
    base = _study(wanted.base, [one.base for one in found])
    attempts = sum(len(one.calm[0]["completion"]) for one in found if one.calm)
    rows: list[tuple[Value, ...]] = [
        ("dyads", len(base.dyads)),
        ("recordings", len(base.blocks)),
        ("trials that count", len(base.counted)),
        ("movements of the board in them", int((base.movements["counts"] == 1).sum())),
        ("of simulated people", f"{int(base.blocks['simulated'].sum())} recordings"),
        ("first and last trials", wanted.base.summaries.ends),
        ("trials in a group", wanted.base.summaries.group),
        ("alternatives, one at a time", len(wanted.singles)),
        ("paths", f"{sum(map(len, wanted.paths.summed_up))} of {wanted.paths.count:.3g}"),
        ("disturbed", f"{sum(bool(one.disturbed) for one in found)} recordings, {attempts} attempts"),
    ]
    return Part("about", "What was measured", ("", "of what"), rows)


def numbers_part(default: Numbers, singles: Sequence[Numbers]) -> Part:
    """List every number with its range over all alternatives that somebody might choose, one at a time.

    Parameters
    ----------
    default : dict of Number
        By the default readings.
    singles : sequence of dict of Number
        With one alternative each.
    """
    rows: list[tuple[Value, ...]] = []
    for name, one in default.items():
        values = np.array([single[name].value for single in singles])
        known = values[np.isfinite(values)]
        low, high = (float(known.min()), float(known.max())) if known.size else (math.nan, math.nan)
        rows.append((name, one.unit, one.value, low, high))
    columns = ("number", "unit", "default", "least", "most")
    return Part(
        "numbers", "Every number, and its range over the alternatives, one at a time", columns, rows, on_screen=False
    )


def readings_part(wanted: Asked, default: Numbers, singles: Sequence[Numbers]) -> Part:
    """Say of every question what its other answers move most.

    Parameters
    ----------
    wanted : Asked
        What was asked for.
    default : dict of Number
        By the default readings.
    singles : sequence of dict of Number
        With one alternative each.
    """
    found = {(one.name, other.name): single for (one, other), single in zip(wanted.singles, singles, strict=True)}
    rows: list[tuple[Value, ...]] = []
    for one in AMBIGUITIES:
        if not one.alternatives:
            rows.append((one.name, one.question, one.default, "none", one.reason, ""))
        for other in one.alternatives:
            rows.append(
                (one.name, one.question, one.default, other.name, *_most(one, default, found[one.name, other.name]))
            )
    columns = ("", "question", "default", "alternative", "moves most", "numbers moved by 1 %")
    return Part("readings", "Every open question, and what its other answers move", columns, rows)


def _most(one: Ambiguity, default: Numbers, single: Numbers) -> tuple[str, str]:
    """Find the number that an answer moves most, and count those that it moves."""
    mine = {
        name: change(number.value, single[name].value)
        for name, number in default.items()
        if number.family in one.touches
    }
    plain = {name: share for name, share in mine.items() if _is_plain(name, default, single)}
    largest = max(plain, key=lambda name: abs(plain[name]), default="")
    moved = sum(not abs(share) <= SMALL for share in mine.values())
    if not largest or abs(plain[largest]) < LEAST:
        return ("nothing" if not moved else "only what is small or rare"), f"{moved} of {len(mine)}"
    before, after = default[largest], single[largest]
    words = f"{largest}: {before.value:.3g} to {after.value:.3g}{_unit(before.unit)}, {signed(plain[largest])}"
    return words, f"{moved} of {len(mine)}"


def _unit(unit: str) -> str:
    return "" if unit == "1" else f" {unit}"


def _is_plain(name: str, default: Numbers, single: Numbers) -> bool:
    """Whether a change of a number in percent says something: it has one unit, and is neither a count nor next to 0."""
    before, after = default[name], single[name]
    known = math.isfinite(before.value) and math.isfinite(after.value) and before.value != 0
    tiny = before.unit == "1" and before.family == "shares" and before.value < 0.02
    return known and not tiny and before.unit == after.unit and not name.startswith("dyads ")


def headlines_part(wanted: Asked, default: Numbers, singles: Sequence[Numbers]) -> Part:
    """Put the headline numbers beside each other, by every alternative that moves one.

    Parameters
    ----------
    wanted : Asked
        What was asked for.
    default : dict of Number
        By the default readings.
    singles : sequence of dict of Number
        With one alternative each.
    """
    names = [(name, label.replace("\n", " "), factor) for name, label, factor in multiverse.HEADLINES]
    rows: list[tuple[Value, ...]] = [
        ("default", "", *(f"{factor * default[name].value:.3g}" for name, _, factor in names))
    ]
    for (one, other), single in zip(wanted.singles, singles, strict=True):
        shares = [change(default[name].value, single[name].value) for name, _, _ in names]
        if any(not abs(share) <= SMALL / 10 for share in shares):
            cells = [
                f"{factor * single[name].value:.3g}" if not abs(share) < SMALL / 10 else ""
                for (name, _, factor), share in zip(names, shares, strict=True)
            ]
            rows.append((one.name, other.name, *cells))
    columns = ("", "reading", *(label for _, label, _ in names))
    return Part(
        "headlines", "Headline numbers by alternatives that move one by 0.1 %; empty: as by default", columns, rows
    )


def moved_part(wanted: Asked, default: Numbers, singles: Sequence[Numbers]) -> Part:
    """List all numbers that an alternative moves.

    Parameters
    ----------
    wanted : Asked
        What was asked for.
    default : dict of Number
        By the default readings.
    singles : sequence of dict of Number
        With one alternative each.
    """
    rows: list[tuple[Value, ...]] = []
    for (one, other), single in zip(wanted.singles, singles, strict=True):
        for name, number in default.items():
            share = change(number.value, single[name].value)
            if not abs(share) <= SMALL:
                rows.append((one.name, other.name, name, number.unit, number.value, single[name].value, signed(share)))
    columns = ("", "alternative", "number", "unit", "default", "alternative", "change")
    return Part("moved", "All numbers that an alternative moves by 1 %", columns, rows, on_screen=False)


def pairs_part(wanted: Asked, default: Numbers, singles: Sequence[Numbers], pairs: Sequence[Numbers]) -> Part:
    """Say what two answers do together, and how much of it neither does alone.

    Parameters
    ----------
    wanted : Asked
        What was asked for.
    default : dict of Number
        By the default readings.
    singles, pairs : sequence of dict of Number
        With one alternative each, and with two.
    """
    alone = {}
    for (one, other), single in zip(wanted.singles, singles, strict=True):
        alone.setdefault(one.name, (other.name, single))
    rows: list[tuple[Value, ...]] = []
    for (one, other), both in zip(wanted.pairs, pairs, strict=True):
        (first, by_one), (second, by_other) = alone[one.name], alone[other.name]
        shared = [
            name for name, number in default.items() if number.family in one.touches and number.family in other.touches
        ]
        shown = [name for name, _, _ in multiverse.HEADLINES if name in shared][:2]
        for name in shown:
            base = default[name].value
            shifts = [found[name].value - base for found in (by_one, by_other, both)]
            joint = shifts[2] - shifts[0] - shifts[1]
            rows.append(
                (
                    f"{one.name} {first}, {other.name} {second}",
                    f"{name}{' [s]' if default[name].unit == 's' else ''}",
                    base,
                    *(base + shift for shift in shifts),
                    joint,
                )
            )
    columns = ("two answers", "number", "default", "first alone", "second alone", "both", "not the sum of the two by")
    return Part("pairs", "Two answers at once", columns, rows)


def paths_part(default: Numbers, paths: Sequence[dict[str, float]], count: int) -> Part:
    """Say how the headline numbers are spread over the paths.

    Parameters
    ----------
    default : dict of Number
        By the default readings.
    paths : sequence of dict
        Values on each path.
    count : int
        How many paths there would be [1].
    """
    rows: list[tuple[Value, ...]] = []
    for name, label, factor in multiverse.HEADLINES:
        values = factor * np.array([one[name] for one in paths])
        known = values[np.isfinite(values)]
        before = factor * default[name].value
        marks = [float(mark) for mark in np.percentile(known, (0, 5, 50, 95, 100))] if known.size else [math.nan] * 5
        below = f"{100 * float(np.mean(known < before)):.0f} %" if known.size else "none"
        rows.append((label.replace("\n", " "), before, *marks, below, known.size))
    columns = ("number", "default", "least", "5 %", "median", "95 %", "most", "paths below the default", "paths")
    return Part("paths", f"Headline numbers on paths drawn from {count:.3g}", columns, rows)


def statements_part(default: Numbers, singles: Sequence[Numbers], paths: Sequence[dict[str, float]]) -> Part:
    """Count where what the paper says of its people holds for these.

    Parameters
    ----------
    default : dict of Number
        By the default readings.
    singles : sequence of dict of Number
        With one alternative each.
    paths : sequence of dict
        Values on each path.
    """
    plain = _values(default)
    one = multiverse.held([_values(single) for single in singles])
    every = multiverse.held(paths)
    rows: list[tuple[Value, ...]] = []
    for statement, (alone, of), (held, among) in zip(STATEMENTS, one, every, strict=True):
        share = f"{100 * held / among:.0f} %" if among else "none tells"
        rows.append((statement.words, statement.gap(plain) > 0, f"{alone} of {of}", share, among))
    columns = ("statement", "default", "one alternative at a time", "paths", "of")
    return Part("statements", "Where what the paper says of its people holds for these", columns, rows)


MEASURES = (
    ("completion", "completion [ms]", 1e3),
    ("peaks", "peaks", 1.0),
    ("cooperative", "cooperative [%]", 100.0),
    ("still", "still [%]", 100.0),
    ("delay_10", "delay 10 % [ms]", 1e3),
    ("delay_40", "delay 40 % [ms]", 1e3),
    ("braking_distance", "braking distance [mm]", 1e3),
    ("braking_velocity", "braking velocity [mm/s]", 1e3),
    ("sparc", "SPARC", 1.0),
    ("ldlj", "LDLJ", 1.0),
)
"""Measures of an attempt that are shown, and the factor to the unit."""


@dataclass(frozen=True, slots=True)
class Shift:
    """How far a disturbance moves a measure.

    Attributes
    ----------
    bias, deviation : float
        Mean and standard deviation of the differences of attempts [as the measure].
    count : int
        Attempts that have the measure with and without it [1].
    lost : int
        Attempts that have it only without [1].
    """

    bias: float
    deviation: float
    count: int
    lost: int


def shift(found: Sequence[Fulfilled], number: int, name: str) -> Shift:
    """Compare each attempt with itself.

    Parameters
    ----------
    found : sequence of Fulfilled
        Disturbed recordings.
    number : int
        Which disturbance [1].
    name : str
        Which measure.
    """
    calm = np.concatenate([one.calm[number][name] for one in found])
    shaken = np.concatenate([one.disturbed[number][name] for one in found])
    both = np.isfinite(calm) & np.isfinite(shaken)
    differences = (shaken - calm)[both]
    lost = int(np.count_nonzero(np.isfinite(calm) & ~np.isfinite(shaken)))
    if differences.size < 2:
        return Shift(math.nan, math.nan, int(differences.size), lost)
    return Shift(float(differences.mean()), float(differences.std(ddof=1)), int(differences.size), lost)


def disturbances_part(found: Sequence[Fulfilled]) -> Part:
    """Show bias and spread of the differences.

    Parameters
    ----------
    found : sequence of Fulfilled
        Disturbed recordings.
    """
    means = []
    for name, _, factor in MEASURES:
        calm = np.concatenate([one.calm[0][name] for one in found])
        means.append(f"{factor * np.nanmean(calm):.3g}" if np.isfinite(calm).any() else "none")
    rows: list[tuple[Value, ...]] = [("undisturbed: mean", "", *means)]
    for number, one in enumerate(DISTURBANCES):
        cells = [_cell(shift(found, number, name), factor) for name, _, factor in MEASURES]
        rows.append((one.kind, one.size, *cells))
    columns = ("disturbance", "size", *(label for _, label, _ in MEASURES))
    title = "What disturbances add to an attempt's measures: mean (standard deviation); L: so many attempts lose it"
    return Part("disturbances", title, columns, rows)


def _cell(one: Shift, factor: float) -> str:
    """Write bias and deviation; nothing where nothing changes."""
    lost = f" L {100 * one.lost / (one.count + one.lost):.2g} %" if one.lost else ""
    if one.count < 2:
        return f"all lost{lost}" if one.lost else "none"
    if factor * max(abs(one.bias), one.deviation) < 5e-4:
        return f"0{lost}"
    return f"{factor * one.bias:+.2g} ({factor * one.deviation:.2g}){lost}"


def all_disturbances_part(found: Sequence[Fulfilled]) -> Part:
    """List all differences in SI units.

    Parameters
    ----------
    found : sequence of Fulfilled
        Disturbed recordings.
    """
    rows: list[tuple[Value, ...]] = []
    for number, one in enumerate(DISTURBANCES):
        for name in found[0].calm[number]:
            calm = np.concatenate([each.calm[number][name] for each in found])
            mean = float(np.nanmean(calm)) if np.isfinite(calm).any() else math.nan
            found_shift = shift(found, number, name)
            rows.append(
                (
                    *(one.kind, one.size, " ".join(one.settings), name, mean),
                    *(found_shift.bias, found_shift.deviation, found_shift.count, found_shift.lost),
                )
            )
    columns = ("disturbance", "size", "readings", "measure", "mean", "bias", "SD", "attempts", "lost")
    return Part("disturbances-all", "All of them, in SI units", columns, rows, on_screen=False)


def forms_part(found: Sequence[Fulfilled]) -> Part:
    """Show what a filter is worth as a fraction of two polynomials (question A3).

    Parameters
    ----------
    found : sequence of Fulfilled
        Disturbed recordings.
    """
    rows: list[tuple[Value, ...]] = []
    for number, form in enumerate(found[0].forms):
        errors = np.array([one.forms[number].error for one in found])
        largest = f"{errors.max():.2g}" if np.isfinite(errors).all() else "beyond all numbers"
        rows.append((form.order, form.cutoff, f"{form.radius:.6f}", f"{form.gain:.6g}", largest))
    columns = (
        "order of a pass",
        "cutoff [Hz]",
        "largest pole [1]",
        "gain of a constant [1]",
        "largest error on a ball [m]",
    )
    title = "A3: filters as one fraction of two polynomials, beside second-order sections; recorded balls"
    return Part("forms", title, columns, rows)


def wrong_way_part(base: Study) -> Part:
    """Count the trials that question A24 concerns.

    Parameters
    ----------
    base : Study
        By the default readings.
    """
    rows: list[tuple[Value, ...]] = []
    for condition, own in base.counted.groupby("condition"):
        wrong = int((own["wrong_way"] > 0).sum())
        none = int(own["braking_distance"].isna().sum())
        rows.append((str(condition), len(own), wrong, f"{100 * wrong / len(own):.2g} %", none))
    columns = ("condition", "trials", "first movement the wrong way", "share", "no braking movement")
    return Part("wrong-way", "A24: trials whose first movement of the board goes the wrong way", columns, rows)
