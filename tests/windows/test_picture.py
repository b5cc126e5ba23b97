"""The picture as a function of the view: geometry, symmetry, states, and hidden content."""

import math
from dataclasses import replace

import pytest
from display_parts import VIEW, WORDS
from hypothesis import given
from hypothesis import strategies as st

from made_recordings import two_trials
from netboard.base.config import Config
from netboard.base.errors import WireError
from netboard.stage.curtain import make_curtain, view_of
from netboard.task.trials.state_machine import Phase
from netboard.windows.participant.scene import COLOURS, GRAIN, TEXT_SHARE, PictureState
from netboard.windows.participant.screens import compose

CONFIG = Config()
PHASES = [phase.name.lower() for phase in Phase] + ["away"]
ON_BOARD = [name for name in PHASES if name not in ("idle", "finished", "away")]
HEIGHTS = st.floats(-0.075, 0.075)
SLACK = 2 * GRAIN
FIGURES = ("board", "target", "handles", "cursors", "fill", "bar", "level", "stripe")


def shown(view, config=CONFIG):
    return compose(view, config, WORDS)


@st.composite
def views(draw):
    return replace(
        VIEW,
        phase=draw(st.sampled_from(ON_BOARD)),
        z=draw(HEIGHTS),
        theta=draw(st.floats(-0.5, 0.5)),
        p=draw(st.none() | st.floats(-0.35, 0.35)),
        target=draw(st.sampled_from((-0.15, 0.15))),
        left=draw(st.none() | HEIGHTS),
        right=draw(st.none() | HEIGHTS),
        completion=draw(st.none() | st.floats(0.1, 60)),
        share=draw(st.floats(0, 1)),
    )


def flipped(points):
    return sorted((-x, y) for x, y in points)


@given(views())
def test_mirrored_view_gives_the_mirrored_picture(view):
    p = None if view.p is None else -view.p
    mirrored = replace(view, theta=-view.theta, p=p, target=-view.target, left=view.right, right=view.left)
    a, b = shown(view), shown(mirrored)
    for name in FIGURES:
        assert flipped(getattr(a, name)) == sorted(getattr(b, name))
    ours, theirs = ([point for arrow in one.arrows for point in arrow] for one in (a, b))
    assert [y for _, y in flipped(ours)] == pytest.approx([y for _, y in sorted(theirs)])
    assert sorted(-x for x, _ in ours) == pytest.approx(sorted(x for x, _ in theirs))
    assert (a.ball is None) == (b.ball is None)
    if a.ball is not None:
        assert (-a.ball[0], a.ball[1]) == b.ball
    bare = {**dict.fromkeys(FIGURES, ()), "arrows": (), "ball": None}
    assert replace(a, **bare) == replace(b, **bare)


@given(views(), st.integers(0, 10**9), st.integers(0, 10**18))
def test_tick_and_send_time_do_not_change_the_picture(view, tick, sent_ns):
    assert shown(view) == shown(replace(view, tick=tick, sent_ns=sent_ns))


@given(views())
def test_board_target_and_handles_keep_their_dimensions(view):
    picture = shown(view)
    a, b, c, _ = picture.board
    assert math.dist(a, b) == pytest.approx(0.700, abs=SLACK)
    assert math.dist(b, c) == pytest.approx(0.050, abs=SLACK)
    left, right = picture.handles
    assert left[1] == pytest.approx(view.z - 0.25 * math.sin(view.theta), abs=SLACK)
    assert right[1] == pytest.approx(view.z + 0.25 * math.sin(view.theta), abs=SLACK)
    if view.p is None:
        assert picture.target == picture.fill == ()
        return
    assert math.dist(*picture.target[:2]) == pytest.approx(0.070, abs=SLACK)
    middle = [sum(corner[i] for corner in picture.target) / 4 for i in (0, 1)]
    assert math.dist(middle, (0.0, view.z)) == pytest.approx(0.150, abs=SLACK)


@given(views().filter(lambda view: view.p is not None))
def test_ball_lies_on_the_board(view):
    picture = shown(view)
    (ax, ay), (bx, by) = picture.board[3], picture.board[2]
    x, y = picture.ball
    above = ((bx - ax) * (y - ay) - (by - ay) * (x - ax)) / math.dist((ax, ay), (bx, by))
    along = ((bx - ax) * (x - ax) + (by - ay) * (y - ay)) / math.dist((ax, ay), (bx, by))
    assert above == pytest.approx(picture.ball_radius, abs=SLACK)
    assert along - 0.350 == pytest.approx(view.p, abs=SLACK)


