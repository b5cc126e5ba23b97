"""Motion-BIDS export: a Brain Imaging Data Structure dataset with motion data and the events of the task.

BIDS has no convention for two participants at once. Here each participant is a subject. Both members of a dyad share a
session label that no one else has. Equal run numbers are the same recording on the same clock: equal ``acq_time``, and
equal ``LATENCY`` in equal rows. ``sessions.tsv`` lists the partners, and ``docs/dyads.tsv`` lists them for the whole
dataset.

Numbers have the fewest digits that read back as the same float64; missing ones are ``n/a``.
"""

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from itertools import chain
from pathlib import Path
from typing import Any, TextIO

import numpy as np
from numpy.typing import NDArray

from netboard.base.files.cells import tsv_lines, tsv_number_lines
from netboard.base.tables.questionnaires import FormQuestion, questions_of
from netboard.recording.export import bids_texts as texts
from netboard.recording.export.answers import Answer, answers_in
from netboard.recording.export.factors import ExportedFactor, exported_factors
from netboard.recording.export.formats import Progress
from netboard.recording.export.runs import (
    Person,
    Run,
    configured_device,
    devices_of,
    pseudonym_of,
    require_people,
    runs_of,
)
from netboard.recording.export.signals import FRAME, Signal, signals_of
from netboard.recording.export.survey import PerturbationSpan, PhaseChange, Survey
from netboard.recording.export.trigger_pulses import pulses_of
from netboard.recording.files.reader import Recording
from netboard.recording.format.backfill import unknown_ticks
from netboard.recording.format.summary import Attempt
from netboard.stage.perturbing import PERTURBATION
from netboard.task.studies.factors import column_of, design_of, factors_of, role_of, trial_role

TASK = "boardandball"
"""Label of the task: its name without spaces."""

_SYSTEM = f"task-{TASK}_tracksys-stylus"

Row = dict[str, Any]
"""Row of a table: values by column name."""


def write(recordings: Sequence[Path], folder: Path, progress: Progress) -> None:
    """Write recordings as one Motion-BIDS dataset."""
    runs = runs_of(recordings)
    require_people(runs)
    factors = exported_factors([run.config for run in runs])
    scans: dict[tuple[str, str], list[Row]] = {}
    for run in runs:
        for label, row in _write_run(run, factors, folder, progress).items():
            scans.setdefault((label, run.session), []).append(row)
    for (label, session), rows in scans.items():
        _write_table(folder / f"sub-{label}/ses-{session}/sub-{label}_ses-{session}_scans.tsv", rows)
    began = {session: min(row["acq_time"] for row in rows) for (_, session), rows in scans.items()}
    _write_people(runs, factors, folder, began)
    _write_answers(runs, folder)
    _write_texts(runs, factors, folder)


def _write_run(run: Run, factors: Sequence[ExportedFactor], folder: Path, progress: Progress) -> dict[str, Row]:
    """Write the files of each person in a recording; return their rows of ``scans.tsv``, by label."""
    source = folder / "sourcedata" / run.path.stem
    source.mkdir(parents=True)
    scans: dict[str, Row] = {}
    files: list[tuple[TextIO, tuple[Signal, ...]]] = []
    with Recording(run.path) as recording, ExitStack() as stack:
        (source / "netboard.toml").write_text(recording.config_text, encoding="utf-8")
        survey = Survey(recording)
        for person in run.people:
            stem = f"sub-{person.label}_ses-{run.session}_{_SYSTEM}_run-{run.number:02d}"
            place = folder / f"sub-{person.label}" / f"ses-{run.session}" / "motion"
            place.mkdir(parents=True, exist_ok=True)
            signals = signals_of(person.sides)
            _write_table(place / f"{stem}_channels.tsv", map(_channel, [texts.LATENCY, *signals]))
            if events := _with_pulses(_events(survey, run, factors), recording, survey):
                _write_table(place / f"{stem}_events.tsv", events)
            _write_json(place / f"{stem}_motion.json", _motion(run, recording, survey, person, signals))
            motion = (place / f"{stem}_motion.tsv").open("x", encoding="ascii", newline="")
            files.append((stack.enter_context(motion), signals))
            scans[person.label] = _scan(run, recording, survey, person, f"motion/{stem}_motion.tsv", factors)
        for rows in survey.portions(recording, progress):
            for file, signals in files:
                file.writelines(_lines(rows, signals, survey.origin_ns))
    return scans


