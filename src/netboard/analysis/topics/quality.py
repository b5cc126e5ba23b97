"""Quality of the recordings: attempts and their outcomes, exclusions with reasons, and drift over a session.

A drift is a change of completion time from block to block after each performer's mean in each condition is removed from
times and block numbers. Practice, fatigue and a changing device all look like drift.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from netboard.analysis.extraction.study import StudyData
from netboard.analysis.statistics.estimates import Estimate, t_interval
from netboard.analysis.topics.figure import Drawn, look_of, new_mosaic, pictured, titled
from netboard.analysis.topics.groups import block_labels, estimated, excluded, of_blocks
from netboard.analysis.topics.measures import exponential, legend
from netboard.analysis.topics.result import Result, plain
from netboard.base.looks import LIGHT_GREY, PRINT_FINE, PRINT_SMALL
from netboard.base.plural import plural

if TYPE_CHECKING:
    from matplotlib.axes import Axes

OUTCOMES = {"success": "succeeded", "fell": "fell", "timed_out": "timed out"}


@dataclass(frozen=True, slots=True, eq=False)
class StudyQuality:
    """Quality of the recordings of a study.

    Attributes
    ----------
    blocks : DataFrame
        Table with a row for each dyad's block: ``dyad``, ``block``, ``condition``, ``attempts``, ``success``, ``fell``,
        ``timed_out``, ``counts``, ``excluded`` (successes and others), ``missing`` ticks and ``time``, the geometric
        mean completion time of the trials that count [1, s].
    reasons : dict of str to int
        Number of attempts excluded for each reason [1].
    drifts : tuple of float
        Change of the log completion time per block, for each dyad [1].
    drift : Estimate
        Mean drift, as the ratio of the times of successive blocks [1].
    """

    blocks: pd.DataFrame
    reasons: dict[str, int]
    dyads: tuple[str, ...]
    drifts: tuple[float, ...]
    drift: Estimate

    @property
    def results(self) -> tuple[Result, ...]:
        """Return the counts of each condition, the reasons for exclusion, missing ticks, and the drift."""
        rows = []
        for condition, own in [("all", self.blocks), *self.blocks.groupby("condition", sort=False)]:
            dyads = own["dyad"].nunique()
            rows.append(_count("attempts", condition, own["attempts"].sum(), dyads))
            rows += [_count(f"attempts that {OUTCOMES[end]}", condition, own[end].sum(), dyads) for end in OUTCOMES]
            rows.append(_count("attempts excluded", condition, own["excluded"].sum(), dyads))
            rows.append(_count("trials that count", condition, own["counts"].sum(), dyads))
            rows.append(_count("missing ticks", condition, own["missing"].sum(), dyads))
        everybody = self.blocks["dyad"].nunique()
        rows += [_count("attempts excluded", why, number, everybody) for why, number in self.reasons.items()]
        note = "ratio of times of successive blocks; includes practice and fatigue"
        return (*rows, estimated("quality", "drift of completion time", "all", self.drift, "1", note))


def _count(quantity: str, group: str, value: float, n: int) -> Result:
    return plain("quality", quantity, group, float(value), "1", n, "dyad", "number of all dyads")


def quality(study: StudyData) -> StudyQuality:
    """Return the quality of a study's recordings."""
    reasons = study.exclusions["why"].value_counts()
    drifts = _drifts(study.counted)
    return StudyQuality(
        blocks=_blocks(study),
        reasons={str(why): int(number) for why, number in reasons.items()},
        dyads=tuple(drifts.index),
        drifts=tuple(drifts),
        drift=exponential(t_interval(drifts)),
    )


def _blocks(study: StudyData) -> pd.DataFrame:
    """Count the attempts of each block; a block may have several recordings, or no attempt."""
    trials = study.trials.assign(
        attempts=1,
        excluded=excluded(study).astype("int64"),
        log_time=np.log(
            study.trials["completion"].where((study.trials["counts"] == 1) & (study.trials["completion"] > 0))
        ),
        **{end: (study.trials["outcome"] == end).astype("int64") for end in OUTCOMES},
    )
    counted = ["attempts", *OUTCOMES, "counts", "excluded"]
    place = ["dyad", "block"]
    blocks = study.blocks.groupby(place).agg(condition=("condition", "first"), missing=("missing", "sum"))
    blocks["condition"] = blocks["condition"].map(block_labels(study))
    sums = trials.groupby(place)[counted].sum().reindex(blocks.index, fill_value=0)
    return blocks.join(sums).assign(time=np.exp(trials.groupby(place)["log_time"].mean())).reset_index()


def _drifts(trials: pd.DataFrame) -> pd.Series:
    """Return each dyad's slope of the log completion time over blocks, within performers and conditions."""
    table = trials.loc[trials["completion"] > 0.0, ["dyad", "performer", "condition", "block", "completion"]]
    table = table.assign(completion=np.log(table["completion"]), block=table["block"].astype(float))
    means = table.groupby(["dyad", "performer", "condition"])[["block", "completion"]].transform("mean")
    x, y = table["block"] - means["block"], table["completion"] - means["completion"]
    above, below = (x * y).groupby(table["dyad"]).sum(), (x * x).groupby(table["dyad"]).sum()
    return (above / below.where(below > 0.0)).dropna()


