"""Imports one table: determines its kind, converts it, and records its provenance."""

import json
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import TypeAdapter, ValidationError

from netboard.base.config import Config, parse
from netboard.base.errors import ConfigError, writing
from netboard.base.files.text import read_text
from netboard.base.plural import plural
from netboard.recording.files.locate import sha256_of
from netboard.recording.files.offline_writer import BlockWriter
from netboard.recording.importing.columns import COLUMNS, TASK
from netboard.recording.importing.exactness import ExaminedTicks
from netboard.recording.importing.resampling import Interpolation, resampled, segments
from netboard.recording.importing.rows import measured, simulated, spread_over_attempts
from netboard.recording.importing.tables import Samples, TableFile, is_tick_table, read_samples

PIECE = 10_000
"""Ticks per progress report [1]."""

ORIGIN = ("rehearsed", "what_if", "source")
"""Metadata that an imported table of ticks takes over from the exported recording."""
METADATA = TypeAdapter(dict[str, str])

Progress = Callable[[str, int, int], None]
"""Progress callback: current table, ticks done and total."""

GIVEN = "--config's, whose devices decide whether its participants count as simulated"
"""Which configuration a table of ticks gets that has none beside it."""


@dataclass(frozen=True, slots=True)
class ImportOptions:
    """Import options."""

    # Column names in the table, as ``column=theirs``, and their units, as ``column=unit``.
    names: tuple[str, ...] = ()
    units: tuple[str, ...] = ()
    simulate: bool = False
    interpolation: Interpolation = "cubic"
    gap: float = 0.1  # longest sample interval that is not a gap [s]
    rate: float | None = None  # sample rate, which times are checked against and missing ones computed from [Hz]

    @property
    def metadata(self) -> dict[str, str]:
        """What a recording says of them."""
        return {
            "imported": "simulated" if self.simulate else "measured",
            "imported_names": json.dumps(self.names),
            "imported_units": json.dumps(self.units),
            "imported_interpolation": self.interpolation,
            "imported_gap_s": repr(self.gap),
            "imported_rate": repr(self.rate),
        }


@dataclass(frozen=True, slots=True)
class Imported:
    """Result of importing a table."""

    path: Path
    what: str
    ticks: int
    notes: tuple[str, ...]


_DERIVED = {
    "ticks": "a copy of an exported table, bit for bit",
    "measured": "derived from the measurements of another program",
    "simulated": "derived from measured hands: board, ball and trials are simulated",
}
"""What a made recording is, in words, by its metadata ``imported``."""


def in_words(done: Sequence[Imported]) -> Iterator[str]:
    """Describe the new recordings, then the notes on them, each once."""
    for found in done:
        yield f"{found.path}: {plural(found.ticks, 'tick')}, {found.what}"
    for note, count in Counter(note for found in done for note in found.notes).items():
        yield f"  {note}" + f" ({count} recordings)" * (count > 1)


def configuration_beside(path: Path) -> Config | None:
    """Read the configuration that an export stored beside its table of ticks; None if there is none."""
    found = path.resolve().parent.parent / "configurations" / f"{path.stem}.toml"
    return parse(read_text(found), str(found)) if found.is_file() else None


def origin_beside(path: Path) -> dict[str, str]:
    """Read what an export states of the origin of a table of ticks: simulated, or measured by another program."""
    recordings = path.resolve().parent.parent / f"recordings{path.suffix}"
    if not recordings.is_file():
        return {}
    table = TableFile(recordings)
    if not {"recording", "metadata"} <= set(table.names):  # a list of the laboratory's own
        return {}
    portions = table.portions(("recording", "metadata"))
    rows = [row for some in portions for row in zip(some.words("recording"), some.words("metadata"), strict=True)]
    try:
        metadata = METADATA.validate_json(dict(rows).get(path.stem, "{}"))
    except ValidationError:
        expected = "expected a JSON object of texts, as netboard export writes it"
        raise ConfigError(f"{recordings}: column metadata of recording {path.stem}: {expected}") from None
    kind = {"imported": metadata["imported"]} if metadata.get("imported") in ("measured", "simulated") else {}
    return kind | {key: metadata[key] for key in ORIGIN if key in metadata}


