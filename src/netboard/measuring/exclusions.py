"""Which attempts do not count, and why: the declared rules, applied to all attempts alike, and everything listed."""

from collections.abc import Iterator, Sequence
from typing import Any

import pandas as pd

from netboard.errors import ConfigError
from netboard.experiment.quality import WORDS
from netboard.measuring.readings import Exclusions
from netboard.measuring.tables import PLACE, words

EXCLUSIONS = (*PLACE, words("why", "why the attempt does not count"))
"""Columns of the table of exclusions: a row for each reason, so an attempt may have several."""

_STUCK = ("stuck_left", "stuck_right")


def excluded(blocks: pd.DataFrame, trials: pd.DataFrame, rules: Exclusions) -> pd.DataFrame:
    """List the attempts that do not count.

    Parameters
    ----------
    blocks, trials : DataFrame
        Tables of blocks and of trials, a row for a recording and for an attempt.
    rules : Exclusions
        The rules.

    Returns
    -------
    DataFrame
        The columns of `EXCLUSIONS`.

    Raises
    ------
    ConfigError
        If a trial is named that is not there.
    """
    named = _named(rules.trials, trials)
    recordings = {row["recording"]: row for row in blocks.to_dict("records")}
    pilots = rules.pilots == "always" or (rules.pilots == "unless_all" and not blocks["pilot"].all())
    rows = [
        (row["recording"], row["trial"], row["attempt"], why)
        for row in trials.to_dict("records")
        for why in _reasons(row, recordings[row["recording"]], rules, pilots, named)
    ]
    return pd.DataFrame(rows, columns=[field.name for field in EXCLUSIONS])


def _named(words_given: Sequence[str], trials: pd.DataFrame) -> dict[tuple[str, int], str]:
    """Read the trials that an experimenter has excluded."""
    there = set(zip(trials["recording"], trials["trial"], strict=True))
    named: dict[tuple[str, int], str] = {}
    for word in words_given:
        place, colon, why = word.partition(":")
        recording, _, trial = place.strip().rpartition("/")
        if not colon or not why.strip() or not trial.isdecimal():
            raise ConfigError(f"[exclusions] trials: found {word!r}, expected RECORDING/TRIAL: why")
        if (recording, int(trial)) not in there:
            raise ConfigError(f"[exclusions] trials: found {word!r}, but there is no trial {trial} in {recording!r}")
        named[recording, int(trial)] = why.strip()
    return named


def _reasons(
    row: dict[str, Any],
    block: dict[str, Any],
    rules: Exclusions,
    pilots: bool,
    named: dict[tuple[str, int], str],
) -> Iterator[str]:
    """Yield why an attempt does not count."""
    if pilots and block["pilot"]:
        yield "a pilot recording"
    if row["trial"] <= rules.warm_up:
        yield f"one of the first {rules.warm_up} trials of the block"
    if rules.catch and row["catch"]:
        yield "a catch trial"
    for flag in str(row["flags"]).split():
        if flag in rules.flags and not (block["simulated"] and flag in _STUCK):
            yield WORDS[flag]
    if (row["recording"], row["trial"]) in named:
        yield f"excluded by the experimenter: {named[row['recording'], row['trial']]}"
