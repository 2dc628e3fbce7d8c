"""Makes this folder's own helpers importable: the tests are no package."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from fault_line import FaultLine, enabled_line

sys.path.insert(0, str(Path(__file__).resolve().parent))


@pytest.fixture
def line() -> FaultLine:
    """One drive in operation under its controller."""
    return enabled_line()
