"""NWB export: one file per person and run, in the layout of neurophysiology archives.

An NWB file has one subject, so each member of a dyad gets a file, with equal session id and start time. The two share a
clock: equal times are the same moments. A run is one recording, a block or a part of it. The file layout is that of the
DANDI archive, ``sub-LABEL/sub-LABEL_ses-SESSION_run-NN_behavior.nwb``.

Data sets are allocated first and then filled in batches, so memory does not grow with the recording. Evenly spaced rows
have a rate; if ticks are missing, every row has a time stamp.
"""

from collections.abc import Sequence
from contextlib import ExitStack
from io import FileIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.device_kind import WORDS, DeviceKind
from netboard.base.tick import TICK, TICK_SECONDS
from netboard.recording.export.factors import ExportedFactor, exported_factors
from netboard.recording.export.formats import Progress, library
from netboard.recording.export.runs import HandDevice, Person, Run, devices_of, require_people, runs_of
from netboard.recording.export.signals import FRAME_TEXT, Signal, signals_of
from netboard.recording.export.survey import PORTION, Survey
from netboard.recording.export.task import ATTEMPT_TEXTS, EVENT_TEXTS, KEYWORDS, TASK_TEXT
from netboard.recording.export.trigger_pulses import KINDS, pulses_of
from netboard.recording.files.reader import Recording
from netboard.task.studies.factors import factors_of, trial_role

Filled = list[tuple[Any, tuple[str, ...]]]
"""Allocated data sets, and the tick fields that fill each."""

_UNITS = {
    "m": "meters",
    "m/s": "meters/second",
    "rad": "radians",
    "rad/s": "radians/second",
    "N": "newtons",
    "1": "n/a",
}
"""Names of units by symbol."""

_UNKNOWN_AGE = "P0D/"
"""Age range for archives that require an age: netboard does not record it, so any age from birth."""

_COLUMNS = {
    "levelling_time": "start of the levelling before the attempt [s]",
    **ATTEMPT_TEXTS,
    "condition": "configuration of the block, and its force condition",
    "force_scale": "factor of the haptic feedback [1]",
    "force_delay": "delay of the haptic feedback [s]",
}
"""Columns of the trials table, besides start (the release of the ball) and stop."""

_PULSE_COLUMNS = {
    "kind": "trigger or trigger_input",
    "event": "event of the session for which the pulse was made; empty of a pulse at the input",
    "code": "code of the pulse [1]",
    "width": "duration of the pulse, NaN if it is not known [s]",
    "latency": "time from the nominal time of the event's tick to the pulse, NaN of a pulse at the input [s]",
}
"""Columns of the table of pulses, besides the time."""

_EVENTS = "Changes of the phase of a trial, at the tick that caused them. " + "; ".join(
    f"{name}: {text}" for name, text in EVENT_TEXTS.items()
)
"""Description of the events table."""


def write(recordings: Sequence[Path], folder: Path, progress: Progress) -> None:
    """Write recordings as NWB files."""
    pynwb, h5py = library("pynwb", "nwb"), library("h5py", "nwb")
    runs = runs_of(recordings)
    require_people(runs)
    factors = exported_factors([run.config for run in runs])
    for run in runs:
        with Recording(run.path) as recording, ExitStack() as stack:
            survey = Survey(recording)
            filled: Filled = []
            for person in run.people:
                stem = f"sub-{person.label}_ses-{run.session}_run-{run.number:02d}_behavior"
                path = folder / f"sub-{person.label}" / f"{stem}.nwb"
                path.parent.mkdir(exist_ok=True)
                layout = NwbLayout(pynwb, run, recording, survey, person, factors)
                file = stack.enter_context(h5py.File(stack.enter_context(_File(path, "w+b")), "w"))
                stack.enter_context(pynwb.NWBHDF5IO(file=file, mode="w")).write(layout.file)
                filled += layout.filled
            _fill(recording, survey, filled, progress)


class _File(FileIO):
    """A file that raises an error of the disk only when it is closed: HDF5 crashes after a failed write."""

    error: OSError | None = None

    def write(self, data: Any) -> int:
        """Write everything, or after an error nothing."""
        view = memoryview(data).cast("B")
        rest = view
        try:
            while rest and self.error is None:
                rest = rest[super().write(rest) :]
        except OSError as error:
            self.error = error
        return len(view)

    def close(self) -> None:
        """Close the file; raise the error of the disk."""
        super().close()
        if self.error is not None:
            raise self.error


