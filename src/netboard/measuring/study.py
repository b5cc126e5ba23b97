"""A study: the tables of all its recordings, joined, in the order in which things were done.

The paths alone are not joined: they are long, and given recording by recording.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from netboard.analysis.performance import running_number
from netboard.measuring.exclusions import excluded
from netboard.measuring.readings import Readings
from netboard.measuring.recordings import FIELDS, Measured
from netboard.measuring.tables import Columns, count, words

PLACE_IN_STUDY = (
    words("dyad", "pseudonym of the dyad"),
    words("performer", "who performed: the pseudonym of the participant, or of the dyad for both"),
    words("configuration", "dyadic or bimanual"),
    words("force", "what the hands felt"),
    count("haptics", "1: they felt something"),
    words("condition", "configuration and force, and who the partner was if none of the two people"),
    count("block", "number of the block in the dyad's plan, from 1; counted through if two have the same"),
    count("counts", "1: a successful trial that is not excluded"),
    count("order", "its number among the performer's that count in the condition, from 1; 0 if it does not count"),
)
"""Columns that the tables of trials and movements have in a study besides their own."""

_SHARED = tuple(field.name for field in PLACE_IN_STUDY)
_KEYS = ["recording", "trial", "attempt"]


@dataclass(frozen=True, slots=True, eq=False, weakref_slot=True)
class Study:
    """All tables of a study.

    Attributes
    ----------
    readings : Readings
        How it was measured, and what counts.
    blocks, trials, movements : DataFrame
        As in `netboard.measuring.recordings`; trials and movements with the columns of `PLACE_IN_STUDY`.
    paths : mapping of DataFrame
        Those of each recording by its name.
    exclusions : DataFrame
        As in `netboard.measuring.exclusions`.
    """

    readings: Readings
    blocks: pd.DataFrame
    trials: pd.DataFrame
    movements: pd.DataFrame
    paths: Mapping[str, pd.DataFrame]
    exclusions: pd.DataFrame

    @property
    def counted(self) -> pd.DataFrame:
        """The successful trials that count, in the order in which they were done within each dyad."""
        return self.trials[self.trials["counts"] == 1]

    @property
    def dyads(self) -> list[str]:
        """Pseudonyms of the dyads, sorted."""
        return sorted(self.blocks["dyad"].unique())


def study_of(
    measured: Iterable[Measured], readings: Readings, paths: Mapping[str, pd.DataFrame] | None = None
) -> Study:
    """Join the tables of recordings.

    Parameters
    ----------
    measured : iterable of Measured
        The tables of each recording, one at least, in any order.
    readings : Readings
        The readings they were measured with; their exclusions are applied here.
    paths : mapping of DataFrame, optional
        The paths of each recording by its name, if they are not in its tables.

    Returns
    -------
    Study
        The study.

    Raises
    ------
    ConfigError
        If the exclusions name a trial that is not there.
    """
    in_order = _in_order(measured)
    if paths is None:
        paths = {one.blocks["recording"][0]: pd.DataFrame(one.paths) for one in in_order}
    tables = {name: _joined([getattr(one, name) for one in in_order]) for name in ("blocks", "trials", "movements")}
    blocks = tables["blocks"]
    blocks["condition"] = _conditions(blocks)
    blocks["block"] = _numbers(blocks)
    left_out = excluded(blocks, tables["trials"], readings.exclusions)
    trials = _placed(tables["trials"], blocks, left_out, readings)
    movements = tables["movements"].merge(trials[[*_KEYS, *_SHARED]], on=_KEYS, how="left", validate="many_to_one")
    return Study(readings, blocks, trials, movements, paths, left_out)


def _in_order(measured: Iterable[Measured]) -> list[Measured]:
    """Sort recordings by dyad, plan after plan, by block, and by their beginnings where a block was interrupted.

    A part has a number only within what was not resumed; a session that was has another name in its recordings.
    """
    every = list(measured)
    began: dict[tuple[str, str], str] = {}
    for one in every:
        plan, opened = (one.blocks["dyad"][0], one.blocks["study"][0]), one.blocks["opened_utc"][0]
        began[plan] = min(began.get(plan, opened), opened)

    def place(one: Measured) -> tuple[str, str, int, str, int, str]:
        at = {name: one.blocks[name][0] for name in ("dyad", "study", "block", "opened_utc", "part", "recording")}
        begun = began[at["dyad"], at["study"]]
        return at["dyad"], begun, at["block"], at["opened_utc"], at["part"], at["recording"]

    return sorted(every, key=place)


def _numbers(blocks: pd.DataFrame) -> pd.Series:
    """Number the blocks: as planned; through, in dyads that have two of one number, of two plans or imported ones."""
    same = ["dyad", "block", "study", "condition", "performer"]
    each = blocks.drop_duplicates(same)
    several = each.loc[each.duplicated(["dyad", "block"]), "dyad"]
    through = blocks.groupby(same, sort=False).ngroup().groupby(blocks["dyad"])
    return blocks["block"].where(~blocks["dyad"].isin(several), through.transform(lambda own: pd.factorize(own)[0] + 1))


def _joined(parts: Sequence[Columns]) -> pd.DataFrame:
    """Put tables one below the other."""
    return pd.DataFrame({name: np.concatenate([part[name] for part in parts]) for name in parts[0]}, copy=False)


def _conditions(blocks: pd.DataFrame) -> pd.Series:
    """Name the condition of each block."""
    partner = [
        "".join(f", {kind} partner" for kind in ("robot", "still") if kind in movers)
        for movers in zip(blocks["left_by"], blocks["right_by"], strict=True)
    ]
    return blocks["configuration"] + ", " + blocks["force"] + pd.Series(partner, blocks.index, dtype=object)


def _placed(trials: pd.DataFrame, blocks: pd.DataFrame, left_out: pd.DataFrame, readings: Readings) -> pd.DataFrame:
    """Say of each attempt whose it is, whether it counts, and the how manyth it is."""
    known = [name for name in _SHARED if name not in ("counts", "order")]
    joined = trials.merge(blocks[["recording", *known]], on="recording", how="left", validate="many_to_one")
    out = pd.MultiIndex.from_frame(left_out[_KEYS])
    kept = ~pd.MultiIndex.from_frame(joined[_KEYS]).isin(out)
    joined["counts"] = ((joined["outcome"] == "success") & kept).astype("int64")
    joined["order"] = 0
    counted = joined["counts"] == 1
    labels = ["dyad", "performer", "configuration"]
    if readings.summaries.numbering == "condition":
        labels.append("condition")
    if counted.any():
        columns = [joined.loc[counted, name].to_numpy() for name in labels]
        joined.loc[counted, "order"] = running_number(*columns)
    return joined


FIELDS_IN_STUDY = {
    name: (*own, *PLACE_IN_STUDY) if name in ("trials", "movements") else own for name, own in FIELDS.items()
} | {"blocks": (*FIELDS["blocks"], words("condition", "configuration and force, and the partner if not a person"))}
"""Columns of each table of a study."""
