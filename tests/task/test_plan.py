"""A plan depends on study, seed and dyad alone, and each of its blocks is a valid configuration."""

from collections import Counter
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netboard.base.config import Config, parse, resolve
from netboard.base.errors import ConfigError
from netboard.base.tables.experiment import Session
from netboard.base.tables.scene import Geometry, Physics
from netboard.task.plans.conditions import sequences_of
from netboard.task.plans.plan import Plan, PlanBlock, config_of, digest, plan_of, seated, shortened, to_json
from netboard.task.studies import library
from netboard.task.studies.study import paper_study, parse_study, resolve_study

STUDIES = {name: parse_study(library.text_of(name), name) for name in (*library.NAMES, library.TEMPLATE)}
PAPER = STUDIES["paper"]
SEEDS = st.integers(0, 2**40)
DYADS = st.integers(1, 500)
ANY = st.sampled_from(sorted(STUDIES))


def blocks_in(plan: Plan, kind: str, performer: str) -> list[PlanBlock]:
    return [block for block in plan.blocks if (block.kind, block.performer) == (kind, performer)]


def level(block: PlanBlock, factor: str = "haptics") -> str:
    return dict(block.conditions)[factor]


def configs(plan: Plan, rig: Config | None = None) -> list[Config]:
    rig = seated(rig or Config(), plan)
    return [config_of(rig, session, block.number) for session in plan.sessions for block in session.blocks]


# --- the paper's -------------------------------------------------------------------------------------------------


@settings(deadline=None, max_examples=40)
@given(SEEDS, DYADS)
def test_paper_study_is_counterbalanced_for_every_seed_and_dyad(seed: int, dyad: int) -> None:
    plan = plan_of(PAPER, seed, dyad)
    (session,) = plan.sessions
    performers = [block.performer for block in session.blocks]
    assert performers == [*("A", "B") * 4, *["dyad"] * 6, *("A", "B") * 2]
    assert [block.configuration for block in session.blocks] == ["bimanual"] * 8 + ["dyadic"] * 6 + ["bimanual"] * 4
    assert {block.count for block in session.blocks} == {60}
    for sequence in sequences_of(PAPER):
        along = [level(block) for block in blocks_in(plan, *sequence)]
        assert all(one != other for one, other in pairwise(along)), "haptics flips along each sequence (C1)"
    for participant in ("A", "B"):
        trials: Counter[tuple[str, str]] = Counter()
        for block in plan.blocks:
            if block.performer in ("dyad", participant):
                trials[block.configuration, level(block)] += len(block.trials)
        assert set(trials.values()) == {180}
        assert len(trials) == 4


def test_first_levels_match_the_paper_for_4_dyads_and_are_all_used_after_8() -> None:
    starts = [
        tuple(level(blocks_in(plan_of(PAPER, 1, dyad), *sequence)[0]) for sequence in sequences_of(PAPER))
        for dyad in range(1, 9)
    ]
    assert starts[:4] == [("on", "off", "on"), ("off", "on", "off"), ("on", "off", "off"), ("off", "on", "on")]
    assert len(set(starts)) == 8


@settings(deadline=None, max_examples=40)
@given(SEEDS, DYADS)
def test_first_targets_are_balanced_in_each_sequence(seed: int, dyad: int) -> None:
    plan = plan_of(PAPER, seed, dyad)
    for sequence in sequences_of(PAPER):
        blocks = blocks_in(plan, *sequence)
        assert sorted(block.first_target for block in blocks) == ["left"] * 3 + ["right"] * 3
        for haptics in ("on", "off"):
            left = sum(block.first_target == "left" for block in blocks if level(block) == haptics)
            assert left in (1, 2)


def test_first_targets_vary_with_the_seed() -> None:
    found = {tuple(block.first_target for block in plan_of(PAPER, seed, 1).blocks) for seed in range(200)}
    assert len(found) > 150


@pytest.mark.parametrize("order", ["dyadic_first", "abba", "interleaved"])
def test_every_block_order_has_the_same_block_counts(order: str) -> None:
    study = parse_study(library.text_of("paper").replace('order = ["paper"]', f'order = ["{order}"]'))
    plan = plan_of(study, 1, 3)
    assert plan.order == order
    assert Counter((b.performer, level(b)) for b in plan.blocks) == {
        (performer, haptics): 3 for performer in ("A", "B", "dyad") for haptics in ("on", "off")
    }


