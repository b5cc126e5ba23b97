"""A study: the joined tables of all its recordings, in the order of the sessions.

Paths are not joined: they are long, and are read recording by recording.
"""

import pickle
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from netboard.analysis.extraction.conditions import (
    FactorLevels,
    StudyFactor,
    names_of,
    participants_of,
    partner_of,
    study_levels,
    value_columns,
)
from netboard.analysis.extraction.exclusions import BLOCK_RUN, excluded
from netboard.analysis.extraction.recordings import BLOCKS, FIELDS, HAPTICS, Measured
from netboard.analysis.extraction.settings import Readings
from netboard.analysis.extraction.tables import ATTEMPT_KEY, Columns, count, words
from netboard.analysis.extraction.trials import RATE
from netboard.analysis.measures.performance import running_number
from netboard.base.tables.outcomes import Declaration
from netboard.recording.format.channels import Field
from netboard.task.studies.declaration import read_declaration

_OF_BLOCKS = {field.name: field for field in BLOCKS}

PLACE_IN_STUDY = (
    _OF_BLOCKS["dyad"],
    _OF_BLOCKS["performer"],
    words("configuration", "dyadic or bimanual"),
    words("force", HAPTICS),
    _OF_BLOCKS["haptics"],
    words("partner", "robot partner or still partner; empty if the partner is a participant or there is none"),
    _OF_BLOCKS["kind"],
    words(
        "condition",
        "configuration, haptics, partner, levels that these do not determine, and the role if it is not test",
    ),
    _OF_BLOCKS["block"],
    count("counts", "1: a successful trial that is not excluded"),
    count(
        "order",
        "number of the trial among the performer's included trials in the condition, from 1; 0 if it is not included",
    ),
)
"""Columns of a study's tables of trials and movements beside those of a recording."""

_SHARED = tuple(field.name for field in PLACE_IN_STUDY)
_RAW = ("factors", "settings")
PLACE_OF_ANSWER = (
    _OF_BLOCKS["dyad"],
    words("force", f"{HAPTICS}; empty if the study has no recording of the block"),
    count("haptics", "1: with haptic feedback; 0: haptics off; -1: the study has no recording of the block"),
)
"""Columns of a study's table of answers beside those of a recording."""


@dataclass(frozen=True, slots=True, eq=False, weakref_slot=True)
class StudyData:
    """All tables of a study; trials, movements and controls with the columns of `PLACE_IN_STUDY`."""

    readings: Readings
    blocks: pd.DataFrame
    trials: pd.DataFrame
    movements: pd.DataFrame
    paths: Mapping[str, pd.DataFrame]
    exclusions: pd.DataFrame
    levels: FactorLevels
    controls: pd.DataFrame
    answers: pd.DataFrame

    @property
    def factors(self) -> tuple[StudyFactor, ...]:
        """Factors of the study besides configuration, force and partner."""
        return self.levels.factors

    @property
    def factor_fields(self) -> tuple[Field, ...]:
        """Columns of the factors, which every table has in addition."""
        return tuple(field for factor in self.factors for field in factor.fields)

    def with_factor_fields(self, own: Sequence[Field]) -> tuple[Field, ...]:
        """Return the columns of a table, followed by those of the factors that are not among them."""
        there = {field.name for field in own}
        return (*own, *(field for field in self.factor_fields if field.name not in there))

    def with_factors(self, rows: pd.DataFrame) -> pd.DataFrame:
        """Add the columns of the factors to rows of trials, of which each may have many."""
        places = dict(zip(self.blocks["recording"], range(len(self.blocks)), strict=True))
        trials = rows.drop_duplicates(["recording", "trial"])
        at = rows.groupby(["recording", "trial"], sort=False).ngroup().to_numpy()
        columns = _factor_columns(self.levels, [places[one] for one in trials["recording"]], trials["trial"])
        return rows.assign(**{name: values[at] for name, values in columns.items()})

    @property
    def analysed(self) -> pd.DataFrame:
        """Blocks whose role is analysed; all blocks if no role is."""
        return self.blocks[_analysed(self.blocks, self.readings.exclusions.roles)]

    @property
    def counted(self) -> pd.DataFrame:
        """Successful trials that count, in the order of each dyad's sessions."""
        return self.trials[self.trials["counts"] == 1]

    @property
    def excluded_attempts(self) -> int:
        """Number of excluded attempts; one that is in two recordings, as if a logger failed in it, counts once [1]."""
        rows = self.exclusions.merge(self.blocks[["recording", *BLOCK_RUN]], on="recording", validate="many_to_one")
        return len(rows.drop_duplicates([*BLOCK_RUN, "trial", "attempt"]))

    @property
    def declarations(self) -> dict[Declaration, int]:
        """What the recordings declare about the analysis of their study, and the number of recordings with each."""
        counts = self.blocks["declaration"].value_counts(sort=False)
        return {read_declaration(str(text)): int(count) for text, count in counts.items()}

    @property
    def dyads(self) -> list[str]:
        """Pseudonyms of the dyads, sorted."""
        return sorted(self.blocks["dyad"].unique())


