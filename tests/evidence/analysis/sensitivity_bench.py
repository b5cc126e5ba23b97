"""``make evidence ARGS=sensitivity``: effect of open questions and disturbances on the reported numbers.

All recordings are measured with the default settings and with alternatives: one at a time, in pairs, and on random
paths through all questions. Each disturbed attempt is compared with the same attempt undisturbed.
"""

import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from evidence.analysis import multiverse
from evidence.analysis import question_tables as tables
from evidence.analysis.disturbance_tables import all_disturbances_part, disturbances_part
from evidence.analysis.disturbances import DISTURBANCES
from evidence.analysis.filter_forms import forms_part
from evidence.analysis.open_questions import (
    PAIRS,
    QUESTIONS,
    Alternative,
    Question,
    question_named,
    readings_of,
)
from evidence.analysis.remeasuring import Remeasured, Request, remeasure_all
from evidence.analysis.reported_numbers import Numbers, numbers
from netboard.analysis.extraction.settings import Readings
from netboard.analysis.extraction.study import StudyData, study_of
from netboard.analysis.measures.performance import window_sizes
from netboard.base.config import Config
from netboard.base.errors import ConfigError, RecordingError
from netboard.base.process.workers import cores
from netboard.benchmarks.harness import running
from netboard.benchmarks.harness.results import Folder, ResultPart
from netboard.benchmarks.harness.running import Options, Tell
from netboard.nodes.rehearsal import session as rehearsal
from netboard.nodes.rehearsal.jobs import jobs_of
from netboard.recording.export.runs import Run, runs_of
from netboard.task.plans.plan import blocks_of, shortened
from netboard.task.studies.study import paper_study

WHOLE, QUICK = (4, 18, 20), (2, 12, 3)
"""Size of the rehearsed study without recordings: dyads, first blocks of the paper's plan, trials in each [1].

Twelve blocks have each condition twice.
"""

SEED = 1

PATHS, QUICK_PATHS = (6, 6, 3), (2, 4, 2)
"""Arguments of `random_paths`: sets of filters, of measures for each, of summaries for each of these [1]."""

DISTURBED_DYADS = 2
"""Number of dyads of which one recording per condition is disturbed [1]."""

CONDITIONS = {(configuration, force) for configuration in ("bimanual", "dyadic") for force in ("none", "full")}
"""The paper's conditions: configuration and force."""

NO_BRIDGING = "filters.bridge=0"
"""Setting that leaves gaps open, so that the effect of lost samples is visible."""


def main(recordings: Path | None, options: Options) -> None:
    """Run the study on recordings, or else on rehearsed ones."""
    if recordings is not None:
        running.run("sensitivity", partial(study, recordings_in(recordings)), options)
        return
    with tempfile.TemporaryDirectory() as made:
        running.run("sensitivity", partial(study, rehearse(Path(made), quick=options.quick)), options)


def recordings_in(folder: Path) -> list[Path]:
    """List the recordings of a folder, sorted by name."""
    found = sorted(folder.glob("*.mcap"))
    if not found:
        raise ConfigError(f"{folder}: expected a folder with recordings (*.mcap)")
    return found


def rehearse(folder: Path, *, quick: bool) -> list[Path]:
    """Rehearse the paper's plan, shortened, with simulated dyads, and keep their recordings."""
    dyads, most, trials = QUICK if quick else WHOLE
    jobs = []
    for dyad in range(1, dyads + 1):
        blocks = shortened(blocks_of(Config(), paper_study(), SEED, dyad), most, trials)
        jobs += jobs_of(list(blocks), SEED, dyad, folder)
    rehearsal.in_parallel(jobs, 2)
    return recordings_in(folder)


@dataclass(frozen=True)
class Variants:
    """The recordings of a run and the settings to compare.

    - `settings`: settings that all variants share: number of first and last trials, and of trials in a group.
    - `base`: the default settings.
    - `singles`, `pairs`, `paths`: alternatives one at a time, two at once, and on random paths.
    """

    runs: tuple[Run, ...]
    settings: tuple[str, ...]
    base: Readings
    singles: tuple[tuple[Question, Alternative, Readings], ...]
    pairs: tuple[tuple[Question, Question, Readings], ...]
    paths: multiverse.Paths

    @property
    def others(self) -> tuple[Readings, ...]:
        """Return all settings but the default ones, each once."""
        every = *(one[2] for one in self.singles), *(one[2] for one in self.pairs), *self.paths.measured
        return tuple(dict.fromkeys(every))


def variants_of(recordings: Sequence[Path], *, quick: bool) -> Variants:
    """Choose the settings to compare; RecordingError if a condition of the paper is missing."""
    runs = runs_of(recordings)
    trials: dict[tuple[str, ...], int] = {}
    for run in runs:
        block = run.config.block
        key = block.configuration, block.force, run.config.session.dyad, block.performer
        trials[key] = trials.get(key, 0) + block.trials
    if missing := CONDITIONS - {key[:2] for key in trials}:
        names = ", ".join(sorted(f"{configuration} with force {force}" for configuration, force in missing))
        raise RecordingError(f"{len(runs)} recordings: expected the paper's four conditions, found none of {names}")
    settings = window_settings(min(trials.values()))
    pairs = [(question_named(one), question_named(other)) for one, other in PAIRS]
    return Variants(
        runs,
        settings,
        readings_of((), settings),
        tuple((q, other, readings_of(other.settings, settings)) for q in QUESTIONS for other in q.alternatives),
        tuple(
            (a, b, readings_of((*a.alternatives[0].settings, *b.alternatives[0].settings), settings)) for a, b in pairs
        ),
        multiverse.random_paths(settings, *(QUICK_PATHS if quick else PATHS)),
    )


