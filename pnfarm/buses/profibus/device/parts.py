"""A slave as its observers and its line see it, and the line as the slave does."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from collections import Counter

    from pnfarm.buses.profibus.device.image import CyclicImage
    from pnfarm.buses.profibus.device.kind import Kind
    from pnfarm.protocols.profibus.slave import Slave
    from pnfarm.station.node import StationPort
    from pnfarm.station.station import Station

__all__ = ["LineParts", "SlaveParts"]


class LineParts(Protocol):
    """The line of all slaves."""

    #: When a telegram came last.
    heard_ns: int

    def changed(self) -> None:
        """A slave has another address, or found or lost the baud rate."""


class SlaveParts(Protocol):
    """The machines are recreated at each power-on."""

    station: Station
    port: StationPort
    kind: Kind
    image: CyclicImage
    slave: Slave
    line: LineParts | None
    connects: int
    #: Those of before the last power-on.
    connects_before: int
    lost: Counter[str]
    connected_ns: int
    address_from: str

    @property
    def baud(self) -> int:
        """The rate of its line, bit/s."""

    @property
    def name(self) -> str:
        """The present name."""

    @property
    def cycle_ns(self) -> int:
        """The master's cycle, as far as it is known."""

    def counted(self) -> Counter[str]:
        """What happened since the farm started, by kind."""

    def poll(self, octets: bytes, now: int) -> bytes | None:
        """See :meth:`pnfarm.buses.bus.LineSegment.poll`."""

    def follow(self, now: int) -> None:
        """What the last requests changed may follow."""
