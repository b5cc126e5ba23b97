"""Run perturbed blocks in plain Python, and print what the tests of perturbations check as one line of JSON."""

import json
import sys
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.config import parse
from netboard.base.tables.perturbations import Perturbation
from netboard.base.tick import TICK, TICK_NS
from netboard.recording.integrity.verification import verify
from netboard.stage.stage import make_stage
from netboard.task.trials.state_machine import Cause

SETTINGS = '[block]\ntrials = 2\nfirst_target = "right"\n[task]\nlevel_time = 0.02\n'
COUNT = 650
COLUMNS = ("phase", "trial", "run_ticks", "p", "vp", "z", "theta", "left_force", "perturbation", "perturbed_ticks")


def rows_with(table: Perturbation, lagrangian: bool = False, lift: float = 0.0) -> tuple[NDArray[Any], bool]:
    """Return the rows of a block with both hands at rest, and whether they verify.

    ``lift``: height to which the left hand goes at tick 100, so that the ball rolls to the target [m].
    """
    text = SETTINGS + ('[physics]\nmodel = "lagrangian"\n' if lagrangian else "")
    stage = make_stage(replace(parse(text), perturbation=table))
    rows = np.zeros(COUNT, TICK)
    rows["tick"] = np.arange(COUNT)
    rows["time_ns"] = rows["tick"] * TICK_NS + 10**9
    for side in ("left", "right"):
        rows[f"{side}_live"], rows[f"{side}_seq"] = 1, rows["tick"]
        rows[f"{side}_stamp_ns"] = rows["time_ns"] - 300_000
    rows["left_sent_z"][100:] = lift
    rows["command"][0] = Cause.START
    stage.advance(stage.initial(), rows, 0, COUNT)
    return rows, verify(stage, rows).identical and verify(stage, rows[COUNT // 2 :]).identical


if __name__ == "__main__":
    results = {}
    for name, given in json.load(sys.stdin).items():
        rows, identical = rows_with(
            Perturbation(**given["table"]), given.get("lagrangian", False), given.get("lift", 0.0)
        )
        results[name] = {"identical": identical, **{column: rows[column].tolist() for column in COLUMNS}}
    json.dump(results, sys.stdout)
