"""Exclusion of attempts: declared rules, applied to all attempts alike, with every reason listed.

The rules are the settings `Exclusions`, and for flags the rule that the running session applies, too
(`netboard.task.trials.exclusion`). All attempts are measured; this module only lists those that do not count. The list
includes attempts without measures, such as those that an operator ended.
"""

from collections.abc import Collection, Iterator, Mapping
from math import isnan
from typing import Any

import pandas as pd

from netboard.analysis.extraction.settings import Exclusions
from netboard.analysis.extraction.tables import PLACE, words
from netboard.analysis.extraction.trials import UNRELEASED
from netboard.base.errors import ConfigError
from netboard.task.trials.exclusion import excluding
from netboard.task.trials.quality import FLAGS

EXCLUSIONS = (*PLACE, words("why", "why the attempt is excluded"))
"""Columns of the table of exclusions: one row for each reason, so an attempt may have several rows."""

NO_COMPLETION = "no completion time: with the settings of this analysis, its samples do not show when the hold began"
"""Reason for the exclusion of a success without a completion time."""

NO_RELEASE = "its release is not in the recording, so its times are not known"
"""Reason for the exclusion of an attempt that began before the first tick of its recording."""

PERTURBED = "a perturbation trial"
"""Reason for the exclusion of a perturbation trial."""

BLOCK_RUN = ("run", "block", "config_sha256")
"""Columns of the table of blocks that are the same in all recordings of a run of a block."""

_SAME_ATTEMPT = (*BLOCK_RUN, "trial", "attempt", "outcome", "target", "duration", "recorded_completion")
"""Columns by which an attempt in two recordings is the same; its measures may differ if one begins within it."""


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
    rows += _recorded_again(blocks, trials)
    return pd.DataFrame(rows, columns=[field.name for field in EXCLUSIONS])


def _recorded_again(blocks: pd.DataFrame, trials: pd.DataFrame) -> Iterator[tuple[str, int, int, str]]:
    """Yield each attempt that another recording has, too, as when two loggers recorded parts of the same block.

    It counts where it is without quality flags, or else in the first recording.
    """
    known = blocks.loc[blocks["run"] != "", ["recording", *BLOCK_RUN]]
    joined = trials.merge(known, on="recording", validate="many_to_one")
    best = joined.sort_values("flags", key=lambda flags: flags != "", kind="stable")
    counts_in = best.groupby(list(_SAME_ATTEMPT), dropna=False)["recording"].transform("first").sort_index()
    for row, counted in zip(joined.to_dict("records"), counts_in, strict=True):
        if row["recording"] != counted:
            yield (
                row["recording"],
                row["trial"],
                row["attempt"],
                f"recorded by another logger, too: counts in {counted}",
            )


def flags_of(rules: Exclusions, block: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the flags that exclude an attempt of a recording, from its row of the table of blocks."""
    declared = str(block["exclude"]).split()
    return tuple(dict.fromkeys(flag for word in rules.flags for flag in (declared if word == "declared" else [word])))


def named_trials(rules: Exclusions) -> dict[tuple[str, int], str]:
    """Return the trials that the experimenter has excluded, with the reasons."""
    named: dict[tuple[str, int], str] = {}
    for word in rules.trials:
        place, colon, why = word.partition(":")
        recording, _, trial = place.strip().rpartition("/")
        if not colon or not why.strip() or not (trial.isascii() and trial.isdecimal()):
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
    row: dict[str, Any], block: dict[str, Any], rules: Exclusions, pilots: bool, named: dict[tuple[str, int], str]
) -> Iterator[str]:
    if row["outcome"] == "success" and isnan(row["completion"]):
        yield NO_COMPLETION
    if pilots and block["pilot"]:
        yield "a pilot recording"
    if row["trial"] <= rules.warm_up:
        which = "the first trial" if rules.warm_up == 1 else f"one of the first {rules.warm_up} trials"
        yield f"{which} of the block"
    if block.get("role") in rules.roles:
        yield f"in a {block['role']} block"
    if rules.catch and row["catch"]:
        yield "a catch trial"
    if rules.perturbed and abs(row["perturbation"]) > 0.0:  # NaN is no perturbation
        yield PERTURBED
    for flag in excluding(str(row["flags"]).split(), flags_of(rules, block), simulated=bool(block["simulated"])):
        yield FLAGS[flag]
    if (row["recording"], row["trial"]) in named:
        yield f"excluded by the experimenter: {named[row['recording'], row['trial']]}"
