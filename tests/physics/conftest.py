from typing import Any

import pytest

from netboard.base.tables.scene import Physics
from netboard.physics.scene.parameters import pack_scene


@pytest.fixture(scope="session")
def scene() -> Any:
    """The paper's scene, as one record."""
    return pack_scene(Physics())[0]
