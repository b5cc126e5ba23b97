"""Synthetic studies for reports, row by row."""

import hashlib
from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd

from made_study import Row, rows_of
from netboard.analysis.extraction.recordings import BLOCKS, FIELDS, Measured
from netboard.analysis.extraction.settings import Readings
from netboard.analysis.extraction.study import StudyData, study_of
from netboard.analysis.topics.result import Result, table_of


def ball_paths(name: str, attempts: Sequence[tuple[int, int]], seconds: float) -> dict[str, Any]:
    """Make paths of a ball that rolls to the target and oscillates there."""
    time = np.arange(0.0, seconds, 0.02)
    return {field.name: np.full(time.size * len(attempts), np.nan) for field in FIELDS["paths"]} | {
        "recording": np.full(time.size * len(attempts), name, object),
        "trial": np.repeat([trial for trial, _ in attempts], time.size),
        "attempt": np.repeat([attempt for _, attempt in attempts], time.size),
        "time": np.tile(time, len(attempts)),
        "p": np.concatenate([0.15 * np.tanh(2 * (time - 1)) + 0.02 * np.sin(3 * time + k) for k, _ in attempts]),
    }


def block(
    name: str, trials: int = 3, seconds: float = 4.0, falls: int = 1, rows: Row | None = None, **changes: Any
) -> Measured:
    """Make a recording in whose first trial the ball fell ``falls`` times before the success."""
    whole = {
        "recording": name,
        "dyad": "D01",
        "session": "S01",
        "study": "made up",
        "block": 1,
        "part": 1,
        "configuration": "bimanual",
        "force": "full",
        "haptics": 1,
        "performer": "D01A",
        "left_by": "D01A",
        "right_by": "D01A",
        "opened_utc": "2026-03-04T05:06:07+00:00",
        "duration": 60.0,
        "ticks": 60_000,
        "trials": trials,
        "netboard": "0.1.0",
    } | changes
    attempts: list[Row] = [(trial, 1 + (falls if trial == 1 else 0), "success") for trial in range(1, trials + 1)]
    attempts = [(1, k, "fell") for k in range(1, falls + 1)] + attempts
    done = [
        {
            "recording": name,
            "trial": trial,
            "attempt": attempt,
            "outcome": outcome,
            "target": 1 if trial % 2 else -1,
            "release": 2.0 + 6.0 * at,
            "duration": seconds,
            "completion": seconds - 1.5 + 0.01 * trial if outcome == "success" else float("nan"),
            "peaks": 2 + trial % 3,
        }
        | dict(rows or {})
        for at, (trial, attempt, outcome) in enumerate(attempts)
    ]
    return Measured(
        rows_of(BLOCKS, [whole]),
        rows_of(FIELDS["trials"], done),
        rows_of(FIELDS["movements"], []),
        ball_paths(name, [(trial, attempt) for trial, attempt, _ in attempts], seconds),
        rows_of(FIELDS["controls"], []),
        rows_of(FIELDS["answers"], []),
    )


def small_study(readings: Readings | None = None, **changes: Any) -> StudyData:
    """One dyad: each alone, with and without forces, and both together."""
    plans: list[dict[str, Any]] = [
        {"configuration": "bimanual", "force": force, "performer": who, "left_by": who, "right_by": who}
        for force in ("full", "none")
        for who in ("D01A", "D01B")
    ]
    plans.append(
        {"configuration": "dyadic", "force": "full", "performer": "D01", "left_by": "D01B", "right_by": "D01A"}
    )
    measured = [
        block(f"made_{k}", **(plan | {"block": k, "part": k, "haptics": int(plan["force"] == "full")} | changes))
        for k, plan in enumerate(plans, start=1)
    ]
    return study_of(measured, readings or Readings())


def provenance_of(study: StudyData, **changes: Any) -> dict[str, Any]:
    """Where it comes from: files named after the recordings, with the SHA-256 of their names."""
    return {
        "recordings": {
            name: {"file": f"recordings/{name}.mcap", "sha256": sha256_of(name)} for name in study.blocks["recording"]
        },
        "versions": {"netboard": "0.1.0", "numpy": "2.2.0"},
    } | changes


def sha256_of(name: str) -> str:
    return hashlib.sha256(name.encode("utf-8", "surrogatepass")).hexdigest()


def few_results() -> pd.DataFrame:
    """Results of two topics."""
    nan = float("nan")
    return table_of(
        [
            Result("learning", "completion time", "bimanual, first 30", 5.714, 1.234, 10.194, "s", "SD", 720, "trial"),
            Result("learning", "completion time", "bimanual, last 30", 3.61, 0.53, 6.69, "s", "SD", 720, "trial"),
            Result(
                "dyads",
                "completion time: dyads better than the mean of the two",
                "haptics on",
                4,
                nan,
                nan,
                "1",
                "",
                4,
                "dyad",
            ),
            Result(
                "classes",
                "share of cooperative movement",
                "dyadic, haptics on",
                0.2,
                0.1,
                0.3,
                "1",
                "95 % t",
                4,
                "dyad",
                "of the time",
            ),
            Result(
                "classes",
                "share of cooperative movement",
                "dyadic, haptics on vs off",
                -0.05,
                -0.12,
                0.02,
                "1",
                "95 % t",
                4,
                "dyad",
                "of the time",
            ),
        ]
    )
