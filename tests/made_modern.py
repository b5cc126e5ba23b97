"""Synthetic studies with all measures beyond the paper, and with paths."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from made_study import Block, made_study, random_movement, random_trial
from netboard.analysis.extraction.attempts import MODERN
from netboard.analysis.extraction.controls import CONTROLS, GROUPS, arms_of
from netboard.analysis.extraction.details import PATHS
from netboard.analysis.extraction.settings import ControlSettings
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
    measured = [field.name for group in MODERN for field in group.fields]
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


MOVED = {arm.name: 0.02 * (number + 1) for number, arm in enumerate(arms_of(ControlSettings()))}
"""What the arms of a made control add to the cooperative share, and take from the share of single movement."""


def control_rows(trials: Sequence[Mapping[str, float]]) -> list[dict[str, Any]]:
    """Make the controls of trials, in which each arm moves `MOVED` of the time to cooperative movement."""
    found: list[dict[str, Any]] = []
    for number, trial in enumerate(trials, start=1):
        own = {field.name: trial[field.name] for group in GROUPS for field in group.fields if field.name in trial}
        own |= {"trial": number, "delay_20": 0.1, "movements": 3}
        whole = sum(trial[name] for name in ("cooperative", "competitive", "single", "still"))
        for control in CONTROLS:
            found.append(own | {"control": control.name, "arm": ""})
            for arm in list(MOVED)[: None if control.every_arm else 2]:
                more = MOVED[arm] * whole
                moved = {"cooperative": own["cooperative"] + more, "single": own["single"] - more}
                found.append(own | moved | {"control": control.name, "arm": arm})
    return found


def opinion_of(dyad: str, force: str, number: int) -> dict[str, str]:
    """Make an answer to "was that a person?", as if the partner had been a robot with haptics off."""
    answer = "a program" if (number % 3 == 0) == (force == "full") else "a person"
    other = "person" if force == "full" else "leader"
    return {"participant": dyad, "other": other, "questionnaire": "who", "question": "opinion", "answer": answer}


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
                    change(row, configuration, force, number)
                moves = [random_movement(chance, trial) for trial in range(1, trials + 1) for _ in range(3)]
                partner = f"{dyad}B" if configuration == "dyadic" else ""
                controls = control_rows(rows) if force == "none" else []
                answers = [opinion_of(dyad, force, number)] if configuration == "dyadic" else []
                blocks.append(Block(dyad, performer, configuration, force, rows, moves, partner, controls, answers))
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
