"""Tables of many dyads at one server: claims, and failures."""

import numpy as np
import pytest

from evidence.loop.bench import MAX_DYADS, read_dyads
from evidence.loop.scale import Served, holds, idle_part, scale_part, shared_part
from netboard.base.errors import ConfigError
from netboard.base.tick import TICK_NS
from netboard.benchmarks.harness.results import ResultPart
from netboard.benchmarks.loop.timing import TickTiming
from netboard.benchmarks.loop.usage import LOOP, OTHER, TRANSPORT, Cost, ThreadUsage

COUNT = 1000


def cost(loop: float, transport: float = 0.0, seconds: float = 1.0) -> Cost:
    spent = {
        LOOP: ThreadUsage(loop, 0.0, 1000, 0),
        TRANSPORT: ThreadUsage(transport, 0.0, 2000, 3),
        OTHER: ThreadUsage(),
    }
    return Cost(spent, seconds)


def verdicts(part: ResultPart) -> list[bool]:
    return [verdict.holds for verdict in part.verdicts]


def served(share: float, late: int = 0, active: float = 1.0, **counts: float) -> Served:
    late_ns = np.zeros(COUNT, np.int64)
    late_ns[:late] = TICK_NS
    return Served(cost(share), counts, TickTiming(late_ns, 0), active, np.zeros(COUNT, np.int64))


def test_server_holds_while_ticks_are_on_time_and_trials_continue() -> None:
    assert holds(served(0.9, late=COUNT // 50))
    assert not holds(served(0.9, late=COUNT // 50 + 1))
    assert not holds(served(0.9, active=0.9))


def test_scaling_verdict_requires_linear_cost_and_held_dyads() -> None:
    linear = scale_part({count: served(0.02 + 0.08 * count) for count in (1, 2, 4, 8)})
    assert verdicts(linear) == [True, True]
    assert "2.00 % + 8.00 % a dyad" in linear.verdicts[1].found
    steep = scale_part({count: served(0.05 * count**1.3) for count in (1, 2, 4, 8)})
    assert verdicts(steep) == [True, False]
    broken = scale_part({1: served(0.1), 4: served(0.4), 8: served(0.8, late=COUNT // 2)})
    assert verdicts(broken) == [False, True]
    assert broken.verdicts[0].found == "4 dyads, not 8"
    assert [row[-1] for row in broken.rows] == [True, True, False]
    assert verdicts(scale_part({1: served(0.1)})) == []
    assert all(len(row) == len(linear.columns) for row in linear.rows)


def test_many_dyads_on_all_cores_should_be_in_time_and_in_trials() -> None:
    part = shared_part(8, served(1.2, late=COUNT // 200))
    assert verdicts(part) == [True]
    assert len(part.rows[0]) == len(part.columns)
    assert verdicts(shared_part(8, served(1.2, late=COUNT // 50))) == [False]
    assert verdicts(shared_part(8, served(1.2, active=0.9))) == [False]


def test_waiting_dyads_should_cost_little() -> None:
    found = {"agents, loggers, no trial": served(0.4), "no peers": served(0.02)}
    assert verdicts(idle_part(8, found)) == [True]
    assert verdicts(idle_part(2, found)) == [False]


def test_dyad_counts_are_parsed_and_validated() -> None:
    assert read_dyads("1,2, 16") == (1, 2, 16)
    for wrong in ("1,,2", "two", "0", "1;2", f"{MAX_DYADS + 1}", "-1"):
        with pytest.raises(ConfigError, match="--dyads"):
            read_dyads(wrong)
