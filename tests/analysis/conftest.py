"""Shared set-up of the analysis tests: reproducible Hypothesis examples, and the recordings of a small study."""

from collections.abc import Generator
from pathlib import Path

import pytest
from hypothesis import settings

from rehearsed_study import small_study

settings.register_profile(
    "repeatable", settings.get_profile("untimed"), derandomize=True, database=None, max_examples=60
)


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(
    collector: pytest.Collector,
) -> Generator[None, pytest.CollectReport, pytest.CollectReport]:
    """Import test modules with that profile: a decorated test keeps the profile that is active at import."""
    before = settings.get_current_profile_name()
    settings.load_profile("repeatable")
    try:
        return (yield)
    finally:
        settings.load_profile(before)


@pytest.fixture(scope="session")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, ...]:
    return small_study(tmp_path_factory.mktemp("study"))
