"""Extraction of all tables of one recording: its block, attempts with measures, movements and paths.

A recording and its settings always give the same tables, in any process on any machine. Nothing is excluded here;
`netboard.analysis.extraction.exclusions` marks attempts later.
"""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import nan
from typing import Any

import numpy as np

from netboard.analysis.extraction.answers import FIELDS as ANSWERS
from netboard.analysis.extraction.answers import answers
from netboard.analysis.extraction.attempts import MODERN, PAPER
from netboard.analysis.extraction.conditions import factors_text, settings_text
from netboard.analysis.extraction.controls import FIELDS as CONTROLS
from netboard.analysis.extraction.controls import controls
from netboard.analysis.extraction.details import MOVEMENTS, PATHS, movements, path
from netboard.analysis.extraction.settings import Readings
from netboard.analysis.extraction.tables import PLACE, Columns, Group, columns_of, count, number, words
from netboard.analysis.extraction.trials import RATE, AttemptData, BlockData, columns_for
from netboard.base.config import SIDES, Side
from netboard.base.errors import RecordingError
from netboard.base.tables.forces import CONDITIONS
from netboard.base.tables.questionnaires import questions_of
from netboard.base.tick import TICK
from netboard.recording.export.runs import Run, identified
from netboard.recording.files.reader import Recording
from netboard.recording.format.backfill import unknown_ticks
from netboard.recording.format.channels import DTYPES
from netboard.recording.integrity.quality_check import judged_along
from netboard.task.studies.declaration import declaration_text
from netboard.task.studies.factors import design_of, role_of, trial_role
from netboard.task.trials.quality import FIELDS_NEEDED, Verdict

HAPTICS = "haptic condition, as [block] force of the configuration: " + ", ".join(
    f"{name} is {condition.label}" for name, condition in CONDITIONS.items()
)
"""Meaning of the column ``force``: keys of the configuration, and their names in conditions, results and figures."""

BLOCKS = (
    words("recording", "name of the recording"),
    words("dyad", "pseudonym of the dyad"),
    words("session", "name of the session"),
    words("study", "name of the study"),
    count("pilot", "1: a pilot run"),
    count(
        "block", "number of the block in the dyad's plan, from 1; renumbered consecutively if two blocks have the same"
    ),
    count("part", "number of the recording in its block, from 1"),
    words("kind", "kind of block, as in the study; empty: none"),
    words("role", "purpose of its trials: practice, familiarisation, baseline or test"),
    words("configuration", "dyadic: two people with one hand each; bimanual: one with both"),
    words("force", HAPTICS),
    count("haptics", "1: with haptic feedback; 0: haptics off"),
    number("force_scale", "factor of the commanded force, were it on; NaN: differs between trials", "1"),
    number("force_delay", "added delay of the commanded force", "s"),
    words("performer", "performer: pseudonym of the participant, or of the dyad if both performed"),
    words("left_by", "pseudonym of the person who moved the left stylus; else still or robot"),
    words("right_by", "pseudonym of the person who moved the right stylus; else still or robot"),
    count("simulated", "1: no person held a device"),
    words("exclude", "quality flags that exclude an attempt, as declared in the recording, separated by spaces"),
    words("stand_ins", "what stood in for a haptic device or a screen, and who confirmed it; empty: nothing"),
    words("run", "id of the server's run that made the recording"),
    words("opened_utc", "start of the recording, UTC"),
    number("duration", "time from the first tick to the last", "s"),
    count("ticks", "number of ticks"),
    count("missing", "number of missing ticks"),
    count("unknown_rendered", "ticks at which a rendered force is unknown, summed over both hands"),
    count("trials", "successful trials planned for the block"),
    count("repaired", "1: a damaged recording that was recovered"),
    count("attempts", "number of attempts that began"),
    words("not_measured", "attempts without success, fall or timeout, or unreleased, as TRIAL.ATTEMPT and the cause"),
    words("netboard", "version of netboard that made the recording"),
    words("config_sha256", "SHA-256 of the block's configuration"),
    words("declaration", "what the study declares about its analysis, as a JSON object; empty: nothing"),
    words("factors", "factors of the block with their levels, as a JSON list"),
    words("settings", "settings that may differ without being a factor, as a JSON object"),
)
"""Columns of the table of blocks: one row for each recording."""

