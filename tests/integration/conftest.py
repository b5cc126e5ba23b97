"""Shared fixtures of the tests with clients in another language."""

import shutil
from pathlib import Path

import pytest
from foreign_clients import fetched


@pytest.fixture(scope="session")
def clients() -> Path:
    """Folder with the clients in JavaScript."""
    if shutil.which("node") is None or shutil.which("npm") is None:
        pytest.skip("the clients in JavaScript need node and npm (on Debian or Ubuntu: apt-get install nodejs npm)")
    return fetched()
