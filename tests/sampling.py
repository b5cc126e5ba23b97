"""Selection of the tests that `make test` runs: all fast ones and a fixed sample of the slow ones.

`make test-all` (NETBOARD_TEST_ALL=1) runs every test, `make test-rest` (NETBOARD_TEST_ALL=rest) those that `make test`
leaves out. Which tests run and what random tests draw depends on the commit and on nothing else. NETBOARD_TEST_SEED=7
draws another sample and other random cases, the same ones each time; `make test-random` takes a new seed, prints it,
and runs every test.

Of the slow tests, `make test` runs those of the base and of the stage, whose bits recordings depend on, those of whole
sessions and their faults, those of one in ten of the other files, and those of a file that is named on the command
line. ``@pytest.mark.sampled(3)`` runs three cases of a test; with ``of="NAME"``, three of all tests with this name.
Tests with the same ``part="NAME"`` share a costly set-up and count as one case. A test with two marks, its own and its
module's, runs if both select it. `some` selects from the cases that one test runs together.
"""

import os
import random
import zlib
from collections import defaultdict
from collections.abc import Iterable
from pathlib import Path

import pytest

SEED = int(os.environ.get("NETBOARD_TEST_SEED", "0"))
"""Seed of the sample and of random tests; 0: that of `make test` and `make test-all`."""
REST = os.environ.get("NETBOARD_TEST_ALL") == "rest"
"""Whether only those tests run that `make test` leaves out."""
ALL = REST or os.environ.get("NETBOARD_TEST_ALL", "") not in ("", "0")


def chance(name: str) -> random.Random:
    """Return the random numbers of a test."""
    return random.Random(f"{SEED} {name}")


def some(name: str, cases: Iterable[str], count: int) -> list[str]:
    """Draw the cases that one test runs together."""
    every = list(cases)
    return every if ALL else chance(name).sample(every, count)


FILES_IN_TURN = 10
"""`make test` runs the slow tests of one file in so many [1]."""

ALWAYS = (".", "base", "stage", "integration/test_processes.py", "integration/test_faults.py")
"""Folders and files in this folder whose slow tests always run; these files have sessions of all processes."""


def left_out(items: list[pytest.Item], named: set[str]) -> set[pytest.Item]:
    """Return the tests that are left out, except those of the files that are named."""
    if ALL and not REST:
        return set()
    others = [item for item in items if _file(item) not in named]
    waiting = {item for item in others if not _is_sampled(item)}
    beyond_the_sample = waiting | _not_drawn([item for item in others if item not in waiting])
    return set(items) - beyond_the_sample if REST else beyond_the_sample


def _file(item: pytest.Item) -> str:
    return item.nodeid.partition("::")[0]


def _is_sampled(item: pytest.Item) -> bool:
    file = item.path.relative_to(Path(__file__).parent)
    if not item.get_closest_marker("slow") or {str(file), str(file.parent)} & set(ALWAYS):
        return True
    return (SEED + zlib.crc32(_file(item).encode())) % FILES_IN_TURN == 0


def _not_drawn(items: list[pytest.Item]) -> set[pytest.Item]:
    groups: dict[str, dict[str, list[pytest.Item]]] = defaultdict(lambda: defaultdict(list))
    most: dict[str, int] = {}
    for item in items:
        for mark in item.iter_markers("sampled"):
            name = mark.kwargs.get("of", item.nodeid.partition("[")[0])
            groups[name][mark.kwargs.get("part", item.nodeid)].append(item)
            most[name] = mark.args[0]
    return {item for name, cases in groups.items() for item in _drawn(name, cases, len(cases) - most[name])}


def _drawn(name: str, cases: dict[str, list[pytest.Item]], count: int) -> list[pytest.Item]:
    drawn = chance(name).sample(list(cases), count) if count > 0 else []
    return [item for case in drawn for item in cases[case]]


def header() -> str:
    """Say which slow tests run."""
    which = "those that make test leaves out" if REST else "all" if ALL else "a fixed sample; make test-all runs all"
    return f"slow tests: {which} (NETBOARD_TEST_SEED={SEED})"