def study_of(
    measured: Iterable[Measured], readings: Readings, paths: Mapping[str, pd.DataFrame] | None = None
) -> StudyData:
    """Join the tables of recordings, at least one, in any order, and apply the exclusions of the settings.

    Paths are by name of the recording, if they are not in its tables.
    """
    in_order = _in_order(measured)
    if paths is None:
        paths = {one.blocks["recording"][0]: pd.DataFrame(one.paths) for one in in_order}
    joined = ("blocks", "trials", "movements", "controls", "answers")
    tables = {name: _joined([getattr(one, name) for one in in_order]) for name in joined}
    blocks = tables["blocks"]
    blocks["partner"] = [partner_of(movers) for movers in zip(blocks["left_by"], blocks["right_by"], strict=True)]
    roles = readings.exclusions.roles
    levels = study_levels(blocks, _analysed(blocks, roles))
    blocks = blocks.drop(columns=[*_RAW])
    blocks["condition"] = _block_conditions(blocks, levels)
    numbers = _numbers(blocks)
    answers = _placed_answers(tables["answers"], blocks, numbers)
    blocks["block"] = numbers
    left_out = excluded(blocks, tables["trials"], readings.exclusions)
    trials = _placed(tables["trials"], blocks, left_out, readings, levels)
    blocks = blocks.assign(**_block_columns(levels))
    moves, controls = (_of_attempts(tables[name], trials, levels) for name in ("movements", "controls"))
    return StudyData(readings, blocks, trials, moves, paths, left_out, levels, controls, answers)


def pooled(study: StudyData, over: Collection[str]) -> StudyData:
    """Pool the trials of a study over factors: their levels are no longer part of conditions."""
    factors = tuple(replace(one, in_names=one.in_names and one.name not in over) for one in study.factors)
    levels = replace(study.levels, factors=factors)
    blocks = study.blocks.assign(condition=_block_conditions(study.blocks, levels))
    added = [*_SHARED, *_columns_of(levels)]
    plain = study.trials.drop(columns=added)
    trials = _placed(plain, blocks, study.exclusions, study.readings, levels)
    return replace(
        study,
        blocks=blocks,
        trials=trials,
        movements=_of_attempts(study.movements.drop(columns=[*added, "role"]), trials, levels),
        controls=_of_attempts(study.controls.drop(columns=[*added, "role"]), trials, levels),
        levels=levels,
    )


def _analysed(blocks: pd.DataFrame, left_out: Collection[str]) -> pd.Series:
    """Return whether each block's role is analysed; all true if none is."""
    kept = ~blocks["role"].isin(left_out)
    return kept if kept.any() else ~kept


def _columns_of(levels: FactorLevels) -> list[str]:
    """Return the factor columns of a table of trials beside those of `PLACE_IN_STUDY`."""
    return [field.name for factor in levels.factors for field in factor.fields if field.name not in _SHARED]


def _factor_columns(levels: FactorLevels, places: Iterable[int], trials: Iterable[int]) -> dict[str, np.ndarray]:
    """Return the factor columns for trials of blocks."""
    at, numbers = list(places), list(trials)
    columns: dict[str, np.ndarray] = {}
    for factor in levels.factors:
        columns |= value_columns(factor, levels.at(factor, at, numbers))
    return columns


def _block_columns(levels: FactorLevels) -> dict[str, np.ndarray]:
    """Return the factor columns for blocks: a factor that varies within blocks lists all levels, with commas."""
    columns: dict[str, np.ndarray] = {}
    for factor in levels.factors:
        own = [", ".join(dict.fromkeys(sequence)) for sequence in levels.sequences[factor.name]]
        columns |= value_columns(factor, own)
    return columns


