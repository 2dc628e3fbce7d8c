"""Which drive a frame of the toy bus concerns."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.station.absent import Absent
from toybus.frames import ETHERTYPE

if TYPE_CHECKING:
    from collections.abc import Collection


class ToySegment:
    """Frames of this bus to one drive alone."""

    def __init__(self, devices: object) -> None:
        self.absent = Absent()

    def admits(self, port: int, data: bytes, now: int) -> bool:
        return data[12:14] == ETHERTYPE.to_bytes(2, "big") and not data[0] & 1

    def audience(self, data: bytes, now: int, besides: Collection[int] = ()) -> tuple[int, ...]:
        return ()

    def settled(self, port: int) -> None:
        pass
