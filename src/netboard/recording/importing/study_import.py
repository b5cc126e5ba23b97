"""Imports the study of a manifest: everything is examined first, then tables become recordings, several at a time.

A recording gets its name when it is whole. One that is there already, is sound and was made of the same table in the
same way is left as it is, so that an import that was stopped can be run again.
"""

import json
import multiprocessing
import signal
import time
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, ProcessPoolExecutor, as_completed
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

from netboard.base.config import Config, parse, resolve
from netboard.base.errors import ConfigError, NetboardError, RecordingError
from netboard.recording.files.offline_writer import name_of
from netboard.recording.files.reader import Recording
from netboard.recording.format.partfile import publish
from netboard.recording.importing.manifest import Listed, Manifest
from netboard.recording.importing.table_import import Imported, Wishes, configuration_beside, import_table
from netboard.recording.importing.tables import is_own, probe, sha256_of
from netboard.recording.integrity.catalogue import entry_of
from netboard.recording.integrity.severity import VERDICTS, Grade

Tell = Callable[[str, int, int], None]
"""Hears what has been done, how much of it, and of what."""

Work = Callable[["Job", Path], Imported]
"""Makes a recording in a folder, and gives it its name."""

UNNAMED = ".importing-"
"""Beginning of the name of the folder in which recordings are written before they have their names."""


@dataclass(frozen=True, slots=True)
class Job:
    """A table that becomes a recording."""

    where: str
    source: Path
    config: Config
    wishes: Wishes
    path: Path


@dataclass(frozen=True, slots=True)
class Plan:
    """What there is to do, and which recordings are there already."""

    jobs: tuple[Job, ...]
    there: tuple[Path, ...]


def examine(path: Path, folder: Path, tell: Tell) -> Plan:
    """Read a manifest and the beginning of each of its tables; nothing is written."""
    manifest = Manifest(path)
    problems, jobs, there = list(manifest.problems), [], []
    sources: dict[Path, str] = {}
    blocks: dict[tuple[str, str, int], str] = {}
    for number, one in enumerate(manifest.listed, start=1):
        tell(one.path.name, number, len(manifest.listed))
        try:
            job = _job(one, folder)
            if not _is_there(job):
                jobs.append(job)
            else:
                there.append(job.path)
        except (ConfigError, RecordingError) as error:
            problems += [f"{one.where}: {line}" for line in str(error).splitlines()]
            continue
        block = (job.config.session.dyad, job.config.session.name, job.config.block.number)
        if (before := sources.setdefault(one.path.resolve(), one.where)) != one.where:
            problems.append(f"{one.where}: this file is listed already, at {before}")
        elif (before := blocks.setdefault(block, one.where)) != one.where:
            dyad, session, block_number = block
            problems.append(
                f"{one.where}: dyad {dyad}, session {session}, block {block_number} is listed already, at {before}; "
                "expected another session.dyad, session.name or block.number"
            )
    if problems:
        raise ConfigError("\n".join((f"nothing was imported, {len(problems)} to mend:", *problems)))
    return Plan(tuple(jobs), tuple(there))


def _job(one: Listed, folder: Path) -> Job:
    """Look at the beginning of a table, and find the name of its recording."""
    own = is_own(one.path) and not one.wishes.names
    beside = configuration_beside(one.path) if own else None
    config = one.config if beside is None else parse(beside.read_text(encoding="utf-8"), str(beside))
    if not own:
        probe(one.path, one.wishes.names, one.wishes.units, one.wishes.rate)
    return Job(one.where, one.path, config, one.wishes, folder / name_of(config, sha256_of(one.path)))


def _is_there(job: Job) -> bool:
    """Tell whether a job has been done already; whatever else has the name of its recording is a mistake."""
    if not job.path.exists():
        return False
    found = entry_of(job.path)
    if found.verdict == VERDICTS[Grade.DAMAGE]:
        raise RecordingError(f"{job.path}: is there and damaged ({found.why}); move it away to import it again")
    with Recording(job.path) as recording:
        said, text = recording.metadata, recording.config_text
    ours = {
        "imported_names": json.dumps(job.wishes.names),
        "imported_units": json.dumps(job.wishes.units),
        "imported_interpolation": job.wishes.interpolation,
        "imported_gap_s": repr(job.wishes.gap),
        "imported_rate": repr(job.wishes.rate),
        "imported": "simulated" if job.wishes.simulate else "measured",
    }
    same = said.get("imported") == "ticks" or all(said.get(name) == value for name, value in ours.items())
    if not same or text != resolve(job.config):
        raise RecordingError(f"{job.path}: is there, and was imported with other settings; move it away")
    return True


def run(
    plan: Plan, folder: Path, workers: int, tell: Tell, work: Work | None = None
) -> tuple[list[Imported], list[str]]:
    """Import what is to be done.

    Returns
    -------
    done : list of Imported
        What came of the tables, in the order of the manifest.
    """
    folder.mkdir(parents=True, exist_ok=True)
    done: dict[int, Imported] = {}
    failed: dict[int, str] = {}
    with TemporaryDirectory(prefix=UNNAMED, dir=folder) as unnamed:
        spawn = multiprocessing.get_context("spawn")
        with ProcessPoolExecutor(min(workers, len(plan.jobs)), spawn, _leave_stopping) as pool:
            try:
                asked = {pool.submit(work or import_one, job, Path(unnamed)): k for k, job in enumerate(plan.jobs)}
                for answer in as_completed(asked):
                    place = asked[answer]
                    try:
                        done[place] = answer.result()
                    except (ConfigError, RecordingError) as error:
                        failed[place] = f"{plan.jobs[place].where}: {error}"  # of this table; the others go on
                    tell(plan.jobs[place].source.name, len(done) + len(failed), len(plan.jobs))
            except BrokenExecutor as error:
                raise NetboardError(
                    f"a process that imports was killed, perhaps for want of memory: {len(done)} of {len(plan.jobs)} "
                    "recordings are done, and whole; run the same command again for the others, with fewer --workers"
                ) from error
            finally:
                pool.shutdown(cancel_futures=True)
    return [done[place] for place in sorted(done)], [failed[place] for place in sorted(failed)]


def _leave_stopping() -> None:
    """Let Ctrl-C stop the process that waits, which stops the others."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def import_one(job: Job, unnamed: Path) -> Imported:
    """Import a table beside the others, and give the recording its name when it is whole."""
    found = import_table(job.source, unnamed, job.config, job.wishes, time.time_ns(), lambda *told: None)
    publish(found.path, job.path)
    return replace(found, path=job.path)
