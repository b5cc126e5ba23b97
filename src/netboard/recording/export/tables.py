"""Tidy tables of a recording: their columns, and their rows in batches.

A table has one kind of item per row (a tick, an attempt, an event) and one value per cell. The first column is always
the name of the recording, so tables of several recordings can be concatenated. Ticks are processed in batches and never
all in memory. Column meanings come from their definitions: the channels of a recording and the keys of its
configuration.
"""

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from operator import attrgetter
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.config import Config
from netboard.base.settings import tables as settings_tables
from netboard.base.tables.questionnaires import questions_of
from netboard.base.tick import TICK
from netboard.recording.export.answers import Answer, answers_in
from netboard.recording.export.factors import ExportedFactor, exported_factors
from netboard.recording.export.runs import refuse_copies
from netboard.recording.export.task import PARTNER_TEXT, PERTURBATION_TEXT, ROLE_TEXT
from netboard.recording.files.locate import sha256_of
from netboard.recording.files.reader import Recording
from netboard.recording.format.channels import CHANNELS, DTYPES, Channel, Field
from netboard.recording.format.rig import rig_of
from netboard.recording.format.summary import Attempt, attempts_along, from_release
from netboard.recording.integrity.quality_check import judged
from netboard.task.studies.factors import design_of, factors_of, trial_role

Rows = Mapping[str, NDArray[Any]]
"""Columns of equal length by name: int64, float64, or text (objects)."""


class OpenRecording:
    """A recording that is open for export, with data that several tables need.

    ``origin_ns``: server time of the first tick, the zero of ``time`` [ns].
    """

    def __init__(self, recording: Recording) -> None:
        self.recording = recording
        self.name = recording.path.stem  # name of the recording in its rows: the file name without suffix
        self.config = recording.config
        self.ticks = self.origin_ns = 0
        self.attempts: tuple[Attempt, ...] = attempts_along(self._counted())
        self.rig = rig_of(self.config, recording.metadata, recording.events(), self.attempts)

    def _counted(self) -> Iterator[NDArray[Any]]:
        for rows in self.recording.batches():
            if rows.size and not self.ticks:
                self.origin_ns = int(rows["time_ns"][0])
            self.ticks += rows.size
            yield rows


@dataclass(frozen=True, slots=True)
class ExportTable:
    """Definition of a table."""

    name: str
    about: str
    fields: tuple[Field, ...]
    rows: Callable[[OpenRecording], Iterator[Rows]]  # yields the rows in batches, in order

    def portions(self, source: OpenRecording) -> Iterator[Rows]:
        """Yield the rows in batches: every column, in order, with the dtype of its kind [SI]."""
        for rows in self.rows(source):
            count = len(next(iter(rows.values())))
            named = {"recording": np.full(count, source.name, object), **rows}
            yield {field.name: np.asarray(named[field.name], DTYPES[field.kind]) for field in self.fields}


_RECORDING = Field("recording", "string", "name of the recording", "")
_TIME = Field("time", "number", "server time since the first tick of the recording", "s")
_NUMBER = "number of the attempt in the recording, from 1, as in trials"

MISSING = "a missing number is NaN; a missing text is empty"
"""Representation of missing values in all tables."""


def _seconds(times_ns: NDArray[np.int64], source: OpenRecording) -> NDArray[np.float64]:
    """Convert server time to seconds from the first tick, as the nearest float (milliseconds print exactly)."""
    return (times_ns - source.origin_ns) / 1e9


# --- ticks -------------------------------------------------------------------------------------------------------


def _ticks(source: OpenRecording) -> Iterator[Rows]:
    """Yield the ticks, each with its attempt."""
    began = np.array([attempt.began for attempt in source.attempts], np.int64)
    first = np.array([attempt.tick for attempt in source.attempts], np.int64)
    stop = np.array([attempt.stop for attempt in source.attempts], np.int64)
    for rows in source.recording.batches():
        ticks = rows["tick"]
        number, since = np.zeros(rows.size, np.int64), np.full(rows.size, np.nan)
        if began.size:
            newest = np.searchsorted(began, ticks, "right") - 1
            within = (newest >= 0) & (ticks < stop[newest])
            number[within] = newest[within] + 1
            free = within & (ticks >= first[newest])
            since[free] = rows["run_ticks"][free] / 1000
        columns = {name: np.ascontiguousarray(rows[name]) for name in TICK.names or ()}
        yield {"time": _seconds(columns["time_ns"], source), "number": number, "since_release": since, **columns}


