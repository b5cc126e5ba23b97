"""Imports the study in a manifest: validates everything first, then converts tables in parallel.

A recording gets its name when it is complete. An existing one that is undamaged and was made from the same table with
the same options is kept, so an interrupted import can be repeated.
"""

import time
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, as_completed
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

from netboard.base.config import Config, resolve
from netboard.base.errors import ConfigError, NetboardError, RecordingError, writing
from netboard.base.plural import plural
from netboard.base.process.workers import worker_processes
from netboard.base.terminal.compiling import workers_compilation
from netboard.recording.files.locate import sha256_of
from netboard.recording.files.offline_writer import recording_name
from netboard.recording.files.reader import Recording
from netboard.recording.format.partfile import publish
from netboard.recording.importing.manifest import ListedTable, Manifest
from netboard.recording.importing.table_import import (
    Imported,
    ImportOptions,
    configuration_beside,
    import_table,
    require_task,
)
from netboard.recording.importing.tables import is_tick_table, probe
from netboard.recording.integrity.catalogue import entry_of
from netboard.recording.integrity.severity import RESULTS, Severity

Tell = Callable[[str, int, int], None]
"""Progress callback: current item, amount done and total."""

Work = Callable[["ImportJob", Path], Imported]
"""Function that makes a recording in a folder and renames it when it is complete."""

UNNAMED = ".importing-"
"""Name prefix of the temporary folder for incomplete recordings."""


@dataclass(frozen=True, slots=True)
class ImportJob:
    """Conversion of one table to a recording."""

    where: str
    source: Path
    config: Config
    options: ImportOptions
    path: Path


@dataclass(frozen=True, slots=True)
class ImportPlan:
    """The jobs to do, and the recordings that exist already."""

    jobs: tuple[ImportJob, ...]
    done: tuple[Path, ...]


def examine(path: Path, folder: Path, tell: Tell) -> ImportPlan:
    """Read a manifest and the start of each of its tables; write nothing."""
    manifest = Manifest(path)
    problems, jobs, done = list(manifest.problems), [], []
    sources: dict[Path, str] = {}
    blocks: dict[tuple[str, str, int], str] = {}
    for number, one in enumerate(manifest.listed, start=1):
        tell(one.path.name, number, len(manifest.listed))
        try:
            job = _job(one, folder)
            if _is_done(job):
                done.append(job.path)
            else:
                jobs.append(job)
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
        raise ConfigError("\n".join((f"nothing was imported, {plural(len(problems), 'problem')} to fix:", *problems)))
    return ImportPlan(tuple(jobs), tuple(done))


def _job(one: ListedTable, folder: Path) -> ImportJob:
    """Read the start of a table and determine the file name of its recording."""
    has_ticks = is_tick_table(one.path) and not one.options.names
    config = (configuration_beside(one.path) if has_ticks else None) or one.config
    if not has_ticks:
        columns = probe(one.path, one.options.names, one.options.units, one.options.rate)
        require_task(one.path, columns, one.options)
    return ImportJob(one.where, one.path, config, one.options, folder / recording_name(config, sha256_of(one.path)))


def _is_done(job: ImportJob) -> bool:
    """Return True if a job is already done; raise an error if its file name is otherwise taken."""
    if not job.path.exists():
        return False
    found = entry_of(job.path)
    if found.verdict == RESULTS[Severity.DAMAGE]:
        raise RecordingError(f"{job.path}: exists but is damaged ({found.why}); move it away to import it again")
    with Recording(job.path) as recording:
        metadata, text = recording.metadata, recording.config_text
    same = "imported_names" not in metadata or job.options.metadata.items() <= metadata.items()
    if not same or text != resolve(job.config):
        raise RecordingError(f"{job.path}: exists, and was imported with other settings; move it away")
    return True


def run(
    plan: ImportPlan, folder: Path, workers: int, tell: Tell, work: Work | None = None
) -> tuple[list[Imported], list[str]]:
    """Run the jobs of a plan. The imported tables come in the order of the manifest."""
    with writing(folder):
        folder.mkdir(parents=True, exist_ok=True)
    done: dict[int, Imported] = {}
    failed: dict[int, str] = {}
    with (
        TemporaryDirectory(prefix=UNNAMED, dir=folder) as unnamed,
        workers_compilation(),
        worker_processes(min(workers, len(plan.jobs))) as pool,
    ):
        try:
            asked = {pool.submit(work or import_one, job, Path(unnamed)): k for k, job in enumerate(plan.jobs)}
            for answer in as_completed(asked):
                place = asked[answer]
                try:
                    done[place] = answer.result()
                except (ConfigError, RecordingError) as error:
                    failed[place] = f"{plan.jobs[place].where}: {error}"  # the other tables continue
                tell(plan.jobs[place].source.name, len(done) + len(failed), len(plan.jobs))
        except BrokenExecutor as error:
            raise NetboardError(
                f"an import process was killed, perhaps because memory ran out: {len(done)} of {len(plan.jobs)} "
                "recordings are complete; run the same command again for the rest, with fewer --workers"
            ) from error
        finally:
            pool.shutdown(cancel_futures=True)
    return [done[place] for place in sorted(done)], [failed[place] for place in sorted(failed)]


def import_one(job: ImportJob, unnamed: Path) -> Imported:
    """Import a table into the temporary folder and rename the recording when it is complete."""
    found = import_table(job.source, unnamed, job.config, job.options, time.time_ns(), lambda *progress: None)
    publish(found.path, job.path)
    return replace(found, path=job.path)
