from typing import Any

import pytest
from hypothesis import settings

from netboard.physics.scene import pack_scene
from netboard.tables.scene import Physics

# The first example of a test may compile a kernel; no test here is about time.
settings.register_profile("physics", deadline=None)
settings.load_profile("physics")


@pytest.fixture(scope="session")
def scene() -> Any:
    """The paper's scene, as one record."""
    return pack_scene(Physics())[0]
