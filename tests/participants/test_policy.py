"""The identity of a policy in the recording: the same text and SHA-256 wherever it runs."""

import hashlib
import json
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np

from netboard.base.config import Config
from netboard.base.tables.simulated import Participant
from netboard.nodes.rehearsal.jobs import Job, rehearse
from netboard.nodes.server.robot import Robot
from netboard.participants.controller import DECISION_INTERVAL, Controller
from netboard.participants.policy import Policy, identity_of
from netboard.recording.files.reader import Recording

PERSON = Participant(kp=2.0)


def test_the_identity_is_the_kind_and_the_parameters_with_their_sum() -> None:
    said = identity_of("anything", PERSON)
    assert Participant(**json.loads(said["policy_parameters"])) == PERSON
    assert said["policy_sha256"] == hashlib.sha256(said["policy_parameters"].encode()).hexdigest()
    assert said["policy_sha256"] != identity_of("anything", replace(PERSON, kd=2.0))["policy_sha256"]
    assert identity_of("held still") == {"policy": "held still"}


def test_live_in_the_server_and_rehearsed_it_is_the_same_policy(tmp_path: Path) -> None:
    config = Config(participant=PERSON)
    config = replace(config, block=replace(config.block, right="robot", trials=1))
    controller: Policy = Controller(PERSON, config.physics, config.task, ("left",), np.random.default_rng(1))
    robot = Robot(config, "right")
    sheet = rehearse(Job(config, {"A": PERSON, "B": PERSON}, "0" * 32, tmp_path, begun_ns=1))
    with Recording(Path(sheet.recording)) as recording:
        said = recording.metadata
    assert controller.interval == DECISION_INTERVAL
    assert controller.identity == robot.identity == {name: said[f"A_{name}"] for name in robot.identity}
    assert json.loads(said["A_policy_parameters"]) == asdict(PERSON)


def test_a_hand_that_is_held_still_has_no_parameters() -> None:
    config = Config()
    assert Robot(replace(config, block=replace(config.block, right="still")), "right").identity == {
        "policy": "held still"
    }
