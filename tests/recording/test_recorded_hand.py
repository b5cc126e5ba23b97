"""The partner that plays a recorded hand: it follows the recording, mirrors it, and refuses what it cannot play."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import rehearsed
from netboard.base.compiled import kernel
from netboard.base.config import Config, Side, parse
from netboard.base.errors import ConfigError
from netboard.base.tick import TICK_SECONDS
from netboard.participants.body.stylus import ACTION
from netboard.participants.policy import OBSERVATION
from netboard.participants.robots.playback import PlaybackPartner, decide
from netboard.participants.seat.partners import problems_of
from netboard.recording.files.reader import Recording
from netboard.recording.importing.recorded_hand import partner
from netboard.task.trials.state_machine import Phase

LAG = 0.0005
"""Largest difference between a recorded height and the one that is played, low-passed and at the same time [m]."""


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return rehearsed.write(tmp_path_factory.mktemp("hand") / "block.mcap", rehearsed.rows())


def configured(file: Path | str, side: Side = "right", **options: Any) -> Config:
    given = {"file": file, **options}
    overrides = [f"block.{side}=playback", *(f"partners.{side}.{key}={value}" for key, value in given.items())]
    return parse("", overrides=overrides)


@kernel
def _decided(state: Any, constants: Any, observation: Any, actions: Any) -> None:
    decide(state[0], constants[0], observation[0], actions)


def played(policy: PlaybackPartner, side: int, target: float, ticks: int) -> NDArray[np.float64]:
    """Equilibrium points of the hand from the release of a ball, with a stylus that follows them [m]."""
    state, actions, o = policy.initial((1,)), np.zeros(2, ACTION), np.zeros(1, OBSERVATION)
    heights = np.zeros(ticks)
    o["seen"]["target"] = target
    for tick in range(-100, ticks):
        o["tick"], o["time"], o["seen"]["time"] = tick, tick * TICK_SECONDS, tick * TICK_SECONDS
        o["seen"]["phase"] = Phase.RUNNING if tick >= 0 else Phase.LEVELLING
        _decided(state, policy.constants, o, actions)
        o["z"][0, side] = actions[side]["target"][2]
        if tick >= 0:
            heights[tick] = actions[side]["target"][2]
    return heights


@pytest.mark.parametrize("trial", [0, 1])
def test_follows_the_recorded_hand_of_the_trial_with_the_same_target(recorded: Path, trial: int) -> None:
    with Recording(recorded) as recording:
        attempt = [one for one in recording.attempts() if one.outcome == "success"][trial]
        wanted = recording.columns("right_used_z", first=attempt.tick, stop=attempt.stop)["right_used_z"]
    heights = played(partner(configured(recorded), "right"), 1, 0.15 * attempt.target, len(wanted) + 500)
    assert np.ptp(wanted) > 20 * LAG
    assert np.abs(heights[200 : len(wanted)] - wanted[200:]).max() < LAG
    assert np.ptp(heights[len(wanted) + 100 :]) == 0.0, "it stays where the recorded trial ended"


def test_left_partner_with_the_hand_of_the_right_one_is_its_mirror_image(recorded: Path) -> None:
    right = played(partner(configured(recorded), "right"), 1, 0.15, 1500)
    left = played(partner(configured(recorded, "left", hand="right"), "left"), 0, -0.15, 1500)
    assert left.tobytes() == right.tobytes()


def test_identity_says_what_is_played(recorded: Path) -> None:
    """The hash is of what was recorded: the filter's result may differ in the last bit on another machine."""
    options: tuple[dict[str, Any], ...] = ({}, {"hand": "right"}, {"cutoff_hz": 10.0}, {"hand": "left"})
    identities = [partner(configured(recorded, **given), "right").identity for given in options]
    movements = [identity["policy_parameters"].partition('"movements_sha256": ')[2][:66] for identity in identities]
    assert movements[0] == movements[1] == movements[2] != movements[3]
    assert identities[0] != identities[2]
    assert len(movements[0].strip('"')) == 64


def test_movements_that_are_too_long_together_are_refused(recorded: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("netboard.participants.robots.playback.MOST_HEIGHTS", 100)
    with pytest.raises(ConfigError, match=r"\[partners.right\] first, last: these trials last .* s, expected at most"):
        partner(configured(recorded), "right")


def test_recording_that_cannot_be_played_is_refused_in_words(recorded: Path, tmp_path: Path) -> None:
    text, cut = tmp_path / "text.mcap", tmp_path / "cut.mcap"
    text.write_text("not a recording")
    cut.write_bytes(recorded.read_bytes()[:5000])
    still = rehearsed.write(tmp_path / "still.mcap", rehearsed.rows(), parse("", overrides=["block.right=still"]))
    for given, message in (
        ({"file": ""}, r"\[partners.right\] file: found none, expected the recording"),
        ({"file": tmp_path / "none.mcap"}, "cannot be read: No such file or directory"),
        ({"file": tmp_path}, r"\[partners.right\] file: "),
        ({"file": text}, "text.mcap"),
        ({"file": cut}, "cut.mcap"),
        ({"file": still}, "its right hand was held still, expected one that moved"),
        (
            {"file": recorded, "first": 2},
            "found 1 complete successful trials from trial 2 on, and none of them with the",
        ),
        ({"file": recorded, "first": 5}, "found 0 complete successful trials from trial 5 on"),
        ({"file": recorded, "made_up": 1}, r"\[partners.right\] made_up"),
    ):
        with pytest.raises(ConfigError, match=message):
            partner(configured(**given), "right")
        assert len(problems_of([configured(**given)])) == 1
