"""Table of performers in each condition, for programs for dyadic data (APIM, multilevel models).

Rows of participants who performed alone name their partner, so that actor and partner effects can be fitted; dyads have
no partner. Values are means of the trials that count; failures are counted over all attempts.
"""

import numpy as np
import pandas as pd

from netboard.analysis.extraction.conditions import participants_of
from netboard.analysis.extraction.study import PLACE_IN_STUDY, StudyData
from netboard.analysis.extraction.tables import count, number, words
from netboard.analysis.measures.movements import mean_shares
from netboard.analysis.topics.groups import CLASSES, counted

_MEANS = {
    "completion": ("mean completion time", "s"),
    "peaks": ("mean number of velocity peaks", "1"),
    "sparc": ("mean spectral arc length of the ball's speed", "1"),
    "ldlj": ("mean log dimensionless jerk of the ball's speed", "1"),
    "braking_distance": ("mean distance to the target at the first braking movement", "m"),
    "braking_velocity": ("mean velocity towards the target at the first braking movement", "m/s"),
}

SHARES = tuple(
    number(name, f"mean share of {name} movement" if name != "still" else "mean share without movement", "1")
    for name in CLASSES
)
"""Columns of the mean share of each movement class."""

_OF_TRIALS = {field.name: field for field in PLACE_IN_STUDY}

PEOPLE = (
    _OF_TRIALS["dyad"],
    words("performer", "participant, or the dyad"),
    words("partner", "the other participant of the dyad; empty if the dyad performed together"),
    *(_OF_TRIALS[name] for name in ("configuration", "force", "condition")),
    words("role", "purpose of the trials: practice, familiarisation, baseline, test, or catch"),
    count("trials", "number of successful trials that are included"),
    count("attempts", "number of attempts that ended with a success, a fall or a timeout"),
    count("falls", "number of these attempts that ended with a fall"),
    *(number(name, text, unit) for name, (text, unit) in _MEANS.items()),
    number("log_completion", "mean natural logarithm of the completion time in s", "1"),
    number("completion_median", "median completion time", "s"),
    number("completion_sd", "standard deviation of the completion times", "s"),
    *SHARES,
    number(
        "delay_20", "mean absolute delay at 20 % of the peak chosen in the settings, over cooperative movements", "s"
    ),
    number("signed_delay_20", "mean signed delay at 20 % of that peak, left minus right: + = right first", "s"),
)
"""Columns of the table of performers."""


def people_of(study: StudyData) -> pd.DataFrame:
    """Average the trials of each performer in each condition."""
    factors = [field.name for field in study.factor_fields]
    keys = ["dyad", "performer", "configuration", "force", "condition", "role"]
    partners = _partners(study)
    times = counted(study)["completion"]
    delays = {key: rows["delay_20"] for key, rows in study.movements[study.movements["counts"] == 1].groupby(keys)}
    rows = []
    for key, attempts in study.trials.groupby(keys, sort=True):
        trials = attempts[attempts["counts"] == 1]
        trials = trials.assign(completion=times[trials.index])
        named = dict(zip(keys, key, strict=True))
        known = delays.get(key, pd.Series(dtype=np.float64)).dropna()
        rows.append(
            {
                **named,
                **{name: _common(attempts[name]) for name in factors},
                "partner": partners.get((named["dyad"], named["performer"]), ""),
                "trials": len(trials),
                "attempts": len(attempts),
                "falls": int((attempts["outcome"] == "fell").sum()),
                **_of_trials(trials, study),
                "delay_20": known.abs().mean(),
                "signed_delay_20": known.mean(),
            }
        )
    return pd.DataFrame(rows, columns=[field.name for field in (*PEOPLE, *study.factor_fields)])


def _common(levels: pd.Series) -> object:
    """Return the common level of some trials; if there are several, all of them, and no value."""
    found = levels.dropna().unique()
    if len(found) == 1:
        return found[0]
    return np.nan if levels.dtype == np.float64 else ", ".join(map(str, found))


def _partners(study: StudyData) -> dict[tuple[str, str], str]:
    """Return the partner of each participant in a dyad: the other who performed alone, or sat at the same board."""
    found: dict[tuple[str, str], str] = {}
    for dyad, blocks in study.blocks.groupby("dyad"):
        people = participants_of(blocks)
        if len(people) == 2:
            found |= {(dyad, people[0]): people[1], (dyad, people[1]): people[0]}
    return found


def _of_trials(trials: pd.DataFrame, study: StudyData) -> dict[str, float]:
    """Average the trials that count."""
    times = trials["completion"]
    shares = mean_shares(trials[list(CLASSES)].to_numpy(np.float64), of=study.readings.summaries.shares)
    return {
        **{name: trials[name].mean() for name in _MEANS},
        "log_completion": np.log(times[times > 0]).mean(),
        "completion_median": times.median(),
        "completion_sd": times.std(),
        **dict(zip(CLASSES, shares, strict=True)),
    }
