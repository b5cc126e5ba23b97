"""Synthetic studies: tables of recordings written by hand, joined as measured ones are."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from netboard.analysis.extraction.conditions import factors_text
from netboard.analysis.extraction.recordings import BLOCKS, FIELDS, Measured
from netboard.analysis.extraction.settings import Readings, parse
from netboard.analysis.extraction.study import StudyData, study_of
from netboard.analysis.extraction.tables import columns_of
from netboard.base.config import Config
from netboard.base.tables.experiment import TECHNICAL, Design
from netboard.recording.format.channels import Field

NOTHING = {"integer": 0, "number": float("nan"), "string": ""}
Row = Mapping[str, Any]

USUAL: Row = {"outcome": "success", "target": 1, "completion": 1.0}
"""What an attempt is, if it does not say otherwise."""


def rows_of(fields: tuple[Field, ...], rows: Iterable[Row]) -> dict[str, Any]:
    """Make columns of rows that say only some of the columns."""
    nothing = {field.name: NOTHING[field.kind] for field in fields}
    return columns_of(fields, [nothing | dict(row) for row in rows])


@dataclass(frozen=True, slots=True)
class Block:
    """A recording: who performed in which condition, and its attempts, a row each; what they do not say is usual."""

    dyad: str
    performer: str
    configuration: str
    force: str
    trials: Sequence[Row]
    movements: Sequence[Row] = ()
    right_by: str = ""
    controls: Sequence[Row] = ()
    answers: Sequence[Row] = ()


def measured(block: Block, number: int) -> Measured:
    """Write the tables of a recording."""
    name = f"{block.dyad}_{number:02}"
    whole: Row = {
        "recording": name,
        "dyad": block.dyad,
        "block": number,
        "part": 1,
        "configuration": block.configuration,
        "force": block.force,
        "haptics": int(block.force != "none"),
        "force_scale": 1.0,
        "force_delay": 0.0,
        "performer": block.performer,
        "left_by": block.performer,
        "right_by": block.right_by or block.performer,
        "simulated": 1,
        "stand_ins": "",
        "exclude": " ".join(TECHNICAL),
    }
    trials = [
        {"recording": name, "trial": k, "attempt": 1, **USUAL, **row} for k, row in enumerate(block.trials, start=1)
    ]
    movements = [
        {"recording": name, "trial": 1, "attempt": 1, "movement": k, "cooperative": 1, **row}
        for k, row in enumerate(block.movements, start=1)
    ]
    done = {(row["trial"], row["attempt"]) for row in trials}
    controls = [{"recording": name, "attempt": 1, **row} for row in block.controls]
    controls = [row for row in controls if (row["trial"], row["attempt"]) in done]
    return Measured(
        rows_of(BLOCKS, [whole]),
        rows_of(FIELDS["trials"], trials),
        rows_of(FIELDS["movements"], movements),
        rows_of(FIELDS["paths"], []),
        rows_of(FIELDS["controls"], controls),
        rows_of(FIELDS["answers"], [{"recording": name, "block": number, **row} for row in block.answers]),
    )


def declared(block: Block, number: int, design: Design) -> Measured:
    """Write the tables of a recording whose block has levels of declared factors."""
    found = measured(block, number)
    row = {name: column[0] for name, column in found.blocks.items()}
    row["factors"] = factors_text(replace(Config(), design=design))
    return replace(found, blocks=rows_of(BLOCKS, [row]))


def made_study(blocks: Sequence[Block], *overrides: str) -> StudyData:
    """Join recordings, with settings such as ``summaries.ends=2``."""
    readings: Readings = parse("", overrides=overrides)
    return study_of([measured(block, number) for number, block in enumerate(blocks, start=1)], readings)


def times(*values: float) -> list[dict[str, float]]:
    """Trials with these completion times, and as many velocity peaks as whole seconds."""
    return [{"completion": value, "duration": value + 1.5, "peaks": int(value)} for value in values]


def random_trial(chance: np.random.Generator) -> dict[str, float]:
    """Make a trial of any numbers that add up."""
    completion = float(chance.lognormal(1.2, 0.4))
    parts = chance.dirichlet([5.0, 1.0, 2.0, 3.0]) * completion
    return {
        "completion": completion,
        "duration": completion + 1.5,
        "peaks": int(chance.poisson(3)) + 1,
        **dict(zip(("cooperative", "competitive", "single", "still"), map(float, parts), strict=True)),
        "braking_distance": float(chance.normal(0.25, 0.03)),
        "braking_velocity": float(chance.normal(0.15, 0.04)),
    }


def random_movement(chance: np.random.Generator, trial: int) -> dict[str, float]:
    """Make a cooperative movement of any delays."""
    first = float(chance.normal(0.0, 0.1))
    signed = {q: first + float(chance.normal(0.0, 0.01)) for q in (10, 20, 30, 40)}
    return {
        "trial": trial,
        **{f"delay_{q}": value for q, value in signed.items()},
        **{f"own_delay_{q}": 0.9 * value for q, value in signed.items()},
        **{f"truncated_{q}": int(chance.random() < 0.1) for q in signed},
    }


def random_block(
    chance: np.random.Generator,
    dyad: str,
    performer: str,
    configuration: str,
    force: str,
    trials: int,
    right_by: str = "",
) -> Block:
    """Make a recording of any numbers."""
    rows = [random_trial(chance) for _ in range(trials)]
    moves = [random_movement(chance, trial) for trial in range(1, trials + 1) for _ in range(2)]
    return Block(dyad, performer, configuration, force, rows, moves, right_by)


def random_blocks(
    seed: int = 0, dyads: int = 3, trials: int = 9, forces: Sequence[str] = ("full", "none")
) -> list[Block]:
    """Make the recordings of a whole study: everybody alone and together, with each force."""
    chance = np.random.default_rng(seed)
    return [
        random_block(chance, dyad, performer, configuration, force, trials)
        for dyad in (f"D{k:02}" for k in range(1, dyads + 1))
        for force in forces
        for performer, configuration in ((f"{dyad}A", "bimanual"), (f"{dyad}B", "bimanual"), (dyad, "dyadic"))
    ]


SMALL = ("summaries.ends=3", "summaries.group=3")
"""Settings for a few trials."""
