"""Slow tests run a part of their cases, drawn by a seed that changes daily; with NETBOARD_TEST_ALL=1 they run all.

The seed is printed at the head of a run: NETBOARD_TEST_SEED=2026-11-22 draws the same cases again.
"""

import os
import random
from collections.abc import Sequence
from datetime import UTC, datetime
from typing import TypeVar

T = TypeVar("T")

SEED = os.environ.setdefault("NETBOARD_TEST_SEED", datetime.now(UTC).date().isoformat())
ALL = os.environ.get("NETBOARD_TEST_ALL", "") not in ("", "0")


def chance(name: str) -> random.Random:
    """Return today's random numbers for a test."""
    return random.Random(f"{SEED} {name}")


def some(cases: Sequence[T], most: int, name: str = "") -> list[T]:
    """Draw at most this many cases [1], in their order."""
    if ALL or len(cases) <= most:
        return list(cases)
    return [cases[place] for place in sorted(chance(name).sample(range(len(cases)), most))]


def header() -> str:
    """Say which cases are drawn."""
    return (
        "slow tests: all cases"
        if ALL
        else f"slow tests: cases of NETBOARD_TEST_SEED={SEED}; NETBOARD_TEST_ALL=1 for all"
    )
