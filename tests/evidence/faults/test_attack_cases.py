"""The attack cases separate the deadline misses of an attack from those of the machine."""

import numpy as np

from evidence.faults.attack_cases import (
    ATTACKS,
    COLUMNS,
    PART,
    deadline_misses,
    figures,
    no_more_misses,
    no_more_pauses,
)
from evidence.faults.attackers import ROLE_MESSAGES
from evidence.faults.bench import Outcome, parts_of
from evidence.faults.evidence import DyadRecordings, Evidence, Pause, Window
from netboard.base.tables.rig import Safety
from netboard.base.tick import TICK, TICK_NS
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
    """Return 6 s of ticks, some late or paused; the server is attacked from 1 s to 3 s, a sink from 3 s to 5 s."""
    ticks = np.zeros(6000, TICK)
    ticks["time_ns"] = np.arange(6000) * TICK_NS
    for tick, late_ns in late.items():
        ticks["late_ns"][tick] = late_ns
    paused = tuple(Pause(tick * TICK_NS, Cause.FAULT.name, 1, 1, (1, 2)) for tick in pauses)
    taken = DyadRecordings(ticks, (), paused, (), {})
    return Evidence(Window(0, 6 * SECOND, FACTS), Safety(), {}, taken, None)


def test_deadline_misses_and_pauses_are_counted_in_each_period() -> None:
    late = {10: 2 * LATE_NS, 5500: LATE_NS, 1500: 3 * LATE_NS, 2999: 5 * LATE_NS, 3500: 4 * LATE_NS}
    without, on_sink, on_server = deadline_misses(evidence(late, (2000,)))
    assert (without.ticks, without.misses, without.pauses, without.latest) == (2000, 1, 0, 1.0)
    assert (on_sink.ticks, on_sink.misses, on_sink.pauses, on_sink.latest) == (2000, 1, 0, 2.0)
    assert (on_server.ticks, on_server.misses, on_server.pauses, on_server.latest) == (2000, 2, 1, 2.5)
    assert without.rate == 50.0


def test_attack_fails_if_it_causes_more_misses_than_chance() -> None:
    few = evidence(dict.fromkeys((3010, 3020, 1500, 1600), SECOND))
    many = evidence(dict.fromkeys((3010, *range(1500, 1580, 2)), SECOND))
    stall = evidence(dict.fromkeys((3010, *range(1500, 1540)), SECOND))
    assert no_more_misses(few).holds
    assert not no_more_misses(many).holds
    assert no_more_misses(stall).holds, "a run of late ticks counts as one stall"
    assert no_more_misses(many).found == "40 in 2000 ticks, 1 in 2000 with the attack on a sink"
    assert not no_more_pauses(evidence({}, (2000,))).holds
    assert no_more_pauses(evidence({}, (500, 2000))).holds


def test_case_fails_if_its_attack_was_not_carried_out() -> None:
    not_made = Evidence(Window(0, SECOND, {}, "broken"), Safety(), {}, evidence({}).rig, None)
    assert not no_more_misses(not_made).holds
    assert len(figures(not_made)) == len(COLUMNS) - 2


def test_table_has_a_row_for_each_attack() -> None:
    outcomes = [Outcome(case, (), figures(evidence({1500: SECOND}))) for case in ATTACKS]
    (part,) = parts_of(outcomes)
    assert part.name == PART
    assert {len(row) for row in part.rows} == {len(COLUMNS)}
    assert part.rows[0][1:5] == (500, 2, "0 / 0 / 1", "0 / 0 / 50")


def test_attack_messages_of_all_roles_can_be_decoded() -> None:
    for connections in ROLE_MESSAGES.values():
        for _, _, first, again in connections:
            for message in (*first, *again):
                assert decode(encode(message)) == message