TICKS = ExportTable(
    "ticks",
    "one tick of 1 ms",
    (
        _RECORDING,
        _TIME,
        Field("number", "integer", f"{_NUMBER}, including levelling; 0 between attempts", "1"),
        Field("since_release", "number", "time since the ball was released; NaN unless it is free", "s"),
        *CHANNELS[0].columns,
    ),
    _ticks,
)


# --- attempts ----------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class _Trial:
    """An attempt, from its release on, and what the columns of the table of trials need besides."""

    number: int
    attempt: Attempt
    config: Config
    flags: tuple[str, ...] | None


def _setting_columns() -> Iterator[tuple[Field, Callable[[_Trial], Any]]]:
    """Yield the columns of the settings that identify participants and condition."""
    kept = {
        "session": ("name", "dyad", "pilot", "study", "participant_a", "participant_b", "hand_a", "hand_b", "seat_a"),
        "block": (
            *("number", "label", "configuration", "performer", "station", "force", "force_scale", "force_delay_ms"),
            *("left", "right"),
        ),
    }
    for table in settings_tables(Config):
        for key in table.keys:
            if key.name in kept.get(table.name, ()):
                kind = {bool: "integer", int: "integer", float: "number"}.get(type(key.default), "string")
                text = key.text.replace("true:", "1:")
                unit = key.unit or ("" if kind == "string" else "1")
                field = Field(f"{table.name}_{key.name}", kind, text, unit)
                yield field, attrgetter(f"config.{table.name}.{key.name}")


def _of_attempt(name: str, kind: str, text: str, unit: str) -> tuple[Field, Callable[[_Trial], Any]]:
    """Return the column of a field of `Attempt`."""
    return Field(name, kind, text, unit), attrgetter(f"attempt.{name}")


_TRIAL_COLUMNS: tuple[tuple[Field, Callable[[_Trial], Any]], ...] = (
    (Field("number", "integer", "number of the attempt in the recording, from 1", "1"), lambda trial: trial.number),
    *_setting_columns(),
    _of_attempt("trial", "integer", "number of the trial in the block, from 1", "1"),
    _of_attempt("attempt", "integer", "number of the attempt at this trial, from 1", "1"),
    _of_attempt("target", "integer", "side of the target: -1 left, +1 right", "1"),
    (
        Field("catch_trial", "integer", "1: a catch trial, without haptic feedback", "1"),
        lambda trial: trial.attempt.trial in trial.config.block.catch,
    ),
    (
        Field("perturbation", "number", PERTURBATION_TEXT, "N"),
        lambda trial: trial.config.perturbation.force_in(trial.attempt.trial),
    ),
    (Field("role", "string", ROLE_TEXT, ""), lambda trial: trial_role(trial.config, trial.attempt.trial)),
    (
        Field("kind", "string", "kind of block, as in the study; empty: none", ""),
        lambda trial: design_of(trial.config).kind,
    ),
    _of_attempt(
        "outcome",
        "string",
        "success, fell, timed_out, or the command or fault that ended it: skip, abort, stop, pause, fault; "
        "unfinished if the recording ends first",
        "",
    ),
    _of_attempt("completion", "number", "completion time of a success, else NaN", "s"),
    _of_attempt("began", "integer", "first tick of its levelling", "1"),
    _of_attempt("tick", "integer", "tick at which the ball was released", "1"),
    _of_attempt("stop", "integer", "first tick after its end", "1"),
    _of_attempt("duration", "number", "from the release to the end, including the hold", "s"),
    (
        Field("doubtful", "integer", "1: it has flags; 0: it has none; -1: not judged, as it has no end", "1"),
        lambda trial: -1 if trial.flags is None else bool(trial.flags),
    ),
    (
        Field("flags", "string", "why it is flagged, by the rules of [quality]: words separated by spaces", ""),
        lambda trial: " ".join(trial.flags or ()),
    ),
)
"""The columns of trials, each with its value for an attempt. A new column is one entry."""