def import_table(
    path: Path, folder: Path, config: Config, options: ImportOptions, utc_ns: int, progress: Progress
) -> Imported:
    """Convert a table to a recording.

    ``config``: configuration of the experiment; one stored beside an exported table of ticks takes precedence.
    """
    origin = {"imported_from": path.name, "imported_sha256": sha256_of(path)}
    if is_tick_table(path) and not options.names:
        return _import_ticks(path, folder, config, origin, utc_ns, progress)
    samples = read_samples(path, options.names, options.units, options.rate)
    require_task(path, samples.columns, options)
    try:
        ticks, columns, notes = _at_ticks(samples, options)
        rows = simulated(ticks, columns, config) if options.simulate else measured(ticks, columns)
    except ConfigError as error:
        raise ConfigError(f"{path}: {error}") from None
    origin |= {
        **options.metadata,
        "imported_columns": json.dumps(sorted(("time", *samples.columns))),
        "imported_samples": str(samples.time.size),
    }
    pieces = (rows[first : first + PIECE] for first in range(0, rows.size, PIECE))
    made = _save(pieces, folder, config, origin, utc_ns, progress, total=rows.size)
    return Imported(made, _DERIVED[origin["imported"]], rows.size, tuple(notes))


def _import_ticks(
    path: Path, folder: Path, config: Config, origin: dict[str, str], utc_ns: int, progress: Progress
) -> Imported:
    """Convert a table of ticks as netboard exports it, and compute them again, which tells whether they are exact."""
    beside = configuration_beside(path)
    source = f"configurations/{path.stem}.toml" if beside else "--config"
    origin = {"imported": "ticks", **origin_beside(path), **origin}
    examined = ExaminedTicks(path, None if origin["imported"] == "measured" else beside or config, source)
    made = _save(examined.pieces(), folder, beside or config, origin, utc_ns, progress, examined.remarks)
    notes = [f"no configurations/{path.stem}.toml beside its folder: it is given {GIVEN}"] * (beside is None)
    what = (
        _DERIVED[origin["imported"]]
        if not [*examined.remarks()]
        else "a copy of an exported table, imported, not bit-exact"
    )
    return Imported(made, what, examined.count, (*notes, *examined.notes()))


def require_task(path: Path, columns: Collection[str], options: ImportOptions) -> None:
    """Refuse a table of hands only, unless the task is to be simulated."""
    if not options.simulate and not set(TASK).intersection(columns):
        raise ConfigError(
            f"{path}: contains hands only, and no column of the task ({', '.join(TASK)}): --simulate, or simulate = "
            "true in a manifest, computes the board, the ball and the trials from them"
        )


def _at_ticks(samples: Samples, options: ImportOptions) -> tuple[NDArray[np.int64], dict[str, NDArray[Any]], list[str]]:
    """Resample to ticks; also return warnings."""
    found = segments(samples.time, options.gap)
    taken = samples.columns if options.simulate else spread_over_attempts(samples.columns)
    parts = [resampled(samples.time, taken, segment, options.interpolation) for segment in found]
    ticks = np.concatenate([segment.ticks for segment in found])
    columns = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    usual = float(np.median(np.diff(samples.time)))
    exact = all(segment.exact for segment in found)
    notes = [f"{samples.time.size} samples, {1 / usual:.6g} a second" + (", which are ticks" if exact else "")]
    if len(found) > 1:
        notes.append(f"{plural(len(found) - 1, 'gap')} of more than {options.gap:g} s, in which there is no sample")
    if alone := samples.time.size - sum(segment.stop - segment.first for segment in found):
        notes.append(f"{alone} samples between gaps are left out, because they are too few to interpolate")
    if samples.left_out:
        notes.append(f"columns left out: {', '.join(samples.left_out)}")
    absent = [name for name, column in COLUMNS.items() if column.kind == "number" and name not in columns]
    absent = [name for name in absent if name not in ("time", "completion")]
    if absent and not options.simulate:
        notes.append(f"missing columns, NaN in the recording: {', '.join(absent)}")
    return ticks, columns, notes


def _save(
    pieces: Iterator[NDArray[Any]],
    folder: Path,
    config: Config,
    origin: dict[str, str],
    utc_ns: int,
    progress: Progress,
    remarks: Callable[[], Iterable[tuple[str, dict[str, str]]]] = tuple,
    total: int = 0,
) -> Path:
    """Write rows as a recording; delete it if writing fails. ``remarks``: log messages after the last row."""
    first = next(pieces, None)
    if first is None:
        raise ConfigError(f"{origin['imported_from']}: has no rows")
    with writing(folder):
        folder.mkdir(parents=True, exist_ok=True)
    writer = BlockWriter(folder, config, origin["imported_sha256"], utc_ns, origin, int(first["time_ns"][0]))
    done = 0
    try:
        for rows in chain([first], pieces):
            writer.take(rows)
            done += rows.size
            progress(origin["imported_from"], done, max(total, done))
        for name, details in remarks():
            writer.remark(name, details)
        writer.finish()
    except BaseException:
        writer.abandon()
        raise
    return writer.path
