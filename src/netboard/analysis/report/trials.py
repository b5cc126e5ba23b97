"""List of all attempts of a study, by block, with ball path and the commands that replay and explain each.

The page has some thousands of attempts, so a path has a few dozen points with integer coordinates, and a row has little
else.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from math import ceil, isfinite
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from netboard.analysis.extraction.study import StudyData
from netboard.analysis.extraction.tables import ATTEMPT_KEY
from netboard.analysis.report.wording import amount, plural
from netboard.analysis.topics.groups import labels_of
from netboard.base.terminal.shell import shell_command

LEAD = 0.5
"""Time before the release at which a replay begins [s]."""

STEP = 0.1
"""Interval between points of a path [s]."""

HEIGHT = 70
"""Height of a path, in drawing units [1]."""

PER_SECOND = 20
"""Width of a path, in drawing units per second [1/s]."""

LONGEST = 20.0
"""Duration at which the width of a path is capped [s]."""

_PIXELS = 0.55
_SIDES = {-1: "left", 1: "right"}
Key = tuple[str, int, int]
"""Recording, trial and attempt."""


@dataclass(frozen=True, slots=True)
class Sparkline:
    """Path of the ball in an attempt, as a small drawing [px]; `squeezed` if its time axis is compressed to the cap."""

    d: str
    extent: int
    width: int
    squeezed: bool


@dataclass(frozen=True, slots=True)
class Row:
    """An attempt as texts, completion time in s; `replay` and `explain` are commands that replay and explain it."""

    anchor: str
    trial: int
    attempt: int
    target: str
    outcome: str
    completion: str
    peaks: str
    flags: str
    why: str
    path: Sparkline
    replay: str
    explain: str


@dataclass(frozen=True, slots=True)
class AttemptListing:
    """The attempts of a recording."""

    anchor: str
    recording: str
    dyad: str
    performer: str
    heading: str
    rows: tuple[Row, ...]


def anchors(study: StudyData) -> dict[Key, str]:
    """Return the anchor of every attempt in the page."""
    place = {recording: number for number, recording in enumerate(study.blocks["recording"], start=1)}
    return {(name, trial, n): f"r{place[name]}t{trial}a{n}" for name, trial, n in _keys(study.trials)}


def listings(study: StudyData, files: Mapping[str, str]) -> tuple[AttemptListing, ...]:
    """Return all attempts of all recordings."""
    known, paths, why = anchors(study), sparklines(study), reasons(study)
    last = study.trials.groupby(["recording", "trial"])["attempt"].max().to_dict()
    rows: dict[str, list[Row]] = {}
    for key, row in zip(_keys(study.trials), study.trials.to_dict("records"), strict=True):
        recording, trial, attempt = key
        file, at = files[recording], max(row["release"] - LEAD, 0.0)
        rows.setdefault(recording, []).append(
            Row(
                anchor=known[key],
                trial=trial,
                attempt=attempt,
                target=_SIDES.get(row["target"], "unknown"),
                outcome=str(row["outcome"]).replace("_", " "),
                completion=amount(row["completion"], 2) if row["outcome"] == "success" else "",
                peaks=amount(int(row["peaks"])) if row["outcome"] == "success" and isfinite(row["peaks"]) else "",
                flags=flag_words(row["flags"]),
                why="; ".join(why.get(key, ())),
                path=paths.get(key, _NOTHING),
                replay=shell_command("netboard", "replay", file, "--at", f"{at:.1f}"),
                explain=_explain(file, trial, attempt if attempt != last[recording, trial] else None),
            )
        )
    labels = labels_of(study)
    return tuple(
        _listing(number, block, labels.get(block["condition"], block["condition"]), rows.get(block["recording"], []))
        for number, block in enumerate(study.blocks.to_dict("records"), start=1)
    )


def _explain(file: str, trial: int, attempt: int | None) -> str:
    """Return the command that explains the measures of an attempt; None for the last attempt at the trial."""
    named = [] if attempt is None else ["--attempt", f"{attempt}"]
    return shell_command("netboard", "explain", file, "--trial", f"{trial}", *named)


def flag_words(words: str) -> str:
    """Return quality flags as text."""
    return ", ".join(word.replace("_", " ") for word in str(words).split())


def reasons(study: StudyData) -> dict[Key, list[str]]:
    """Return the reasons for the exclusion of attempts."""
    found: dict[Key, list[str]] = {}
    for key, why in zip(_keys(study.exclusions), study.exclusions["why"], strict=True):
        found.setdefault(key, []).append(why)
    return found


def _listing(number: int, block: Mapping[Any, Any], condition: str, rows: list[Row]) -> AttemptListing:
    done = sum(row.outcome == "success" for row in rows)
    excluded = sum(bool(row.why) for row in rows)
    parts = [
        f"block {block['block']}: {condition}",
        f"{done} of {plural(int(block['trials']), 'trial')} done in {plural(len(rows), 'attempt')}",
    ]
    if excluded:
        parts.append(f"{plural(excluded, 'attempt')} excluded")
    return AttemptListing(
        f"r{number}", block["recording"], block["dyad"], block["performer"], "; ".join(parts), tuple(rows)
    )


def _keys(table: pd.DataFrame) -> list[Key]:
    columns = (table[name].tolist() for name in ATTEMPT_KEY)
    return [(recording, int(trial), int(attempt)) for recording, trial, attempt in zip(*columns, strict=True)]


# --- paths -----------------------------------------------------------------------------------------------------------

_NOTHING = Sparkline("", 1, 1, False)


def reach(study: StudyData) -> float:
    """Return the largest distance of the ball from the board's middle, rounded up to 50 mm, as range of paths [m]."""
    largest = max(float(np.nanmax(np.abs(own["p"].to_numpy()), initial=0.0)) for own in study.paths.values())
    return max(ceil(largest / 0.05 - 1e-6), 1) * 0.05