def test_seats_follow_dominant_hands_and_are_balanced_if_these_are_equal() -> None:
    assert plan_of(PAPER, 1, 1, ("left", "right")).seat_a == "left"
    assert plan_of(PAPER, 1, 1, ("right", "left")).seat_a == "right"
    for hands in (("right", "right"), ("left", "left")):
        seats = [plan_of(PAPER, 1, dyad, hands).seat_a for dyad in range(1, 9)]  # type: ignore[arg-type]
        assert seats.count("left") == seats.count("right") == 4


@pytest.mark.parametrize("order", ["alternate", "latin", "random"])
def test_factor_of_no_kind_of_block_changes_no_plan(order: str) -> None:
    used = """
        orders.main = "4 dyadic"
        factors.haptics.levels = { on = {}, off = { block.force = "none" } }
        kinds.dyadic.factors = ["haptics"]
        """
    unused = f'factors.mass = {{ order = "{order}", levels = {{ light = {{}}, heavy = {{ physics.M = 0.02 }} }} }}'
    for dyad in range(1, 5):
        plans = [plan_of(parse_study(text), 1, dyad) for text in (used, used + unused)]
        assert [block.conditions for block in plans[0].blocks] == [block.conditions for block in plans[1].blocks]


# --- any study ---------------------------------------------------------------------------------------------------


@pytest.mark.slow
@settings(deadline=None, max_examples=40)
@given(ANY, SEEDS, DYADS)
def test_plan_is_deterministic(name: str, seed: int, dyad: int) -> None:
    plan, again = (plan_of(study, seed, dyad) for study in (STUDIES[name], parse_study(library.text_of(name))))
    assert plan == again
    assert digest(plan) == digest(again)
    assert to_json(plan) == to_json(again)


@settings(deadline=None, max_examples=40)
@given(ANY, SEEDS, DYADS, SEEDS)
def test_plans_of_different_seeds_differ(name: str, seed: int, dyad: int, other: int) -> None:
    plans = plan_of(STUDIES[name], seed, dyad), plan_of(STUDIES[name], other, dyad)
    assert (digest(plans[0]) == digest(plans[1])) == (seed == other)


def test_digest_of_the_paper_plan_is_stable_across_releases() -> None:
    assert digest(plan_of(paper_study(), 1, 1)) == "b8a9144456f9bac9e4677415b3a2e833333eed5ec66db9302e545033c7a007c9"


def test_out_of_range_seed_or_dyad_is_refused() -> None:
    for seed, dyad in ((-1, 1), (1, 0)):
        with pytest.raises(ValueError, match="expected a seed from 0 and a dyad from 1"):
            plan_of(PAPER, seed, dyad)


@pytest.mark.slow
@settings(deadline=None, max_examples=40)
@given(ANY, SEEDS, DYADS, st.sampled_from(("left", "right")))
def test_every_block_gives_a_valid_configuration(name: str, seed: int, dyad: int, seat: str) -> None:
    plan = plan_of(STUDIES[name], seed, dyad)
    rig = Config(session=Session(seat_a=seat, dyad="D07"))  # type: ignore[arg-type]
    for session in plan.sessions:
        for block in session.blocks:
            config = config_of(rig, session, block.number)
            assert parse(resolve(config)) == config
            assert config.session == rig.session
            assert (config.block.number, config.block.blocks) == (block.number, len(session.blocks))
            assert (config.block.trials, config.block.catch) == (block.count, block.catch)
            assert (config.block.first_target, config.block.rest) == (block.first_target, block.rest)
            if config.block.configuration == "bimanual":
                assert (config.block.station == seat) == (block.performer == "A")


def test_configured_seat_overrides_the_seat_of_the_plan() -> None:
    plan = plan_of(PAPER, 1, 3)
    assert seated(Config(), plan).session == Session(study="paper", seat_a="right")
    first = config_of(Config(session=Session(seat_a="left")), plan.sessions[0], 1)
    assert (first.block.performer, first.block.station) == ("A", "left")


def test_robot_takes_the_side_opposite_the_participant() -> None:
    plan = plan_of(STUDIES["controls"], 1, 1)
    (session,) = plan.sessions
    for block in session.blocks:
        config = config_of(Config(session=Session(seat_a="right")), session, block.number)
        hands = {"A": (block.kind, "person"), "B": ("person", block.kind), "dyad": ("person", "person")}
        assert (config.block.left, config.block.right) == hands[block.performer]
        assert config.block.configuration == "dyadic"


