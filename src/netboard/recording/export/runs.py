"""Runs: which person moved which hand in which recording, for the export formats that are standards.

A recording is one *run* of a dyad's session. Its persons are those who moved a hand in it: both participants in a
dyadic block, the performer in a bimanual one. A fixed hand or one moved by a robot has no person. Labels consist of
letters and digits. The session label combines dyad and session, so both members of the dyad share it and no one else
has it. Runs are numbered in order of time, jointly for both persons, so equal run numbers are one recording.
"""

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import Literal

from netboard.base.config import SIDES, Config, Side
from netboard.base.device_kind import DeviceKind, held_by
from netboard.base.errors import RecordingError
from netboard.base.process.workers import cores
from netboard.recording.files.copies import find_repeats
from netboard.recording.files.reader import Recording
from netboard.recording.format.claims import whole_number
from netboard.recording.format.rig import RecordedRig, agents_in_use, rig_of
from netboard.task.plans.plan import OTHER_SIDE
from netboard.task.trials.exclusion import is_simulated

Letter = Literal["A", "B"]
"""Participant of a dyad."""

_NEEDED = ("session", "part", "opened_log_ns", "opened_monotonic_ns", "welcome_server_ns", "netboard")
"""Metadata that a run needs; a recovered recording may have lost some."""

MAKERS_BEFORE = {"falcon": "Novint", "openhaptics": "3D Systems", "spacemouse": "3Dconnexion"}
"""Manufacturer of each backend's devices in recordings from before agents stated it."""


@dataclass(frozen=True, slots=True)
class Person:
    """A person who moved one stylus or both in a run."""

    letter: Letter
    label: str  # label of the person: the pseudonym or, without one, that of the dyad with the letter
    handedness: str
    sides: tuple[Side, ...]
    simulated: bool


@dataclass(frozen=True, slots=True)
class Run:
    """A recording and its place in a session."""

    path: Path
    metadata: dict[str, str]
    config: Config
    session: str  # label of the session: dyad and session combined
    number: int
    people: tuple[Person, ...]
    stand_ins: str = ""  # what stood in for a haptic device or a screen, and who confirmed it; empty: nothing


def runs_of(recordings: Sequence[Path]) -> tuple[Run, ...]:
    """Return the runs of recordings, which are read in threads: decompression leaves them to each other.

    Raises `RecordingError` if a recording is unreadable, empty or repeated, or if two names yield the same label.
    """
    with ThreadPoolExecutor(cores()) as pool:
        return numbered(list(pool.map(unnumbered_run, recordings)))


def require_people(runs: Sequence[Run]) -> None:
    """Refuse blocks in which no person takes part, for a format with a file for each person."""
    for run in runs:
        if not run.people:
            movers = ", ".join(f"{side}: {getattr(run.config.block, side)}" for side in SIDES)
            raise RecordingError(
                f"{run.path}: no person takes part in this block ({movers}), and this format has a file for each "
                "person; leave it out, or export it to csv, parquet, mat or xdf"
            )


def unnumbered_run(path: Path) -> Run:
    """Return the run of a recording, numbered 0; raises `RecordingError` if the recording is unreadable or empty."""
    with Recording(path) as recording:
        return identified(_described(recording), recording)


def described_run(path: Path) -> Run:
    """Return the run of a recording without reading any event: whether its people are simulated is not known yet."""
    with Recording(path) as recording:
        return _described(recording)


def _described(recording: Recording) -> Run:
    path = recording.path
    if not recording.counts["/ticks"]:
        raise RecordingError(f"{path}: contains no ticks; leave it out (netboard analyse: --skip-unreadable)")
    if lost := [name for name in _NEEDED if name not in recording.metadata]:
        raise RecordingError(f"{path}: lost its {', '.join(lost)} when it was damaged; leave it out")
    metadata, config = recording.metadata, recording.config
    session = _label(config.session.dyad + config.session.name)
    return Run(path, metadata, config, session, number=0, people=tuple(people_in(config, metadata)))


def identified(run: Run, recording: Recording) -> Run:
    """Return a run with its people and stand-ins, as the events of its recording tell."""
    rig = rig_of(run.config, run.metadata, recording.events(), recording.attempts())
    people = tuple(people_in(run.config, run.metadata, rig))
    return replace(run, people=people, stand_ins=rig.stand_ins_in_words)


def numbered(runs: Sequence[Run]) -> tuple[Run, ...]:
    """Number the runs; raises `RecordingError` if one is repeated, or if two names yield the same label."""
    sessions: dict[tuple[str, str], list[Run]] = {}
    for run in runs:
        sessions.setdefault((run.config.session.dyad, run.config.session.name), []).append(run)
    found = tuple(run for who in sorted(sessions) for run in _numbered_session(sessions[who]))
    _refuse_repeats(found)
    return found


