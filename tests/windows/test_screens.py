"""The texts that a participant reads in every state of a trial and between blocks."""

import math
from dataclasses import replace

import pytest
from display_parts import VIEW, WORDS

from netboard.base.config import Config, parse
from netboard.base.tables.experiment import Block, Session, Task
from netboard.base.tables.rig import Display
from netboard.windows.participant.language import load_words
from netboard.windows.participant.scene import COLOURS, PictureState
from netboard.windows.participant.screens import blank, compose

CONFIG = Config()


def shown(config=CONFIG, words=WORDS, result="", **view):
    return compose(replace(VIEW, **view), config, words, result)


def test_times_and_texts_appear_between_trials_only():
    times = {"completion": 3.416, "best": 2.9}
    assert shown(phase="levelling", **times).detail == "Last 3.42 s   (best 2.90 s)"
    assert shown(phase="levelling").detail == ""
    running = shown(**times)
    assert (running.headline, running.detail, running.counter) == ("", "", "Trial 4 of 60")
    assert shown(phase="paused", trial=61).counter == "Trial 60 of 60"


def test_numbers_use_the_decimal_mark_of_the_language():
    german = shown(words=load_words("de"), phase="levelling", completion=3.416)
    assert (german.headline, german.detail) == ("Halten Sie das Brett waagerecht und ruhig", "Zuletzt 3,42 s")


def test_success_screen_shows_the_time_and_the_next_step():
    picture = shown(phase="levelling", result="succeeded", completion=3.4, best=2.9)
    assert (picture.headline, picture.detail) == ("Well done", "Last 3.40 s   (best 2.90 s)")
    assert picture.notice == "Hold the board level and still"
    assert picture.colours.headline == COLOURS[PictureState.SUCCESS].headline
    best = shown(phase="levelling", result="succeeded", completion=2.9, best=2.9)
    assert best.detail == "2.90 s   Your best time so far"


def test_failure_screen_announces_the_same_target():
    picture = shown(phase="levelling", result="failed", notice="again")
    assert (picture.headline, picture.detail) == ("The ball fell off", "Once more: same target")
    timed = replace(CONFIG, task=Task(time_limit=20.0))
    assert shown(timed, phase="failed").headline == "Not this time"
    assert shown(phase="levelling", notice="again").notice == "Once more: same target"


def test_screen_before_a_block_shows_instructions_without_a_board():
    picture = shown(replace(CONFIG, block=Block(number=3, blocks=18)), phase="idle", block=3, blocks=18)
    assert picture.headline == "Block 3 of 18"
    assert WORDS.who_dyadic.format(end=WORDS.left_end) in picture.text
    assert not picture.board
    assert not picture.cursors
    assert shown(phase="idle").headline == "Get ready"


@pytest.mark.parametrize(("rest", "countdown"), [(75.2, "1:16"), (60.0, "1:00"), (0.4, "0:01")])
def test_rest_screen_counts_down_in_whole_seconds(rest, countdown):
    picture = shown(phase="idle", rest=rest, block=3, blocks=18)
    assert (picture.headline, picture.detail, picture.notice) == ("Take a rest", countdown, "Next: block 3 of 18")
    assert picture.text == ""
    assert shown(phase="idle", rest=0.0).headline == "Get ready"


def test_participant_without_a_role_in_the_block_sees_the_rest_screen():
    picture = shown(phase="away", z=0.0, p=None, left=None, block=3, blocks=18)
    assert (picture.headline, picture.counter) == ("You can rest", "Block 3 of 18")
    assert not picture.board
    assert shown(phase="away", rest=30.0).detail == "0:30"


def test_screen_after_a_block_and_after_the_last_block():
    done = shown(phase="finished", block=3, blocks=18, best=2.9)
    assert (done.headline, done.detail) == ("Block 3 of 18 is done", "Best 2.90 s")
    last = shown(phase="finished", block=18, blocks=18)
    assert (last.headline, last.detail, last.notice) == ("Finished. Thank you", "", "")


