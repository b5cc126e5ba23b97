"""``netboard bench analysis --sensitivity``: open questions answered otherwise, singly, in pairs, all at once; noise.

All recordings are measured by the default readings and by each alternative; what is made of the trials is done anew
from the same tables. Disturbances are paired: each attempt with itself, undisturbed.
"""

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from netboard.analysis.extraction.settings import Readings
from netboard.analysis.extraction.study import Study, study_of
from netboard.analysis.measures.performance import window_sizes
from netboard.base.errors import RecordingError
from netboard.benchmarks.analysis import multiverse
from netboard.benchmarks.analysis import reading_tables as tables
from netboard.benchmarks.analysis.again import Fulfilled, Wish, fulfil_all
from netboard.benchmarks.analysis.disturbance_tables import all_disturbances_part, disturbances_part, forms_part
from netboard.benchmarks.analysis.disturbances import DISTURBANCES
from netboard.benchmarks.analysis.numbers import Numbers, numbers
from netboard.benchmarks.analysis.readings import (
    AMBIGUITIES,
    PAIRS,
    Alternative,
    Ambiguity,
    ambiguity,
    readings_of,
)
from netboard.benchmarks.harness.results import Folder, Part, Value
from netboard.benchmarks.harness.running import Tell
from netboard.recording.export.runs import Run, runs_of

PATHS, QUICK_PATHS = (6, 6, 3), (2, 4, 2)
"""Sets of filters, of measures for each, of summaries for each of these [1]."""

DISTURBED_DYADS = 2
"""Dyads of which one recording per condition is disturbed [1]."""

CONDITIONS = {(configuration, force) for configuration in ("bimanual", "dyadic") for force in ("none", "full")}
"""The paper's conditions: configuration and force."""

HOLES_LEFT = "filters.bridge=0"
"""Setting that turns bridging off, so that the effect of lost ticks is visible."""


@dataclass(frozen=True)
class Asked:
    """The recordings and readings of a run.

    - `settings`: settings of all readings: how many trials the first and the last are.
    """

    runs: tuple[Run, ...]
    settings: tuple[str, ...]
    base: Readings
    singles: tuple[tuple[Ambiguity, Alternative], ...]
    pairs: tuple[tuple[Ambiguity, Ambiguity], ...]
    paths: multiverse.Paths

    @property
    def first_path(self) -> int:
        """Return the index of the first path among the other readings [1]."""
        return len(self.singles) + len(self.pairs)

    @property
    def others(self) -> tuple[Readings, ...]:
        """Return all other readings: singles, then pairs, then paths."""
        one = [readings_of(other.settings, self.settings) for _, other in self.singles]
        two = [
            readings_of((*a.alternatives[0].settings, *b.alternatives[0].settings), self.settings)
            for a, b in self.pairs
        ]
        return (*one, *two, *self.paths.measured)


def asked(recordings: Sequence[Path], *, quick: bool) -> Asked:
    """Say what is measured."""
    runs = runs_of(recordings)
    trials: dict[tuple[str, ...], int] = {}
    for run in runs:
        block = run.config.block
        who = block.configuration, block.force, run.config.session.dyad, block.performer
        trials[who] = trials.get(who, 0) + block.trials
    if missing := CONDITIONS - {who[:2] for who in trials}:
        words = ", ".join(sorted(f"{configuration} with force {force}" for configuration, force in missing))
        raise RecordingError(f"{len(runs)} recordings: expected the paper's four conditions, there is none of {words}")
    settings = sizes(min(trials.values()))
    return Asked(
        runs,
        settings,
        readings_of((), settings),
        tuple((one, other) for one in AMBIGUITIES for other in one.alternatives),
        tuple((ambiguity(one), ambiguity(other)) for one, other in PAIRS),
        multiverse.draw(settings, *(QUICK_PATHS if quick else PATHS)),
    )


def sizes(trials: int) -> tuple[str, ...]:
    """Say how many trials the first and the last ones are, and those of a group: the paper's 30, or fewer.

    - `trials`: how many there are in a condition at the least [1].
    """
    ends, group = window_sizes(trials)
    return f"summaries.ends={ends}", f"summaries.group={group}"


def chosen(runs: Sequence[Run]) -> set[Path]:
    """Choose the recordings that are disturbed: the first of each condition of the first dyads."""
    dyads = sorted({run.config.session.dyad for run in runs})[:DISTURBED_DYADS]
    first: dict[tuple[str, str, str], Path] = {}
    for run in runs:
        block, dyad = run.config.block, run.config.session.dyad
        if dyad in dyads:
            first.setdefault((dyad, block.configuration, block.force), run.path)
    return set(first.values())


