"""A block without network or clock: simulated participants, devices, safety chain and stage in one thread.

The delays of the real system are imitated: a stylus reading is used, and a force rendered, one tick later; views are
sent at 120 Hz and seen 5 ms later. As in the real system, no force is rendered before the block starts, and it starts
when both devices are armed.
"""

from collections import deque
from dataclasses import dataclass, replace

import numpy as np

from lateral import lateral_force
from netboard.base.config import SIDES, Config, Side
from netboard.base.safeguards import Safeguard
from netboard.base.tick import TICK, TICK_NS
from netboard.devices.safety.chain import Guard, SafetyChain
from netboard.devices.simulated.virtual import VirtualTouch
from netboard.participants.people.controller import Controller
from netboard.participants.people.senses import DECISION_INTERVAL, Glimpse
from netboard.participants.people.submovement import Submovement
from netboard.stage.stage import make_stage
from netboard.task.trials.state_machine import Cause, Phase

VIEW_EVERY = 1 / 120
VIEW_DELAY = 0.005


@dataclass
class BlockResult:
    completions: list[float]
    failures: int
    seconds: float
    largest_force: float
    lateral: float
    safeguards: Safeguard
    rows: np.ndarray


def with_block(config: Config, configuration: str, haptics: bool, trials: int, seed: int) -> Config:
    block = replace(
        config.block, configuration=configuration, force="full" if haptics else "none", trials=trials, seed=seed
    )
    return replace(config, block=block)


def make_controllers(config: Config) -> list[tuple[tuple[Side, ...], Controller]]:
    groups = [("left",), ("right",)] if config.block.configuration == "dyadic" else [SIDES]
    seeds = np.random.default_rng((config.block.seed, 99)).spawn(2)
    return [
        (sides, Controller(config.participant, config.physics, config.task, config.virtual, sides, rng))
        for sides, rng in zip(groups, seeds, strict=False)
    ]


def decide_if_due(
    controller: Controller, now: float, glimpse: Glimpse | None, felt: float | None
) -> tuple[Submovement, ...]:
    """Let a controller decide, unless its last decision was too short a time ago."""
    due = now - controller.state["decision_time"][0] >= DECISION_INTERVAL
    return controller.decide(now, glimpse, felt) if due else ()


def play(config: Config, max_seconds: float) -> BlockResult:
    stage = make_stage(config)
    state = stage.initial()
    rows = np.zeros(int(max_seconds * 1000), TICK)
    row = rows[0]
    devices = {side: VirtualTouch(side, config) for side in SIDES}
    infos = {side: devices[side].open() for side in SIDES}
    chains = {side: SafetyChain(config.safety, infos[side].max_force, infos[side].continuous_force) for side in SIDES}
    for chain in chains.values():
        chain.arm()
    controllers = make_controllers(config)
    views: deque[tuple[float, dict[str, object]]] = deque()
    glimpses: dict[Side, Glimpse] = {}
    readings = {}
    result = BlockResult([], 0, 0.0, 0.0, 0.0, Safeguard(0), np.zeros(0, TICK))
    next_view = 0.0
    for tick in range(len(rows)):
        now_ns = 1_000_000_000 + tick * TICK_NS
        now = now_ns * 1e-9
        last, row = row, rows[tick]
        row["tick"], row["time_ns"] = tick, now_ns
        armed = all(chain.guard is Guard.ARMED for chain in chains.values())
        row["command"] = Cause.START if armed and state["phase"][0] == Phase.IDLE else Cause.NONE
        for side in SIDES:
            device, chain = devices[side], chains[side]
            reading = device.read(now_ns)
            requested = (
                *lateral_force(reading, config.fixture),
                float(last[f"{side}_force"]) if last["phase"] else 0.0,
            )
            limited = chain.step(now_ns, requested, now_ns - TICK_NS, (reading.vx, reading.vy, reading.vz))
            device.write(limited.fx, limited.fy, limited.fz)
            result.largest_force = max(result.largest_force, float(np.hypot(limited.fy, limited.fz)))
            result.lateral = max(result.lateral, abs(reading.x), abs(reading.y))
            if last["phase"]:
                result.safeguards |= limited.safeguards
            used = readings.get(side, reading)
            row[f"{side}_live"], row[f"{side}_stamp_ns"] = 1, used.stamp_ns
            row[f"{side}_sent_z"], row[f"{side}_sent_vz"] = used.z, used.vz
            readings[side] = reading
        if now >= next_view:
            next_view = now + VIEW_EVERY
            views.append((now + VIEW_DELAY, {name: state[name][0] for name in state.dtype.names}))
        while views and views[0][0] <= now:
            when, shown = views.popleft()
            for sides, _ in controllers:
                glimpses[sides[0]] = glimpse_of(when, shown, sides, config)
        for sides, controller in controllers:
            felt = devices[sides[0]].felt if len(sides) == 1 and config.block.haptics else None
            for move in decide_if_due(controller, now, glimpses.get(sides[0]), felt):
                devices[move.side].command((move,))
        stage.advance(state, rows, tick)
        if row["event"] == Cause.HELD:
            result.completions.append(float(state["completion"][0]))
        if state["phase"][0] == Phase.FINISHED:
            break
    result.failures = int(state["failures"][0])
    result.rows = rows[: tick + 1]
    result.seconds = (tick + 1) * 1e-3
    return result


def glimpse_of(when: float, shown: dict[str, object], sides: tuple[Side, ...], config: Config) -> Glimpse:
    return Glimpse(
        time=when,
        phase=Phase(int(shown["phase"])).name.lower(),
        z=float(shown["z"]),
        theta=float(shown["theta"]),
        p=float(shown["p"]) if config.physics.balls else None,
        target=float(shown["target"]) * config.geometry.target_distance,
        left=float(shown["left_z"]) if "left" in sides else None,
        right=float(shown["right_z"]) if "right" in sides else None,
    )