def _lines(rows: NDArray[Any], signals: Sequence[Signal], origin_ns: int) -> Iterator[str]:
    """Format ticks as lines of a motion file."""
    times = (divmod(time_ns, 1_000_000_000) for time_ns in (rows["time_ns"] - origin_ns).tolist())
    latency = (f"{seconds}.{rest:09d}" for seconds, rest in times)
    columns = (_cells(rows[signal.field]) for signal in signals)
    return tsv_number_lines((latency, *columns))


def _cells(values: NDArray[Any]) -> Iterable[str]:
    cells = map(repr, values.tolist())
    return (texts.MISSING if cell == "nan" else cell for cell in cells) if np.isnan(values).any() else cells


# --- the lines of tables ------------------------------------------------------------------------------------------


def _channel(signal: Signal) -> Row:
    return {
        "name": signal.name,
        "component": signal.axis or texts.MISSING,
        "type": signal.kind,
        "tracked_point": signal.point,
        "units": texts.MISSING if signal.unit == "1" else signal.unit,
        "placement": "held in the hand" if signal.point.endswith("stylus") else texts.MISSING,
        "reference_frame": FRAME if signal.axis else texts.MISSING,
        "description": signal.about,
    }


def _events(survey: Survey, run: Run, factors: Sequence[ExportedFactor]) -> list[Row]:
    """Return the rows of ``events.tsv``: levelling phases, attempts, and changes of the trial phase."""
    block_factors = factors_of(run.config)
    rows = [_event(survey, change, change.tick, 0, change.name) for change in survey.phase_changes]
    for one in survey.attempts:
        if one.began < one.tick:
            rows.append(_event(survey, one, one.began, survey.span(one.began, one.tick), "levelling"))
        rows.append(
            _event(survey, one, one.tick, survey.span(one.tick, one.stop), "attempt")
            | {
                "outcome": one.outcome,
                "completion_time": one.completion,
                "catch_trial": one.trial in run.config.block.catch,
                "perturbation": run.config.perturbation.force_in(one.trial),
                "flags": " ".join(survey.flags.get(one.tick, ())),
            }
        )
    for push in survey.perturbations:
        rows.append(
            _event(survey, push, push.tick, survey.span(push.tick, push.stop), PERTURBATION)
            | {"perturbation": run.config.perturbation.force_in(push.trial)}
        )
    for row in rows:
        row["role"] = trial_role(run.config, row["trial"])
        for factor in factors:
            row.update(factor.at(block_factors, row["trial"]))
    return sorted(rows, key=lambda row: row["onset"])


def _with_pulses(rows: list[Row], recording: Recording, survey: Survey) -> list[Row]:
    """Add the pulses of a trigger box, if there are any, and their codes as ``value``, as BIDS names it."""
    pulses = list(pulses_of(recording))
    if not pulses:
        return rows
    empty = dict.fromkeys(rows[0] if rows else ("onset", "duration", "trial_type"), texts.MISSING)
    added = [
        empty
        | {
            "onset": (pulse.time_ns - survey.origin_ns) / 1e9,
            "duration": pulse.width,
            "trial_type": pulse.kind,
            "value": pulse.code,
            "trigger_event": pulse.event,
            "trigger_latency": pulse.latency,
        }
        for pulse in pulses
    ]
    columns = {"value": texts.MISSING, "trigger_event": texts.MISSING, "trigger_latency": texts.MISSING}
    return sorted([*(row | columns for row in rows), *added], key=lambda row: row["onset"])


def _event(survey: Survey, of: Attempt | PhaseChange | PerturbationSpan, tick: int, duration: float, kind: str) -> Row:
    return {
        "onset": survey.seconds(tick),
        "duration": duration,
        "trial_type": kind,
        "trial": of.trial,
        "attempt": of.attempt,
        "target": {-1: "left", 1: "right"}.get(of.target, texts.MISSING),
        "outcome": texts.MISSING,
        "completion_time": texts.MISSING,
        "catch_trial": texts.MISSING,
        "perturbation": texts.MISSING,
        "role": texts.MISSING,
        "flags": texts.MISSING,
    }