def _trials(source: OpenRecording) -> Iterator[Rows]:
    """Yield all attempts: condition, outcome and quality flags."""
    flags = {verdict.release: verdict.flags for verdict in judged(source.recording)}
    counts = source.recording.columns("tick", "run_ticks")
    released = from_release(source.attempts, counts["tick"], counts["run_ticks"])
    trials = [
        _Trial(number, attempt, source.config, flags.get(whole.tick))
        for number, (attempt, whole) in enumerate(zip(released, source.attempts, strict=True), start=1)
    ]
    yield {
        field.name: np.array([value(trial) for trial in trials], DTYPES[field.kind]) for field, value in _TRIAL_COLUMNS
    }


TRIALS = ExportTable("trials", "one attempt at a trial", (_RECORDING, *(field for field, _ in _TRIAL_COLUMNS)), _trials)


def with_factors(factors: Sequence[ExportedFactor]) -> ExportTable:
    """Return the trials table with factor columns."""

    def rows(source: OpenRecording) -> Iterator[Rows]:
        block_factors = factors_of(source.config)
        levels = [[one.at(block_factors, attempt.trial) for one in factors] for attempt in source.attempts]
        for portion in _trials(source):
            yield {
                **portion,
                **{
                    field.name: np.array([trial[place][field.name] for trial in levels], DTYPES[field.kind])
                    for place, one in enumerate(factors)
                    for field in one.fields
                },
            }

    fields = (*TRIALS.fields, *(field for one in factors for field in one.fields))
    return ExportTable(TRIALS.name, TRIALS.about, fields, rows)


# --- the other channels ------------------------------------------------------------------------------------------


def _of_channel(
    name: str, channel: Channel, records: Callable[[Recording], Sequence[Any]], timed_by: str = ""
) -> ExportTable:
    """Return the table of a channel of records. ``timed_by``: the field with their server time, if they have one."""
    described = [
        Field(field.name, "string", f"{field.text}, as a JSON object", "") if field.kind == "texts" else field
        for field in channel.fields
    ]

    def rows(source: OpenRecording) -> Iterator[Rows]:
        found, columns = records(source.recording), dict[str, NDArray[Any]]()
        for field in channel.fields:
            values = [getattr(record, field.name) for record in found]
            if field.kind == "texts":
                values = [json.dumps(value, ensure_ascii=False) for value in values]
            columns[field.name] = np.array(values, object)
        yield {"time": _seconds(columns[timed_by].astype(np.int64), source), **columns} if timed_by else columns

    return ExportTable(name, channel.about, (_RECORDING, *((_TIME,) if timed_by else ()), *described), rows)


EVENTS = _of_channel("events", CHANNELS[1], Recording.events, "time_ns")
CLOCKS = _of_channel("clocks", CHANNELS[2], Recording.clocks, "t3_ns")
FRAMES = _of_channel("frames", CHANNELS[3], Recording.frames)
REMARKS = _of_channel("remarks", CHANNELS[4], Recording.remarks)


# --- recordings --------------------------------------------------------------------------------------------------


def _of_metadata(name: str, text: str) -> tuple[Field, Callable[[OpenRecording], Any]]:
    """Return the column of an entry of the metadata."""
    return Field(name, "string", text, ""), lambda source: source.recording.metadata.get(name, "")


