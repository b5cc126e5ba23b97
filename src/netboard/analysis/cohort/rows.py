"""Tables of a virtual study: one row for each performer, condition and group of trials, and if wanted each attempt.

A plan with perturbation trials also has a table of the responses to their pushes.

A row of `GROUPS` has means with their numbers of values, so that means over groups, performers and dyads are those that
an analysis of all trials gives.
"""

from collections.abc import Callable
from dataclasses import dataclass
from operator import itemgetter

import numpy as np
import pandas as pd

from netboard.analysis.cohort.block import TRIALS
from netboard.analysis.extraction.details import THRESHOLDS
from netboard.analysis.extraction.study import PLACE_IN_STUDY, StudyData
from netboard.analysis.extraction.tables import ATTEMPT_KEY, Columns, columns_of, count, number
from netboard.analysis.measures.ellipses import groups_of
from netboard.analysis.measures.performance import ENDS
from netboard.analysis.topics.groups import CLASSES, counted, excluded
from netboard.analysis.topics.measures import MEASURES, Measure, rows_of
from netboard.analysis.topics.models import trial_numbers
from netboard.analysis.topics.performers import SHARES
from netboard.analysis.topics.pushes import pushes
from netboard.recording.format.channels import Field

SIZE = ENDS
"""Trials in a group: the paper's 30 [1]."""

STUDY = count("study", "number of the virtual study, from 1")

STUDIES = (
    STUDY,
    count("seed", "seed of its plans and participants, as for netboard session rehearse"),
    count("dyads", "dyads in it"),
    count("blocks", "blocks of all dyads"),
    count("given_up", "number of blocks that were aborted because their participants could not complete them"),
    count("trials", "successful trials that count"),
    count("attempts", "number of attempts that ended with a success, a fall or a timeout"),
    count("excluded", "number of attempts that are excluded by a rule"),
    number("duration", "simulated time", "s"),
)
"""Columns of the table of virtual studies."""

_LABELS = ("configuration", "force", "haptics", "partner", "role", "kind")
_SPREAD = ("completion", "peaks", "braking_distance", "braking_velocity")
_LABELLED = {field.name: field for field in (*PLACE_IN_STUDY, *TRIALS)}

GROUPS = (
    STUDY,
    *(_LABELLED[name] for name in ("dyad", "performer", "condition", *_LABELS)),
    count("group", f"number of the group of {SIZE} trials in the condition, from 1"),
    count("trials", "successful trials that count"),
    count("attempts", "number of attempts at these trials that ended with a success or a fall"),
    count("falls", "number of these attempts that ended with a fall"),
    number("completion", "mean completion time", "s"),
    number("completion_sd", "standard deviation of the completion times", "s"),
    number("log_completion", "mean natural logarithm of the completion time in s", "1"),
    number("peaks", "mean number of velocity peaks (NP) of the ball", "1"),
    number("peaks_sd", "standard deviation of the number of velocity peaks (NP)", "1"),
    *SHARES,
    count("brakings", "trials with a first braking movement"),
    number("braking_distance", "mean distance to the target at the first braking movement", "m"),
    number(
        "braking_distance_sd", "standard deviation of the distance to the target at the first braking movement", "m"
    ),
    number("braking_velocity", "mean velocity towards the target at the first braking movement", "m/s"),
    number(
        "braking_velocity_sd",
        "standard deviation of the velocity towards the target at the first braking movement",
        "m/s",
    ),
    count("movements", "cooperative movements with a delay at 20 %"),
    *(number(f"delay_{q}", f"mean absolute delay at {q} % of the slower side's peak", "s") for q in THRESHOLDS),
    number("signed_delay_20", "mean delay at 20 %, left minus right: + = right first", "s"),
)
"""Columns of the table of groups."""

ATTEMPTS = (
    STUDY,
    *(field for field in (*PLACE_IN_STUDY, *TRIALS) if field.name != "recording"),
    count("excluded", "1: excluded by a rule"),
    number("delay_20", "mean absolute delay at 20 % over its cooperative movements", "s"),
)
"""Columns of the table of attempts."""

PUSHES = (
    STUDY,
    *(_LABELLED[name] for name in ("dyad", "performer", "condition", "configuration", "force", "pushed")),
    number("peak", "peak displacement after a push, in its direction, from the mean course of trials without one", "m"),
    number("peak_time", "time of the peak displacement after the onset", "s"),
    number("half_back", "time after the onset until half-way back; NaN: not within the window", "s"),
)
"""Columns of the table of responses to pushes, as of `netboard.analysis.topics.pushes`."""

KEYS = ["dyad", "performer", "condition", "group"]
"""Columns that identify a row of `GROUPS` in a study."""


