"""Models of the partner: what each is made of, and the same decisions in an agent and in a rehearsal."""

from dataclasses import replace
from math import isnan, nan
from typing import Any, get_args

import numpy as np
import pytest

from netboard.base.config import Config, parse
from netboard.base.errors import ConfigError
from netboard.base.tables.simulated import Participant, PartnerModel, VirtualDevice
from netboard.participants.body.device_models import resolved
from netboard.participants.people.controller import Controller
from netboard.participants.people.muscles import hand_mechanics, pack_arm
from netboard.participants.people.observer import pack_observer
from netboard.participants.people.partner_models import INFORMED, PARTNER_MODELS
from netboard.participants.people.person import DECISION_TICKS
from netboard.participants.people.senses import Glimpse
from netboard.participants.policy import SEEN
from netboard.participants.seat.block import Rehearsal
from netboard.participants.seat.closed_loop import is_shown, scale_in
from netboard.stage.curtain import NO_PHASE, glimpse
from netboard.task.trials.state_machine import Phase

DEVICE = VirtualDevice()


def arm_of(**keys: Any) -> Any:
    return pack_arm(Participant(**keys), resolved(DEVICE))[0]


def test_each_model_is_a_value_of_the_configuration() -> None:
    assert tuple(PARTNER_MODELS) == get_args(PartnerModel)
    for name in PARTNER_MODELS:
        assert parse(f'[participant]\npartner_model = "{name}"', "test").participant.partner_model == name


@pytest.mark.parametrize("model", PARTNER_MODELS)
def test_a_model_has_the_gains_that_it_declares_and_else_the_same_arm(model: PartnerModel) -> None:
    arm, plain, parts = arm_of(partner_model=model), arm_of(partner_model="mechanics"), PARTNER_MODELS[model]
    assert {name for name in arm.dtype.names if arm[name] != plain[name]} <= {"yielding", "stiffening"}
    assert arm["yielding"] == pytest.approx(parts.reflex_gain / Participant().arm_stiffness)
    assert arm["stiffening"] == pytest.approx(parts.impedance_gain * 1e-3)
    observer = pack_observer(Participant(partner_model=model), Config().physics, DEVICE, "left")[0]
    assert bool(observer["informed"]) == (model in INFORMED)
    assert bool(observer["sight"]) == (model == "sight")


def test_a_configured_gain_replaces_that_of_the_model() -> None:
    assert arm_of(partner_model="follower", reflex_gain=0.0)["yielding"] == 0.0
    assert arm_of(partner_model="position", reflex_gain=3.0)["yielding"] == pytest.approx(3.0 / 150.0)
    assert arm_of(partner_model="impedance", impedance_gain=0.0)["stiffening"] == 0.0


def test_adaptive_impedance_is_rejected_with_compliant_cables() -> None:
    device = VirtualDevice(cable_stiffness=2000.0)
    with pytest.raises(ConfigError, match="impedance_gain: found 20000, expected 0"):
        hand_mechanics(Participant(partner_model="impedance"), resolved(device))


def shown(record: Any) -> Glimpse | None:
    """Return a view as an agent receives it."""
    if isnan(record["time"]):
        return None
    phase = "" if record["phase"] == NO_PHASE else Phase(int(record["phase"])).name.lower()
    p, left, right = (None if isnan(record[name]) else float(record[name]) for name in ("p", "left", "right"))
    numbers = (float(record[name]) for name in ("z", "theta"))
    return Glimpse(float(record["time"]), phase, *numbers, p, float(record["target"]), left, right)


@pytest.mark.slow
@pytest.mark.parametrize("model", PARTNER_MODELS)
def test_an_agent_and_a_rehearsal_make_the_same_decisions(model: PartnerModel) -> None:
    person, config = Participant(partner_model=model), Config()
    config = replace(config, participant=person, block=replace(config.block, trials=1))
    rehearsal = Rehearsal(config, {"A": person, "B": person})
    rows = np.concatenate([piece.copy() for piece in rehearsal.pieces()])
    words, rendered = rows.view(np.int64).reshape(len(rows), -1), np.append(rows["left_rendered"][1:], nan)
    numbers, seat, seen = words.view(np.float64), rehearsal._seats[0], np.zeros(1, SEEN)
    seen["time"] = nan
    rng = np.random.default_rng((config.block.seed, config.block.number, 3))
    live = Controller(person, config.physics, config.task, config.virtual, ("left",), rng)
    for tick, time_ns in enumerate(rows["time_ns"]):
        if tick > 0 and is_shown(seat.timing, tick - 1):
            glimpse(seat.curtain[0], words[tick - 1], numbers[tick - 1], float(time_ns) * 1e-9, seen[0])
        if tick % DECISION_TICKS == 0:
            scale = scale_in(seat, int(rows["trial"][tick]), int(rows["phase"][tick]))
            live.decide(float(time_ns) * 1e-9, shown(seen[0]), rendered[tick] / scale if scale != 0.0 else None)
    assert live.state.tobytes() == seat.state["brain"].tobytes()
    assert (live.state["observed"]["count"][0] > 0) == (model in (*INFORMED, "sight"))
