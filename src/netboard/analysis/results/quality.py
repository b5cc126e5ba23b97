"""Quality of the recordings: attempts and their outcomes, exclusions with reasons, and drift over a session.

A drift is a change of completion time from block to block after each performer's mean in each condition is removed from
times and block numbers. Practice, fatigue and a changing device all look like drift.
"""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from netboard.analysis.extraction.study import Study
from netboard.analysis.results.groups import block_labels, estimated
from netboard.analysis.results.measures import exponential
from netboard.analysis.results.result import Result
from netboard.analysis.statistics.estimates import Estimate, t_interval

OUTCOMES = {"success": "succeeded", "fell": "fell", "timed_out": "timed out"}
"""Outcomes of attempts."""


@dataclass(frozen=True, slots=True, eq=False)
class Quality:
    """Quality of the recordings of a study.

    Attributes
    ----------
    blocks : DataFrame
        Table with a row for each dyad's block: ``dyad``, ``block``, ``condition``, ``attempts``, ``success``, ``fell``,
        ``timed_out``, ``counts``, ``excluded`` (successes and others), ``missing`` ticks and ``time``, the geometric
        mean completion time of the trials that count [1, s].
    reasons : dict of str to int
        Reasons for exclusion, with numbers of attempts [1].
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
        note = "ratio of times of successive blocks; practice and tiredness too"
        return (*rows, estimated("quality", "drift of completion time", "all", self.drift, "1", note))


def _count(quantity: str, group: str, value: float, n: int) -> Result:
    return Result("quality", quantity, group, float(value), np.nan, np.nan, "1", "", n, "dyad", "number of all dyads")


def quality(study: Study) -> Quality:
    """Return the quality of a study's recordings."""
    reasons = study.exclusions["why"].value_counts()
    drifts = _drifts(study.counted)
    return Quality(
        _blocks(study),
        {str(why): int(number) for why, number in reasons.items()},
        tuple(drifts.index),
        tuple(drifts),
        exponential(t_interval(drifts)),
    )


def _blocks(study: Study) -> pd.DataFrame:
    """Count the attempts of each block; a block may have several recordings, or no attempt."""
    keys = ["recording", "trial", "attempt"]
    out = pd.MultiIndex.from_frame(study.exclusions[keys])
    trials = study.trials.assign(
        attempts=1,
        excluded=pd.MultiIndex.from_frame(study.trials[keys]).isin(out).astype("int64"),
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