def window_settings(trials: int) -> tuple[str, ...]:
    """Return settings for the number of first and last trials and of trials in a group: the paper's 30, or fewer.

    - `trials`: smallest number of trials in a condition [1].
    """
    ends, group = window_sizes(trials)
    return f"summaries.ends={ends}", f"summaries.group={group}"


def recordings_to_disturb(runs: Sequence[Run]) -> set[Path]:
    """Choose the first recording of each condition of the first dyads."""
    dyads = sorted({run.config.session.dyad for run in runs})[:DISTURBED_DYADS]
    first: dict[tuple[str, str, str], Path] = {}
    for run in runs:
        block, dyad = run.config.block, run.config.session.dyad
        if dyad in dyads:
            first.setdefault((dyad, block.configuration, block.force), run.path)
    return set(first.values())


def study(recordings: Sequence[Path], folder: Folder, tell: Tell, *, quick: bool) -> Iterator[ResultPart]:
    """Measure all variants and tabulate their effects."""
    variants = variants_of(recordings, quick=quick)
    found = _measured(variants, tell)
    base = study_of([one.base for one in found], variants.base)
    yield about_part(variants, base, found)
    tell("computing the reported numbers", 0.9)
    default = numbers(base)
    alone = [(one, other, numbers(_study(found, by), default)) for one, other, by in variants.singles]
    both = [(one, other, numbers(_study(found, by), default)) for one, other, by in variants.pairs]
    yield tables.numbers_part(default, alone)
    yield tables.alternatives_part(default, alone)
    yield tables.headlines_part(default, alone)
    yield tables.moved_part(default, alone)
    yield tables.pairs_part(default, alone, both)
    whole_ball = next(by for question, _, by in variants.singles if question.name == "B5")
    yield tables.affected_part(base, _study(found, whole_ball))
    paths = _paths(variants, found, default, tell)
    yield tables.paths_part(default, paths, variants.paths.count)
    yield tables.statements_part(default, alone, paths)
    singles = [tables.values_of(values) for _, other, values in alone if other.likely]
    folder.save("analysis-paths", lambda: multiverse.plot_paths(tables.values_of(default), paths, singles))
    disturbed = [one for one in found if one.disturbed]
    yield disturbances_part(disturbed)
    yield all_disturbances_part(disturbed)
    yield forms_part([one.forms for one in disturbed])


def _study(found: Sequence[Remeasured], measured: Readings, summarised: Readings | None = None) -> StudyData:
    """Return the study with other settings, and with other summaries of the same measures if they are given."""
    return study_of([one.others[measured] for one in found], summarised or measured)


def _measured(variants: Variants, tell: Tell) -> list[Remeasured]:
    disturbed = recordings_to_disturb(variants.runs)
    requests = []
    for run in variants.runs:
        disturbances = DISTURBANCES if run.path in disturbed else ()
        by = tuple(readings_of((NO_BRIDGING, *one.settings), variants.settings) for one in disturbances)
        requests.append(Request(run, variants.base, variants.others, disturbances, by))
    total = len(requests)
    # The longest jobs first, so that all processes end at about the same time.
    order = sorted(range(total), key=lambda number: not requests[number].disturbances)
    done = remeasure_all(
        [requests[number] for number in order],
        min(cores(), total),
        lambda count: tell(f"{count} of {total} recordings", 0.9 * count / total),
    )
    by_number = dict(zip(order, done, strict=True))
    return [by_number[number] for number in range(total)]


def _paths(variants: Variants, found: Sequence[Remeasured], default: Numbers, tell: Tell) -> list[dict[str, float]]:
    values = []
    paths = variants.paths
    for number, (measured, summaries) in enumerate(zip(paths.measured, paths.summaries, strict=True)):
        tell("random paths", 0.9 + 0.1 * number / len(paths.measured))
        values += [tables.values_of(numbers(_study(found, measured, one), default)) for one in summaries]
    return values


def about_part(variants: Variants, base: StudyData, found: Sequence[Remeasured]) -> ResultPart:
    """Tabulate the data and settings of the study."""
    attempts = sum(len(one.undisturbed[0]["completion"]) for one in found if one.undisturbed)
    return ResultPart(
        "about",
        "Data and settings",
        "quantity | value",
        [
            ("dyads", len(base.dyads)),
            ("recordings", len(base.blocks)),
            ("trials included", len(base.counted)),
            ("movements of the board in these trials", int((base.movements["counts"] == 1).sum())),
            ("simulated participants", f"{int(base.blocks['simulated'].sum())} recordings"),
            ("first and last trials", variants.base.summaries.ends),
            ("trials in a group", variants.base.summaries.group),
            ("alternatives, one at a time", len(variants.singles)),
            ("paths", f"{sum(map(len, variants.paths.summaries))} of {variants.paths.count:.3g}"),
            ("disturbed", f"{sum(bool(one.disturbed) for one in found)} recordings, {attempts} attempts"),
        ],
    )
