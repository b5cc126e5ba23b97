"""What an attack cost is told from what the machine did anyway."""

import numpy as np

from netboard.base.tables.rig import Safety
from netboard.base.tick import TICK, TICK_NS
from netboard.benchmarks.faults.attack_cases import ATTACKS, COLUMNS, PART, figures, tolls, unmoved, unpaused
from netboard.benchmarks.faults.attackers import SAID
from netboard.benchmarks.faults.bench import Outcome, parts_of
from netboard.benchmarks.faults.evidence import Pause
from netboard.benchmarks.faults.gathering import Evidence, Taken, Window
from netboard.network.protocol.codec import decode, encode
from netboard.nodes.server.tick_clock import LATE_NS
from netboard.task.trials.state_machine import Cause

SECOND = 1_000_000_000
FACTS = {
    "calm": f"0 {SECOND} {5 * SECOND} {6 * SECOND}",
    "aside": f"{3 * SECOND} {5 * SECOND}",
    "begun_ns": str(SECOND),
    "over_ns": str(3 * SECOND),
    "messages": "500",
    "connections": "2",
}


def evidence(late: dict[int, int], pauses: tuple[int, ...] = ()) -> Evidence:
    """Six seconds, an attack in the second and third, one on a sink in the next two: late ticks, and paused ones."""
    ticks = np.zeros(6000, TICK)
    ticks["time_ns"] = np.arange(6000) * TICK_NS
    for tick, late_ns in late.items():
        ticks["late_ns"][tick] = late_ns
    paused = tuple(Pause(tick * TICK_NS, Cause.FAULT.name, 1, 1, (1, 2)) for tick in pauses)
    taken = Taken(ticks, (), paused, (), {})
    return Evidence(Window(0, 6 * SECOND, FACTS), Safety(), {}, taken, None)


def test_misses_and_pauses_are_those_of_their_stretch() -> None:
    late = {10: 2 * LATE_NS, 5500: LATE_NS, 1500: 3 * LATE_NS, 2999: 5 * LATE_NS, 3500: 4 * LATE_NS}
    calm, aside, attacked = tolls(evidence(late, (2000,)))
    assert (calm.ticks, calm.misses, calm.pauses, calm.latest) == (2000, 1, 0, 1.0)
    assert (aside.ticks, aside.misses, aside.pauses, aside.latest) == (2000, 1, 0, 2.0)
    assert (attacked.ticks, attacked.misses, attacked.pauses, attacked.latest) == (2000, 2, 1, 2.5)
    assert calm.rate == 50.0


def test_an_attack_holds_if_it_costs_no_more_than_chance() -> None:
    few = evidence(dict.fromkeys((3010, 3020, 1500, 1600), SECOND))
    many = evidence(dict.fromkeys((3010, *range(1500, 1580, 2)), SECOND))
    stall = evidence(dict.fromkeys((3010, *range(1500, 1540)), SECOND))
    assert unmoved(few).holds
    assert not unmoved(many).holds
    assert unmoved(stall).holds, "it is one event: the machine stood still"
    assert unmoved(many).found == "40 in 2000 ticks, 1 in 2000 with the attack on a sink"
    assert not unpaused(evidence({}, (2000,))).holds
    assert unpaused(evidence({}, (500, 2000))).holds


def test_an_attack_that_was_not_made_does_not_hold() -> None:
    unmade = Evidence(Window(0, SECOND, {}, "broken"), Safety(), {}, evidence({}).rig, None)
    assert not unmoved(unmade).holds
    assert len(figures(unmade)) == len(COLUMNS) - 2


def test_the_table_has_a_row_for_each_attack() -> None:
    outcomes = [Outcome(case, (), figures(evidence({1500: SECOND}))) for case in ATTACKS]
    (part,) = parts_of(outcomes)
    assert part.name == PART
    assert {len(row) for row in part.rows} == {len(COLUMNS)}
    assert part.rows[0][1:5] == (500, 2, "0 / 0 / 1", "0 / 0 / 50")


def test_what_attackers_say_is_legal() -> None:
    for connections in SAID.values():
        for _, _, first, again in connections:
            for message in (*first, *again):
                assert decode(encode(message)) == message