def _fill(recording: Recording, survey: Survey, filled: Filled, progress: Progress) -> None:
    done = 0
    for rows in survey.portions(recording, progress):
        for data, fields in filled:
            data.dataset[done : done + rows.size] = _values(rows, fields, survey)
        done += rows.size


def _values(rows: NDArray[Any], fields: tuple[str, ...], survey: Survey) -> NDArray[Any]:
    if fields == ("time_ns",):
        return (rows["time_ns"] - survey.origin_ns) / 1e9
    return rows[fields[0]] if len(fields) == 1 else np.column_stack([rows[field] for field in fields])


class NwbLayout:
    """File of one person in one run, complete except for the values in its data sets."""

    def __init__(
        self,
        pynwb: Any,
        run: Run,
        recording: Recording,
        survey: Survey,
        person: Person,
        factors: Sequence[ExportedFactor] = (),
    ) -> None:
        self._pynwb, self._survey, self._factors = pynwb, survey, factors
        self._timed: Any = None  # the first series, whose times all others share
        self.filled: Filled = []  # data sets of the file, and the tick fields that fill each
        session, block = run.config.session, run.config.block
        part = run.metadata["part"]
        self.file = pynwb.NWBFile(
            session_description=_session_text(run, person),
            identifier=f"{run.metadata['session']}_block{block.number:02d}_part{part}_{person.label}",
            session_start_time=survey.began,
            session_id=run.session,
            experiment_description=f"Study {session.study}" if session.study else "No study: a single block",
            keywords=list(KEYWORDS),
            data_collection=f"Exported from {run.path.name}. Configuration (TOML):\n{recording.config_text}",
            was_generated_by=[["netboard", run.metadata["netboard"]]],
        )
        self.file.subject = pynwb.file.Subject(
            subject_id=person.label,
            description=_described(run, person),
            species="Homo sapiens",
            sex="U",
            age=_UNKNOWN_AGE,
        )
        for side in person.sides:
            own = [device for device in devices_of(run.config, recording) if device.side == side]
            for number, device in enumerate(own, start=1):
                self._add_device(device, f" {number}" if len(own) > 1 else "")
        self._add_signals(signals_of(person.sides))
        self._add_trials(run)
        self._add_events()
        self._add_pulses(recording)

    def _add_device(self, device: HandDevice, number: str) -> None:
        """Describe a device in the hand; ``number``: if it was replaced in the run."""
        model = self.file.create_device_model(
            name=f"{device.side} {device.model or device.backend or 'unknown'}{number}",
            manufacturer=device.maker or "unknown",
            description=f"{WORDS[DeviceKind(device.kind)]}; netboard's backend {device.backend or 'unknown'}",
        )
        self.file.create_device(
            name=f"{device.side} stylus{number}",
            description=f"What the {device.side} end of the board is moved with",
            serial_number=device.serial or "unknown",
            model=model,
        )

    def _add_signals(self, signals: Sequence[Signal]) -> None:
        """Add the positions, and the other signals grouped by their object."""
        behavior = self.file.create_processing_module("behavior", "Styluses, forces, and the virtual board and ball")
        positions: dict[str, list[Signal]] = {}
        others: dict[str, list[Signal]] = {}
        for signal in signals:
            (positions if signal.kind == "POS" else others).setdefault(signal.point, []).append(signal)
        series = [self._position(point, of_point) for point, of_point in positions.items()]
        behavior.add(self._pynwb.behavior.Position(spatial_series=series))
        for point, of_point in others.items():
            series = [self._signal(signal) for signal in of_point]
            behavior.add(self._pynwb.behavior.BehavioralTimeSeries(name=point, time_series=series))

    def _position(self, point: str, signals: Sequence[Signal]) -> Any:
        return self._series(
            self._pynwb.behavior.SpatialSeries,
            point,
            self._data(tuple(signal.field for signal in signals), np.dtype(np.float64)),
            description=f"Position of the {point.replace('_', ' ')} as sent: columns x, y, z",
            reference_frame=FRAME_TEXT,
            unit=_UNITS["m"],
        )

    def _signal(self, signal: Signal) -> Any:
        data = self._data((signal.field,), TICK[signal.field])
        return self._series(
            self._pynwb.TimeSeries, signal.name, data, description=signal.about, unit=_UNITS[signal.unit]
        )

    def _series(self, kind: Any, name: str, data: Any, **texts: str) -> Any:
        """Create a series with a rate, or with time stamps that all series share."""
        if self._survey.regular:
            return kind(name=name, data=data, starting_time=0.0, rate=1 / TICK_SECONDS, **texts)
        times = self._timed or self._data(("time_ns",), np.dtype(np.float64))
        series = kind(name=name, data=data, timestamps=times, **texts)
        self._timed = self._timed or series
        return series

    def _data(self, fields: tuple[str, ...], dtype: np.dtype[Any]) -> Any:
        """Allocate a data set."""
        count = self._survey.ticks
        width = (len(fields),) if len(fields) > 1 else ()
        data = self._pynwb.H5DataIO(
            shape=(count, *width),
            dtype=dtype,
            chunks=(min(count, PORTION), *width),
            compression="gzip",
            shuffle=True,
            fletcher32=True,
        )
        self.filled.append((data, fields))
        return data

    def _add_trials(self, run: Run) -> None:
        """Fill the table of attempts; a file cannot have a table without rows."""
        if not self._survey.attempts:
            return
        for name, text in _COLUMNS.items():
            self.file.add_trial_column(name, text)
        for field in (field for one in self._factors for field in one.fields):
            self.file.add_trial_column(field.name, f"{field.text} [{field.unit}]" if field.unit else field.text)
        block, block_factors = run.config.block, factors_of(run.config)
        for one in self._survey.attempts:
            self.file.add_trial(
                start_time=self._survey.seconds(one.tick),
                stop_time=self._survey.seconds(one.stop),
                levelling_time=self._survey.seconds(one.began),
                trial=one.trial,
                attempt=one.attempt,
                target={-1: "left", 1: "right"}.get(one.target, "n/a"),
                outcome=one.outcome,
                completion_time=one.completion,
                flags=" ".join(self._survey.flags.get(one.tick, ())),
                condition=f"{block.configuration}, force {block.force}",
                catch_trial=one.trial in block.catch,
                perturbation=run.config.perturbation.force_in(one.trial),
                role=trial_role(run.config, one.trial),
                force_scale=block.force_scale,
                force_delay=block.force_delay_ms / 1000,
                **{name: value for each in self._factors for name, value in each.at(block_factors, one.trial).items()},
            )

    def _add_events(self) -> None:
        """Fill the table of changes of the trial phase; a file cannot have a table without rows."""
        if not self._survey.phase_changes:
            return
        table = self._pynwb.event.EventsTable(name="trial_events", description=_EVENTS)
        table.add_column(name="event", description="what happened")
        table.add_column(name="trial", description=_COLUMNS["trial"])
        table.add_column(name="attempt", description=_COLUMNS["attempt"])
        for one in self._survey.phase_changes:
            table.add_row(
                timestamp=self._survey.seconds(one.tick), event=one.name, trial=one.trial, attempt=one.attempt
            )
        self.file.add_events_table(table)

    def _add_pulses(self, recording: Recording) -> None:
        """Fill the table of the pulses of a trigger box, if there are any."""
        pulses = list(pulses_of(recording))
        if not pulses:
            return
        text = "; ".join(f"{kind}: {text}" for kind, text in KINDS.items())
        table = self._pynwb.event.EventsTable(name="trigger_pulses", description=text)
        for name, about in _PULSE_COLUMNS.items():
            table.add_column(name=name, description=about)
        for pulse in pulses:
            table.add_row(
                timestamp=(pulse.time_ns - self._survey.origin_ns) / 1e9,
                kind=pulse.kind,
                event=pulse.event,
                code=pulse.code,
                width=pulse.width,
                latency=pulse.latency,
            )
        self.file.add_events_table(table)


def _described(run: Run, person: Person) -> str:
    text = f"Participant {person.letter} of dyad {run.config.session.dyad}, dominant hand: {person.handedness}."
    partner = "".join(f" Partner: {other.label}." for other in run.people if other is not person)
    return text + partner + " Simulated: no person moved the device." * person.simulated


def _session_text(run: Run, person: Person) -> str:
    block = run.config.block
    hands = f"the {person.sides[0]} stylus" if len(person.sides) == 1 else "both styluses"
    label = f" ({block.label})" if block.label else ""
    return (
        f"{TASK_TEXT} This is run {run.number} of session {run.session}: block {block.number} of "
        f"{block.blocks}{label}, {block.configuration}, force condition: {block.force}. The subject moved {hands}."
    )
