"""Shared fixtures of the tests with JavaScript clients."""

import shutil
from pathlib import Path

import pytest
from foreign_clients import install_clients


@pytest.fixture(scope="session")
def javascript_clients() -> Path:
    """Folder with the JavaScript clients and their packages."""
    if shutil.which("node") is None or shutil.which("npm") is None:
        pytest.skip("the JavaScript clients need node and npm (on Debian or Ubuntu: apt-get install nodejs npm)")
    return install_clients()