def _block_conditions(blocks: pd.DataFrame, levels: FactorLevels) -> list[str]:
    """Return the condition of each block, without factors that vary within it."""
    names = {
        one.name: [sequence[0] if sequence else "" for sequence in levels.sequences[one.name]]
        for one in levels.factors
        if one.in_names and one.scope != "trial"
    }
    return names_of(blocks, names, blocks["role"])


def _of_attempts(rows: pd.DataFrame, trials: pd.DataFrame, levels: FactorLevels) -> pd.DataFrame:
    """Add the columns of its attempt to each row."""
    shared = [*ATTEMPT_KEY, *_SHARED, "role", *_columns_of(levels)]
    return rows.merge(trials[shared], on=ATTEMPT_KEY, how="left", validate="many_to_one")


def _in_order(measured: Iterable[Measured]) -> list[Measured]:
    """Sort recordings by dyad, plan, session and block, and the parts of an interrupted block by their numbers.

    Blocks are numbered within a session, and parts within a run of the server; the runs are ordered by start time, so
    that a step of the wall clock within a run does not change the order.
    """
    every = list(measured)
    began: dict[tuple[str, ...], str] = {}

    def visit(one: Measured) -> tuple[str, str, str]:
        return one.blocks["dyad"][0], one.blocks["study"][0], one.blocks["session"][0]

    for one in every:
        opened = one.blocks["opened_utc"][0]
        for whole in (visit(one), visit(one)[:2], (*visit(one), one.blocks["run"][0])):
            began[whole] = min(began.get(whole, opened), opened)

    def place(one: Measured) -> tuple[Any, ...]:
        dyad, study, session = visit(one)
        block, run, *at = (one.blocks[name][0] for name in ("block", "run", "part", "opened_utc", "recording"))
        in_block = (began[dyad, study, session, run], run, *at)
        return dyad, began[dyad, study], study, began[dyad, study, session], session, block, *in_block

    return sorted(every, key=place)


def _numbers(blocks: pd.DataFrame) -> pd.Series:
    """Number the blocks as planned; consecutively for dyads with duplicate numbers: two sessions, plans or imports.

    Consecutive recordings of one block are its parts, as after an interruption.
    """
    same = ["dyad", "session", "block", "study", "condition", "performer"]
    each = blocks.drop_duplicates(same)
    several = each.loc[each.duplicated(["dyad", "block"]), "dyad"]
    through = blocks.groupby(same, sort=False).ngroup()
    begins = through != through.shift()
    return blocks["block"].where(~blocks["dyad"].isin(several), begins.groupby(blocks["dyad"]).cumsum())


def _joined(parts: Sequence[Columns]) -> pd.DataFrame:
    return pd.DataFrame({name: np.concatenate([part[name] for part in parts]) for name in parts[0]}, copy=False)


def _placed_answers(answers: pd.DataFrame, blocks: pd.DataFrame, numbers: pd.Series) -> pd.DataFrame:
    """Add dyad, number and force condition of the block that each answer is about; it may be in the next recording."""
    session = ["dyad", "study", "session"]
    own = answers.merge(blocks[["recording", *session]], on="recording", how="left", validate="many_to_one")
    places = blocks[[*session, "block", "force", "haptics"]].assign(number=numbers)
    places = places.drop_duplicates([*session, "block"])
    placed = own.merge(places, on=[*session, "block"], how="left", validate="many_to_one")
    placed["block"] = placed["number"].fillna(placed["block"]).astype("int64")
    placed["force"] = placed["force"].fillna("")
    placed["haptics"] = placed["haptics"].fillna(-1).astype("int64")
    return placed.drop(columns=["number", "study", "session"])


def series_labels(readings: Readings) -> list[str]:
    """Return the columns that identify a series: trials of a performer that the settings number together."""
    condition = ["condition"] if readings.summaries.numbering == "condition" else []
    return ["dyad", "performer", "configuration", *condition]


