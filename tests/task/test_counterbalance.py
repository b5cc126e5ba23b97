"""Counterbalancing of orders, levels, first targets, seats and catch trials."""

from collections import Counter
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from netboard.task.plans.counterbalance import bits, drawn_trials, first_sides, rows, shuffled, turn_of

SEEDS = st.integers(0, 2**63)


@given(SEEDS, st.integers(0, 200))
def test_shuffle_is_a_deterministic_permutation(seed: int, number: int) -> None:
    order = shuffled(number, seed, 1)
    assert sorted(order) == list(range(number))
    assert shuffled(number, seed, 1) == order


def test_random_stream_is_stable_across_releases() -> None:
    assert shuffled(8, 1, 2, 3) == (1, 3, 7, 5, 2, 0, 4, 6)
    assert bits(2, 0) == (11749869230777074271, 4976686463289251617)


def test_shuffles_are_uniform() -> None:
    found = Counter(shuffled(3, seed) for seed in range(6000))
    assert len(found) == 6
    assert all(850 < number < 1150 for number in found.values())


@pytest.mark.parametrize("levels", range(2, 9))
def test_latin_square_is_balanced_for_first_order_carryover(levels: int) -> None:
    square = rows(levels, "latin")
    places = Counter((place, level) for row in square for place, level in enumerate(row))
    follows = Counter(pair for row in square for pair in pairwise(row))
    assert len(places) == levels**2
    assert set(places.values()) == {len(square) // levels}
    assert len(follows) == levels * (levels - 1)
    assert set(follows.values()) == {len(square) // levels}


def test_alternate_order_rotates_through_the_starting_levels() -> None:
    assert rows(3, "alternate") == ((0, 1, 2), (1, 2, 0), (2, 0, 1))
    assert rows(3, "random") == rows(3, "between") == ()


PAPER = (1, (), ((2, (0, 1, 0)),))


def test_starts_match_the_paper_for_4_dyads_and_are_all_used_after_8() -> None:
    starts = [turn_of(dyad, *PAPER).starts[0] for dyad in range(1, 9)]
    assert starts[:4] == [(0, 1, 0), (1, 0, 1), (0, 1, 1), (1, 0, 0)]
    assert len(set(starts)) == 8


@given(
    st.integers(1, 60),
    st.integers(1, 4),
    st.lists(st.integers(2, 4), max_size=2),
    st.lists(st.tuples(st.integers(2, 6), st.lists(st.sampled_from((0, 1)), min_size=1, max_size=4)), max_size=2),
)
def test_every_component_of_a_turn_is_balanced_over_dyads(
    rounds: int, orders: int, between: list[int], factors: list[tuple[int, list[int]]]
) -> None:
    turns = [turn_of(dyad, orders, between, factors) for dyad in range(1, rounds + 1)]
    assert spread(turn.order for turn in turns) <= 1 or rounds < orders
    slower = orders
    for place, levels in enumerate(between):
        assert spread_over_levels((turn.between[place] for turn in turns), levels) <= slower
        slower *= levels
    for place, (number, offsets) in enumerate(factors):
        for sequence in range(len(offsets)):
            assert spread_over_levels((turn.starts[place][sequence] for turn in turns), number) <= slower
        slower *= number
    assert spread_over_levels((turn.seat for turn in turns), 2) <= 2
    assert spread_over_levels((turn.seat for turn in turns[: rounds // 4 * 4]), 2) == 0


def spread(values: object) -> int:
    counted = Counter(values)  # type: ignore[call-overload]
    return max(counted.values()) - min(counted.values()) if counted else 0


def spread_over_levels(values: object, levels: int) -> int:
    counted = Counter(values)  # type: ignore[call-overload]
    found = [counted[level] for level in range(levels)]
    return max(found) - min(found)


@given(SEEDS, st.integers(0, 50), st.sampled_from((0, 1)))
def test_first_sides_are_balanced_up_to_the_odd_one(seed: int, number: int, spare: int) -> None:
    sides = first_sides(number, spare, seed)
    assert len(sides) == number
    assert sides.count(spare) - sides.count(1 - spare) == number % 2


@given(SEEDS, st.integers(1, 200), st.integers(0, 50), st.data())
def test_drawn_trials_have_the_requested_number_and_spare_the_first_trials(
    seed: int, trials: int, after: int, data: st.DataObject
) -> None:
    number = data.draw(st.integers(0, max(trials - after, 0)))
    drawn = drawn_trials(number, range(after + 1, trials + 1), seed)
    assert len(set(drawn)) == number
    assert list(drawn) == sorted(drawn)
    assert all(after < trial <= trials for trial in drawn)
    odd = sum(trial % 2 for trial in drawn)
    if number <= (trials - after) // 2:
        assert abs(odd - (number - odd)) <= 1


def test_odd_drawn_trial_has_each_target_equally_often_over_seeds() -> None:
    odd = sum(drawn_trials(1, range(3, 61), seed)[0] % 2 for seed in range(2000))
    assert 850 < odd < 1150
