"""Which telegrams concern a slave: everybody on the line hears all of them."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pnfarm.buses.profibus.device.device import ProfibusDevice

__all__ = ["ProfibusSegment"]


class ProfibusSegment:
    """See :class:`pnfarm.buses.bus.Segment`; a slave itself turns away what is not its own, which costs no more."""

    def __init__(self, devices: Sequence[ProfibusDevice]) -> None:
        del devices

    def admits(self, port: int, frame: bytes, now: int) -> bool:
        del port, frame, now
        return True

    def audience(self, frame: bytes) -> Sequence[int] | None:
        del frame
        return None

    def settled(self, port: int) -> None:
        del port
