"""Tables of the loop benchmarks: ratios, claims and growth."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from netboard.base.config import SIDES, Config
from netboard.base.tick import TICK, TICK_NS
from netboard.benchmarks.harness.results import ResultPart
from netboard.benchmarks.loop.bench import Setting
from netboard.benchmarks.loop.loop import (
    MeasuredLoop,
    Round,
    costs_part,
    latency_part,
    lateness_part,
    loop_series,
    ratios_part,
)
from netboard.benchmarks.loop.rig import dyad_configs, write_configs
from netboard.benchmarks.loop.soak import RecordedDyad, growth, memory_part, minutes_part, records_part, stays_prompt
from netboard.benchmarks.loop.timing import TickTiming, loop_timing
from netboard.benchmarks.loop.usage import LOOP, OTHER, TRANSPORT, Cost, ThreadUsage, Usage
from netboard.recording.timing.stamps import COLUMNS, Stamps, stamps_from
from netboard.services.loading import load
from netboard.task.trials.state_machine import Phase

COUNT = 1000


def cost(loop: float, transport: float = 0.0, seconds: float = 1.0) -> Cost:
    spent = {
        LOOP: ThreadUsage(loop, 0.0, 1000, 0),
        TRANSPORT: ThreadUsage(transport, 0.0, 2000, 3),
        OTHER: ThreadUsage(),
    }
    return Cost(spent, seconds)


def stamps_with(loops_ns: Sequence[int], late_ns: int = 0) -> Stamps:
    """Stamps of a trial, whose ticks each close a loop but the first, which is in no round.

    Durations differ, because a repeated duration is not counted.
    """
    count = COUNT * len(loops_ns)
    ticks = np.zeros(1 + count, TICK)
    ticks["tick"] = np.arange(1 + count)
    ticks["time_ns"] = (ticks["tick"] - 1) * TICK_NS
    ticks["phase"], ticks["late_ns"] = Phase.RUNNING, late_ns
    for side in SIDES:
        ticks[f"{side}_seq"] = ticks["tick"]
        ticks[f"{side}_loop_ns"][1:] = np.repeat(loops_ns, COUNT) + np.arange(count) % 2
    return stamps_from({name: ticks[name] for name in COLUMNS})


def measured(*loops_ns: int, echo_ns: int = 200_000, late_ns: int = 0, agent: float = 0.1) -> MeasuredLoop:
    """One round for each duration of the loop."""
    stamps = stamps_with(loops_ns, late_ns)
    timer = TickTiming(np.zeros(COUNT, np.int64), 0)
    costs = {"server": cost(0.1, 0.05), "echo": cost(0.1)}
    costs |= {f"{side} agent": cost(agent) for side in SIDES} | {f"peer {side}": cost(0.05) for side in SIDES}
    spans = [(k * COUNT * TICK_NS, (k + 1) * COUNT * TICK_NS) for k in range(len(loops_ns))]
    rounds = [Round(span, np.full(2 * COUNT, echo_ns), timer, costs) for span in spans]
    return MeasuredLoop(rounds, stamps, loop_timing(stamps, spans), {"server": cost(0.1, 0.05)})


def verdicts(part: ResultPart) -> list[bool]:
    return [verdict.holds for verdict in part.verdicts]


def test_loop_is_compared_with_baselines_by_the_median_of_rounds() -> None:
    part = ratios_part(measured(400_000, 220_000, 238_000, agent=0.06))
    names, medians, least, largest, _ = zip(*part.rows, strict=True)
    assert medians[:3] == tuple(pytest.approx(1.19, rel=1e-4) for _ in range(3))
    assert least[0] == pytest.approx(1.1, rel=1e-4)
    assert largest[0] == pytest.approx(2.0, rel=1e-4)
    assert medians[3:] == (0.0, pytest.approx(1.5), pytest.approx(1.2))
    assert verdicts(part) == [False, True, True, True, False, True]
    assert [name.partition(",")[0] for name in names[:3]] == ["sample to force / echo"] * 3
    late = ratios_part(measured(290_000, late_ns=TICK_NS + 1))
    assert late.rows[3][1] == pytest.approx(100_000)
    assert verdicts(late) == [False, False, False, False, False, False]


def test_loop_must_take_less_than_a_tick_in_real_time() -> None:
    assert verdicts(latency_part(measured(290_000), real_time=True)) == [True]
    assert verdicts(latency_part(measured(1_400_000), real_time=True)) == [False]
    part = latency_part(measured(300_000), real_time=False)
    assert part.verdicts == []
    assert part.rows[0][:3] == ("sample to force", 2 * COUNT, pytest.approx(0.3, rel=1e-4))
    assert all(len(row) == len(part.columns) for row in part.rows)


def test_tick_lateness_is_tabulated_with_the_bare_timer() -> None:
    part = lateness_part(measured(300_000, late_ns=TICK_NS + 1))
    assert [row[0] for row in part.rows] == ["server's ticks", "timer alone"]
    assert [row[-3:] for row in part.rows] == [(COUNT, COUNT, pytest.approx(100_000.0)), (0, 0, 0.0)]


def test_plotted_series_are_the_measured_durations() -> None:
    loops, ticks = loop_series(measured(300_000, late_ns=-5))
    assert [times.size for times in loops.values()] == [2 * COUNT, 2 * COUNT]
    assert [times.size for times in ticks.values()] == [COUNT, COUNT]  # shares are of all ticks


def test_costs_are_percentages_of_a_core_and_counts_per_tick() -> None:
    part = costs_part({"server": cost(0.2, 0.1, seconds=2.0)})
    ((name, loop, transport, other, whole, waits, sleeps, wakes, preemptions),) = part.rows
    assert (name, other, waits) == ("server", 0.0, 0.0)
    assert (loop, transport, whole) == (pytest.approx(10), pytest.approx(5), pytest.approx(15))
    assert (sleeps, wakes, preemptions) == (pytest.approx(0.5), pytest.approx(1.0), pytest.approx(0.0015))


# --- soak ----------------------------------------------------------------------------------------------------------


def dyads(p99_ms: float = 0.3, **changes: object) -> RecordedDyad:
    count = 600_000
    time_ns = np.arange(count) * TICK_NS
    loop_ns = np.full(count, 200_000)
    loop_ns[2 * count // 3 :: 50] = round(p99_ms * 1e6)
    loop_ns[: count // 3 : 50] = 300_000
    values: dict[str, object] = {
        "ticks": count,
        "missing": 0,
        "lost": 0,
        "faults": 0,
        "verified": True,
        "time_ns": time_ns,
        "late_ns": np.zeros(count, np.int64),
        "loop_at_ns": time_ns,
        "loop_ns": loop_ns,
        "size": 5_000_000,
    }
    return RecordedDyad(**(values | changes))  # type: ignore[arg-type]


def test_records_verdict_fails_on_any_loss() -> None:
    assert verdicts(records_part([dyads(), dyads()])) == [True]
    for fault in ({"missing": 1}, {"lost": 1}, {"verified": False}):
        assert verdicts(records_part([dyads(), dyads(**fault)])) == [False]


def test_end_of_a_soak_is_compared_with_its_beginning() -> None:
    part = minutes_part([dyads(p99_ms=0.4)])
    assert len(part.rows) == 10
    assert verdicts(part) == [True, True]
    assert verdicts(minutes_part([dyads(p99_ms=0.6)])) == [True, False]
    assert all(len(row) == len(part.columns) for row in part.rows)


def test_very_short_times_may_vary_within_a_tolerance() -> None:
    assert stays_prompt("ticks begin", [-0.2, -0.2, -0.12]).holds
    assert stays_prompt("ticks begin", [0.01, 0.01, 0.1]).holds
    assert not stays_prompt("ticks begin", [0.01, 0.01, 0.2]).holds


def test_growth_is_the_slope_of_a_linear_fit() -> None:
    at = np.arange(100.0) + 5e5
    assert growth(at, 1e8 + 2500.0 * at) == pytest.approx(2500.0, rel=1e-6)
    assert growth(at[:1], at[:1]) == 0.0


def test_memory_may_grow_during_warm_up_only() -> None:
    def samples(held: np.ndarray, name: str = "server") -> list[dict[str, Usage]]:
        return [{name: Usage(k * 10**9, {}, int(value))} for k, value in enumerate(held)]

    at = np.arange(1800.0)
    warm = np.minimum(at, 50.0) * 1e6
    assert verdicts(memory_part(samples(1e8 + warm))) == [True]
    assert verdicts(memory_part(samples(1e8 + warm + 5000 * at))) == [False]
    assert verdicts(memory_part(samples(1e8 + 5000 * at[:60]))) == [True]  # too little to tell
    assert verdicts(memory_part(samples(1e8 + 15_000 * at, "logger 2"))) == [True]  # its index
    assert verdicts(memory_part(samples(1e8 + 50_000 * at, "logger 2"))) == [False]


# --- settings ------------------------------------------------------------------------------------------------------


def test_setting_is_converted_to_a_configuration() -> None:
    config = Setting("ipc", True, False, 2).config
    assert (config.network.transport, config.network.curve, config.realtime.scheduling) == ("ipc", "on", False)
    assert str(Setting("ipc", True, False, 2)) == "virtual, ipc, keys, usual scheduling, displays: 2"


def test_dyads_have_their_own_ports_folders_and_ids(tmp_path: Path) -> None:
    configs = dyad_configs(Setting(curve=True).config, tmp_path, 3)
    assert len({config.network.port for config in configs}) == 3
    assert len({config.recording.directory for config in configs}) == 3
    assert len({config.session.dyad for config in configs}) == 3
    assert {config.network.keys for config in configs} == {str(tmp_path / "keys")}
    assert (tmp_path / "keys" / "agent.left.key").exists()
    assert dyad_configs(Config(), tmp_path, 1)[0].network.port
    assert [load(file) for file in write_configs(configs, tmp_path)] == configs
