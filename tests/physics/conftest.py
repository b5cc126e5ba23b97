from typing import Any

import pytest

from netboard.physics.scene import pack_scene
from netboard.tables.scene import Physics


@pytest.fixture(scope="session")
def scene() -> Any:
    """The paper's scene, as one record."""
    return pack_scene(Physics())[0]