def _numbered_session(session: Sequence[Run]) -> Iterator[Run]:
    """Yield the runs of a session in order of time, with their numbers.

    The wall clock orders only servers that began with the same block, as after a restart: a step of it does not change
    the order of their blocks.
    """
    began: dict[str, tuple[int, int]] = {}
    for run in session:
        server, first = run.metadata["session"], (run.config.block.number, int(run.metadata["opened_log_ns"]))
        began[server] = min(first, began.get(server, first))

    def place(run: Run) -> tuple[tuple[int, int], str, int, int, int, Path]:
        server, opened = run.metadata["session"], int(run.metadata["opened_log_ns"])
        return began[server], server, run.config.block.number, whole_number(run.metadata["part"]) or 0, opened, run.path

    for number, run in enumerate(sorted(session, key=place), start=1):
        yield replace(run, number=number)


def people_in(config: Config, metadata: dict[str, str], rig: RecordedRig | None = None) -> Iterator[Person]:
    """Yield the persons of a block, A before B. ``rig``: that of the recording, if it has been read."""
    who, block = config.session, config.block
    both: tuple[tuple[Letter, str, str], ...] = (
        ("A", who.participant_a, who.hand_a),
        ("B", who.participant_b, who.hand_b),
    )
    for letter, name, hand in both:
        if block.configuration == "bimanual":
            sides: tuple[Side, ...] = SIDES if block.performer == letter else ()
        else:
            side = config.session.seat_a if letter == "A" else OTHER_SIDE[config.session.seat_a]
            sides = (side,) if getattr(block, side) == "person" else ()
        if sides:
            given = name if name != letter else who.dyad + letter
            yield Person(letter, _label(given), hand, sides, _simulated(config, metadata, sides, rig))


def _simulated(config: Config, metadata: dict[str, str], sides: Sequence[Side], rig: RecordedRig | None) -> bool:
    """Return True if a simulated participant moved these sides, by its agents if they are known."""
    if rig is not None and "imported" not in metadata and all(rig.hands.get(side) for side in sides):
        return set(sides) <= set(rig.simulated)
    return is_simulated(config, metadata, sides)


def _label(name: str) -> str:
    """Convert a name to a label: standards allow only letters and digits."""
    return re.sub("[^A-Za-z0-9]", "", name) or "0"


def _refuse_repeats(runs: Sequence[Run]) -> None:
    """Raise an error for repeated recordings and colliding labels."""
    _refuse_shared(runs, lambda run: [("session", run.session, (run.config.session.dyad, run.config.session.name))])
    _refuse_shared(runs, lambda run: [("participant", person.label, _identity(run, person)) for person in run.people])
    refuse_copies((run.path, run.metadata) for run in runs)
    for run in runs:
        if len({person.label for person in run.people}) < len(run.people):
            raise RecordingError(f"{run.path}: both participants are called {run.people[0].label}; expected two names")


def refuse_copies(recordings: Iterable[tuple[Path, Mapping[str, str]]]) -> None:
    """Raise an error for two files with the same ticks or the same identity, from their paths and metadata."""
    for found in chain.from_iterable(find_repeats(recordings)):
        raise RecordingError(str(found))


def _identity(run: Run, person: Person) -> tuple[str, ...]:
    """Return the identity behind a label: the pseudonym, or dyad and letter without one."""
    name = pseudonym_of(run, person)
    return (name,) if name != person.letter else (run.config.session.dyad, name)


def pseudonym_of(run: Run, person: Person) -> str:
    """Return how a person is called in a run; the letter if there is no pseudonym."""
    who = run.config.session
    return who.participant_a if person.letter == "A" else who.participant_b


def _refuse_shared(runs: Sequence[Run], named: Callable[[Run], list[tuple[str, str, tuple[str, ...]]]]) -> None:
    """Raise an error if two different identities share a label."""
    owners: dict[str, tuple[Path, tuple[str, ...]]] = {}
    for run in runs:
        for kind, label, identity in named(run):
            first, other = owners.setdefault(label, (run.path, identity))
            if other != identity:
                raise RecordingError(
                    f"{first} and {run.path}: {kind}s {' '.join(other)} and {' '.join(identity)} would both be called "
                    f"{label}, because labels keep only letters and digits; export them separately"
                )


@dataclass(frozen=True, slots=True)
class HandDevice:
    """A device held in a recording."""

    side: Side
    backend: str
    kind: str
    maker: str
    model: str
    serial: str


def configured_device(config: Config, metadata: Mapping[str, str], side: Side) -> str:
    """Return the backend of a side in the configuration; empty for imported hands if that is a simulated one."""
    device = config.agents.of(side).device
    foreign = metadata.get("imported") in ("measured", "simulated")
    return "" if foreign and held_by({"device": device}).kind is DeviceKind.SIMULATED else device


def devices_of(config: Config, recording: Recording) -> tuple[HandDevice, ...]:
    """Return the devices that moved in a recording, left before right, and those of a side in the order of use."""
    events, attempts = recording.events(), recording.attempts()
    found: dict[HandDevice, None] = {}
    for side in SIDES:
        for details in list(agents_in_use(events, attempts, side)) or [dict[str, str]()]:
            backend = details.get("device", configured_device(config, recording.metadata, side))
            maker = details.get("maker", MAKERS_BEFORE.get(backend, ""))
            model, serial = details.get("model", ""), details.get("serial", "")
            kind = str(held_by({"device": backend, **details}).kind)
            found[HandDevice(side, backend, kind, maker, model, serial)] = None
    return tuple(found)
