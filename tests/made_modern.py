"""Synthetic studies with all measures beyond the paper, and with paths."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from made_study import Block, made_study, random_movement, random_trial
from netboard.analysis.extraction.attempts import MODERN
from netboard.analysis.extraction.details import PATHS
from netboard.analysis.extraction.study import StudyData
from netboard.recording.format.channels import DTYPES

Path = Mapping[str, NDArray[np.float64]]
"""Columns of the path of a trial, all but its place and the time."""


def modern_trial(chance: np.random.Generator) -> dict[str, float]:
    """Make a trial of any numbers, all that is measured among them."""
    sides = {
        f"{side}_{name}": float(value)
        for side in ("left", "right")
        for name, value in zip(
            ("reaction", "given", "received", "effort", "power"),
            (0.3 + 0.1 * chance.random(), *(0.01 * chance.random(4))),
            strict=True,
        )
    }
    names = ("to_left", "to_right", "interaction", "force_share", "in_target", "overshoot")
    measured = [field.name for group in MODERN for field in group.fields if not field.name.startswith("passive_")]
    others = chance.spawn(1)[0]  # so that a new measure changes no other number
    return {
        **{name: float(others.random()) for name in measured},
        **random_trial(chance),
        **sides,
        **{name: float(chance.random()) for name in names},
        "overshoots": int(chance.poisson(0.7)),
        "lag": float(chance.normal(0.0, 0.05)),
        "correlation": float(chance.random()),
        "sparc": float(chance.normal(-1.8, 0.1)),
        "ldlj": float(chance.normal(-8.0, 0.5)),
    }


def modern_blocks(
    seed: int = 0,
    dyads: int = 4,
    trials: int = 6,
    forces: Sequence[str] = ("full", "none"),
    change: Callable[[dict[str, float], str, str, int], None] = lambda *_: None,
) -> list[Block]:
    """Make the recordings of a whole study, in which nothing makes a difference but what is changed.

    `change` gets a trial, its configuration, its force and the number of the dyad from 0.
    """
    chance = np.random.default_rng(seed)
    blocks = []
    for number in range(dyads):
        dyad = f"D{number + 1:02}"
        for force in forces:
            for performer, configuration in ((f"{dyad}A", "bimanual"), (f"{dyad}B", "bimanual"), (dyad, "dyadic")):
                rows = [modern_trial(chance) for _ in range(trials)]
                for row in rows:
                    if configuration == "dyadic" and force != "none":
                        row |= {f"passive_{k}": share for k, share in ((50, 0.3), (150, 0.2), (300, 0.1))}
                        row |= {f"passive_{k}_device": share for k, share in ((50, 0.03), (150, 0.02), (300, 0.01))}
                        row["passive_friction"] = 0.26
                    change(row, configuration, force, number)
                moves = [random_movement(chance, trial) for trial in range(1, trials + 1) for _ in range(3)]
                partner = f"{dyad}B" if configuration == "dyadic" else ""
                blocks.append(Block(dyad, performer, configuration, force, rows, moves, partner))
    return blocks


def modern_study(blocks: Sequence[Block], *overrides: str) -> StudyData:
    """Join recordings; in dyadic ones participant A sits at the left."""
    study = made_study(blocks, *overrides)
    together = (study.blocks["configuration"] == "dyadic") & (study.blocks["left_by"] == study.blocks["dyad"])
    left = study.blocks["left_by"].where(~together, study.blocks["dyad"] + "A")
    return replace(study, blocks=study.blocks.assign(left_by=left))


def with_paths(study: StudyData, draw: Callable[[pd.Series], Path]) -> StudyData:
    """Give every trial that counts a path."""
    drawn: dict[str, list[pd.DataFrame]] = {name: [] for name in study.blocks["recording"]}
    for _, trial in study.counted.iterrows():
        path = draw(trial)
        count = len(path["left_vz"])
        place = {name: np.full(count, trial[name], dtype=object) for name in ("recording", "trial", "attempt")}
        drawn[trial["recording"]].append(pd.DataFrame({**place, "time": 0.02 * np.arange(count), **path}))
    types: dict[str, Any] = {field.name: DTYPES[field.kind] for field in PATHS}
    nothing = pd.DataFrame(columns=list(types))
    return replace(
        study,
        paths={
            name: pd.concat(rows or [nothing], ignore_index=True).reindex(columns=list(types)).astype(types)
            for name, rows in drawn.items()
        },
    )


def without_paths(study: StudyData) -> StudyData:
    """Take the paths away."""
    return replace(study, paths={name: paths.iloc[:0] for name, paths in study.paths.items()})
