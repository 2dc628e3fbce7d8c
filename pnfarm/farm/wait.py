"""What a wait that failed says."""

from __future__ import annotations

from pnfarm.errors import PnfarmError

__all__ = ["NotInTime", "require_in_time"]

#: Between two checks of who waits, if nothing else is said: what is seen so long after its time was not in time.
LOOK_NS = 20_000_000


class NotInTime(PnfarmError, AssertionError):  # noqa: N818 - a test that waits in vain has failed, as by an assertion
    """A condition did not hold in time; the message shows the drives."""

    exit_code = 1


def require_in_time(what: str, took_ns: float, within_ns: int, look_ns: int = LOOK_NS) -> float:
    """How long a wait took, s.  Raises :class:`NotInTime` where it looked so late that it saw what came too late.

    ``look_ns``: between two checks, and so exact is ``took_ns``.
    """
    if took_ns > within_ns + look_ns:
        raise NotInTime(f"{what} was seen after {took_ns / 1e9:.3f} s, and not within {within_ns / 1e9:g} s")
    return took_ns / 1e9
