"""Fixtures of several test modules: a server's session whose ticks a test runs."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from stepped_session import SteppedSession

from netboard.network.transport import sockets


@pytest.fixture
def context() -> Iterator[sockets.Context]:
    with sockets.open_context() as context:
        yield context


@pytest.fixture
def stepped(tmp_path: Path, context: sockets.Context) -> Iterator[SteppedSession]:
    stepped = SteppedSession(tmp_path, context)
    yield stepped
    stepped.close()
