"""Small synthetic studies with missing parts: conditions, dyads, trials, successes, measures, movements, paths."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd

from made_modern import modern_blocks, modern_study, with_paths
from made_study import Block
from netboard.analysis.extraction.study import StudyData

LACKS = (
    *("no_success", "no_falls", "all_flagged", "one_condition", "one_dyad", "one_trial"),
    *("one_block", "one_participant"),
    *("only_bimanual", "only_dyadic", "no_forces", "empty_block", "no_trials", "no_movements", "no_cooperation"),
    *("no_completion", "no_measures", "holes", "constant", "pilots", "many_falls", "unequal", "catch"),
)
"""What a study may lack, or have too much of."""


def lacking(lacks: Sequence[str], seed: int, dyads: int = 2, trials: int = 3) -> StudyData:
    """Make a study that lacks some of `LACKS`."""
    chance = np.random.default_rng(seed)
    blocks = [block for block in modern_blocks(seed, dyads, trials) if _kept(block, lacks)] or modern_blocks(
        seed, 1, 1
    )[:1]
    if "one_block" in lacks:
        blocks = [blocks[int(chance.integers(len(blocks)))]]
    blocks = [_thinned(block, lacks, chance) for block in blocks]
    if "empty_block" in lacks:
        blocks[-1] = replace(blocks[-1], trials=[], movements=[])
    settings = ["exclusions.pilots=always"] if "pilots" in lacks else []
    return _with_lines(modern_study(blocks, *settings))


def _kept(block: Block, lacks: Sequence[str]) -> bool:
    """Say whether a study has a block."""
    unwanted = {
        "one_condition": block.force == "none" or block.configuration == "bimanual",
        "one_dyad": block.dyad != "D01",
        "one_participant": block.performer != "D01A",
        "only_bimanual": block.configuration != "bimanual",
        "only_dyadic": block.configuration != "dyadic",
        "no_forces": block.force != "none",
    }
    return not any(unwanted.get(lack, False) for lack in lacks)


def _thinned(block: Block, lacks: Sequence[str], chance: np.random.Generator) -> Block:
    """Take things away from a block."""
    count = 1 if "one_trial" in lacks else int(chance.integers(len(block.trials) + 1)) if "unequal" in lacks else None
    trials: list[dict[str, Any]] = [_attempt(dict(row), lacks, chance) for row in block.trials[:count]]
    moves: list[dict[str, Any]] = [dict(row) for row in block.movements if int(row["trial"]) <= len(trials)]
    if "no_trials" in lacks:
        trials, moves = [], []
    if "no_movements" in lacks:
        moves = []
    if "no_cooperation" in lacks:
        moves = [row | {"cooperative": 0} for row in moves]
    if "holes" in lacks:
        moves = [
            {name: value for name, value in row.items() if "delay" not in name or chance.random() < 0.5}
            for row in moves
        ]
    return replace(block, trials=trials, movements=moves)


def _attempt(row: dict[str, Any], lacks: Sequence[str], chance: np.random.Generator) -> dict[str, Any]:
    """Take things away from an attempt."""
    if "constant" in lacks:
        row = {name: value if name == "peaks" else 0.5 for name, value in row.items()} | {"peaks": 2, "overshoots": 0}
    if "no_measures" in lacks:
        row = {name: row[name] for name in ("completion", "duration")}
    if "holes" in lacks:
        row = {
            name: value for name, value in row.items() if chance.random() < 0.6 or name in ("overshoots", "duration")
        }
    if "no_completion" in lacks:
        row["completion"] = float("nan")
    if "no_success" in lacks or ("many_falls" in lacks and chance.random() < 0.7):
        row |= {"outcome": "fell" if chance.random() < 0.8 else "timed_out", "completion": float("nan")}
    elif "no_falls" not in lacks and chance.random() < 0.15:
        row |= {"outcome": "fell", "completion": float("nan")}
    if "all_flagged" in lacks:
        row["flags"] = "clipped"
    if "catch" in lacks and chance.random() < 0.5:
        row["catch"] = 1
    return row


def _with_lines(study: StudyData) -> StudyData:
    """Give every trial a path of a ball that goes to the target, as long as it took."""

    def path(trial: pd.Series) -> dict[str, np.ndarray]:
        duration = trial["duration"] if np.isfinite(trial["duration"]) else 1.0
        time = np.arange(0.0, min(duration, 3.0), 0.02)
        line = np.linspace(-0.15, 0.15, time.size)
        names = ("left_z", "right_z", "left_vz", "right_vz", "theta", "p", "vp")
        return {name: line * scale for scale, name in enumerate(names, start=1)} | {"p": line}

    return with_paths(study, path)
