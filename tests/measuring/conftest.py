"""The recordings of a small study, made once."""

from pathlib import Path

import pytest

from rehearsed_study import small_study


@pytest.fixture(scope="session")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, ...]:
    return small_study(tmp_path_factory.mktemp("study"))
