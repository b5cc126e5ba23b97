"""The study file: valid files are parsed, and errors name table, key and remedy."""

import re
from dataclasses import fields
from pathlib import Path

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from netboard.base.errors import ConfigError
from netboard.task.plans.balance import require_balance
from netboard.task.plans.plan import plan_of
from netboard.task.studies import library
from netboard.task.studies.factors import Declared, declared
from netboard.task.studies.parts import CHANGED, Factor, Kind, Questionnaire
from netboard.task.studies.study import Study, paper_study, parse_study, resolve_study

SMALL = 'orders.main = "2 duo"\n[kinds.duo]\n'
BUILT_IN = (*library.NAMES, library.TEMPLATE)


def problems(text: str) -> list[str]:
    with pytest.raises(ConfigError) as raised:
        parse_study(text, "x.toml")
    lines = str(raised.value).splitlines()
    assert all(line.startswith("x.toml: ") for line in lines)
    return [line.removeprefix("x.toml: ") for line in lines]


@pytest.mark.parametrize("name", BUILT_IN)
def test_built_in_studies_survive_a_round_trip(name: str) -> None:
    study = parse_study(library.text_of(name), name)
    assert study.name == name
    assert parse_study(resolve_study(study), "resolved") == study
    assert resolve_study(parse_study(resolve_study(study))) == resolve_study(study)


def test_unknown_built_in_study_is_refused() -> None:
    with pytest.raises(ConfigError, match="no study 'other'"):
        library.text_of("other")


def test_paper_study_declares_its_orders_and_trials_per_condition() -> None:
    study = paper_study()
    assert study.orders["paper"] == "4 bimanual, 6 dyadic, 2 bimanual"
    assert study.taken() == ("paper",)
    assert {"dyadic_first", "interleaved", "abba"} < set(study.orders)
    assert study.trials_per_condition == 180


def test_template_has_every_key() -> None:
    text = library.text_of(library.TEMPLATE)
    for cls in (Study, Kind, Factor, Questionnaire):
        for item in fields(cls):
            tables = (f"{item.name}.", f"[{item.name}.", f"[{item.name}]")
            assert f"{item.name} =" in text or any(table in text for table in tables), item.name


def test_how_to_page_names_every_key_and_its_examples_are_valid() -> None:
    page = (Path(__file__).parents[2] / "docs" / "how-to" / "studies.md").read_text(encoding="utf-8")
    for cls in (Study, Kind, Factor, Questionnaire):
        for item in fields(cls):
            assert re.search(rf"[`\[.\n]{item.name}\b", page), item.name
    examples = re.findall(r"```toml\n(.*?)```", page, re.DOTALL)
    whole = [text for text in examples if "orders." in text]
    assert (len(whole), len(examples)) == (5, 7), "the others are a declaration, and an entry of a package"
    for example_text in whole:
        study = parse_study(example_text)
        assert require_balance(study, plan_of(study, 1, 1)).blocks


def test_minimal_study_has_two_lines() -> None:
    study = parse_study(SMALL)
    assert study.kinds == {"duo": Kind()}
    assert study.taken() == ("main",)