_RENDERED = tuple(f"{side}_rendered" for side in SIDES)

GROUPS = (*PAPER, *MODERN)
"""All groups of measures of an attempt."""

_TO_COMPLETION = {field.name for group in MODERN for field in group.fields if field.kind == "number"}
"""Measures over the window to completion, whatever the settings."""

ATTEMPT = (
    *PLACE,
    words("outcome", "success, fell or timed_out"),
    count("target", "side of the target: -1 left, +1 right"),
    number("release", "release of the ball, from the first tick of the recording", "s"),
    number("duration", "time from the release to the end, including the hold", "s"),
    words("role", "purpose of the trial: practice, familiarisation, baseline, test, or catch"),
    count("catch", "1: a catch trial, without haptic feedback"),
    number("perturbation", "force of its perturbation, + = towards the target on the ball, else up; 0: none", "N"),
    number("perturbed_at", "onset of the perturbation after the release; NaN: none came", "s"),
    words("pushed", "where the perturbations of its block act: ball, board, left or right; empty: there are none"),
    number("push_onset", "when a perturbation began or, in a trial without one, would have begun; NaN: never", "s"),
    words("flags", "quality flags, separated by spaces"),
)
"""Columns of an attempt beside its measures."""

TRIALS = (*ATTEMPT, *(field for group in GROUPS for field in group.fields))
"""Columns of the table of trials: one row for each attempt."""


@dataclass(frozen=True, slots=True)
class Measured:
    """Extracted tables of a recording, in SI units; `paths` is empty if they are stored elsewhere."""

    blocks: Columns
    trials: Columns
    movements: Columns
    paths: Columns
    controls: Columns
    answers: Columns


FIELDS = {
    "blocks": BLOCKS,
    "trials": TRIALS,
    "movements": MOVEMENTS,
    "paths": PATHS,
    "controls": CONTROLS,
    "answers": ANSWERS,
}
"""Columns of each table of `Measured`."""


def measure(run: Run, readings: Readings) -> Measured:
    """Return the tables of a recording."""
    return identify_and_measure(run, readings)[1]


def identify_and_measure(run: Run, readings: Readings) -> tuple[Run, Measured]:
    """Return the tables of a recording, and its run with the people that its events tell: they are read once."""
    name = run.path.stem
    with Recording(run.path) as recording:
        columns, verdicts = _read(recording, readings)
        run = identified(run, recording)
        block = BlockData.of(recording, run.config, readings, columns)
        unknown = _unknown(recording, columns)
        repaired, events = bool(recording.recovery), recording.events()
    _refuse_repeats(run, block)
    flags = {(verdict.trial, verdict.attempt): verdict.flags for verdict in verdicts}
    takes = list(block.takes())
    return run, Measured(
        columns_of(BLOCKS, [block_row(run, block, repaired, unknown)]),
        columns_of(TRIALS, [attempt_row(name, take, flags) for take in takes]),
        movements(name, takes),
        paths_of(name, takes),
        columns_of(CONTROLS, list(controls(name, block, takes))),
        columns_of(ANSWERS, list(answers(name, events, questions_of(run.config.form)))),
    )


def _refuse_repeats(run: Run, block: BlockData) -> None:
    """Raise an error if two attempts have the same numbers, as in an imported table: they could not be told apart."""
    counts = Counter((one.trial, one.attempt) for one in block.attempts)
    for (trial, attempt), times in counts.items():
        if times > 1:
            raise RecordingError(
                f"{run.path}: found {times} attempts with the number {attempt} at trial {trial}, expected one; "
                "number the trials or the attempts of the imported table consecutively"
            )


def place_of(name: str, take: AttemptData) -> dict[str, Any]:
    """Return the columns that locate an attempt."""
    return {"recording": name, "trial": take.attempt.trial, "attempt": take.attempt.attempt}


def _read(recording: Recording, readings: Readings) -> tuple[Columns, tuple[Verdict, ...]]:
    """Read the needed columns and check the attempts' quality in one pass, so chunks are decompressed once."""
    wanted = tuple(dict.fromkeys((*columns_for(recording.config, readings), *_RENDERED)))
    columns = {name: np.empty(recording.counts["/ticks"], TICK[name]) for name in wanted}

    def portions() -> Iterator[Columns]:
        done = 0
        for found in recording.portions(tuple(dict.fromkeys((*wanted, *FIELDS_NEEDED)))):
            stop = done + found["tick"].size
            for name, column in columns.items():
                column[done:stop] = found[name]
            done = stop
            yield found

    return columns, judged_along(recording, portions())


