"""The tests of this folder, and no others, draw the same examples each time."""

from collections.abc import Generator

import pytest
from hypothesis import settings

settings.register_profile(
    "repeatable", settings.get_profile("untimed"), derandomize=True, database=None, max_examples=60
)


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(
    collector: pytest.Collector,
) -> Generator[None, pytest.CollectReport, pytest.CollectReport]:
    """Import test modules with that profile: what is decorated keeps the one in force then."""
    before = settings.get_current_profile_name()
    settings.load_profile("repeatable")
    try:
        return (yield)
    finally:
        settings.load_profile(before)
