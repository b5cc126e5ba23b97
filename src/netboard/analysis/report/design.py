"""Design section: block order of each dyad, balance of conditions, and participants."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import pandas as pd

from netboard.analysis.extraction.conditions import STAND_INS, StudyFactor
from netboard.analysis.extraction.study import StudyData
from netboard.analysis.report.grids import Cell, Grid, GridColumn, grid, name, number
from netboard.analysis.report.wording import amount, plural
from netboard.analysis.topics.groups import CONFIGURATIONS, FORCE_LABELS, haptics_of, labels_of
from netboard.base.config import SIDES
from netboard.task.studies.factors import level_text


@dataclass(frozen=True, slots=True)
class PerformedBlock:
    """A block of a dyad: haptic condition and whether forces are felt, other levels, and the role if it is not test."""

    who: str
    configuration: str
    haptics: str
    felt: bool
    levels: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class PerformedDesign:
    """Design as performed: factors, blocks and trials of conditions, counts of the haptic condition that came first."""

    steps: tuple[tuple[str, tuple[PerformedBlock | None, ...]], ...]
    numbers: tuple[int, ...]
    sentences: tuple[str, ...]
    factors: Grid
    conditions: Grid
    beginnings: Grid


def design(study: StudyData) -> PerformedDesign:
    """Return the design of a study as performed."""
    blocks = study.blocks.drop_duplicates(["dyad", "block"])
    numbers = tuple(sorted({int(block) for block in blocks["block"]}))
    found = {(row["dyad"], row["block"]): _step(row, study.factors) for row in blocks.to_dict("records")}
    steps = tuple((dyad, tuple(found.get((dyad, block)) for block in numbers)) for dyad in study.dyads)
    sentences = (*_sentences(study.analysed.drop_duplicates(["dyad", "block"])), *_studies(study.blocks))
    return PerformedDesign(steps, numbers, sentences, _factors(study), _conditions(study, blocks), _beginnings(study))


def _step(row: Mapping[Any, Any], factors: Sequence[StudyFactor]) -> PerformedBlock:
    who = "both" if row["configuration"] == "dyadic" else str(row["performer"]).removeprefix(str(row["dyad"]))
    levels = [one.text(row[one.column]) for one in factors if one.in_names and row[one.column]]
    if row["role"] not in ("", "test"):
        levels.append(row["role"])
    return PerformedBlock(who, row["configuration"], haptics_of(row["force"]), bool(row["haptics"]), tuple(levels))


def _factors(study: StudyData) -> Grid:
    """Return the factors that vary over the analysed blocks; one that is the haptic condition is not listed again."""
    where = {"dyad": "between dyads", "block": "between blocks", "trial": "within blocks"}
    analysed = study.analysed
    teams = [one for one in CONFIGURATIONS if one in set(analysed["configuration"])]
    forces = [haptics_of(force) for force in FORCE_LABELS if force in set(analysed["force"])]
    rows: list[tuple[str, ...]] = [
        ("configuration", "between blocks", "categorical", ", ".join(teams), "yes"),
        ("haptics", "between blocks", "categorical", ", ".join(forces), "yes"),
    ]
    for one in study.factors:
        of_blocks = [study.levels.sequences[one.name][place] for place in analysed.index]
        there = {level for sequence in of_blocks for level in sequence}
        if len(there) > 1 and not _is_haptics(of_blocks, analysed["force"]):
            levels = ", ".join(level_text(one.of, level) for level in one.of.levels if level in there)
            named = "yes" if one.in_names else "no: its level follows from the other factors"
            rows.append((one.label, where[one.scope], one.of.type, levels, named))
    titles = ("Varies", "Type", "Levels", "In the names of conditions")
    return grid("Factors of the blocks that are analysed.", [name("Factor"), *map(GridColumn, titles)], rows)


def _is_haptics(of_blocks: Sequence[tuple[str, ...]], forces: pd.Series) -> bool:
    """Return whether a factor is the haptic condition: each of its levels has one force, and each force one level."""
    pairs = set(zip(of_blocks, forces, strict=True))
    return len(pairs) == len({levels for levels, _ in pairs}) == len({force for _, force in pairs})


def _sentences(blocks: pd.DataFrame) -> list[str]:
    """Return sentences on the order of conditions in the blocks that are analysed."""
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
        f"Every dyad performed {had} before its first dyadic block (blocks for practice do not count). A difference "
        "between dyads and their own participants therefore includes the effect of practice."
    ]


def _studies(blocks: pd.DataFrame) -> list[str]:
    """Return warnings of dyads in several studies: their trials are numbered as one study."""
    names = blocks.groupby("dyad")["study"].unique()
    several = names[names.map(len) > 1]
    if several.empty:
        return []
    every = ", ".join(sorted({name or "one without a name" for own in several for name in own}))
    return [
        f"{plural(len(several), 'dyad pseudonym')} in more than one study ({every}): each "
        "is treated as one dyad, with consecutive trial numbers. If they are different people, analyse each study "
        "separately."
    ]


def _conditions(study: StudyData, blocks: pd.DataFrame) -> Grid:
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
        GridColumn("Condition"),
        number("Blocks"),
        number("Performers"),
        number("Trials done"),
        number("Trials counted"),
        number("Mean position in the order"),
    ]
    caption = "Amount of data in each condition. A performer is a participant, or a dyad if both performed."
    return grid(caption, columns, rows)


def _beginnings(study: StudyData) -> Grid:
    """Return with which haptic condition performers began each configuration: in the plan, and in what is analysed."""
    counted = study.counted[study.counted["role"] != "catch"]
    forces = [force for force in FORCE_LABELS if force in set(study.analysed["force"])]
    planned, done = (_first_forces(rows) for rows in (study.analysed, counted))
    rows: list[list[Cell | float]] = []
    for team in planned.index:
        ways = (("planned", planned), ("trials that count", done))
        rows += [[team, what, *(int(table.get(force, {}).get(team, 0)) for force in forces)] for what, table in ways]
    columns = [
        GridColumn("Configuration"),
        GridColumn("First block"),
        *(number(f"Began with {haptics_of(force)}") for force in forces),
    ]
    return grid(
        "Counterbalancing: number of performers who began a configuration with each haptic condition. “Planned” takes "
        "the first block in the plan of each performer, without practice, familiarisation and baseline. “Trials that "
        "count” takes the first block with a counted trial.",
        columns,
        rows,
    )


def _first_forces(rows: pd.DataFrame) -> pd.DataFrame:
    """Count the performers of each configuration (rows) by the force of their first block (columns)."""
    first = rows.sort_values("block", kind="stable").drop_duplicates(["dyad", "performer", "configuration"])
    return pd.crosstab(first["configuration"], first["force"])


def participants(study: StudyData, handedness: Mapping[str, str]) -> Grid:
    """Return the table of participants."""
    people: dict[tuple[str, str], list[dict[Any, Any]]] = {}
    for row in study.blocks.to_dict("records"):
        for who in sorted({row["left_by"], row["right_by"]} - set(STAND_INS)):
            people.setdefault((row["dyad"], who), []).append(row)
    rows = [_person(who, dyad, mine, handedness.get(who, "not known")) for (dyad, who), mine in sorted(people.items())]
    columns = [
        name("Participant"),
        name("Dyad"),
        GridColumn("Dominant hand"),
        GridColumn("Seat when together"),
        number("Recordings alone"),
        number("Recordings together"),
        GridColumn("Simulated"),
    ]
    return grid("Participants, by pseudonym", columns, rows)


def _person(who: str, dyad: str, mine: list[dict[Any, Any]], hand: str) -> tuple[str | int, ...]:
    together = [row for row in mine if row["configuration"] == "dyadic"]
    seats = [side for side in SIDES if any(row[f"{side}_by"] == who for row in together)]
    simulated = sum(int(row["simulated"]) for row in mine)
    part = "yes" if simulated == len(mine) else f"in {simulated} of {len(mine)}" if simulated else "no"
    return who, dyad, hand, " and ".join(seats) or "none", len(mine) - len(together), len(together), part
