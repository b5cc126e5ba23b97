"""Selection of the slow tests of a day; the others run within days. NETBOARD_TEST_ALL=1 runs all.

The slow tests of a file run every fourth day. Every day run those of the base and of the stage, whose bits
recordings depend on, those of whole sessions and their faults, and those of a file that is named on the command line.
``@pytest.mark.daily(3)`` runs three random cases of a test; with ``of="NAME"``, three of all tests with this name.
Tests with the same ``part="NAME"`` share a costly set-up and count as one case. A test with two marks, its own and its
module's, runs if both select it. `some` selects from the cases that one test runs together. The seed, a date, is
printed at the head of a run: NETBOARD_TEST_SEED=2026-11-22 runs the same tests and cases again.
"""

import os
import random
import zlib
from collections import defaultdict
from collections.abc import Iterable
from datetime import UTC, date, datetime
from pathlib import Path

import pytest

SEED = os.environ.setdefault("NETBOARD_TEST_SEED", datetime.now(UTC).date().isoformat())
DAY = date.fromisoformat(SEED).toordinal()
ALL = os.environ.get("NETBOARD_TEST_ALL", "") not in ("", "0")


def chance(name: str) -> random.Random:
    """Return today's random numbers for a test."""
    return random.Random(f"{SEED} {name}")


def some(name: str, cases: Iterable[str], count: int) -> list[str]:
    """Draw today's cases of what one test runs together."""
    every = list(cases)
    return every if ALL else chance(name).sample(every, count)


TURNS = 4
"""Number of days in which the slow tests of each file run once [1]."""

EVERY_DAY = (".", "base", "stage", "integration/test_processes.py", "integration/test_faults.py")
"""Folders and files in this folder whose slow tests run every day; these files have sessions of all processes."""


def left_out(items: list[pytest.Item], named: set[str]) -> set[pytest.Item]:
    """Return the tests that are not run today, except those of the files that are named."""
    others = [item for item in items if not ALL and _file(item) not in named]
    waiting = {item for item in others if not _has_turn(item)}
    return waiting | _not_drawn([item for item in others if item not in waiting])


def _file(item: pytest.Item) -> str:
    return item.nodeid.partition("::")[0]


def _has_turn(item: pytest.Item) -> bool:
    file = item.path.relative_to(Path(__file__).parent)
    if not item.get_closest_marker("slow") or {str(file), str(file.parent)} & set(EVERY_DAY):
        return True
    return (DAY + zlib.crc32(_file(item).encode())) % TURNS == 0


def _not_drawn(items: list[pytest.Item]) -> set[pytest.Item]:
    groups: dict[str, dict[str, list[pytest.Item]]] = defaultdict(lambda: defaultdict(list))
    most: dict[str, int] = {}
    for item in items:
        for mark in item.iter_markers("daily"):
            name = mark.kwargs.get("of", item.nodeid.partition("[")[0])
            groups[name][mark.kwargs.get("part", item.nodeid)].append(item)
            most[name] = mark.args[0]
    return {item for name, cases in groups.items() for item in _drawn(name, cases, len(cases) - most[name])}


def _drawn(name: str, cases: dict[str, list[pytest.Item]], count: int) -> list[pytest.Item]:
    drawn = chance(name).sample(list(cases), count) if count > 0 else []
    return [item for case in drawn for item in cases[case]]


def header() -> str:
    """Say which slow tests run."""
    return f"slow tests: {'all' if ALL else f'those of NETBOARD_TEST_SEED={SEED}; NETBOARD_TEST_ALL=1 for all'}"
