"""Identity of a policy in the recording: the same text and SHA-256 hash in every process."""

import hashlib
import json
from dataclasses import asdict, replace
from pathlib import Path

from netboard.base.config import Config
from netboard.base.tables.simulated import Participant
from netboard.nodes.rehearsal.jobs import RehearsalJob, rehearse
from netboard.nodes.server.still_hand import IDENTITY
from netboard.participants.policy import identity_of
from netboard.participants.seat.partners import make_partner
from netboard.recording.files.reader import Recording

PERSON = Participant(kp=2.0)


def test_identity_holds_the_policy_and_its_parameters_with_their_hash() -> None:
    identity = identity_of("anything", PERSON)
    assert Participant(**json.loads(identity["policy_parameters"])) == PERSON
    assert identity["policy_sha256"] == hashlib.sha256(identity["policy_parameters"].encode()).hexdigest()
    assert identity["policy_sha256"] != identity_of("anything", replace(PERSON, kd=2.0))["policy_sha256"]
    assert identity_of("held still") == {"policy": "held still"}


def test_identity_of_a_partner_agrees_with_that_of_a_rehearsal(tmp_path: Path) -> None:
    config = Config(participant=PERSON)
    config = replace(config, block=replace(config.block, right="robot", trials=1))
    identity = make_partner("robot", config, "right").identity
    result = rehearse(RehearsalJob(config, {"A": PERSON, "B": PERSON}, "0" * 32, tmp_path, begun_ns=1))
    with Recording(Path(result.recording)) as recording:
        metadata = recording.metadata
    assert identity == {name: metadata[f"A_{name}"] for name in identity}
    assert json.loads(metadata["A_policy_parameters"]) == asdict(PERSON)


def test_policy_of_a_still_hand_has_no_parameters() -> None:
    assert IDENTITY == {"policy": "held still"}
