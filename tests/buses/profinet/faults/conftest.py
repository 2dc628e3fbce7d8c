from __future__ import annotations

import pytest
from fault_line import FaultLine, enabled_line


@pytest.fixture
def line() -> FaultLine:
    """One drive in operation under its controller."""
    return enabled_line()