@dataclass(frozen=True, slots=True)
class CohortMeasure:
    """A measure that can be computed from `GROUPS`.

    - `value`: function of rows; returns the mean of each.
    - `weight`: column with the number of values behind that mean.
    """

    measure: Measure
    value: Callable[[pd.DataFrame], pd.Series]
    weight: str


_KEPT: dict[str, tuple[Callable[[pd.DataFrame], pd.Series], str]] = {
    "completion time": (itemgetter("log_completion"), "trials"),
    "velocity peaks": (itemgetter("peaks"), "trials"),
    "falls per attempt": (lambda rows: rows["falls"] / rows["attempts"].where(rows["attempts"] > 0), "attempts"),
    **{f"{name} share": (itemgetter(name), "trials") for name in CLASSES},
    "|delay at 20 %|": (itemgetter("delay_20"), "movements"),
}

KEPT = tuple(CohortMeasure(one, *_KEPT[one.name]) for one in MEASURES if one.name in _KEPT)
"""The measures of a cohort, in the order of the report."""


def fields_of(study: StudyData) -> dict[str, tuple[Field, ...]]:
    """Return the columns of the tables of a study, with those of its factors."""
    return {
        "groups": study.with_factor_fields(GROUPS),
        "trials": study.with_factor_fields(ATTEMPTS),
        "pushes": PUSHES,
    }


def group_rows(study: StudyData, number: int) -> pd.DataFrame:
    """Summarise the trials, attempts and movements of a study in groups.

    - `number`: number of the virtual study [1].
    """
    attempts = rows_of(study, "attempt")
    attempts = _grouped(attempts.assign(order=trial_numbers(attempts), fell=attempts["outcome"] == "fell"))
    factors = [field.name for field in study.factor_fields if field.name not in _LABELS]
    first = {name: (name, "first") for name in (*_LABELS, *factors)}
    of_attempts = attempts.groupby(KEYS, sort=False).agg(**first, attempts=("fell", "size"), falls=("fell", "sum"))
    found = of_attempts.join(
        [_of_trials(_grouped(counted(study))), _of_movements(_grouped(rows_of(study, "movement")))]
    )
    whole = found.fillna({"trials": 0, "brakings": 0, "movements": 0}).reset_index()
    return whole.assign(study=number)


def _grouped(rows: pd.DataFrame) -> pd.DataFrame:
    return rows.assign(group=groups_of(rows["order"].to_numpy(), SIZE) + 1)


def _of_trials(rows: pd.DataFrame) -> pd.DataFrame:
    """Summarise the trials that count."""
    values = {
        one.measure.name: np.asarray(one.measure.values(rows), float) for one in KEPT if one.measure.of == "trial"
    }
    times = values["completion time"]
    table = rows[[*KEYS, *_SPREAD]].assign(
        log_completion=np.log(np.where(times > 0.0, times, np.nan)),
        **{name: values[f"{name} share"] for name in CLASSES},
    )
    groups = table.groupby(KEYS, sort=False)
    spreads = groups[list(_SPREAD)].std().add_suffix("_sd")
    counts = groups.agg(trials=("completion", "size"), brakings=("braking_distance", "count"))
    return counts.join([groups.mean(), spreads])


def _of_movements(rows: pd.DataFrame) -> pd.DataFrame:
    """Summarise the cooperative movements of these trials."""
    delays = {f"delay_{q}": rows[f"delay_{q}"].abs() for q in THRESHOLDS}
    table = rows[KEYS].assign(**delays, signed_delay_20=rows["delay_20"])
    groups = table.groupby(KEYS, sort=False)
    return groups.agg(movements=("delay_20", "count")).join(groups.mean())


def push_rows(study: StudyData, number: int) -> Columns:
    """Return the mean response of each performer to pushes at a place, in each condition."""
    rows = [
        {
            "study": number,
            "dyad": dyad,
            "performer": performer,
            "condition": one.condition.name,
            "configuration": one.condition.configuration,
            "force": one.condition.force,
            "pushed": one.place,
            "peak": response.peak,
            "peak_time": response.at,
            "half_back": response.half_back,
        }
        for one in pushes(study).parts
        for (dyad, performer), response in zip(one.performers, one.responses, strict=True)
    ]
    return columns_of(PUSHES, rows)


def attempt_rows(study: StudyData, number: int) -> pd.DataFrame:
    """Return all attempts of a study, with their mean delay and whether they are excluded."""
    moved = study.movements[study.movements["cooperative"] == 1]
    delays = moved["delay_20"].abs().groupby([moved[key] for key in ATTEMPT_KEY]).mean()
    return study.trials.join(delays, on=ATTEMPT_KEY).assign(excluded=excluded(study).astype(int), study=number)
