"""Programs of other packages that tests call."""

import shutil

import pytest


def needed(*tools: str) -> None:
    """Skips a test where one is not installed: a machine has what its user installed, and lists what could not run.

    With ``PNFARM_REQUIRE_ALL=1`` a skip is a failure.
    """
    for tool in tools:
        if shutil.which(tool) is None:
            pytest.skip(f"needs the tool `{tool}`")
