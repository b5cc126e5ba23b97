"""Exclusion of attempts: declared rules, applied to all attempts alike, with every reason listed.

The rules are the settings `Exclusions`. All attempts are measured; this module only lists those that do not count. The
list includes attempts without measures, such as those that an operator ended.
"""

from collections.abc import Collection, Iterator
from math import isnan
from typing import Any

import pandas as pd

from netboard.analysis.extraction.settings import Exclusions
from netboard.analysis.extraction.tables import PLACE, words
from netboard.analysis.extraction.trials import UNRELEASED
from netboard.base.errors import ConfigError
from netboard.task.trials.quality import FLAGS

EXCLUSIONS = (*PLACE, words("why", "why the attempt is excluded"))
"""Columns of the table of exclusions: one row for each reason, so an attempt may have several rows."""

NO_COMPLETION = "no completion time: with the settings of this analysis, its samples do not show when the hold began"
"""Reason for the exclusion of a success without a completion time."""

NO_RELEASE = "its release is not in the recording, so its times are not known"
"""Reason for the exclusion of an attempt that began before the first tick of its recording."""

_STUCK = ("stuck_left", "stuck_right")


def excluded(blocks: pd.DataFrame, trials: pd.DataFrame, rules: Exclusions) -> pd.DataFrame:
    """Return the table of excluded attempts, from a row for each recording and one for each attempt."""
    named = named_trials(rules)
    there = set(zip(trials["recording"], trials["trial"], strict=True))
    for recording, trial in named:
        if (recording, trial) not in there:
            raise ConfigError(f"[exclusions] trials: there is no trial {trial} in {recording!r}")
    recordings = {row["recording"]: row for row in blocks.to_dict("records")}
    pilots = rules.pilots == "always" or (rules.pilots == "unless_all" and not blocks["pilot"].all())
    rows = [
        (row["recording"], row["trial"], row["attempt"], why)
        for row in trials.to_dict("records")
        for why in _reasons(row, recordings[row["recording"]], rules, pilots, named)
    ]
    rows += [(name, *ended) for name, block in recordings.items() for ended in _ended_otherwise(block["not_measured"])]
    return pd.DataFrame(rows, columns=[field.name for field in EXCLUSIONS])


def named_trials(rules: Exclusions) -> dict[tuple[str, int], str]:
    """Return the trials that the experimenter has excluded, with the reasons."""
    named: dict[tuple[str, int], str] = {}
    for word in rules.trials:
        place, colon, why = word.partition(":")
        recording, _, trial = place.strip().rpartition("/")
        if not colon or not why.strip() or not trial.isdecimal():
            raise ConfigError(f"[exclusions] trials: found {word!r}, expected RECORDING/TRIAL: why")
        named[recording, int(trial)] = why.strip()
    return named


def require_recordings(rules: Exclusions, recordings: Collection[str]) -> None:
    """Raise an error if an excluded trial names an unknown recording, before any is measured."""
    for recording, trial in named_trials(rules):
        if recording not in recordings:
            raise ConfigError(f"[exclusions] trials: there is no trial {trial} in {recording!r}: no such recording")


def _ended_otherwise(text: str) -> Iterator[tuple[int, int, str]]:
    """Yield trial, attempt and reason of each attempt that is not measured, from the column of a block."""
    for word in filter(None, text.split("; ")):
        place, _, outcome = word.partition(" ")
        trial, _, attempt = place.partition(".")
        why = NO_RELEASE if outcome == UNRELEASED else f"ended without success, fall or timeout: {outcome}"
        yield int(trial), int(attempt), why


def _reasons(
    row: dict[str, Any],
    block: dict[str, Any],
    rules: Exclusions,
    pilots: bool,
    named: dict[tuple[str, int], str],
) -> Iterator[str]:
    if row["outcome"] == "success" and isnan(row["completion"]):
        yield NO_COMPLETION
    if pilots and block["pilot"]:
        yield "a pilot recording"
    if row["trial"] <= rules.warm_up:
        yield f"one of the first {rules.warm_up} trials of the block"
    if block.get("role") in rules.roles:
        yield f"in a {block['role']} block"
    if rules.catch and row["catch"]:
        yield "a catch trial"
    for flag in str(row["flags"]).split():
        if flag in rules.flags and not (block["simulated"] and flag in _STUCK):
            yield FLAGS[flag]
    if (row["recording"], row["trial"]) in named:
        yield f"excluded by the experimenter: {named[row['recording'], row['trial']]}"
