from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from drives_kit import SHARED, Drive, Running, new_drive
from model_copy import copy_model

from pnfarm.drives.catalogue import models

if TYPE_CHECKING:
    from pathlib import Path


@pytest.fixture(params=sorted(models()))
def drive(request: pytest.FixtureRequest) -> Drive:
    """A drive of each model that has parameters by number."""
    return new_drive(request.param)


@pytest.fixture
def akd() -> Drive:
    return new_drive("akd-profinet")


@pytest.fixture
def running() -> Running:
    """An AKD whose firmware is stepped by hand."""
    return Running("akd-profinet")


@pytest.fixture
def msd() -> Drive:
    return new_drive("moog-msd")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A copy of the AKD's model to change."""
    return copy_model("akd-profinet", tmp_path / "model")


@pytest.fixture
def shared() -> Path:
    return SHARED