def test_pilot_run_is_marked_in_every_picture():
    pilot = replace(CONFIG, session=Session(pilot=True))
    for phase in ("idle", "levelling", "running", "holding", "succeeded", "failed", "paused", "finished", "away"):
        assert shown(pilot, phase=phase).pilot == "PILOT RUN"
        assert shown(phase=phase).pilot == ""
    assert blank(pilot, WORDS, "Connection lost", lost=True).pilot == "PILOT RUN"


def test_photodiode_patch_is_white_during_a_trial():
    patched = replace(CONFIG, display=Display(patch=True))
    white = {
        phase: shown(patched, phase=phase).patch for phase in ("idle", "levelling", "running", "holding", "paused")
    }
    assert white == {"idle": False, "levelling": False, "running": True, "holding": True, "paused": False}
    assert shown().patch is None
    assert blank(patched, WORDS, "").patch is False


def ups(picture):
    """Whether the arrows at the left and right ends point up; None where there is no arrow."""
    found = {-1: None, 1: None}
    for arrow in picture.arrows:
        heights = [y for _, y in arrow]
        tip = max(range(len(arrow)), key=lambda i: abs(heights[i] - sum(heights) / len(heights)))
        found[int(math.copysign(1, arrow[tip][0]))] = heights[tip] > 0
    return found[-1], found[1]


@pytest.mark.parametrize(
    ("z", "tilt_deg", "expected"),
    [
        (0.0, 0.0, (None, None)),
        (0.009, 0.9, (None, None)),
        (0.0, 2.0, (True, False)),
        (0.0, -2.0, (False, True)),
        (0.02, 0.0, (False, False)),
        (-0.02, 0.0, (True, True)),
        (0.35 * math.sin(math.radians(4.0)), 4.0, (None, False)),
    ],
)
def test_levelling_arrows_show_how_to_move_each_end(z, tilt_deg, expected):
    picture = shown(phase="levelling", z=z, theta=math.radians(tilt_deg))
    assert ups(picture) == expected
    assert shown(phase="running", z=z, theta=math.radians(tilt_deg)).arrows == ()


def width(corners):
    return max(x for x, _ in corners) - min(x for x, _ in corners) if corners else 0.0


@pytest.mark.parametrize("share", [0.0, 0.25, 1.0])
def test_elapsed_share_fills_the_level_bar_or_the_target(share):
    levelling = shown(phase="levelling", share=share)
    assert width(levelling.level) == pytest.approx(share * width(levelling.bar))
    holding = shown(phase="holding", p=0.15, share=share)
    assert width(holding.fill) == pytest.approx(share * width(holding.target))
    assert holding.bar == ()
    assert shown(phase="running", share=share).fill == ()


@pytest.mark.parametrize(("notice", "says"), [("operator", "experimenter"), ("fault", "problem"), ("stop", "no force")])
def test_pause_names_its_cause(notice, says):
    picture = shown(phase="paused", notice=f"pause_{notice}")
    assert picture.headline == "Paused"
    assert says in picture.detail
    assert shown(phase="paused").detail == ""


def test_last_block_whose_trials_may_be_repeated_asks_to_wait():
    held = shown(phase="finished", block=18, blocks=18, notice="pause_decision")
    assert (held.headline, held.notice) == ("Block 18 of 18 is done", "Please wait. There may be more trials.")


@pytest.mark.parametrize(
    ("device", "haptics", "says"),
    [
        ("openhaptics", "full", "feel the board"),
        ("mouse", "full", "arrow"),
        ("spacemouse", "full", "not feel"),
        ("mouse", "none", "not feel"),
    ],
)
def test_instructions_promise_only_a_force_that_the_device_renders(device, haptics, says):
    config = parse(f'[agents.left]\ndevice = "{device}"\n[block]\nforce = "{haptics}"')
    assert says in shown(config, phase="idle").text
