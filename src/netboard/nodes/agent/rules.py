"""What an agent does with a reading and with an answer, each as one kernel that single steps and compiled runs call.

The rules themselves are the kernels of `netboard.devices.safety`; here they meet the state of the link.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.compiled import Records, kernel, machine_code, waiting
from netboard.base.tables.rig import Fixture
from netboard.devices.safety.arming import ALLOWS, FORBIDS, SILENT, Arming, arm, note_stop
from netboard.devices.safety.chain import SafetyChain, limit
from netboard.devices.safety.passivity import Passivity, passive_force, remember_height, restart
from netboard.devices.safety.virtual_coupling import coupling_force
from netboard.network.protocol import fixed
from netboard.network.protocol.motion import Force, Point
from netboard.network.transport import fastpath
from netboard.nodes.agent import motion_link
from netboard.nodes.agent.motion_link import BEAT, COMMANDED, FORCE, MAY_ARM, NEWER, NONE, POINT, wait_for_answer
from netboard.participants.body.device_forces import fixture_force

LIMITED = -5
"""Result of `await_limited_force` beside those of `wait_for_answer`: a limited force is ready [1]."""

FIXTURE = np.dtype([("stiffness", "<f8"), ("damping", "<f8")])
"""Of the lateral fixture [N/m, N s/m]."""

_K, _C, _Z, _VZ, _MADE = fixed.places_of(Point, "k", "c", "z", "vz", "stamp_ns")
(_SEQ,) = fixed.places_of(Force, "stylus_seq")

Rules = tuple[Any, Any, Any, Any]
"""The states that the kernels below change or read: of the chain, the arming, passivity control and the fixture."""


def rules_of(safety: SafetyChain, arming: Arming, passivity: Passivity, fixture: Fixture) -> Rules:
    """Return the rules of an agent, as the kernels take them."""
    spring = np.zeros(1, FIXTURE)
    spring[0] = fixture.stiffness, fixture.damping
    return safety.chain, arming.state, passivity.state, spring


@kernel
def apply_reading(link: Records, rules: Rules, seq: int, z: float, buttons: int, ready: bool, safeguards: int) -> int:
    """Arm, disarm or stop the device after a reading; return the safeguards of its sample, number ``seq``."""
    chain, arming, passivity, _ = rules
    state, permission, answered_seq = link[0], SILENT, -1
    if state["kind"] == BEAT:
        permission = ALLOWS if state["words"][MAY_ARM] != 0 else FORBIDS
    if state["kind"] != NONE:
        answered_seq = state["words"][_SEQ]
    safeguards |= arm(arming, chain, buttons, ready, permission, answered_seq)
    remember_height(passivity, seq, z)
    note_stop(arming, seq, safeguards)
    return safeguards


@kernel
def limited_force(
    link: Records,
    rules: Rules,
    now_ns: int,
    stamp_ns: int,
    x: float,
    y: float,
    z: float,
    vx: float,
    vy: float,
    vz: float,
    rendered: float,
) -> tuple[float, float, float, int]:
    """Pass the newest commanded or own force and the fixture's force through the safety chain.

    ``stamp_ns`` to ``vz``: of the reading. ``rendered``: vertical force on the hand since the last one [N]. Returns the
    force x, y, z [N] and the safeguards.
    """
    chain, _, passivity, fixture = rules
    state, spring, fz = link[0], fixture[0], 0.0
    words = state["words"]
    values = words.view(np.float64)
    if state["kind"] == POINT:
        made_ns = words[_MADE] if words[_MADE] != 0 else state["heard_ns"]
        fz = coupling_force(values[_K], values[_C], values[_Z], values[_VZ], stamp_ns - made_ns, z, vz)
    elif state["kind"] == FORCE:
        fz = values[COMMANDED]
        if passivity[0]["on"]:
            fz = passive_force(passivity, fz, words[_SEQ], z, vz, rendered)
    elif passivity[0]["on"]:
        restart(passivity)
    fx = fixture_force(spring["stiffness"], spring["damping"], x, vx)
    fy = fixture_force(spring["stiffness"], spring["damping"], y, vy)
    safeguards = limit(chain, now_ns, fx, fy, fz, state["received_ns"], vx, vy, vz)
    ready = chain[0]
    return ready["fx"], ready["fy"], ready["fz"], safeguards


@waiting
def await_limited_force(
    fast: Records,
    frame: NDArray[np.uint8],
    link: Records,
    rules: Rules,
    until_ns: int,
    limits: bool,
    stamp_ns: int,
    x: float,
    y: float,
    z: float,
    vx: float,
    vy: float,
    vz: float,
    rendered: float,
) -> tuple[int, float, float, float, int]:
    """Wait for an answer as `wait_for_answer` does, and limit its force, in one call.

    ``limits``: whether an answer is to be rendered. ``stamp_ns`` to ``rendered``: as in `limited_force`. Returns
    `LIMITED`, the force x, y, z [N] and the safeguards; or a result of `wait_for_answer` and zeros.
    """
    came = wait_for_answer(fast, frame, link, until_ns)
    if came != NEWER or not limits:
        return came, 0.0, 0.0, 0.0, 0
    now_ns = fastpath.now_ns(fast)
    fx, fy, fz, safeguards = limited_force(link, rules, now_ns, stamp_ns, x, y, z, vx, vy, vz, rendered)
    return LIMITED, fx, fy, fz, safeguards


class RuleKernels:
    """The kernels above as machine code, without the look-up of types at each call."""

    def __init__(self, frame: NDArray[np.uint8], rules: Rules) -> None:
        nowhere, link, hand = fastpath.FastPath(None).record, motion_link.empty(), (0, *(0.0,) * 7)
        self.await_limited_force = machine_code(await_limited_force, nowhere, frame, link, rules, 0, False, *hand)
        self.limited_force = machine_code(limited_force, link, rules, 0, *hand)
        self.apply_reading = machine_code(apply_reading, link, rules, 0, 0.0, 0, False, 0)
