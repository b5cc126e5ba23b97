"""Slow tests run a part of their cases, drawn by a seed that changes daily; with NETBOARD_TEST_ALL=1 they run all.

``@pytest.mark.daily(3)`` runs three cases of a test; with ``of="NAME"``, three of all tests that give this name; with
``part="NAME"``, tests that give this name too, and share what is costly, are one of these. A test with two marks, its
own and its module's, runs if both draw it. `some` draws from what one test runs together. The seed is printed at the
head of a run: NETBOARD_TEST_SEED=2026-11-22 draws the same cases again.
"""

import os
import random
from collections import defaultdict
from collections.abc import Iterable
from datetime import UTC, datetime

import pytest

SEED = os.environ.setdefault("NETBOARD_TEST_SEED", datetime.now(UTC).date().isoformat())
ALL = os.environ.get("NETBOARD_TEST_ALL", "") not in ("", "0")


def chance(name: str) -> random.Random:
    """Return today's random numbers for a test."""
    return random.Random(f"{SEED} {name}")


def some(name: str, cases: Iterable[str], count: int) -> list[str]:
    """Draw today's cases of what one test runs together."""
    every = list(cases)
    return every if ALL else chance(name).sample(every, count)


def left_out(items: list[pytest.Item]) -> set[pytest.Item]:
    """Draw the cases that are not run today."""
    groups: dict[str, dict[str, list[pytest.Item]]] = defaultdict(lambda: defaultdict(list))
    most: dict[str, int] = {}
    for item in items:
        for mark in item.iter_markers("daily"):
            name = mark.kwargs.get("of", item.nodeid.partition("[")[0])
            groups[name][mark.kwargs.get("part", item.nodeid)].append(item)
            most[name] = mark.args[0]
    return {item for name, cases in groups.items() for item in _drawn(name, cases, len(cases) - most[name])}


def _drawn(name: str, cases: dict[str, list[pytest.Item]], count: int) -> list[pytest.Item]:
    drawn = chance(name).sample(list(cases), count) if count > 0 and not ALL else []
    return [item for case in drawn for item in cases[case]]


def header() -> str:
    """Say which cases are drawn."""
    drawn = f"cases of NETBOARD_TEST_SEED={SEED}; NETBOARD_TEST_ALL=1 for all"
    return f"slow tests: {'all cases' if ALL else drawn}"
