"""What a wait that failed says."""

from __future__ import annotations

from pnfarm.errors import PnfarmError

__all__ = ["NotInTime"]


class NotInTime(PnfarmError, AssertionError):  # noqa: N818 - a test that waits in vain has failed, as by an assertion
    """A condition did not hold in time; the message shows the drives."""

    exit_code = 1
