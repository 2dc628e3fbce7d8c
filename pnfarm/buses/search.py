"""What ``pnfarm scan`` asks each bus, and what a bus answers: the devices that are on a wire."""

from __future__ import annotations

from collections.abc import Callable, Sequence  # noqa: TC003 - fields of a dataclass
from dataclasses import dataclass, field
from ipaddress import IPv4Address  # noqa: TC003 - the same
from typing import Any

from pnfarm.buses.bus import Bus

__all__ = ["Question", "SearchAnswer", "SearchBus"]


@dataclass(frozen=True, slots=True)
class Question:
    """Search on ``interface`` and wait for answers for so many seconds.

    ``neighbour_seconds``: listen so long in all for stations that only announce themselves, 0 for not at all;
    ``addresses``: ask these devices, too, which a broadcast does not reach; ``chosen``: the user named this bus.
    """

    interface: str
    seconds: float
    neighbour_seconds: float
    addresses: tuple[IPv4Address, ...] = ()
    chosen: bool = False


@dataclass(frozen=True, slots=True)
class SearchAnswer:
    """What was found.

    ``devices`` are plain JSON values with at least ``name``, ``type``, ``mac``, ``ip``, ``vendor_id``, None where that
    is not known.  ``show`` prints them for people; ``warnings`` are sentences for the error output.  ``searched`` is
    False if nobody was asked, because it was not possible here and the user did not name this bus.
    """

    devices: Sequence[dict[str, Any]]
    show: Callable[[], None]
    warnings: Sequence[str] = field(default=())
    searched: bool = True


class SearchBus(Bus):
    """A bus whose devices can be found on a wire; another one cannot be searched."""

    async def search(self, question: Question) -> SearchAnswer:
        """Search for devices.  Raises :class:`~pnfarm.errors.EnvironmentError_` where this machine cannot."""
        return await self._own("commands.scan", "search")(question)
