"""All of an analysis but its tables: numbers, pictures, the report, files."""

from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from netboard.export.formats import new_folder
from netboard.measuring.cache import Cache
from netboard.measuring.crews import processes
from netboard.measuring.readings import Readings
from netboard.measuring.running import harvest
from netboard.measuring.shelf import Shelf
from netboard.measuring.study import study_of
from netboard.process import peak_memory
from netboard.report.folder import write_analysis
from netboard.throughput.apart import Took, Watch
from netboard.throughput.making import quiet


def remainder(recordings: Sequence[Path], kept: Path, folder: Path) -> tuple[Took, float]:
    """Write the folder of an analysis whose measures are kept; and tell the most memory, in bytes [1]."""
    with new_folder(folder) as part, TemporaryDirectory(dir=part) as paths:
        found = harvest(recordings, Readings(), processes(1), Cache(kept), Shelf(Path(paths)), quiet)
        study = study_of(found.measured, Readings(), found.paths)
        watch = Watch()
        write_analysis(part, study, found, ["netboard", "bench", "analysis"], quiet)
    return watch.read(), peak_memory()
