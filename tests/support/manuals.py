"""The manuals beside the project."""

from __future__ import annotations

from pathlib import Path

import pytest

FOLDER = Path(__file__).resolve().parents[3] / "shared" / "manuals"


def manual_text(first: str) -> str:
    """The manual whose file's name begins with these figures; without it the test cannot be run."""
    found = sorted(FOLDER.glob(f"{first}_*.txt"))
    if not found:
        # what the maker's own text says can only be held against the text; the project does not carry it
        pytest.skip("the manuals are not beside the project")
    return found[0].read_text(encoding="utf-8")
