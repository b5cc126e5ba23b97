"""Balance of plans: the counts are tabulated, and unbalanced plans are refused."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netboard.base.errors import ConfigError
from netboard.task.plans.balance import Balance, balance_of, require_balance
from netboard.task.plans.plan import Plan, plan_of
from netboard.task.studies import library
from netboard.task.studies.study import Study, parse_study

STUDIES = {name: parse_study(library.text_of(name), name) for name in (*library.NAMES, library.TEMPLATE)}
BALANCED_AFTER = {"paper": 4, "five_forces": 20, "controls": 12, "partners": 16, "pilot": 4, "template": 8}
"""Dyads after which all counts are equal: orders x rows, twice for the odd first targets, four times for the seats."""


def plans(study: Study, dyads: int, seed: int = 1) -> list[Plan]:
    return [plan_of(study, seed, dyad) for dyad in range(1, dyads + 1)]


def balance_from(text: str, dyads: int = 1) -> Balance:
    study = parse_study(text)
    return balance_of(study, plans(study, dyads))


@pytest.mark.slow
@settings(deadline=None, max_examples=40)
@given(st.sampled_from(sorted(STUDIES)), st.integers(0, 2**40), st.integers(1, 24))
def test_built_in_studies_are_balanced_for_every_seed_and_number_of_dyads(name: str, seed: int, dyads: int) -> None:
    study = STUDIES[name]
    found = balance_of(study, plans(study, dyads, seed))
    assert found.problems == ()
    assert require_balance(study, plan_of(study, seed, dyads)).dyad == dyads
    if dyads % BALANCED_AFTER[name] == 0 and name != "template":
        assert found.uneven == ()


def test_balance_tables_of_the_paper_for_eight_dyads() -> None:
    trials, starts, over, practice = balance_of(STUDIES["paper"], plans(STUDIES["paper"], 8)).tables
    assert trials.columns == ("dyad", "bimanual on", "bimanual off", "dyadic on", "dyadic off")
    assert {row[1:] for row in trials.rows} == {("180",) * 4}
    assert len(trials.rows) == 16
    assert [row[3:] for row in starts.rows[:2]] == [("on", "off", "on"), ("off", "on", "off")]
    assert {row[2] for row in over.rows} == {"even"}
    assert practice.rows[0] == ("bimanual on", "4.50")
    assert practice.rows[2] == ("dyadic on", "6.50")


@pytest.mark.parametrize("order", ["abba", "interleaved"])
def test_mirrored_orders_do_not_confound_configuration_with_practice(order: str) -> None:
    text = library.text_of("paper").replace('order = ["paper"]', f'order = ["{order}"]')
    practice = balance_from(text, 2).tables[-1]
    assert {row[1] for row in practice.rows} == {"5.50"}


def test_alternating_orders_are_balanced_over_dyads() -> None:
    text = library.text_of("paper").replace('order = ["paper"]', 'order = ["paper", "dyadic_first"]')
    found = balance_from(text, 8)
    assert found.problems == found.uneven == ()
    assert ("order", "paper 4, dyadic_first 4", "even") in found.tables[2].rows
    assert "order: paper 3, dyadic_first 2" in balance_from(text, 5).uneven


LEVELS = "[factors.haptics]\nlevels.on = {}\nlevels.off = {}\n"


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        (
            'orders.main = "3 a"\n[kinds.a]\n' + LEVELS,
            "dyad 1, participant A, a: trials are not even: on 120 in 2 blocks, off 60 in 1 block; expected as many "
            "in every condition (blocks in multiples of 2)",
        ),
        (
            'orders.main = "a"\n[kinds.a]\n' + LEVELS,
            "dyad 1, participant A, a: trials are not even: on 60 in 1 block, off 0 in 0 blocks; expected as many in "
            "every condition (blocks in multiples of 2)",
        ),
        (
            'trials_per_condition = 180\norders.main = "4 a"\n[kinds.a]\n' + LEVELS,
            "dyad 1, participant A, a: trials are on 120 in 2 blocks, off 120 in 2 blocks; expected 180 in every "
            "condition (trials_per_condition)",
        ),
        (
            'orders.main = "2 a"\n[kinds.a]\n[factors.f]\nlevels.x.block.trials = 9\nlevels.y.block.trials = 8\n',
            "dyad 1, participant A, a: trials are not even: x 9 in 1 block, y 8 in 1 block",
        ),
        (
            'orders.main = "2 a"\n[kinds.a]\n[factors.f]\nlevels.x.block.duration = 9\nlevels.y.block.duration = 8\n',
            "dyad 1, participant A, a: trials are not even",
        ),
    ],
)
def test_unbalanced_plans_are_refused(text: str, problem: str) -> None:
    found = balance_from(text)
    assert found.problems[0].startswith(problem)
    assert len(found.problems) == 2
    study = parse_study(text)
    with pytest.raises(ConfigError) as raised:
        require_balance(study, plan_of(study, 1, 1))
    assert problem in str(raised.value)


@settings(deadline=None, max_examples=50)
@given(st.integers(1, 12), st.integers(2, 4), st.sampled_from(("alternate", "latin", "random")))
def test_study_is_refused_unless_its_levels_divide_its_number_of_blocks(blocks: int, levels: int, order: str) -> None:
    text = f'orders.main = "{blocks} a"\n[kinds.a]\n[factors.f]\norder = "{order}"\n[factors.f.levels]\n'
    text += "".join(f"x{level} = {{}}\n" for level in range(levels))
    assert (balance_from(text).problems == ()) == (blocks % levels == 0)


def test_blocks_without_factors_are_exempt_from_the_balance() -> None:
    assert balance_from('orders.main = "3 a, 2 b"\n[kinds.a]\nfactors = []\n[kinds.b]\n' + LEVELS).problems == ()


def test_participant_may_have_no_blocks_of_a_kind() -> None:
    assert (
        balance_from(
            'orders.main = "2 a, 2 b"\n[kinds.a]\nperformers = "A"\n[kinds.b]\nperformers = "B"\n' + LEVELS
        ).problems
        == ()
    )


def test_between_dyads_factor_is_balanced_over_dyads() -> None:
    text = (
        'orders.main = "4 a"\n[kinds.a]\n'
        + LEVELS
        + '[factors.group]\norder = "between"\nlevels.x = {}\nlevels.y = {}\n'
    )
    found = balance_from(text, 8)
    assert found.problems == found.uneven == ()
    assert ("group", "x 4, y 4", "even") in found.tables[2].rows
    assert "group: x 2, y 1" in balance_from(text, 3).uneven


def test_timed_blocks_are_balanced_in_seconds() -> None:
    study = STUDIES["pilot"]
    trials = balance_of(study, plans(study, 1)).tables[0]
    assert trials.rows[0] == ("1 A", "120 s", "20", "20")
