"""What a wait that failed says."""

from __future__ import annotations

from pnfarm.errors import PnfarmError

__all__ = ["NotInTime", "require_in_time"]

#: Who waits looks at least so often: what is seen later than this behind its time was not in time.
LOOK_NS = 20_000_000


class NotInTime(PnfarmError, AssertionError):  # noqa: N818 - a test that waits in vain has failed, as by an assertion
    """A condition did not hold in time; the message shows the drives."""

    exit_code = 1


def require_in_time(what: str, took_ns: float, within_ns: int) -> float:
    """How long a wait took, s.  Raises :class:`NotInTime` where it looked so late that it saw what came too late."""
    if took_ns > within_ns + LOOK_NS:
        raise NotInTime(f"{what} was seen after {took_ns / 1e9:.3f} s, and not within {within_ns / 1e9:g} s")
    return took_ns / 1e9
