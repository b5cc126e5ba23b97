"""A block with simulated participants: the same bits in pieces of any size, at human speed, by the named performers."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from netboard.base.config import Config
from netboard.base.errors import ConfigError
from netboard.base.tables.simulated import Participant, VirtualDevice
from netboard.participants.people.muscles import CAPACITY
from netboard.participants.seat import block as rehearsed
from netboard.participants.seat.block import START_TICK, BlockSummary, Rehearsal
from netboard.participants.seat.closed_loop import policy_at
from netboard.recording.integrity.verification import verify
from netboard.stage.stage import commanded_forces, make_stage
from netboard.task.trials.state_machine import Cause, Phase

DEFAULT_PEOPLE = {"A": Participant(), "B": Participant()}
CONDITIONS = [("dyadic", "full"), ("dyadic", "none"), ("bimanual", "full"), ("bimanual", "none")]


def with_block(**keys: Any) -> Config:
    config = Config()
    return replace(config, block=replace(config.block, **keys))


def play(
    config: Config, size: int = 1000, people: dict[str, Participant] = DEFAULT_PEOPLE
) -> tuple[np.ndarray, BlockSummary]:
    rehearsal = Rehearsal(config, people)
    rows = np.concatenate([piece.copy() for piece in rehearsal.pieces(size)])
    return rows, rehearsal.summary()


@pytest.mark.slow
@pytest.mark.parametrize("size", [1, 7, 10, 64, 100_000])
def test_ticks_are_independent_of_chunk_size(size: int) -> None:
    config = with_block(trials=1)
    assert play(config, size)[0].tobytes() == play(config, 1000)[0].tobytes()


@pytest.mark.slow
@pytest.mark.parametrize(("configuration", "force"), CONDITIONS)
def test_completion_times_are_human_like(configuration: str, force: str) -> None:
    rows, summary = play(with_block(configuration=configuration, force=force, trials=15))
    assert len(summary.completions) == 15
    assert 2.0 < np.mean(summary.completions) < 8.0
    assert summary.failures <= 6
    assert not summary.given_up
    assert summary.ticks == len(rows)
    assert rows["event"][-1] == Cause.LAST
    assert bool(rows["left_force"].any()) == (force == "full")


@pytest.mark.slow
def test_rehearsed_ticks_verify_bit_for_bit() -> None:
    config = with_block(trials=2)
    rows, _ = play(config)
    verdict = verify(make_stage(config), rows)
    assert verdict.identical
    assert (verdict.checked, verdict.gaps) == (len(rows), 0)


@pytest.mark.slow
def test_rehearsed_rows_equal_those_of_a_rig_without_jitter() -> None:
    rows, summary = play(with_block(trials=2))
    assert (np.diff(rows["tick"]) == 1).all()
    assert (np.diff(rows["time_ns"]) == 1_000_000).all()
    assert rows["event"][START_TICK] == Cause.START
    held = rows["mark_ticks"][rows["event"] == Cause.HELD] * 1e-3
    assert held == pytest.approx(summary.completions)
    for side in ("left", "right"):
        assert (rows[f"{side}_live"] == 1).all()
        assert (rows[f"{side}_seq"] == rows["tick"]).all()
        assert (rows["time_ns"] - rows[f"{side}_stamp_ns"] == 250_000).all()
        assert np.abs(rows[f"{side}_x"]).max() < 0.01
        assert rows[f"{side}_rendered"][1:] == pytest.approx(rows[f"{side}_force"][:-1])


@pytest.mark.slow
def test_ticks_depend_on_seed_and_block_number() -> None:
    plain = play(with_block(trials=1))[0]
    assert play(with_block(trials=1))[0].tobytes() == plain.tobytes()
    for other in (with_block(trials=1, seed=2), with_block(trials=1, number=2, blocks=2)):
        assert play(other)[0].tobytes() != plain.tobytes()


@pytest.mark.slow
def test_delayed_force_is_rendered_later() -> None:
    rows, _ = play(with_block(trials=1, force_delay_ms=20))
    running = rows["phase"] == Phase.RUNNING
    later = np.flatnonzero(running)[100:-100]
    assert rows["left_rendered"][later] == pytest.approx(rows["left_force"][later - 21])


def test_catch_trial_renders_no_delayed_force_of_the_trial_before() -> None:
    config = with_block(trials=2, force_delay_ms=200, catch=(2,))
    rows, _ = play(config)
    sent = np.roll(commanded_forces(rows, 200, config.block.catch)[:, 0], 1)
    assert rows["left_rendered"][1:] == pytest.approx(sent[1:])
    caught = np.flatnonzero(rows["trial"] == 2)
    assert len(caught) > 0
    assert not rows["left_rendered"][caught[1:]].any()


@pytest.mark.parametrize("configuration", ["dyadic", "bimanual"])
def test_participant_without_pauses_between_movements_has_no_more_than_a_hand_can_make(configuration: str) -> None:
    restless = Participant(threshold_deg=0.0, refractory=0.0, movement_time=0.6)
    config = replace(with_block(trials=1, configuration=configuration), participant=restless)
    rehearsal, most = Rehearsal(config, {"A": restless, "B": restless}), 0
    for _, rows in zip(range(60), rehearsal.pieces(100), strict=False):
        most = max(most, *(seat.state["muscles"]["moves"].max() for seat in rehearsal._seats if seat.hands.any()))
        assert np.isfinite(rows["left_sent_z"]).all()
    assert most == CAPACITY


def test_participant_moves_by_sight_alone_if_stylus_and_board_are_not_coupled() -> None:
    config = replace(with_block(trials=1), physics=replace(Config().physics, k_h=0.0))
    rehearsal = Rehearsal(config, DEFAULT_PEOPLE)
    for _, rows in zip(range(30), rehearsal.pieces(100), strict=False):
        assert all(np.isfinite(seat.state["muscles"]["submovements"]).all() for seat in rehearsal._seats)
        assert np.isfinite(rows["left_sent_z"]).all()


@pytest.mark.slow
def test_partner_may_be_fixed_or_a_robot() -> None:
    rows, summary = play(with_block(trials=2, right="still"))
    assert len(summary.completions) == 2
    assert not rows["right_sent_z"].any()
    rows, summary = play(with_block(trials=2, right="robot"))
    assert len(summary.completions) == 2
    assert rows["right_sent_z"].any()


def test_participants_are_assigned_to_their_seats() -> None:
    a, b = Participant(kp=2.0), Participant(kp=3.0)
    people = {"A": a, "B": b}
    config = with_block()

    def seated(config: Config, *sides: str) -> list[Participant]:
        return [policy_at(config, (side,), people)._person for side in sides]

    assert seated(config, "left", "right") == [a, b]
    swapped = replace(config, session=replace(config.session, seat_a="right"))
    assert seated(swapped, "left", "right") == [b, a]
    bimanual = with_block(configuration="bimanual", performer="B")
    assert policy_at(bimanual, ("left", "right"), people)._person == b
    assert seated(with_block(left="robot"), "left", "right") == [Participant(), b]


@pytest.mark.slow
def test_block_is_given_up_if_trials_take_too_long(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rehearsed, "MAX_MEAN_TRIAL", 1.0)
    rows, summary = play(with_block(trials=2))
    assert summary.given_up
    assert rows["event"][-1] == Cause.STOP
    assert summary.ticks == START_TICK + 2001


@pytest.mark.parametrize(
    ("config", "problem"),
    [
        (with_block(force="unrelated", unrelated="x.mcap"), "no recorded forces"),
        (replace(Config(), virtual=VirtualDevice(read_latency_ms=2.0)), "read_latency_ms: found 2"),
        (replace(Config(), virtual=VirtualDevice(thermal_time="model")), "thermal_time: found 100"),
    ],
)
def test_unsupported_configuration_is_refused(config: Config, problem: str) -> None:
    with pytest.raises(ConfigError, match=problem):
        Rehearsal(config, DEFAULT_PEOPLE)


@pytest.mark.slow
def test_two_robot_partners_complete_the_task_together() -> None:
    rows, summary = play(with_block(trials=2, left="robot", right="robot"))
    assert len(summary.completions) == 2
    assert not np.array_equal(rows["left_sent_z"], -rows["right_sent_z"])
    again, _ = play(with_block(trials=2, left="robot", right="robot"))
    assert rows.tobytes() == again.tobytes()


@pytest.mark.slow
def test_robot_partner_renders_no_force_without_haptic_feedback() -> None:
    rows, summary = play(with_block(trials=1, left="robot", right="robot", force="none"))
    assert len(summary.completions) == 1
    assert not rows["left_rendered"].any()
