"""Rigs with tampered devices, and how to wait for the forces that are written to them."""

import time
from pathlib import Path

from evidence.faults.devices import NAME, install, read_trace, trace_file
from netboard.base.config import SIDES, Side
from netboard.base.errors import NetboardError
from netboard.benchmarks.harness.rig import ACTIVE, TIMEOUT, Rig
from netboard.network.protocol.control import Status

FORCE_ROWS = 50
"""Number of different consecutive forces from which forces count as rendered [1]."""


def tampered(folder: Path) -> tuple[tuple[str, ...], dict[str, str]]:
    """Return the settings and the environment that give a rig in this folder tampered devices."""
    settings = [
        setting
        for side in SIDES
        for setting in (f"agents.{side}.device={NAME}", f"agents.{side}.options.folder={folder}")
    ]
    return tuple(settings), install(folder / "plug-in")


def until_forces(rig: Rig, seconds: float = TIMEOUT) -> Status:
    """Wait until forces are rendered in a trial to both hands."""

    def forces_rendered(status: Status) -> bool:
        rig.require_running()
        return status.phase in ACTIVE and all(_renders(rig, side) for side in SIDES)

    return rig.until(forces_rendered, seconds)


def until_undisturbed(rig: Rig, seconds: float, patience: float = TIMEOUT) -> int:
    """Wait until forces have been rendered for this duration without a pause [s]; return the pauses before."""
    pauses = 0
    end = time.monotonic() + patience
    while True:
        before = until_forces(rig, patience)
        time.sleep(seconds)
        after = rig.until(lambda status: True)
        if after.phase != "paused" and _paused(after) == _paused(before):
            return pauses
        pauses += 1
        if time.monotonic() > end:
            raise NetboardError(f"waited {patience:g} s: no trial goes on for {seconds:g} s; {after.notice}")


def _paused(status: Status) -> int:
    """Return the attempts of the block that were paused, so neither successes nor failures [1]."""
    return status.outcomes - status.successes - status.failures


def _renders(rig: Rig, side: Side) -> bool:
    """Return whether changing forces are written to the device of a side."""
    agent = rig.running[f"{side} agent"].pid
    forces = read_trace(trace_file(rig.folder, side, agent), FORCE_ROWS)["fz"].tolist()
    return len(forces) == FORCE_ROWS and 0.0 not in forces and len(set(forces)) > FORCE_ROWS // 4