def test_overrides_are_converted_like_configuration_values() -> None:
    study = parse_study(SMALL + "physics.M = 1\nblock.trials = 3\nparticipant.kp = 2")
    assert study.kinds["duo"].changed() == {"block": {"trials": 3}, "physics": {"M": 1.0}, "participant": {"kp": 2.0}}
    assert type(study.kinds["duo"].physics["M"]) is float


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("a = ", "not valid TOML"),
        (f"a = {'[' * 100_000}", "lists or tables are nested too deeply"),
        ("", "[kinds]: found none"),
        ("[kinds.duo]", "[orders]: found none"),
        (SMALL + "questions = 3", "[kinds.duo] questions: unknown key; "),
        (SMALL + "trials = 3", "[kinds.duo] trials: unknown key; did you mean block.trials?"),
        ("hold_time = 3\n" + SMALL, "hold_time: unknown key; did you mean task.hold_time?"),
        (SMALL + "performer = 'A'", "[kinds.duo] performer: unknown key; did you mean performers"),
        (SMALL + "performers = 'C'", '[kinds.duo] performers: found "C", expected "dyad" or "A"'),
        (SMALL + "block.trials = 0", "[kinds.duo.block] trials: found 0, expected a whole number >= 1"),
        (SMALL + "block.trails = 1", "[kinds.duo.block] trails: unknown key; did you mean trials"),
        (SMALL + "physics.M = nan", "[kinds.duo.physics] M: found nan, expected a number >= 1e-09"),
        (SMALL + "physics = 3", "[kinds.duo.physics]: found 3, expected a table"),
        (SMALL + "block.seed = 3", "[kinds.duo.block] seed: follows from the plan and is not set here"),
        (SMALL + "catch = -1", "[kinds.duo] catch: found -1, expected a number >= 0"),
        (SMALL + "factors = ['heat']", '[kinds.duo] factors: found "heat", expected one of all'),
        (SMALL + "factors = 3", "[kinds.duo] factors: found 3, expected a list of texts"),
        (SMALL + "other_hand = 'robot'", '[kinds.duo] other_hand: found "robot", expected performers ='),
        (
            SMALL + "[factors.f.levels]\na.other_hand = 'leader'\nb.other_hand = 'person'",
            "[kinds.duo] other_hand: found",
        ),
        (SMALL + "partners.middle.lead = 3", "[kinds.duo.partners.middle]: unknown table; there are left, right"),
        (
            SMALL + "[factors.f]\norder = 'trial'\nlevels.a.other_hand = 'still'\nlevels.b = {}",
            "[factors.f] levels.a: sets",
        ),
        (SMALL + "instructions.en = 3", "[kinds.duo] instructions.en: found 3, expected text"),
        (SMALL + "performers = 'A'\nblock.left = 'still'", "[kinds.duo] block.left, block.right: are set"),
        ("kinds = 3\n" + 'orders.main = "a"', "[kinds]: found 3, expected a table"),
        ("kinds.duo = 3\n" + 'orders.main = "a"', "[kinds.duo]: found 3, expected a table"),
        ("kinds.'a b' = {}\n" + 'orders.main = "a"', "[kinds.a b]: expected a name of letters"),
        ("kinds.session = {}\n" + 'orders.main = "session"', "[kinds.session]: expected another name"),
        ("order = ['mian']\n" + SMALL, 'order: found "mian", expected one of main; did you mean main?'),
        ("safety.max_force = 3\n" + SMALL, "[safety]: unknown table; there are block, perturbation, task"),
        ('orders.main = "2 dou"\n[kinds.duo]', '[orders] main: found "dou", expected one of duo; did you mean duo?'),
        ('orders.main = "2 ("\n[kinds.duo]', "[orders] main: a bracket ( is not closed"),
        ('orders.main = "600 duo"\n[kinds.duo]\nperformers = "AB"', "[orders] main: 1200 blocks, expected at most"),
        (SMALL + "[factors.f]\nlevels.one = {}", "[factors.f] levels: found 1, expected two or more"),
        (SMALL + "[factors.f]\norder = 'abba'", '[factors.f] order: found "abba", expected "alternate" or "latin"'),
        (SMALL + "[factors.f]\nlevels.a.physics.MM = 1", "[factors.f.levels.a.physics] MM: unknown key"),
        (SMALL + "[factors.f]\nlevels.a = 1", "[factors.f.levels.a]: found 1, expected a table"),
        (SMALL + "[factors.all]\nlevels = {a = {}, b = {}}", "[factors.all]: expected another name"),
        (SMALL + "[questionnaires.q]\nafter = ['duo']", "[questionnaires.q] text: found none, expected a text for the"),
        (SMALL + "[questionnaires.q]\ntext = 'x'\nafter = ['dou']", '[questionnaires.q] after: found "dou"'),
        (
            "trials_per_condition = 3\n" + SMALL + "block.duration = 9\n[factors.f.levels]\na = {}\nb = {}",
            "[kinds.duo] block.duration: with a time limit the number of trials is unknown",
        ),
        (
            SMALL + "".join(f"[factors.{f}]\nlevels.a.physics.M = 1\nlevels.b.physics.M = 2\n" for f in "xy"),
            "[kinds.duo] factors: x and y both set physics.M",
        ),
    ],
)
def test_invalid_study_is_reported_with_table_and_key(text: str, problem: str) -> None:
    assert any(line.startswith(problem) for line in problems(text)), problems(text)


