"""Synthetic studies with declared factors and a declared analysis: a block for each dyad and combination of levels."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import product

import numpy as np

from made_study import Block, declared, random_trial, rows_of
from netboard.analysis.extraction.recordings import BLOCKS
from netboard.analysis.extraction.settings import Readings
from netboard.analysis.extraction.study import StudyData, study_of
from netboard.base.tables.experiment import Design
from netboard.base.tables.outcomes import Declaration
from netboard.task.studies.declaration import declaration_text

TWO = {"mass": ("light", "heavy"), "partner": ("person", "robot")}
DECLARED = Declaration(
    question="Does it help more with a person?",
    primary="completion time",
    contrast="mass: heavy vs light x partner: person vs robot",
    secondary=("velocity peaks", "cooperative share"),
)
"""Two factors, and a declaration of their effects on completion time."""


def crossed_study(
    declaration: Declaration,
    factors: Mapping[str, Sequence[str]],
    *,
    dyads: int = 6,
    trials: int = 4,
    between: Sequence[str] = (),
    seed: int = 0,
) -> StudyData:
    """Cross all factors within each dyad, but for those between dyads, whose levels the dyads have in turn."""
    chance = np.random.default_rng(seed)
    found = []
    for place in range(dyads):
        dyad, number = f"D{place + 1:02}", 0
        for levels in product(*factors.values()):
            own = dict(zip(factors, levels, strict=True))
            if any(own[one] != factors[one][place % len(factors[one])] for one in between):
                continue
            number += 1
            rows = [random_trial(chance) for _ in range(trials)]
            every = {name: tuple(values) for name, values in factors.items()}
            types = dict.fromkeys(factors, "categorical")
            design = Design(kind="duo", between=tuple(between), factors=own, levels=every, types=types)  # type: ignore[arg-type]
            one = declared(Block(dyad, dyad, "dyadic", "full", rows), number, design)
            row = {name: column[0] for name, column in one.blocks.items()}
            row |= {"declaration": declaration_text(declaration), "kind": "duo", "trials": trials, "study": "crossed"}
            found.append(replace(one, blocks=rows_of(BLOCKS, [row])))
    return study_of(found, Readings())
