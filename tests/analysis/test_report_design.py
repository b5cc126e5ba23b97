"""Design section of a report: what is counted is what is analysed, and the haptic condition has one name."""

from dataclasses import replace
from typing import Any

from made_study import Block, Row, declared, made_study, measured, rows_of, times
from netboard.analysis.extraction.recordings import BLOCKS, FIELDS, Measured
from netboard.analysis.extraction.settings import Readings, parse
from netboard.analysis.extraction.study import StudyData, study_of
from netboard.analysis.report.design import design
from netboard.analysis.report.grids import Grid
from netboard.base.tables.experiment import Design


def changed(found: Measured, **values: Any) -> Measured:
    """Return a recording with other values of its block, and of all its trials."""
    row: Row = {name: column[0] for name, column in found.blocks.items()}
    trials = dict(found.trials)
    for name, value in values.items():
        if name in trials:
            trials[name] = trials[name].copy().astype(object)
            trials[name][:] = value
    return replace(found, blocks=rows_of(BLOCKS, [row | values]), trials=trials)


def with_practice(*overrides: str, kind: str = "practice") -> StudyData:
    """Two dyads that practise with haptics on, alone, and begin with haptics on and with haptics off."""
    found = []
    for dyad, forces in (("D01", ("full", "none")), ("D02", ("none", "full"))):
        found.append(changed(measured(Block(dyad, f"{dyad}A", "bimanual", "full", times(3.0, 4.0)), 1), role=kind))
        for number, force in enumerate(forces, start=2):
            found.append(changed(measured(Block(dyad, dyad, "dyadic", force, times(2.0, 3.0)), number), role="test"))
    return study_of(found, parse("", overrides=overrides))


def rows(grid: Grid) -> list[list[str]]:
    return [[str(cell) for cell in row] for row in grid.rows]


def test_practice_is_no_part_of_the_counterbalancing() -> None:
    for kind in ("practice", "familiarisation", "baseline"):
        found = design(with_practice(kind=kind))
        assert [column.title for column in found.beginnings.columns] == [
            "Configuration",
            "First block",
            "Began with haptics off",
            "Began with haptics on",
        ]
        assert rows(found.beginnings) == [
            ["dyadic", "planned", "1", "1"],
            ["dyadic", "trials that count", "1", "1"],
        ]
        assert not [one for one in found.sentences if "before its first dyadic block" in one]


def test_practice_counts_if_it_is_analysed() -> None:
    found = design(with_practice("exclusions.roles=[]"))
    assert rows(found.beginnings)[0] == ["bimanual", "planned", "0", "2"]


def test_counterbalancing_of_what_counts_differs_from_the_plan_if_a_first_block_is_excluded() -> None:
    study = with_practice('exclusions.trials=["D01_02/1: noise", "D01_02/2: noise"]')
    assert rows(design(study).beginnings) == [
        ["dyadic", "planned", "1", "1"],
        ["dyadic", "trials that count", "2", "0"],
    ]


def test_bimanual_practice_is_no_reason_for_confounding() -> None:
    blocks = [Block("D01", "D01A", "bimanual", "full", times(3.0)), Block("D01", "D01", "dyadic", "full", times(2.0))]
    (sentence,) = design(made_study(blocks)).sentences
    assert sentence.startswith("Every dyad performed 1 bimanual block before its first dyadic block")


def test_haptic_condition_is_one_factor_with_one_set_of_names() -> None:
    found = []
    for number, (level, force) in enumerate((("on", "full"), ("off", "none")), start=1):
        factors = Design(factors={"feedback": level}, levels={"feedback": ("on", "off")})
        found.append(declared(Block("D01", "D01", "dyadic", force, times(2.0, 3.0)), number, factors))
    study = study_of(found, Readings())
    shown = design(study)
    assert [row[0] for row in rows(shown.factors)] == ["configuration", "haptics"]
    assert rows(shown.factors)[1][3] == "haptics off, haptics on"
    assert sorted(study.trials["condition"].unique()) == ["dyadic, haptics off", "dyadic, haptics on"]
    steps = [step for _, own in shown.steps for step in own if step]
    assert [step.haptics for step in steps] == ["haptics on", "haptics off"]
    assert "haptics on" in FIELDS["blocks"][[one.name for one in FIELDS["blocks"]].index("force")].text
