"""Work that a scene does not need is skipped: the server's work with and without each part, counted and timed."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from time import perf_counter
from typing import Literal

import numpy as np

from netboard.base.config import Config
from netboard.base.tick import TICK, TICK_NS, TICK_SECONDS
from netboard.benchmarks.harness.results import Part, Value, Verdict
from netboard.benchmarks.harness.running import Tell
from netboard.benchmarks.loop.scale import LightPeers, Peers, Served, on_cores
from netboard.benchmarks.loop.usage import LOOP, TRANSPORT
from netboard.stage.stage import make_stage
from netboard.task.trials.state_machine import Phase


@dataclass(frozen=True)
class Case:
    """A part that may be omitted."""

    peers: Peers
    haptics: bool = True
    logger: bool = True

    def of(self, config: Config) -> Config:
        """Return a configuration with or without the part."""
        return replace(
            config,
            block=replace(config.block, force="full" if self.haptics else "none"),
            network=replace(config.network, require_logger=self.logger),
        )


FULL, NO_TRIAL, AT_REST, NO_PEERS = "everything, in a trial", "no trial", "no trial, hands at rest", "no peers"
NO_FEEDBACK = "no forces"
CASES = {
    FULL: Case(Peers(displays=True)),
    NO_FEEDBACK: Case(Peers(displays=True), haptics=False),
    "no displays": Case(Peers()),
    "no logger": Case(Peers(displays=True, loggers=False), logger=False),
    NO_TRIAL: Case(Peers(displays=True, trial=False)),
    AT_REST: Case(Peers(displays=True, trial=False, moving=False)),
    "no agents": Case(Peers(agents=False, displays=True, trial=False)),
    NO_PEERS: Case(Peers(agents=False, loggers=False, trial=False)),
}


def measure_skips(config: Config, light_peers: LightPeers, seconds: float, tell: Tell) -> dict[str, Served]:
    """Run a server of one dyad in every case."""
    found = {}
    for step, (name, case) in enumerate(CASES.items()):
        tell(f"work done: {name}", step / len(CASES))
        found[name] = light_peers.serve(case.of(on_cores(config)), 1, case.peers, seconds)
    return found


SENT = ("forces", "beats", "views", "records", "batches")
"""Messages that a server sends."""


def skips_part(found: dict[str, Served]) -> Part:
    """Return the work done in every case."""
    rows: list[tuple[Value, ...]] = []
    for name, served in found.items():
        spent, seconds = served.cost.spent, served.cost.seconds
        rows.append(
            (
                name,
                *(round(served.counts.get(what, 0.0)) for what in SENT),
                *(round(spent[kind].sleeps / seconds) for kind in (LOOP, TRANSPORT)),
                *(1e6 * spent[kind].seconds * TICK_SECONDS / seconds for kind in (LOOP, TRANSPORT)),
                100 * served.cost.core_share,
            )
        )
    return Part(
        "skips",
        "Work of a server of one dyad: with everything, and with parts left out",
        (
            "",
            *(f"{'heartbeats' if what == 'beats' else what} [Hz]" for what in SENT),
            *(f"{kind} wakes [Hz]" for kind in (LOOP, TRANSPORT)),
            *(f"{kind}, per tick [us]" for kind in (LOOP, TRANSPORT)),
            "CPU [%]",
        ),
        rows,
        _verdicts(found),
    )


def _verdicts(found: dict[str, Served]) -> list[Verdict]:
    forces, beats = (found[NO_FEEDBACK].counts.get(what, 0.0) for what in ("forces", "beats"))
    views, fewer = (found[name].counts.get("views", 0.0) for name in (NO_TRIAL, AT_REST))
    busy, forceless, idle = (found[name].cost.core_share for name in (FULL, NO_FEEDBACK, NO_PEERS))
    return [
        Verdict(
            "no force is sent without haptic feedback",
            forces == 0,
            f"{forces:.0f} Hz, and heartbeats at {beats:.0f} Hz",
        ),
        Verdict(
            "a trial without forces costs no more",
            forceless <= busy,
            f"{forceless:.1%} of a core instead of {busy:.1%}",
        ),
        Verdict(
            "an unchanged view is sent only occasionally",
            fewer < views / 2,
            f"{fewer:.0f} Hz at rest, {views:.0f} Hz in motion",
        ),
        Verdict("a server without peers sleeps", idle < busy / 10, f"{idle:.2%} of a core instead of {busy:.1%}"),
    ]


# --- inside a tick -------------------------------------------------------------------------------------------------

RUNS, TICKS = 30, 2000
"""Number of runs, of which the minimum is taken, and ticks in each [1]."""


def tick_part(config: Config) -> Part:
    """Return the cost of the stage's part of a tick, with and without each part."""
    bare = replace(config, physics=replace(config.physics, balls=0))
    lone = replace(bare, physics=replace(bare.physics, coupling="left"))
    part, no_force = _with_force(config, "environment_only"), _with_force(config, "none")
    costs = {
        "the ball rolls": stage_cost(config, Phase.RUNNING),
        "the ball rolls, forces of the environment only": stage_cost(part, Phase.RUNNING),
        "the ball rolls, no forces": stage_cost(no_force, Phase.RUNNING),
        "the ball is fixed": stage_cost(config, Phase.LEVELLING),
        "no ball": stage_cost(bare, Phase.LEVELLING),
        "no ball, no forces: a board alone": stage_cost(_with_force(bare, "none"), Phase.LEVELLING),
        "no ball, one hand": stage_cost(lone, Phase.LEVELLING),
    }
    whole = costs["the ball rolls"]
    return Part(
        "stage",
        "Cost of the stage in a tick",
        " | a tick [ns] | relative [1]",
        [(name, cost * 1e9, cost / whole) for name, cost in costs.items()],
    )


def _with_force(config: Config, force: Literal["environment_only", "none"]) -> Config:
    return replace(config, block=replace(config.block, force=force))


def stage_cost(config: Config, phase: Phase) -> float:
    """Time the stage's part of a tick [s].

    - `phase`: constant phase of the trial: the board is not level, and the ball rests far from target and edge.
    """
    stage = make_stage(config)
    rows = np.zeros(TICKS, TICK)
    rows["time_ns"] = (1 + np.arange(TICKS)) * TICK_NS
    for side, z in (("left", 0.02), ("right", 0.02)):
        rows[f"{side}_live"], rows[f"{side}_stamp_ns"], rows[f"{side}_sent_z"] = 1, rows["time_ns"], z

    def run() -> float:
        state = stage.initial()
        state["phase"] = phase
        begun = perf_counter()
        stage.advance(state, rows, 0, TICKS)
        return (perf_counter() - begun) / TICKS

    return quickest(run)


def quickest(run: Callable[[], float]) -> float:
    """Return the minimum of many runs [s]."""
    return min(run() for _ in range(RUNS))