def test_all_problems_are_reported_together() -> None:
    assert len(problems(SMALL + "block.trials = 0\nphysics.M = 0\nhands = 2\n[factors.f]\norder = 1")) == 4


WORDS = st.sampled_from(
    [
        *("name", "order", "orders", "factors", "kinds", "questionnaires", "levels", "catch", "performers", "duo"),
        *("instructions", "text", "after", "trials", "force", "long_rest", "trials_per_condition", "main", *CHANGED),
    ]
)
VALUES = st.recursive(
    st.text(max_size=8)
    | st.sampled_from(["2 duo", "dyad", "AB", "none", "latin"])
    | st.booleans()
    | st.integers(-(2**63), 2**63 - 1)
    | st.floats(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(WORDS, inner, max_size=3),
    max_leaves=12,
)


def toml(value: object) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key} = {toml(inner)}" for key, inner in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(toml, value)) + "]"
    if isinstance(value, str):
        return '"' + "".join(f"\\U{ord(letter):08x}" for letter in value) + '"'
    return str(value).lower()


def read_or_refuse(text: str) -> None:
    try:
        study = parse_study(text)
    except ConfigError:
        return
    assert parse_study(resolve_study(study)) == study


@settings(deadline=None)
@given(st.dictionaries(WORDS, VALUES, max_size=5))
def test_any_tables_parse_or_raise_config_error(values: dict[str, object]) -> None:
    read_or_refuse("\n".join(f"{key} = {toml(value)}" for key, value in values.items()))


@settings(deadline=None)
@given(st.text())
@example("a = " + "[" * 20_000)
@example(SMALL + "catch = " + "9" * 400)
@example(SMALL + "catch_after = " + "9" * 400)
def test_any_study_text_parses_or_raises_config_error(text: str) -> None:
    read_or_refuse(text)
    read_or_refuse(SMALL + text)


# --- types of factors, roles -------------------------------------------------------------------------------------


def study_with(*lines: str) -> str:
    return "\n".join(('orders.main = "4 duo"', "[kinds.duo]", *lines))


def test_factor_whose_levels_set_one_number_is_numeric_with_its_unit() -> None:
    levels = "levels.light.physics.m = 0.02", "levels.heavy.physics.m = 0.05"
    found = declared(parse_study(study_with("[factors.mass]", *levels)).factors["mass"])
    assert found == Declared("numeric", ("light", "heavy"), (0.02, 0.05), "kg")


def test_other_factors_are_categorical_or_boolean() -> None:
    text = study_with(
        "[factors.force]",
        'levels.on.block.force = "full"',
        'levels.off.block.force = "none"',
        "[factors.smooth]",
        "levels.yes.display.smooth = true",
        "levels.no.display.smooth = false",
        "[factors.nothing]",
        "levels.some.physics.m = 0.02",
        "levels.rest = {}",
    )
    types = {name: declared(factor).type for name, factor in parse_study(text).factors.items()}
    assert types == {"force": "categorical", "smooth": "boolean", "nothing": "categorical"}


def test_level_may_declare_its_value() -> None:
    lines = 'unit = "y"', "levels.young.value = 20.0", "levels.old.value = 70.0"
    found = declared(parse_study(study_with("[factors.age]", 'order = "between"', *lines)).factors["age"])
    assert found == Declared("numeric", ("young", "old"), (20.0, 70.0), "y")


def test_numeric_factor_without_values_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"\[factors.age\] levels.old value: there is none, expected one for each"):
        parse_study(study_with("[factors.age]", 'type = "numeric"', "levels.young.value = 20.0", "levels.old = {}"))


def test_trial_factor_may_set_only_the_force_gain() -> None:
    levels = "levels.light.physics.m = 0.02", "levels.heavy.physics.m = 0.05"
    with pytest.raises(ConfigError, match=r"sets physics.m; within a block only block.force_scale can differ"):
        parse_study(study_with("[factors.mass]", 'order = "trial"', *levels))


def test_keys_added_later_are_absent_from_the_resolved_paper_study() -> None:
    text = resolve_study(paper_study())
    assert not {line.partition(" =")[0].rpartition(".")[2] for line in text.splitlines()} & {"role", "type", "unit"}
