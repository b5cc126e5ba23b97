"""Design section: block order of each dyad, balance of conditions, and participants."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import pandas as pd

from netboard.analysis.extraction.conditions import STAND_INS, StudyFactor
from netboard.analysis.extraction.study import Study
from netboard.analysis.report.grids import Cell, Column, Grid, grid, name, number
from netboard.analysis.report.wording import amount, plural
from netboard.analysis.topics.groups import FORCE_LABELS, labels_of
from netboard.base.config import SIDES
from netboard.task.studies.factors import level_text


@dataclass(frozen=True, slots=True)
class Step:
    """A block in the order of a dyad, with the levels of other factors, and the role if it is not test."""

    who: str
    configuration: str
    force: str
    haptics: bool
    levels: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Design:
    """Design as performed: factors, blocks and trials of conditions, counts of the haptic condition that came first."""

    steps: tuple[tuple[str, tuple[Step | None, ...]], ...]
    numbers: tuple[int, ...]
    sentences: tuple[str, ...]
    factors: Grid
    conditions: Grid
    beginnings: Grid


def design(study: Study) -> Design:
    """Return the design of a study as performed."""
    blocks = study.blocks.drop_duplicates(["dyad", "block"])
    numbers = tuple(sorted({int(block) for block in blocks["block"]}))
    found = {(row["dyad"], row["block"]): _step(row, study.factors) for row in blocks.to_dict("records")}
    steps = tuple((dyad, tuple(found.get((dyad, block)) for block in numbers)) for dyad in study.dyads)
    sentences = (*_sentences(blocks), *_studies(study.blocks))
    return Design(steps, numbers, sentences, _factors(study), _conditions(study, blocks), _beginnings(blocks))


def _step(row: Mapping[Any, Any], factors: Sequence[StudyFactor]) -> Step:
    who = "both" if row["configuration"] == "dyadic" else str(row["performer"]).removeprefix(str(row["dyad"]))
    levels = [f"{one.name} {row[one.column]}" for one in factors if one.in_names and row[one.column]]
    if row["role"] not in ("", "test"):
        levels.append(row["role"])
    return Step(who, row["configuration"], row["force"], bool(row["haptics"]), tuple(levels))


def _factors(study: Study) -> Grid:
    where = {"dyad": "between dyads", "block": "between blocks", "trial": "within blocks"}
    forces = [force for force in FORCE_LABELS if force in set(study.analysed["force"])]
    rows: list[tuple[str, ...]] = [
        ("configuration", "between blocks", "categorical", ", ".join(sorted(study.analysed["configuration"].unique()))),
        ("force", "between blocks", "categorical", ", ".join(FORCE_LABELS.get(force, force) for force in forces)),
    ]
    for one in study.factors:
        if one.of.levels:
            levels = ", ".join(level_text(one.of, level) for level in one.of.levels)
            determined = "" if one.in_names else "; determined by the others"
            rows.append((one.label, where[one.scope], f"{one.of.type}{determined}", levels))
    columns = [name("Factor"), Column("It varies"), Column("Type"), Column("Levels")]
    return grid(
        "Factors of the plan. A factor that the others determine is not part of the names of conditions.", columns, rows
    )


def _sentences(blocks: pd.DataFrame) -> list[str]:
    """Return sentences on the order of conditions."""
    both = blocks[blocks["configuration"] == "dyadic"]
    alone = blocks[blocks["configuration"] == "bimanual"]
    if both.empty or alone.empty:
        return []
    before = [
        int((alone.loc[alone["dyad"] == dyad, "block"] < first).sum())
        for dyad, first in both.groupby("dyad")["block"].min().items()
    ]
    if min(before) == 0:
        return []
    least, most = min(before), max(before)
    had = plural(least, "bimanual block") if least == most else f"{least} to {most} bimanual blocks"
    return [
        f"Before its first block together, every dyad had {had}. So a comparison of dyads with their own participants "
        "is confounded with practice."
    ]


def _studies(blocks: pd.DataFrame) -> list[str]:
    """Return warnings of dyads in several studies: their trials are numbered as one study."""
    names = blocks.groupby("dyad")["study"].unique()
    several = names[names.map(len) > 1]
    if several.empty:
        return []
    every = ", ".join(sorted({name or "one without a name" for own in several for name in own}))
    return [
        f"{plural(len(several), 'dyad')} of the same pseudonym in more than one study ({every}): treated as the "
        "same people, with consecutive trial numbers. If they are different people, analyse each study separately."
    ]


def _conditions(study: Study, blocks: pd.DataFrame) -> Grid:
    trials, labels = study.trials, labels_of(study)
    rows = []
    for condition, of_it in trials.groupby("condition", sort=True):
        mine = blocks[blocks["recording"].isin(of_it["recording"]) | (blocks["condition"] == condition)]
        rows.append(
            (
                labels.get(str(condition), str(condition)),
                len(mine),
                mine["performer"].nunique(),
                int((of_it["outcome"] == "success").sum()),
                int(of_it["counts"].sum()),
                amount(mine["block"].mean(), 1),
            )
        )
    columns = [
        Column("Condition"),
        number("Blocks"),
        number("Performers"),
        number("Trials done"),
        number("Trials counted"),
        number("Mean position in the order"),
    ]
    caption = "Amount of data in each condition. A performer is a participant, or a dyad if both performed."
    return grid(caption, columns, rows)


def _beginnings(blocks: pd.DataFrame) -> Grid:
    first = blocks.sort_values("block", kind="stable").drop_duplicates(["dyad", "performer", "configuration"])
    counts = pd.crosstab(first["configuration"], first["force"])
    columns = [Column("Configuration"), *(number(f"Began with {FORCE_LABELS.get(force, force)}") for force in counts)]
    rows: list[list[Cell | float]] = [[str(row[0]), *map(int, row[1:])] for row in counts.itertuples(name=None)]
    return grid("Counterbalancing: how many performers began a configuration with which force.", columns, rows)


def participants(study: Study, handedness: Mapping[str, str]) -> Grid:
    """Return the table of participants."""
    people: dict[tuple[str, str], list[dict[Any, Any]]] = {}
    for row in study.blocks.to_dict("records"):
        for who in sorted({row["left_by"], row["right_by"]} - set(STAND_INS)):
            people.setdefault((row["dyad"], who), []).append(row)
    rows = [_person(who, dyad, mine, handedness.get(who, "not known")) for (dyad, who), mine in sorted(people.items())]
    columns = [
        name("Participant"),
        name("Dyad"),
        Column("Dominant hand"),
        Column("Seat when together"),
        number("Recordings alone"),
        number("Recordings together"),
        Column("Simulated"),
    ]
    return grid("Participants, by pseudonym", columns, rows)


def _person(who: str, dyad: str, mine: list[dict[Any, Any]], hand: str) -> tuple[str | int, ...]:
    together = [row for row in mine if row["configuration"] == "dyadic"]
    seats = [side for side in SIDES if any(row[f"{side}_by"] == who for row in together)]
    simulated = sum(int(row["simulated"]) for row in mine)
    part = "yes" if simulated == len(mine) else f"in {simulated} of {len(mine)}" if simulated else "no"
    return who, dyad, hand, " and ".join(seats) or "none", len(mine) - len(together), len(together), part
