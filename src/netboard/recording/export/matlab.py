"""MATLAB export, also readable by GNU Octave: one file per recording, with a struct for each table.

The file format is version 5. Numbers are column vectors of double or int64, exact to the bit; texts are cell arrays. A
variable in this version is limited to 2 GB, which 50 minutes of ticks reach. Parquet has no such limit.
"""

import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.io.matlab import savemat

from netboard.base.errors import RecordingError
from netboard.recording.export.formats import Progress
from netboard.recording.export.tables import TICKS, ExportTable, OpenRecording, small_tables
from netboard.recording.export.tabular import opened, tick_portions, write_dictionary

MAX_BYTES = 2**31 - 2**20
"""Size limit of a variable, less some space for its names [1]."""


MAX_NAME = 63
"""Length limit of a field name [1]."""


def write(recordings: Sequence[Path], folder: Path, progress: Progress) -> None:
    """Write recordings as MATLAB files."""
    tables = small_tables(recordings)
    for name in (field.name for table in tables for field in table.fields):
        if len(name) > MAX_NAME:
            raise RecordingError(
                f"column {name}: found {len(name)} characters, expected at most {MAX_NAME} in a MATLAB file; use "
                "--to parquet, which MATLAB reads with parquetread"
            )
    places = "RECORDING.mat: a struct for each table; that of ticks has no column recording"
    write_dictionary(folder, (TICKS, *tables), places)
    for source in opened(recordings, folder):
        with tempfile.TemporaryFile(dir=folder) as spool:
            structs = {"ticks": _ticks(source, spool, progress)}
            structs |= {table.name: _struct(table, source) for table in tables}
            with (folder / f"{source.name}.mat").open("xb") as file:
                savemat(file, structs, long_field_names=True, oned_as="column")


def _ticks(source: OpenRecording, spool: Any, progress: Progress) -> dict[str, NDArray[Any]]:
    """Spool the ticks to disk row by row; return views of the columns, so that one is in memory at a time."""
    kinds = {"integer": np.int64, "number": np.float64}
    row = np.dtype([(field.name, kinds[field.kind]) for field in TICKS.fields if field.kind in kinds])
    if (size := source.ticks * row.itemsize) > MAX_BYTES:
        raise RecordingError(
            f"{source.recording.path}: its ticks are {size / 1e9:.1f} GB, expected at most {MAX_BYTES / 1e9:.1f} GB "
            "in a MATLAB file; use --to parquet, which MATLAB reads with parquetread"
        )
    for columns in tick_portions(source, progress):
        rows = np.empty(len(columns["tick"]), row)
        for name in row.names or ():
            rows[name] = columns[name]
        spool.write(rows.tobytes())  # unlike ndarray.tofile, it says why the disk refuses
    spool.flush()
    table = np.memmap(spool, row, "r") if source.ticks else np.empty(0, row)
    return {name: table[name] for name in row.names or ()}


def _struct(table: ExportTable, source: OpenRecording) -> dict[str, NDArray[Any]]:
    portions = list(table.portions(source))
    return {field.name: np.concatenate([rows[field.name] for rows in portions]) for field in table.fields}
