"""The curtain: what a station may see of a tick, and what it never may."""

from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from netboard.base.config import SIDES, Side, parse
from netboard.base.tick import TICK
from netboard.stage.curtain import AGAIN, make_curtain, view_of
from netboard.task.trials.state_machine import Phase

DYADIC = make_curtain(parse('[block]\nconfiguration = "dyadic"\ntrials = 6'))
BIMANUAL = make_curtain(parse('[block]\nconfiguration = "bimanual"\ntrials = 6'))

OF_THE_PARTNER = ("sent_z", "sent_vz", "used_z", "used_vz", "coupling", "force", "rendered", "x", "y", "buttons", "seq")


def row(seed: int) -> NDArray[Any]:
    """A row of random but plausible content."""
    rng = np.random.default_rng(seed)
    row = np.zeros(1, TICK)
    for name in TICK.names or ():
        row[name] = rng.normal(0, 0.01) if TICK[name].kind == "f" else rng.integers(0, 100)
    row["phase"], row["target"] = rng.integers(0, len(Phase)), rng.choice((-1, 1))
    return row


@given(st.integers(0, 2**31), st.sampled_from(SIDES))
def test_dyadic_view_never_depends_on_the_partners_hand(seed: int, station: str) -> None:
    other = "right" if station == "left" else "left"
    one, two = row(seed), row(seed)
    for name in OF_THE_PARTNER:
        two[f"{other}_{name}"] += 1
    seen = [view_of(DYADIC, r[0], station, None, 0) for r in (one, two)]  # type: ignore[arg-type]
    assert seen[0] == seen[1]
    assert getattr(seen[0], other) is None
    assert getattr(seen[0], station) == one[f"{station}_used_z"][0]


def test_bimanual_view_shows_both_hands() -> None:
    r = row(3)
    view = view_of(BIMANUAL, r[0], "left", None, 0)
    assert (view.left, view.right) == (r["left_used_z"][0], r["right_used_z"][0])


ALONE = {
    "right": '[block]\nconfiguration = "bimanual"',
    "left": '[block]\nconfiguration = "bimanual"\nstation = "right"',
}
MANNED = {"right": '[block]\nright = "still"', "left": '[block]\nleft = "robot"'}


@pytest.mark.parametrize("text", [*ALONE.items(), *MANNED.items()])
@given(st.integers(0, 2**31))
def test_view_of_an_unused_station_shows_nothing_of_the_trial(text: tuple[Side, str], seed: int) -> None:
    station, toml = text
    curtain = make_curtain(parse(toml))
    assert curtain.away == (station,)
    rows = [row(s) for s in (seed, seed + 1)]
    for r in rows:
        r["phase"] %= Phase.FINISHED  # any other
    seen = [view_of(curtain, r[0], station, 2.0, 0, 7, 12.5) for r in rows]
    numbers = {"tick": 0, "trial": 0, "trials": 0}
    assert replace(seen[0], **numbers) == replace(seen[1], **numbers)  # type: ignore[arg-type]
    view = seen[0]
    assert (view.phase, view.z, view.theta, view.p, view.left, view.right) == ("away", 0.0, 0.0, None, None, None)
    assert (view.completion, view.best, view.failures, view.share, view.notice) == (None, None, 0, 0.0, "")
    assert (view.seq, view.rest) == (7, 12.5)


@pytest.mark.parametrize("text", [*ALONE.items(), *MANNED.items()])
@pytest.mark.parametrize(("blocks", "phase"), [(1, "finished"), (2, "away")])
def test_view_of_an_unused_station_says_when_the_session_is_over(
    text: tuple[Side, str], blocks: int, phase: str
) -> None:
    station, toml = text
    r = row(3)
    r["phase"] = Phase.FINISHED
    view = view_of(make_curtain(parse(f"{toml}\nblocks = {blocks}")), r[0], station, 2.0, 0)
    assert (view.phase, view.p, view.best, view.completion) == (phase, None, None, None)


@pytest.mark.parametrize(
    ("phase", "counted", "share"),
    [(Phase.LEVELLING, 250, 0.5), (Phase.HOLDING, 375, 0.25), (Phase.HOLDING, 9999, 1.0), (Phase.RUNNING, 375, 0.0)],
)
def test_share_is_the_elapsed_fraction_of_the_required_time(phase: Phase, counted: int, share: float) -> None:
    r = row(1)
    r["phase"], r["counted"] = phase, counted
    assert view_of(DYADIC, r[0], "left", None, 0).share == share


def test_share_is_zero_without_a_required_levelling_time() -> None:
    r = row(1)
    r["phase"], r["counted"] = Phase.LEVELLING, 1
    assert view_of(make_curtain(parse("[task]\nlevel_time = 0")), r[0], "left", None, 0).share == 0.0


def test_view_has_the_block_number() -> None:
    curtain = make_curtain(parse("[block]\nnumber = 3\nblocks = 18"))
    view = view_of(curtain, row(1)[0], "left", None, 0)
    assert (view.block, view.blocks) == (3, 18)


def test_view_has_the_board_state_and_the_trial_count() -> None:
    r = row(5)
    r["phase"], r["target"], r["completion"], r["trial"], r["extra"] = Phase.HOLDING, -1, 2.5, 4, 2
    view = view_of(DYADIC, r[0], "left", 2.25, 77)
    assert (view.phase, view.target, view.completion, view.best) == ("holding", -0.15, 2.5, 2.25)
    assert (view.z, view.theta, view.p) == (r["z"][0], r["theta"][0], r["p"][0])
    assert (view.trial, view.trials, view.sent_ns, view.notice) == (4, 8, 77, "")
    assert (view.seq, view.block, view.blocks, view.rest) == (0, 1, 1, None)
    assert all(type(getattr(view, f.name)) in (str, int, float, type(None)) for f in fields(view))


@pytest.mark.parametrize(("completion", "shown"), [(0.0, None), (1.25, 1.25)])
def test_completion_time_is_hidden_before_the_first_success(completion: float, shown: float | None) -> None:
    r = row(1)
    r["completion"] = completion
    assert view_of(DYADIC, r[0], "right", None, 0).completion == shown


def test_view_without_a_ball_has_no_ball_position() -> None:
    bare = make_curtain(parse("[physics]\nballs = 0"))
    assert view_of(bare, row(2)[0], "left", None, 0).p is None


def test_repeated_attempt_is_announced_while_levelling() -> None:
    r = row(4)
    r["phase"], r["attempt"] = Phase.LEVELLING, 2
    assert view_of(DYADIC, r[0], "left", None, 0).notice == AGAIN
    r["attempt"] = 1
    assert view_of(DYADIC, r[0], "left", None, 0).notice == ""
    r["phase"], r["attempt"] = Phase.RUNNING, 2
    assert view_of(DYADIC, r[0], "left", None, 0).notice == ""
