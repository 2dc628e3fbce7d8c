from __future__ import annotations

import pytest
from api_world import ApiWorld


@pytest.fixture(scope="module")
def still() -> ApiWorld:
    """Two drives without a controller."""
    world = ApiWorld(2, controller=False)
    world.line.run(0.2)
    return world
