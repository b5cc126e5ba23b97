"""The player's grip picture depends only on the player's own stylus, pointer and force."""

from dataclasses import replace

import pytest
from display_parts import VIEW, WORDS
from hypothesis import given
from hypothesis import strategies as st

from netboard.base.config import Config
from netboard.windows.participant.grip import ARROW_PER_FORCE, SMALLEST_FORCE, TEETH, grip_of
from netboard.windows.participant.scene import CURSOR_RADIUS, GRAIN

CONFIG = Config()
L = CONFIG.physics.l
HEIGHTS = st.floats(-0.075, 0.075)
FORCES = st.none() | st.floats(-3.3, 3.3)


def grip(view=VIEW, station="left", pointer=0.0, force=None, keys=False):
    return grip_of(view, CONFIG, WORDS, station, pointer, force, keys=keys)


@given(HEIGHTS, HEIGHTS, HEIGHTS, FORCES)
def test_grip_does_not_show_the_partner(own, one, another, force):
    seen = [grip(replace(VIEW, left=own, right=right), "left", 0.01, force) for right in (one, another, None)]
    assert seen[0] == seen[1] == seen[2]


@given(HEIGHTS, HEIGHTS, FORCES)
def test_right_grip_mirrors_the_left(own, pointer, force):
    left = grip(replace(VIEW, left=own, right=None), "left", pointer, force)
    right = grip(replace(VIEW, left=None, right=own), "right", pointer, force)
    for name in ("mark", "arrow"):
        ours = sorted((round(x + L, 9), y) for x, y in getattr(left, name))
        theirs = sorted((round(L - x, 9), y) for x, y in getattr(right, name))
        assert [y for _, y in ours] == pytest.approx([y for _, y in theirs])
        assert [x for x, _ in ours] == pytest.approx([x for x, _ in theirs], abs=1e-6)
    assert (left.label, left.label_at[1]) == (right.label, right.label_at[1])
    assert left.hint[0] == right.hint[0].replace("right", "left")


@given(HEIGHTS, HEIGHTS)
def test_spring_runs_from_the_pointer_to_the_stylus(own, pointer):
    seen = grip(replace(VIEW, left=own), "left", pointer)
    assert [y for _, y in seen.mark] == pytest.approx([pointer, pointer], abs=GRAIN)
    if seen.spring:
        (x, begin), (_, end) = seen.spring[0], seen.spring[-1]
        assert (x, begin, end) == pytest.approx((-L, pointer, own), abs=GRAIN)
        assert len(seen.spring) == TEETH + 3
        heights = [y for _, y in seen.spring]
        assert heights in (sorted(heights), sorted(heights, reverse=True))
    else:
        assert own == pytest.approx(pointer, abs=2 * GRAIN)


@pytest.mark.parametrize("force", [-3.0, -0.3, 0.05, 2.0])
def test_arrow_has_the_direction_and_length_of_the_force(force):
    seen = grip(replace(VIEW, left=0.01), force=force)
    heights = [y for _, y in seen.arrow]
    tip = max(heights) if force > 0 else min(heights)
    reach = CURSOR_RADIUS + ARROW_PER_FORCE * abs(force)
    assert abs(tip - 0.01) == pytest.approx(reach, abs=2 * GRAIN)
    assert seen.label == f"{abs(force):.1f} N"
    assert (seen.label_at[1] - tip) * force > 0


@pytest.mark.parametrize("force", [None, 0.0, SMALLEST_FORCE / 2, -SMALLEST_FORCE / 2])
def test_no_arrow_below_the_smallest_force(force):
    seen = grip(force=force)
    assert (seen.arrow, seen.label) == ((), "")
    assert seen.mark


@pytest.mark.parametrize(("view", "pointer"), [(None, 0.01), (VIEW, None), (replace(VIEW, left=None), 0.01)])
def test_only_the_hint_is_shown_without_a_stylus_or_a_pointer(view, pointer):
    seen = grip(view, pointer=pointer, force=1.0)
    assert (seen.mark, seen.spring, seen.arrow, seen.label) == ((), (), (), "")
    assert len(seen.hint) == 2
    assert all(seen.hint)


def test_hint_names_the_input_that_moves_the_stylus():
    assert "mouse" in grip().hint[0]
    assert "key" in grip(keys=True).hint[0]
    assert "begin" in grip(pointer=None).hint[0]
    assert "key" in grip(pointer=None, keys=True).hint[0]
