"""Resource usage from /proc, parsed from samples and read from this process."""

import os
import sys
import threading
from pathlib import Path

import pytest

from netboard.base.errors import NetboardError
from netboard.benchmarks.loop.usage import (
    KINDS,
    LOOP,
    OTHER,
    TRANSPORT,
    Cost,
    ThreadUsage,
    Usage,
    _read_thread,
    add_costs,
    kind_of,
    parse_thread,
    read_usage,
    total,
)

STAT = "77 (ZMQbg/IO/0) S 1 77 77 0 -1 4194368 9 0 0 0 250 50 0 0 -66 0 2 0 9 1 2 3 4 5 6"
STATUS = "Name:\tZMQbg/IO/0\nvoluntary_ctxt_switches:\t1200\nnonvoluntary_ctxt_switches:\t34\n"


def test_thread_times_are_read_from_schedstat() -> None:
    name, spent = parse_thread(STAT, "1500000000 2000000 42\n", STATUS, 100)
    assert name == "ZMQbg/IO/0"
    assert spent == ThreadUsage(1.5, 0.002, 1200, 34)


def test_thread_times_fall_back_to_clock_ticks() -> None:
    assert parse_thread(STAT, "", STATUS, 100)[1] == ThreadUsage(3.0, 0.0, 1200, 34)


def test_thread_names_may_contain_parentheses_and_spaces() -> None:
    assert parse_thread(STAT.replace("ZMQbg/IO/0", "a (b) c"), "", STATUS, 100)[0] == "a (b) c"


def test_threads_are_classified_by_name() -> None:
    assert kind_of(7, 7, "python") == LOOP
    assert kind_of(7, 8, "ZMQbg/IO/0") == TRANSPORT
    assert kind_of(7, 9, "ZMQbg/Reaper") == OTHER


def test_usage_between_two_readings_is_a_difference() -> None:
    before = Usage(1_000, {(7, LOOP): ThreadUsage(1.0, 0.5, 10, 1)}, 0)
    after = Usage(
        2_000_001_000, {(7, LOOP): ThreadUsage(1.5, 0.5, 30, 1), (8, TRANSPORT): ThreadUsage(0.25, 0.0, 5, 0)}, 0
    )
    found = after.since(before)
    assert set(found) == set(KINDS)
    assert found[LOOP] == ThreadUsage(0.5, 0.0, 20, 0)
    assert found[TRANSPORT] == ThreadUsage(0.25, 0.0, 5, 0)
    assert total(found.values()) == ThreadUsage(0.75, 0.0, 25, 0)
    costs: dict[str, Cost] = {}
    add_costs(costs, {"server": before}, {"server": after})
    add_costs(costs, {"server": before}, {"server": after})
    assert costs["server"].seconds == pytest.approx(4.0)
    assert costs["server"].spent[LOOP] == ThreadUsage(1.0, 0.0, 40, 0)


linux = pytest.mark.skipif(sys.platform != "linux", reason="there is no /proc")


@linux
def test_usage_of_this_process_includes_its_threads() -> None:
    done = threading.Event()
    thread = threading.Thread(target=done.wait)
    thread.start()
    try:
        usage = read_usage(os.getpid())
    finally:
        done.set()
        thread.join()
    assert usage.threads[os.getpid(), LOOP].seconds > 0
    assert (thread.native_id, OTHER) in usage.threads
    assert usage.resident > 2**20


@linux
def test_missing_process_is_reported() -> None:
    with pytest.raises(NetboardError, match="process 999999999"):
        read_usage(999_999_999)


@linux
def test_thread_that_ends_while_it_is_read_is_left_out() -> None:
    """As the servo thread of a haptic device does that is opened again."""
    assert _read_thread(os.getpid(), 999_999_999, Path("/proc/self/task/999999999"), 100) is None
