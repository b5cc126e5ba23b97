"""Runs are timed in turns."""

from math import inf

from netboard.benchmarks.harness.running import in_turns


def test_runs_are_timed_in_turns() -> None:
    called: list[str] = []
    times = in_turns([lambda: called.append("a"), lambda: called.append("b")], 3, inf)
    changes = [name for i, name in enumerate(called) if i == 0 or called[i - 1] != name]
    assert changes == ["a", "b"] * 3
    assert [len(taken) for taken in times] == [called.count("a"), called.count("b")]


def test_run_over_budget_gets_no_further_turn() -> None:
    called: list[str] = []
    in_turns([lambda: called.append("a"), lambda: called.append("b")], 10, 0.0)
    changes = [name for i, name in enumerate(called) if i == 0 or called[i - 1] != name]
    assert changes == ["a", "b"]