def _scan(
    run: Run, recording: Recording, survey: Survey, person: Person, filename: str, factors: Sequence[ExportedFactor]
) -> Row:
    """Return the row of ``scans.tsv``: time and condition."""
    block = run.config.block
    return {
        "filename": filename,
        "acq_time": survey.began.strftime("%Y-%m-%dT%H:%M:%S.%fZ"),
        "block": block.number,
        "part": run.metadata["part"],
        "label": block.label,
        "kind": design_of(run.config).kind,
        "role": role_of(run.config),
        "configuration": block.configuration,
        "stylus": "+".join(person.sides),
        "force": block.force,
        "force_scale": block.force_scale,
        "force_delay_ms": block.force_delay_ms,
        "catch_trials": " ".join(map(str, block.catch)),
        "other_hand": _other_hand(run, person),
        "device": "+".join(filter(None, (configured_device(run.config, run.metadata, side) for side in person.sides))),
        "simulated": person.simulated,
        "stand_ins": run.stand_ins or "none",
        "pilot": run.config.session.pilot,
        "ended": recording.end.get("ended", "recovered"),
        "recording": run.path.name,
        **{name: value for one in factors for name, value in one.over(factors_of(run.config)).items()},
    }


def _other_hand(run: Run, person: Person) -> str:
    """Describe what moves the other end of the board."""
    partner = next((other for other in run.people if other is not person), None)
    if partner is not None:
        return f"sub-{partner.label}"
    block = run.config.block
    if block.configuration == "bimanual":
        return "own"
    return block.right if person.sides == ("left",) else block.left


# --- the files of the dataset -------------------------------------------------------------------------------------


def _write_people(runs: Sequence[Run], factors: Sequence[ExportedFactor], folder: Path, began: dict[str, str]) -> None:
    people = {person.label: person for run in reversed(runs) for person in run.people}
    real = {person.label for run in runs for person in run.people if not person.simulated}
    rows = [
        _participant(person, label in real) | _levels_of_person(label, runs, factors)
        for label, person in people.items()
    ]
    _write_table(folder / "participants.tsv", rows)
    sessions: dict[str, dict[str, str]] = {}
    for run in runs:
        sessions.setdefault(run.session, {}).update({person.letter: f"sub-{person.label}" for person in run.people})
    names = {run.session: run.config.session for run in runs}
    dyads: list[Row] = [
        {
            "dyad": names[session].dyad,
            "session_id": f"ses-{session}",
            "session_name": names[session].name,
            "study": names[session].study,
            "participant_a": members.get("A", ""),
            "participant_b": members.get("B", ""),
            "runs": sum(run.session == session for run in runs),
        }
        for session, members in sessions.items()
    ]
    (folder / "docs").mkdir()
    _write_table(folder / "docs" / "dyads.tsv", dyads)
    for label in people:
        rows = [
            _session(row, "B" if row["participant_a"] == f"sub-{label}" else "A", began[session])
            for session, row in zip(sessions, dyads, strict=True)
            if f"sub-{label}" in (row["participant_a"], row["participant_b"])
        ]
        _write_table(folder / f"sub-{label}" / f"sub-{label}_sessions.tsv", rows)


def _write_answers(runs: Sequence[Run], folder: Path) -> None:
    """Write the answers to questionnaires: a table with its sidecar for each, a row for each form."""
    forms: dict[str, dict[tuple[str, ...], Row]] = {}
    questions: dict[str, FormQuestion] = {}
    # Of all runs of a session: late answers are recorded in the next block, in which the participant may not play.
    labels = {(run.session, pseudonym_of(run, person)): person.label for run in runs for person in run.people}
    for run in runs:
        questions |= questions_of(run.config.form)
        with Recording(run.path) as recording:
            found = answers_in(recording.events(), questions)
        for one in found:
            key = (run.session, one.participant, str(one.block), str(one.time_ns))
            row = forms.setdefault(one.questionnaire, {}).setdefault(key, _form_row(one, run.session, labels))
            row[one.question] = _answer(one, questions)
    for name, rows in forms.items():
        (folder / "phenotype").mkdir(exist_ok=True)
        _write_table(folder / "phenotype" / f"{name}.tsv", list(rows.values()))
        _write_json(folder / "phenotype" / f"{name}.json", texts.of_questionnaire(name, questions))


def _answer(one: Answer, questions: Mapping[str, FormQuestion]) -> object:
    """Return an answer for a cell: a number, if the question asks for one."""
    if f"{one.questionnaire}.{one.question}" not in questions or np.isnan(one.value):
        return one.answer or texts.MISSING
    return int(one.value) if one.value.is_integer() else one.value