def sparklines(study: StudyData) -> dict[Key, Sparkline]:
    """Draw the ball's path in every attempt: up is right, and time runs to the right."""
    far, found = reach(study), {}
    for paths in study.paths.values():
        starts = np.flatnonzero(~paths.duplicated(["trial", "attempt"]))
        each = np.split(paths[["time", "p"]].to_numpy(), starts[1:])
        for key, own in zip(_keys(paths.iloc[starts]), each, strict=False):
            found[key] = _sparkline(own[:, 0], own[:, 1], far)
    return found


def _sparkline(time: NDArray[np.float64], p: NDArray[np.float64], far: float) -> Sparkline:
    spacing = float(np.median(np.diff(time))) if time.size > 1 else STEP
    every = max(round(STEP / spacing), 1) if isfinite(spacing) and spacing > 0 else 1
    chosen = np.unique(np.append(np.arange(0, time.size, every), time.size - 1))
    gaps = np.flatnonzero(~np.isfinite(p[chosen]))
    pieces = [piece[np.isfinite(p[piece])] for piece in np.split(chosen, gaps)]
    d = "".join(
        _path(
            np.rint(PER_SECOND * time[piece]).astype(np.int64),
            np.rint(HEIGHT / 2 * (1 - p[piece] / far)).astype(np.int64),
        )
        for piece in pieces
    )
    extent = max(ceil(PER_SECOND * float(time[-1])), 1)
    squeezed = float(time[-1]) > LONGEST
    width = max(round(_PIXELS * min(extent, LONGEST * PER_SECOND)), 1)
    return Sparkline(d, extent, width, squeezed)


def _path(x: NDArray[np.int64], y: NDArray[np.int64]) -> str:
    """Return points as an SVG path: the first point and steps, with equal consecutive steps merged."""
    if x.size < 2:
        return ""
    dx, dy = np.diff(x), np.diff(y)
    last = np.append(np.flatnonzero((np.diff(dx) != 0) | (np.diff(dy) != 0)), dx.size - 1)
    at_x, at_y = np.append(x[0], x[last + 1]), np.append(y[0], y[last + 1])
    steps = (f"{a}{b}" if b < 0 else f"{a} {b}" for a, b in zip(np.diff(at_x), np.diff(at_y), strict=True))
    return f"M{x[0]} {y[0]}l" + " ".join(steps)
