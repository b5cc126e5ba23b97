"""Folder of a cohort: what was asked for, a file for each finished study, and the tables of all.

    cohort.json             plan, configuration, seed and code; a resume with others is refused
    studies/NAME.tables     one virtual study, complete: written under another name, and renamed
    tables/                 studies, groups and if wanted trials of all studies, in their order, and a dictionary

The tables are equal, byte for byte, for equal settings, whatever computed them and however often it was interrupted.
"""

import json
import shutil
from collections.abc import Iterator
from contextlib import ExitStack
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any, Literal

import pandas as pd

from netboard.analysis.cohort.rows import STUDIES
from netboard.analysis.cohort.virtual import (
    StudyTables,
    VirtualDesign,
    check,
    compile_kernels,
    jobs_of_dyad,
    simulate,
    unpack,
)
from netboard.analysis.cohort.workers import CODE, Runner
from netboard.analysis.extraction.fingerprint import fingerprint
from netboard.analysis.extraction.store import Store
from netboard.analysis.extraction.tables import TableKind, columns_of
from netboard.base.config import resolve
from netboard.base.errors import ConfigError, RecordingError, writing
from netboard.base.files.new import refuse_existing
from netboard.base.settings import parse_json
from netboard.recording.export.formats import new_folder
from netboard.recording.export.tabular import open_csv, open_parquet, write_dictionary
from netboard.task.studies.study import resolve_study

Ending = Literal["parquet", "csv"]

MANIFEST, STUDIES_IN, TABLES_IN = "cohort.json", "studies", "tables"

WORDS = {
    "netboard": "version of netboard",
    "code_sha256": "code of netboard",
    "study": "study",
    "plan": "plan",
    "config": "configuration",
    "seed": "--seed",
    "dyads": "--dyads",
    "keep_trials": "--trials",
    "posterior": "--posterior",
}
"""Keys of the manifest, in words."""

ABOUT = {
    "studies": "one virtual study",
    "groups": "one group of trials of a performer in a condition of a virtual study",
    "trials": "one attempt at a trial in a virtual study",
    "pushes": "the mean response of a performer to pushes at a place, in a condition of a virtual study",
}
"""Meaning of a row of each table."""


def manifest_of(design: VirtualDesign) -> dict[str, Any]:
    """Return what determines the tables of a cohort."""
    return {
        "netboard": version("netboard"),
        "code_sha256": fingerprint(CODE),
        "study": design.study.name,
        "plan": resolve_study(design.study),
        "config": resolve(design.config),
        "seed": design.seed,
        "dyads": design.dyads,
        "keep_trials": design.keep_trials,
        "posterior": None if design.posterior is None else design.posterior.sha256,
    }