_READABLE = 30
"""Largest number of labelled dyads, and of dyads with numbers in the squares [1]."""


@pictured("What was recorded")
def picture(study: StudyData) -> Drawn:
    """Draw the quality of the recordings."""
    found = quality(study)
    if not len(found.blocks):
        return "There is no recording."
    dyads = found.blocks["dyad"].nunique()
    tall = 0.55 + 0.2 * min(dyads, 40)
    figure, axes = new_mosaic(2.6 + tall, [["falls", "excluded"], ["times", "times"]], height_ratios=[tall, 2.2])
    _counts(axes["falls"], found, "fell")
    titled(axes["falls"], "A", "attempts that fell [1]")
    _counts(axes["excluded"], found, "excluded")
    titled(axes["excluded"], "B", "attempts excluded [1]")
    _times(axes["times"], found, study)
    titled(axes["times"], "C", "completion time through the session")
    legend(figure, of_blocks(study), "outside lower center")
    return figure, _caption(found, dyads)


def _counts(axes: "Axes", found: StudyQuality, column: str) -> None:
    """Draw a square for each block, darker for higher counts; blocks without a recording are empty."""
    table = found.blocks.pivot(index="dyad", columns="block", values=column)
    values = table.to_numpy(float)
    most = max(float(np.nanmax(values)), 1.0)
    axes.imshow(values, cmap="Blues", vmin=0.0, vmax=1.6 * most, aspect="auto", label=f"_{column}")
    if not np.nansum(values):
        axes.text(0.5, 0.5, "none", transform=axes.transAxes, ha="center", va="center", fontsize=PRINT_SMALL)
    if len(table) <= _READABLE:
        for row, column_number in zip(*np.nonzero(np.nan_to_num(values)), strict=True):
            axes.text(
                column_number, row, f"{values[row, column_number]:.0f}", ha="center", va="center", fontsize=PRINT_FINE
            )
    every = -(-len(table) // _READABLE)
    axes.set_yticks(range(0, len(table), every), table.index[::every], fontsize=PRINT_SMALL)
    step = _step(table.shape[1])
    axes.set_xticks(range(0, table.shape[1], step), table.columns[::step], fontsize=PRINT_SMALL)
    axes.set_xlabel("block of the plan [1]")
    axes.set_ylabel("dyad")


def _step(blocks: int) -> int:
    """Return the step between labelled blocks on an axis, starting with the first."""
    return max(1, blocks // 9)


def _times(axes: "Axes", found: StudyQuality, study: StudyData) -> None:
    """Draw the geometric mean of each block, joined within a dyad."""
    for dyad, own in found.blocks.groupby("dyad"):
        axes.plot(own["block"], own["time"], color=LIGHT_GREY, linewidth=0.6, zorder=1, label=f"_{dyad}")
    for condition in of_blocks(study):
        look = look_of(condition)
        own = found.blocks[found.blocks["condition"] == condition.label]
        axes.plot(
            own["block"],
            own["time"],
            linestyle="none",
            marker=look.marker,
            markersize=4,
            color=look.colour,
            markerfacecolor=look.face,
            zorder=2,
            label=f"_{condition.name}",
        )
    axes.set_ylim(bottom=0.0)
    blocks = np.unique(found.blocks["block"])
    axes.set_xticks(blocks[:: _step(len(blocks))])
    axes.set_xlim(blocks[0] - 0.5, blocks[-1] + 0.5)
    axes.set_xlabel("block of the plan [1]")
    axes.set_ylabel("completion time [s]")


def _caption(found: StudyQuality, dyads: int) -> str:
    total = found.blocks[["attempts", "success", "fell", "timed_out", "excluded", "counts", "missing"]].sum()
    reasons = "; ".join(f"{why}: {number}" for why, number in found.reasons.items())
    return (
        f"Blocks of {plural(dyads, 'dyad')}: {total['attempts']} attempts, of which "
        f"{total['success']} succeeded, {total['fell']} fell and {total['timed_out']} timed out; {total['excluded']} "
        f"are excluded{f' ({reasons})' if reasons else ''}, {total['counts']} trials count, {total['missing']} ticks "
        "are missing. A, B: counts in each block. C: geometric mean of the included trials of each block, a line for "
        f"each dyad. {_drift(found)}"
    )


def _drift(found: StudyQuality) -> str:
    if not np.isfinite(found.drift.value):
        return "A drift cannot be separated from the conditions."
    ends = f" ({_percent(found.drift.low)} to {_percent(found.drift.high)})" if np.isfinite(found.drift.low) else ""
    dyads, level = plural(found.drift.n, "dyad"), 100 * found.drift.level
    interval = f" ({level:.0f} % confidence interval over {dyads}, {found.drift.method})" if ends else ""
    return (
        f"Within a performer and a condition, times change by {_percent(found.drift.value)}{ends} from block to "
        f"block{interval}."
    )


def _percent(ratio: float) -> str:
    return f"{100 * (ratio - 1):+.1f} %"