def test_level_names_the_partner_at_the_other_side_with_its_parameters() -> None:
    text = """
    orders.main = "2 alone"
    partners.left.initiative = 0.1
    [factors.partner]
    levels.person.other_hand = "person"
    levels.follower = {other_hand = "follower", partners.left = {initiative = 0.4}}
    [kinds.alone]
    performers = "B"
    other_hand = "still"
    """
    study = parse_study(text)
    assert parse_study(resolve_study(study)) == study
    plan = plan_of(study, 1, 1)
    (session,) = plan.sessions
    found = {dict(block.conditions)["partner"]: config_of(Config(), session, block.number) for block in session.blocks}
    assert {level: (config.block.left, config.block.right) for level, config in found.items()} == {
        "person": ("person", "person"),
        "follower": ("follower", "person"),
    }
    assert [found[level].partners.left["initiative"] for level in ("person", "follower")] == [0.1, 0.4]
    assert {config.block.configuration for config in found.values()} == {"dyadic"}


def test_sessions_rests_and_questionnaires_follow_the_block_order() -> None:
    text = 'orders.main = "2 a / a | a, a"\nlong_rest = 99\nblock.rest = 5\n[kinds.a]\n[questionnaires.q]\ntext = "?"'
    plan = plan_of(parse_study(text), 1, 1)
    assert [session.number for session in plan.sessions] == [1, 2]
    assert [block.rest for block in plan.blocks] == [0.0, 5.0, 99.0, 0.0, 5.0]
    assert [block.number for block in plan.blocks] == [1, 2, 3, 1, 2]
    assert [block.questionnaires for block in plan.blocks] == [(), (), (("q", "?"),), (), (("q", "?"),)]
    asked = [config_of(Config(), plan.sessions[0], number).block.questionnaires for number in (1, 2, 3)]
    assert asked == ["", "", "q: ?"]
    assert len({block.seed for block in plan.blocks}) == 5


@settings(deadline=None, max_examples=40)
@given(SEEDS, st.sampled_from(("alternate", "latin", "random")), st.integers(2, 5), st.integers(2, 4))
def test_crossed_factors_cover_all_combinations_in_each_cycle(seed: int, order: str, slow: int, fast: int) -> None:
    cells = slow * fast
    levels = {"slow": slow, "fast": fast}
    text = f'orders.main = "{2 * cells} a"\n[kinds.a]\nblock.trials = 1\n' + "".join(
        f'[factors.{name}]\norder = "{order}"\n[factors.{name}.levels]\n'
        + "".join(f"x{index} = {{}}\n" for index in range(number))
        for name, number in levels.items()
    )
    plan = plan_of(parse_study(text), seed, 5)
    for half in (plan.blocks[:cells], plan.blocks[cells:]):
        assert len({block.conditions for block in half}) == cells
    for cycle in range(2 * slow):
        assert len({level(block, "fast") for block in plan.blocks[cycle * fast : (cycle + 1) * fast]}) == fast


def test_between_dyads_factor_has_one_level_per_dyad() -> None:
    text = (
        'orders.main = "4 a"\n[kinds.a]\n[factors.group]\norder = "between"\n'
        "levels.light.physics.M = 0.01\nlevels.heavy.physics.M = 0.03\n"
    )
    groups = [{config.physics.M for config in configs(plan_of(parse_study(text), 1, dyad))} for dyad in (1, 2, 3)]
    assert groups == [{0.01}, {0.03}, {0.01}]


CATCH = 'orders.main = "8 a"\n[kinds.a]\nblock.trials = 20\ncatch = {}\ncatch_after = 4\n[factors.f]\n{}\n'
LEVELS = 'levels.on.block.force = "full"\nlevels.off.block.force = "none"'


@pytest.mark.parametrize(("catch", "number"), [("0.25", 5), ("3", 3), ("16", 16), ("0", 0)])
def test_catch_trials_occur_only_in_blocks_with_haptic_feedback(catch: str, number: int) -> None:
    plan = plan_of(parse_study(CATCH.format(catch, LEVELS)), 1, 1)
    for block in plan.blocks:
        assert len(block.catch) == (number if level(block, "f") == "on" else 0)
        assert all(trial > 4 for trial in block.catch)
        assert [trial.number for trial in block.trials if trial.catch] == list(block.catch)
    assert number in (0, 16) or len({block.catch for block in plan.blocks}) > 2


PERTURBED = (
    'orders.main = "4 a"\nperturbation.at = "ball"\n[kinds.a]\nblock.trials = 20\ncatch = 4\nperturbed = {}\n'
    "perturbed_after = 2\nperturbed_both_ways = true\n"
)


