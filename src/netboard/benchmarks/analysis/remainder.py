"""Cost of an analysis after its tables are complete: results, figures, report and files."""

from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from netboard.analysis.extraction.cache import Cache
from netboard.analysis.extraction.path_table import PathTable
from netboard.analysis.extraction.running import extract
from netboard.analysis.extraction.settings import Readings
from netboard.analysis.extraction.study import study_of
from netboard.analysis.extraction.workers import processes
from netboard.analysis.report.folder import write_analysis
from netboard.base.process import peak_memory
from netboard.benchmarks.analysis.apart import Took, Watch
from netboard.benchmarks.analysis.making import quiet
from netboard.recording.export.formats import new_folder


def remainder(recordings: Sequence[Path], kept: Path, folder: Path) -> tuple[Took, float]:
    """Write the folder of an analysis whose measures are kept; and tell the most memory, in bytes [1]."""
    with new_folder(folder) as part, TemporaryDirectory(dir=part) as paths:
        found = extract(recordings, Readings(), processes(1), Cache(kept), PathTable(Path(paths)), quiet)
        study = study_of(found.measured, Readings(), found.paths)
        watch = Watch()
        write_analysis(part, study, found, ["netboard", "bench", "analysis"], quiet)
    return watch.read(), peak_memory()