def _placed(
    trials: pd.DataFrame, blocks: pd.DataFrame, left_out: pd.DataFrame, readings: Readings, levels: FactorLevels
) -> pd.DataFrame:
    """Add to each attempt its performer, condition, inclusion and running number."""
    known = [name for name in _SHARED if name not in ("counts", "order", "condition")]
    joined = trials.merge(blocks[["recording", *known]], on="recording", how="left", validate="many_to_one")
    places = dict(zip(blocks["recording"], range(len(blocks)), strict=True))
    at = [places[one] for one in joined["recording"]]
    named = {one.name: levels.at(one, at, joined["trial"]) for one in levels.factors if one.in_names}
    joined["condition"] = names_of(joined, named, joined["role"])
    out = pd.MultiIndex.from_frame(left_out[ATTEMPT_KEY])
    kept = ~pd.MultiIndex.from_frame(joined[ATTEMPT_KEY]).isin(out)
    joined["counts"] = ((joined["outcome"] == "success") & kept).astype("int64")
    joined["order"] = 0
    counted = joined["counts"] == 1
    if counted.any():
        columns = [joined.loc[counted, name].to_numpy() for name in series_labels(readings)]
        joined.loc[counted, "order"] = running_number(*columns)
    return joined.assign(**_factor_columns(levels, at, joined["trial"]))


FIELDS_IN_STUDY = {
    "blocks": (
        *(field for field in FIELDS["blocks"] if field.name not in _RAW),
        *(field for field in PLACE_IN_STUDY if field.name in ("partner", "condition")),
    ),
    "trials": (*FIELDS["trials"], *PLACE_IN_STUDY),
    **{
        name: (*FIELDS[name], *PLACE_IN_STUDY, *(field for field in FIELDS["trials"] if field.name == "role"))
        for name in ("movements", "controls")
    },
    "paths": FIELDS["paths"],
    "answers": (*FIELDS["answers"], *PLACE_OF_ANSWER),
}
"""Columns of each table of a study, without those of its factors."""


NEAR = 1.5 / RATE
"""Tolerance between recorded and recomputed times: one tick, because the server counts the tick of entry [s]."""


def notes(study: StudyData) -> tuple[str, ...]:
    """Return notes on who is in a dyad, and on completion times that are not those of the samples.

    A recorded time replaces the computed one if the samples show no hold. Each note names the columns of the table of
    trials to compare.
    """
    done = study.trials[study.trials["outcome"] == "success"]
    from_recording = int((done["completion_source"] == "recording").sum())
    apart = np.abs(done["completion"] - done["recorded_completion"])
    differ = apart[(done["completion_source"] == "samples") & (apart > NEAR)]
    found = [*_crowded(study.blocks), *_in_several_dyads(study.blocks)]
    if from_recording:
        found.append(
            f"{from_recording} of {len(done)} completion times are those of the recording (completion_source in the "
            "table of trials): the samples show no hold."
        )
    if len(differ):
        found.append(
            f"{len(differ)} of {len(done)} completion times differ from the recorded ones by more than a tick, by "
            f"{1e3 * differ.max():.0f} ms at most: compare the columns completion and recorded_completion of the table "
            "of trials."
        )
    return tuple(found)


def _crowded(blocks: pd.DataFrame) -> Iterator[str]:
    """Yield a note for each dyad with more than two people, as if two dyads were recorded under one pseudonym."""
    for dyad, own in blocks.groupby("dyad"):
        people = participants_of(own)
        if len(people) > 2:
            yield (
                f"dyad {dyad} has {len(people)} participants ({', '.join(people)}) and is taken for one dyad: if these "
                "are several dyads, or several names of one person, this analysis mixes them."
            )


def _in_several_dyads(blocks: pd.DataFrame) -> Iterator[str]:
    """Yield a note for each participant of more than one dyad: these dyads are not independent."""
    dyads: dict[str, list[str]] = {}
    for dyad, own in blocks.groupby("dyad"):
        for name in participants_of(own):
            dyads.setdefault(name, []).append(str(dyad))
    for name, own in sorted(dyads.items()):
        if len(own) > 1:
            yield (
                f"participant {name} is in {len(own)} dyads ({', '.join(own)}), which every confidence interval, test "
                f"and model takes for independent: if {name} is one person, they are not; if {name} is the name of "
                "several people, nothing is wrong."
            )


# --- for other processes ----------------------------------------------------------------------------------------------

Shared = StudyData | Path
"""A study, or the file from which another process reads it."""


def share(study: StudyData, place: Path) -> Path:
    """Write a study to a new file, from which other processes read it."""
    with place.open("xb") as file:
        pickle.dump(study, file, protocol=5)
    return place


def study_in(shared: Shared) -> StudyData:
    """Return a shared study."""
    return shared if isinstance(shared, StudyData) else _read(shared)


@lru_cache(maxsize=1)
def _read(path: Path) -> StudyData:
    """Read a study, once in each process."""
    with path.open("rb") as file:
        found: StudyData = pickle.load(file)
    return found