@pytest.mark.parametrize(("perturbed", "number"), [("0.3", 6), ("14", 14), ("0", 0)])
def test_perturbation_trials_are_drawn_among_those_with_haptic_feedback(perturbed: str, number: int) -> None:
    plan = plan_of(parse_study(PERTURBED.format(perturbed)), 1, 1)
    for block, config in zip(plan.blocks, configs(plan), strict=True):
        assert len(block.perturbed) == number
        assert not {*block.perturbed} & {*block.catch}
        assert all(trial > 2 for trial in block.perturbed)
        assert {*block.opposite} <= {*block.perturbed}
        assert len(block.opposite) == number // 2
        assert (config.perturbation.trials, config.perturbation.opposite) == (block.perturbed, block.opposite)
    assert plan == plan_of(parse_study(PERTURBED.format(perturbed)), 1, 1)
    assert number == 0 or len({block.perturbed for block in plan.blocks}) > 2


def test_study_without_a_place_has_no_perturbation_trials() -> None:
    text = PERTURBED.format("0.3").replace('"ball"', '"none"')
    assert all(block.perturbed == () for block in plan_of(parse_study(text), 1, 1).blocks)


def test_more_perturbation_trials_than_trials_are_refused() -> None:
    with pytest.raises(ConfigError, match=r"\[kinds.a\] perturbed: 15 perturbation trials do not fit into 20 trials"):
        plan_of(parse_study(PERTURBED.format("15")), 1, 1)


def test_shorter_block_keeps_only_the_perturbations_of_its_trials() -> None:
    plan = plan_of(parse_study(PERTURBED.format("14")), 1, 1)
    for config in shortened(list(configs(plan)), None, 8):
        assert all(trial <= 8 for trial in (*config.perturbation.trials, *config.perturbation.opposite))
        assert {*config.perturbation.opposite} <= {*config.perturbation.trials}


def test_more_catch_trials_than_trials_are_refused() -> None:
    with pytest.raises(ConfigError, match=r"\[kinds.a\] catch: 17 catch trials do not fit into 20 trials"):
        plan_of(parse_study(CATCH.format(17, LEVELS)), 1, 1)


def test_each_instruction_falls_back_to_english_on_its_own() -> None:
    text = (
        'orders.main = "2 a"\ninstructions.en = "Top."\n[kinds.a]\ninstructions.de = "Art."\n'
        '[factors.f]\nlevels.one.instructions.en = "One."\nlevels.two = {}\n'
    )
    plan = plan_of(parse_study(text), 1, 1)

    def read(language: str) -> list[str]:
        rig = parse(f'[display]\nlanguage = "{language}"')
        return [config.block.instructions for config in configs(plan, rig)]

    assert read("en") == ["Top.\n\nOne.", "Top."]
    assert read("de") == ["Art.\n\nOne.", "Art."]
    assert read("fr") == read("en")


def test_level_overrides_kind_and_kind_overrides_study() -> None:
    text = (
        'orders.main = "2 a"\nphysics.M = 0.1\nphysics.m = 0.1\nphysics.g = 1\n[kinds.a]\nphysics.m = 0.2\n'
        "physics.g = 2\n[factors.f]\nlevels.one.physics.g = 3\nlevels.two = {}\n"
    )
    rig = Config(physics=Physics(k_h=300.0))
    found = [config.physics for config in configs(plan_of(parse_study(text), 1, 1), rig)]
    assert found == [Physics(M=0.1, m=0.2, g=g, k_h=300.0) for g in (3.0, 2.0)]


def test_block_table_of_the_rig_is_ignored() -> None:
    plan = plan_of(PAPER, 1, 1)
    rig = parse('[block]\ntrials = 3\nforce = "none"\nseed = 9')
    assert configs(plan, rig) == configs(plan)


def test_conflict_with_the_rig_names_the_block() -> None:
    plan = plan_of(parse_study('orders.main = "a"\n[kinds.a]\ngeometry.target_distance = 0.4'), 1, 1)
    with pytest.raises(ConfigError) as raised:
        configs(plan)
    assert str(raised.value).startswith("block 1 (a): [geometry] target_distance")
    rig = parse("[geometry]\nboard_length = 1.0\n[task]\nfall_distance = 0.5")
    assert configs(plan, rig)[0].geometry == Geometry(board_length=1.0, target_distance=0.4)


@settings(deadline=None, max_examples=40)
@given(ANY, SEEDS, DYADS)
def test_targets_alternate_from_the_first_target(name: str, seed: int, dyad: int) -> None:
    for block in plan_of(STUDIES[name], seed, dyad).blocks:
        trials = block.trials
        assert trials[0].target == block.first_target
        assert all(one.target != other.target for one, other in pairwise(trials))
        assert [trial.number for trial in trials] == list(range(1, block.count + 1))


def test_planning_does_not_modify_the_study() -> None:
    study = parse_study(library.text_of("template"))
    plan_of(study, 1, 1)
    assert study == STUDIES["template"]