def _unknown(recording: Recording, columns: Columns) -> int:
    """Count ticks without a known rendered force; read the agents' reports only if there may be any."""
    if any(unknown_ticks(columns[name]) for name in _RENDERED):
        columns = recording.columns(*_RENDERED)
    return sum(unknown_ticks(columns[name]) for name in _RENDERED)


def attempt_row(
    name: str, take: AttemptData, flags: Mapping[tuple[int, int], tuple[str, ...]], groups: Sequence[Group] = GROUPS
) -> dict[str, Any]:
    """Return the row of an attempt with its measures, and its quality flags by trial and attempt."""
    attempt, config = take.attempt, take.block.config
    row = place_of(name, take) | {
        "outcome": attempt.outcome,
        "target": attempt.target,
        "release": (attempt.tick - take.block.first) / RATE,
        "duration": attempt.duration,
        "role": trial_role(config, attempt.trial),
        "catch": int(attempt.trial in config.block.catch),
        "perturbation": config.perturbation.force_in(attempt.trial),
        "perturbed_at": take.block.perturbed_at(attempt),
        "pushed": config.perturbation.at if config.perturbation.trials else "",
        "push_onset": take.block.push_onset(attempt),
        "flags": " ".join(flags.get((attempt.trial, attempt.attempt), ())),
    }
    for group in groups:
        row |= group.of(take)
    if not take.knows("to_completion"):
        row |= dict.fromkeys(row.keys() & _TO_COMPLETION, np.nan)
    return row


def paths_of(name: str, takes: Sequence[AttemptData]) -> Columns:
    """Return the paths of the attempts of a recording, by its name."""
    places, parts = [place_of(name, take) for take in takes], [path(take) for take in takes]
    lengths = [len(part["time"]) for part in parts]
    whole: Columns = {}
    for field in PATHS:
        if field in PLACE:
            values = np.array([place[field.name] for place in places], DTYPES[field.kind])
            whole[field.name] = np.repeat(values, lengths)
        else:
            whole[field.name] = np.concatenate([np.empty(0), *(part[field.name] for part in parts)])
    return whole


def block_row(run: Run, block: BlockData, repaired: bool, unknown: int) -> dict[str, Any]:
    """Return the row of a recording's block; `unknown` ticks, in both hands, have no known rendered force."""
    metadata, config = run.metadata, run.config
    return {
        "recording": run.path.stem,
        "dyad": config.session.dyad,
        "session": config.session.name,
        "study": config.session.study,
        "pilot": int(config.session.pilot),
        "block": config.block.number,
        "part": int(metadata["part"]),
        "kind": design_of(config).kind,
        "role": role_of(config),
        "configuration": config.block.configuration,
        "force": config.block.force,
        "haptics": int(config.block.haptics),
        "force_scale": nan if config.block.trial_scales else config.block.force_scale,
        "force_delay": 1e-3 * config.block.force_delay_ms,
        "performer": run.people[0].label if len(run.people) == 1 else config.session.dyad,
        "left_by": _mover(run, "left"),
        "right_by": _mover(run, "right"),
        "simulated": int(all(person.simulated for person in run.people)),
        "exclude": " ".join(run.config.quality.exclude),
        "stand_ins": run.stand_ins,
        "run": metadata["session"],
        "opened_utc": metadata["opened_utc"],
        "duration": block.samples / RATE,
        "ticks": block.samples - block.missing,
        "missing": block.missing,
        "unknown_rendered": unknown,
        "trials": config.block.trials,
        "repaired": int(repaired),
        "attempts": len(block.attempts),
        "not_measured": "; ".join(
            f"{one.trial}.{one.attempt} {why}" for one in block.attempts if (why := block.unmeasured(one))
        ),
        "netboard": metadata["netboard"],
        "config_sha256": metadata["config_sha256"],
        "declaration": declaration_text(config.analysis),
        "factors": factors_text(config),
        "settings": settings_text(config),
    }


def _mover(run: Run, side: Side) -> str:
    kind: str = getattr(run.config.block, side)
    return next((person.label for person in run.people if side in person.sides), kind)