def study(recordings: Sequence[Path], folder: Folder, tell: Tell, *, quick: bool) -> Iterator[Part]:
    """Run the parts of the study, one after the other."""
    wanted = asked(recordings, quick=quick)
    found = _measured(wanted, tell)
    base = study_of([one.base for one in found], wanted.base)
    yield about_part(wanted, base, found)
    tell("summing up", 0.9)
    default = numbers(base)
    alone, both = _singles_and_pairs(wanted, found, default)
    yield tables.numbers_part(default, alone)
    yield tables.readings_part(default, alone)
    yield tables.headlines_part(default, alone)
    yield tables.moved_part(default, alone)
    yield tables.pairs_part(default, alone, both)
    yield tables.concerned_part(base, _single(wanted, found, "B5"))
    paths = _paths(wanted, found, default, tell)
    yield tables.paths_part(default, paths, wanted.paths.count)
    yield tables.statements_part(default, alone, paths)
    if find_spec("matplotlib") is not None:
        singles = [tables.values_of(values) for _, other, values in alone if other.likely]
        _save(folder, multiverse.draw_paths(tables.values_of(default), paths, singles))
    disturbed = [one for one in found if one.disturbed]
    yield disturbances_part(disturbed)
    yield all_disturbances_part(disturbed)
    yield forms_part(disturbed)


def _save(folder: Folder, figure: Any) -> None:
    from netboard.analysis.topics.figure import as_bytes

    for kind in ("png", "svg"):
        (folder.path / f"analysis-paths.{kind}").write_bytes(as_bytes(figure, kind))


def _singles_and_pairs(
    wanted: Asked, found: Sequence[Fulfilled], default: Numbers
) -> tuple[
    list[tuple[Ambiguity, Alternative, Numbers]],
    list[tuple[Ambiguity, Ambiguity, Numbers]],
]:
    """Summarise the study with one alternative each, and with two."""
    each = [
        numbers(study_of([one.others[number] for one in found], readings), default)
        for number, readings in enumerate(wanted.others[: wanted.first_path])
    ]
    alone = [(*which, values) for which, values in zip(wanted.singles, each, strict=False)]
    return alone, [(*which, values) for which, values in zip(wanted.pairs, each[len(alone) :], strict=True)]


def _single(wanted: Asked, found: Sequence[Fulfilled], name: str) -> Study:
    """Join the tables by the first alternative of a question."""
    number = next(place for place, (one, _) in enumerate(wanted.singles) if one.name == name)
    return study_of([one.others[number] for one in found], wanted.others[number])


def _measured(wanted: Asked, tell: Tell) -> list[Fulfilled]:
    """Measure all recordings by all readings."""
    disturbed = chosen(wanted.runs)
    wishes = []
    for run in wanted.runs:
        shaken = DISTURBANCES if run.path in disturbed else ()
        by = tuple(readings_of((HOLES_LEFT, *one.settings), wanted.settings) for one in shaken)
        wishes.append(Wish(run, wanted.base, wanted.others, shaken, by))
    total = len(wishes)
    # Those that take longest first, so that no process is alone with one in the end.
    order = sorted(range(total), key=lambda number: not wishes[number].disturbances)
    done = fulfil_all(
        [wishes[number] for number in order],
        min(os.cpu_count() or 1, total),
        lambda count: tell(f"{count} of {total} recordings", 0.9 * count / total),
    )
    by_number = dict(zip(order, done, strict=True))
    return [by_number[number] for number in range(total)]


def _paths(wanted: Asked, found: Sequence[Fulfilled], default: Numbers, tell: Tell) -> list[dict[str, float]]:
    """Summarise the study on all paths."""
    values = []
    for number, ways in enumerate(wanted.paths.summed_up):
        tell("paths", 0.9 + 0.1 * number / len(wanted.paths.summed_up))
        measured = [one.others[wanted.first_path + number] for one in found]
        values += [tables.values_of(numbers(study_of(measured, readings), default)) for readings in ways]
    return values


def about_part(wanted: Asked, base: Study, found: Sequence[Fulfilled]) -> Part:
    """Tabulate the data on which the study is based."""
    attempts = sum(len(one.calm[0]["completion"]) for one in found if one.calm)
    rows: list[tuple[Value, ...]] = [
        ("dyads", len(base.dyads)),
        ("recordings", len(base.blocks)),
        ("trials that count", len(base.counted)),
        ("movements of the board in them", int((base.movements["counts"] == 1).sum())),
        ("of simulated participants", f"{int(base.blocks['simulated'].sum())} recordings"),
        ("first and last trials", wanted.base.summaries.ends),
        ("trials in a group", wanted.base.summaries.group),
        ("alternatives, one at a time", len(wanted.singles)),
        ("paths", f"{sum(map(len, wanted.paths.summed_up))} of {wanted.paths.count:.3g}"),
        ("disturbed", f"{sum(bool(one.disturbed) for one in found)} recordings, {attempts} attempts"),
    ]
    return Part("about", "What was measured", ("", "of what"), rows)