class Cohort:
    """An open folder of a cohort.

    - `folder`: folder with a manifest.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        try:
            self.manifest: dict[str, Any] = parse_json((folder / MANIFEST).read_text(encoding="utf-8"))
        except FileNotFoundError:
            raise ConfigError(f"{folder}: has no {MANIFEST}, expected the folder of a netboard cohort") from None
        except (OSError, ValueError) as error:
            raise RecordingError(f"{folder / MANIFEST}: cannot be read: {error}") from error
        if not isinstance(self.manifest, dict):
            raise RecordingError(f"{folder / MANIFEST}: expected a JSON object")
        self._store = Store(folder / STUDIES_IN, advice="choose another --output")

    @classmethod
    def create(cls, folder: Path, design: VirtualDesign) -> "Cohort":
        """Make a new folder."""
        refuse_existing(folder, ", or continue it with --resume")
        with new_folder(folder) as part:
            text = json.dumps(manifest_of(design), indent=1, ensure_ascii=False) + "\n"
            (part / MANIFEST).write_text(text, encoding="utf-8")
        return cls(folder)

    def require(self, design: VirtualDesign) -> None:
        """Refuse to continue a cohort with other settings than those that it was begun with."""
        wanted = manifest_of(design)
        for key, words in WORDS.items():
            if self.manifest.get(key) != wanted[key]:
                found, given = _shortly(self.manifest.get(key), wanted[key])
                raise ConfigError(
                    f"--resume {self.folder}: its {words} is {found}, and {given} is asked for; expected the settings "
                    "that it was begun with, or another --output"
                )

    def put(self, number: int, content: bytes) -> None:
        """Store a finished study."""
        self._store.put(_name(number), content)

    def has(self, number: int) -> bool:
        """Return whether a study is finished, and its file undamaged."""
        return self._store.get(_name(number)) is not None

    def get(self, number: int) -> StudyTables:
        """Return a finished study."""
        content = self._store.get(_name(number))
        if content is None:
            raise RecordingError(f"{self.folder}: virtual study {number} is missing or damaged; continue with --resume")
        return unpack(content)

    @property
    def finished(self) -> int:
        """Number of studies from the first one on of which none is missing [1]."""
        number = 0
        while (self.folder / STUDIES_IN / _name(number + 1)).is_file():
            number += 1
        return number

    @property
    def largest(self) -> int:
        """Largest number of a study that was ever finished; 0 without one [1]."""
        names = (self.folder / STUDIES_IN).glob("study-*.tables")
        return max((int(path.stem.partition("-")[2]) for path in names), default=0)

    def frames(self, table: str, studies: int) -> Iterator[pd.DataFrame]:
        """Yield a table of each of the first studies."""
        for number in range(1, studies + 1):
            yield pd.DataFrame(self.get(number).tables[table], copy=False)

    def clean(self) -> None:
        """Remove unfinished files of a process that was killed."""
        for part in (self.folder / STUDIES_IN).glob("*.part"):
            part.unlink(missing_ok=True)

    def write_tables(self, studies: int, ending: Ending) -> None:
        """Join the tables of the first studies; a former join is replaced."""
        part = self.folder / f"{TABLES_IN}.part"
        with writing(part):
            shutil.rmtree(part, ignore_errors=True)
            part.mkdir()
            try:
                self._write(part, studies, ending)
            except BaseException:
                shutil.rmtree(part, ignore_errors=True)
                raise
            shutil.rmtree(self.folder / TABLES_IN, ignore_errors=True)
            part.rename(self.folder / TABLES_IN)

    def _write(self, part: Path, studies: int, ending: Ending) -> None:
        """Write all tables, one study after the other."""
        in_file = self.get(1).fields
        fields = {"studies": STUDIES, **in_file}
        kinds = [TableKind(name, ABOUT[name], own) for name, own in fields.items()]
        write_dictionary(part, kinds, "NAME.parquet and NAME.csv: a table of all studies; trials in one of them only")
        with ExitStack() as stack:
            sheets: list[tuple[str, Any]] = []
            for kind in kinds:
                for own, opened in (("parquet", open_parquet), ("csv", open_csv)):
                    if kind.name != "trials" or own == ending:
                        sheets.append((kind.name, stack.enter_context(opened(part / f"{kind.name}.{own}", kind))))
            for number in range(1, studies + 1):
                packed = self.get(number)
                if packed.fields != in_file:
                    raise RecordingError(f"{self.folder}: virtual study {number} has other columns than the first")
                tables = {"studies": columns_of(STUDIES, [packed.whole]), **packed.tables}
                for name, put in sheets:
                    put(tables[name])


def _name(number: int) -> str:
    return f"study-{number:06d}.tables"


def _shortly(found: object, wanted: object) -> tuple[str, str]:
    """Return two settings for a message: of long texts only the first lines that differ."""
    one, other = str(found), str(wanted)
    if "\n" in one or "\n" in other:
        pairs = zip([*one.splitlines(), ""], [*other.splitlines(), ""], strict=False)
        one, other = next(((a, b) for a, b in pairs if a != b), (one, other))
    return f'"{one}"', f'"{other}"'


def make_cohort(
    design: VirtualDesign,
    studies: int,
    folder: Path,
    runner: Runner,
    *,
    resume: bool = False,
    ending: Ending = "parquet",
) -> Cohort:
    """Simulate the studies of a cohort that are not finished, and join their tables.

    - `studies`: number of virtual studies; a cohort that is continued may get more of them, and not fewer [1].
    - `ending`: format of the table of trials, if it is kept.
    """
    check(design, studies)
    cohort = Cohort(folder) if resume else Cohort.create(folder, design)
    cohort.require(design)
    if studies < cohort.largest:
        raise ConfigError(
            f"--studies: found {studies}, but {folder} has {cohort.largest}, all of which netboard power --cohort "
            f"uses; expected {cohort.largest} or more, or another --output"
        )
    cohort.clean()
    missing = [number for number in range(1, studies + 1) if not cohort.has(number)]
    done = studies - len(missing)
    if missing:
        runner.progress("compiling (only once)", done, studies)
        compile_kernels(jobs_of_dyad(design.config, design.study, design.seed_of(1), 1))
    runner.progress(f"{done} of {studies} studies", done, studies)
    for number, content in runner.run_all(partial(simulate, design), missing):
        cohort.put(number, content)
        done += 1
        runner.progress(f"{done} of {studies} studies", done, studies)
    cohort.write_tables(studies, ending)
    return cohort