_RECORDING_COLUMNS: tuple[tuple[Field, Callable[[OpenRecording], Any]], ...] = (
    (Field("file", "string", "file name of the recording", ""), lambda source: source.recording.path.name),
    (Field("sha256", "string", "SHA-256 of that file", ""), lambda source: sha256_of(source.recording.path)),
    _of_metadata("session", "id of the run of the server"),
    _of_metadata("part", "number of the file within its block, from 1"),
    _of_metadata("opened_utc", "when the file was opened, UTC"),
    _of_metadata("netboard", "version of netboard that recorded it"),
    _of_metadata("platform", "machine that recorded it"),
    _of_metadata("config_sha256", "SHA-256 of its configuration"),
    (
        Field("ended", "string", "how the recording ended: complete, if as planned; empty if it was recovered", ""),
        lambda source: source.recording.end.get("ended", ""),
    ),
    (
        Field("origin_ns", "integer", "server time of its first tick, the zero of time", "ns"),
        lambda source: source.origin_ns,
    ),
    (
        Field("left_device", "string", "what the left hand held, in words; several if it was replaced", ""),
        lambda source: "; then ".join(source.rig.hands.get("left", ())),
    ),
    (
        Field("right_device", "string", "what the right hand held, likewise", ""),
        lambda source: "; then ".join(source.rig.hands.get("right", ())),
    ),
    (
        Field(
            "stand_ins",
            "string",
            "what stood in for a haptic device or a screen, each with the words that confirmed it; empty: nothing",
            "",
        ),
        lambda source: source.rig.stand_ins_in_words,
    ),
    (
        Field("metadata", "string", "all metadata of the recording, as a JSON object", ""),
        lambda source: json.dumps(source.recording.metadata, ensure_ascii=False),
    ),
)
"""The columns of recordings, each with its value. A new column is one entry."""


def _recordings(source: OpenRecording) -> Iterator[Rows]:
    yield {field.name: np.array([value(source)], DTYPES[field.kind]) for field, value in _RECORDING_COLUMNS}


RECORDINGS = ExportTable(
    "recordings", "one recording", (_RECORDING, *(field for field, _ in _RECORDING_COLUMNS)), _recordings
)


def _of_answer(name: str, kind: str, text: str, unit: str) -> tuple[Field, Callable[[Answer], Any]]:
    """Return the column of a field of `Answer`."""
    return Field(name, kind, text, unit), attrgetter(name)


_ANSWER_COLUMNS: tuple[tuple[Field, Callable[[Answer], Any]], ...] = (
    _of_answer("participant", "string", "pseudonym of the participant", ""),
    _of_answer("station", "string", "where the participant sat: left or right", ""),
    _of_answer("block", "integer", "number of the block that the question is about", "1"),
    _of_answer("label", "string", "label of that block", ""),
    _of_answer("partner", "string", PARTNER_TEXT, ""),
    _of_answer("questionnaire", "string", "name of the questionnaire", ""),
    _of_answer("question", "string", "name of the question", ""),
    _of_answer("answer", "string", "the answer; empty: skipped", ""),
    _of_answer("value", "number", "the answer as a number; NaN if it is none, or the question asks for none", "1"),
    (Field("complete", "integer", "1: the participant finished the form", "1"), lambda one: int(one.complete)),
    _of_answer("seconds", "number", "how long the form was open", "s"),
    _of_answer("time_ns", "integer", "server time at which the answers came", "ns"),
)
"""The columns of answers, each with its value. A new column is one entry."""


def _answers(source: OpenRecording) -> Iterator[Rows]:
    found = answers_in(source.recording.events(), questions_of(source.config.form))
    yield {field.name: np.array([value(one) for one in found], DTYPES[field.kind]) for field, value in _ANSWER_COLUMNS}


ANSWERS = ExportTable(
    "answers", "one answer of a participant to a question", (_RECORDING, *(f for f, _ in _ANSWER_COLUMNS)), _answers
)

SMALL = (RECORDINGS, TRIALS, ANSWERS, EVENTS, CLOCKS, FRAMES, REMARKS)
"""Tables that are short enough for one file over all recordings."""

TABLES = (TICKS, *SMALL)
"""All tables, without factor columns."""


def small_tables(recordings: Sequence[Path]) -> tuple[ExportTable, ...]:
    """Return the tables of `SMALL` for these recordings, with factor columns in the trials table.

    Raises `RecordingError` if a recording is unreadable or repeated.
    """
    configs, metadata = [], []
    for path in recordings:
        with Recording(path) as recording:
            configs.append(recording.config)
            metadata.append((path, recording.metadata))
    refuse_copies(metadata)
    trials = with_factors(exported_factors(configs))
    return tuple(trials if table is TRIALS else table for table in SMALL)