def _form_row(one: Answer, session: str, labels: Mapping[tuple[str, str], str]) -> Row:
    label = labels.get((session, one.participant), "")
    return {
        "participant_id": f"sub-{label}" if label else texts.MISSING,
        "session_id": f"ses-{session}",
        "block": one.block,
        "label": one.label,
        "partner": one.partner,
        "complete": one.complete,
        "seconds": one.seconds,
    }


def _participant(person: Person, real: bool) -> Row:
    return {
        "participant_id": f"sub-{person.label}",
        "species": "homo sapiens" if real else texts.MISSING,
        "age": texts.MISSING,
        "sex": texts.MISSING,
        "handedness": person.handedness,
        "simulated": not real,
    }


def _levels_of_person(label: str, runs: Sequence[Run], factors: Sequence[ExportedFactor]) -> Row:
    """Return the levels of the between-dyad factors; for a person in several dyads, all levels."""
    attended = [run for run in runs if any(person.label == label for person in run.people)]
    row: Row = {}
    for one in (one for one in factors if one.scope == "dyad"):
        found = [one.over(factors_of(run.config)) for run in attended]
        for name in found[0]:
            values = list(dict.fromkeys(levels[name] for levels in found if levels[column_of(one.name)]))
            row[name] = values[0] if len(values) == 1 else ", ".join(map(str, values))
    return row


def _session(dyad: Row, partner: str, began: str) -> Row:
    return {
        "session_id": dyad["session_id"],
        "acq_time": began,
        "dyad": dyad["dyad"],
        "session_name": dyad["session_name"],
        "partner": dyad[f"participant_{partner.lower()}"],
    }


def _write_texts(runs: Sequence[Run], factors: Sequence[ExportedFactor], folder: Path) -> None:
    """Write the descriptions and sidecars that all runs share."""
    studies = sorted({run.config.session.study for run in runs})
    _write_json(folder / "dataset_description.json", texts.description(studies))
    (folder / "README.md").write_text(texts.README, encoding="utf-8")
    for name, sidecar in texts.SIDECARS.items():
        more = texts.of_factors(factors, name)
        _write_json(folder / name.format(task=f"task-{TASK}", system=_SYSTEM), sidecar | more)


def _motion(run: Run, recording: Recording, survey: Survey, person: Person, signals: Sequence[Signal]) -> Row:
    """Return the sidecar of a motion file."""
    devices = [device for device in devices_of(run.config, recording) if device.side in person.sides]
    kinds = [signal.kind for signal in signals]
    return {
        "Manufacturer": _joined(device.maker for device in devices),
        "ManufacturersModelName": _joined(device.model for device in devices),
        "DeviceSerialNumber": _joined(device.serial for device in devices),
        "SoftwareVersions": f"netboard {run.metadata['netboard']}",
        "Instructions": run.config.block.instructions or texts.INSTRUCTIONS,
        "RecordingDuration": survey.duration,
        "SamplingFrequencyEffective": survey.rate,
        "MotionChannelCount": 1 + len(kinds),
        "LATENCYChannelCount": 1,
        "POSChannelCount": kinds.count("POS"),
        "VELChannelCount": kinds.count("VEL"),
        "MISCChannelCount": kinds.count("MISC"),
        "TrackedPointsCount": len(person.sides),
        "RenderedForceUnknownRows": _unknown(recording, person),
    }


def _unknown(recording: Recording, person: Person) -> int:
    """Count the rows with an unknown rendered force, from the first known one on."""
    columns = recording.columns(*(f"{side}_rendered" for side in person.sides))
    return sum(unknown_ticks(rendered) for rendered in columns.values())


def _joined(values: Iterable[str]) -> str:
    """Join the known values of one device or two."""
    return " + ".join(dict.fromkeys(value or texts.MISSING for value in values))


def _write_json(path: Path, values: Row) -> None:
    path.write_text(json.dumps(values, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")


def _write_table(path: Path, rows: Iterable[Row]) -> None:
    """Write a table with a header line, and with the columns of all its rows."""
    lines = list(rows)
    columns = list(dict.fromkeys(chain.from_iterable(lines)))
    with path.open("x", encoding="utf-8", newline="") as file:
        cells = ([row.get(name, texts.MISSING) for name in columns] for row in lines)
        file.writelines(tsv_lines([columns, *cells], _cell))


def _cell(value: object) -> str:
    """Format a table cell. BIDS has no quoting, so spaces replace tabs and line feeds."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        return texts.MISSING if np.isnan(value) else repr(value)
    return " ".join(str(value).split()) or texts.MISSING