@given(st.floats(-0.3, 0.3))
def test_stripe_shows_that_the_ball_rolls_without_slip(p):
    picture = shown(replace(VIEW, z=0.0, theta=0.0, p=p))
    assert all(math.dist(corner, picture.ball) < picture.ball_radius for corner in picture.stripe)
    (bx, by), (ax, ay), *_ = picture.stripe
    assert [sum(places) / 4 for places in zip(*picture.stripe, strict=True)] == pytest.approx(picture.ball, abs=SLACK)
    turned = math.atan2(bx - ax, by - ay) - p / picture.ball_radius
    assert math.sin(turned) == pytest.approx(0.0, abs=0.01)
    assert math.cos(turned) == pytest.approx(1.0, abs=0.01), "rolling to the right is turning to the right"


def test_plain_and_hidden_balls_have_no_stripe():
    plain = replace(CONFIG, display=replace(CONFIG.display, ball="plain"))
    assert shown(VIEW, plain).stripe == ()
    assert replace(shown(VIEW), stripe=()) == shown(VIEW, plain)
    assert shown(replace(VIEW, p=None)).stripe == ()


@given(HEIGHTS, HEIGHTS, st.floats(-0.35, 0.35), st.sampled_from(ON_BOARD))
def test_board_within_stylus_reach_stays_visible_below_the_text(left, right, p, phase):
    theta = math.asin((right - left) / 0.5)
    view = replace(VIEW, phase=phase, z=(left + right) / 2, theta=theta, p=p, left=left, right=right)
    picture = shown(view)
    width, height = picture.extent
    points = (*picture.board, *picture.handles, *picture.cursors, picture.ball)
    assert all(abs(x) <= width / 2 for x, _ in points)
    assert all(abs(y) <= height / 2 * (1 - TEXT_SHARE) + 1e-3 for _, y in points)
    assert picture.ball[1] + picture.ball_radius <= height / 2 * (1 - TEXT_SHARE) + 1e-3


@pytest.mark.parametrize(("station", "partner", "x"), [("left", "right", -0.25), ("right", "left", 0.25)])
def test_partners_hand_is_not_in_the_picture(station, partner, x):
    curtain = make_curtain(CONFIG)
    row = two_trials()[2000]
    other = row.copy()
    other[f"{partner}_used_z"] += 0.03
    pictures = [shown(view_of(curtain, which, station, None, 0)) for which in (row, other)]
    assert pictures[0] == pictures[1]
    ((cursor_x, cursor_y),) = pictures[0].cursors
    assert cursor_x == pytest.approx(x)
    assert cursor_y == pytest.approx(row[f"{station}_used_z"])


def test_bimanual_picture_shows_both_hands():
    picture = shown(replace(VIEW, left=0.01, right=-0.02))
    assert picture.cursors == (pytest.approx((-0.25, 0.01)), pytest.approx((0.25, -0.02)))


@pytest.mark.parametrize("phase", PHASES)
def test_every_phase_has_the_colours_of_its_picture_state(phase):
    picture = shown(replace(VIEW, phase=phase))
    assert picture.colours == COLOURS[picture.state]


@pytest.mark.parametrize("change", [{"phase": "dancing"}, {"z": math.nan}, {"p": math.inf}, {"left": math.nan}])
def test_unknown_phase_or_non_finite_value_is_refused(change):
    with pytest.raises(WireError):
        shown(replace(VIEW, **change))


def test_adjacent_parts_differ_in_brightness():
    def brightness(colour):
        red, green, blue = (int(colour[i : i + 2], 16) for i in (1, 3, 5))
        return 0.2126 * red + 0.7152 * green + 0.0722 * blue

    for colours in COLOURS.values():
        for one, other in (
            ("board", "background"),
            ("target", "board"),
            ("ball", "background"),
            ("cursor", "board"),
        ):
            assert abs(brightness(getattr(colours, one)) - brightness(getattr(colours, other))) > 12
    holding = COLOURS[PictureState.HOLD]
    assert abs(brightness(holding.fill) - brightness(holding.target)) > 12
