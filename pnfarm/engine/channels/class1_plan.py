"""What class 1 connections of CIP send and take: plans for :class:`pnfarm.engine.channels.schedule.ChannelTable`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from ipaddress import IPv4Address
from typing import ClassVar

from pnfarm.engine.channels.class1 import (
    ADDRESS_ITEM,
    ADDRESS_LENGTH,
    CLASS1_PORT,
    COUNT,
    DATA_ITEM,
    ITEM,
    LEAST_PLACE,
    RUN_IDLE,
    UDP,
)
from pnfarm.engine.channels.parts import Piece, Rider
from pnfarm.table.channel import FRAMING_CLASS1
from pnfarm.wire.ethernet import ETHERTYPE_IPV4
from pnfarm.wire.ipv4 import PROTOCOL_UDP, Ipv4Packet, emit_ipv4

__all__ = ["Class1ConsumerPlan", "Class1ProviderPlan"]

#: How long the first data are awaited at least, ns (CIP vol. 1, 3-4.5.2).
FIRST_DATA_NS = 10_000_000_000


@dataclass(frozen=True, slots=True)
class Class1ProviderPlan:
    """What a provider sends each ``rpi_ns``.  Offsets count from the first octet of data, after all headers.

    ``words``: (code, offset of the less significant octet) of each 16-bit word; ``constants``: (offset, octet) of what
    never changes.  ``destination`` is the receiver's MAC address, a router's, or that of a multicast group
    (:func:`pnfarm.wire.mac.multicast_mac`).  ``run_idle``: the header that an originator sends.  ``tos`` holds the DSCP
    in its upper six bits.  ``phase_ns``: offset in the interval.  ``drift``: of the sender's clock.
    """

    image: int
    port: int
    destination: bytes
    source: bytes
    destination_address: IPv4Address
    source_address: IPv4Address
    connection_id: int
    data_length: int
    rpi_ns: int
    words: Sequence[tuple[int, int]]
    run_idle: bool = False
    constants: Sequence[tuple[int, int]] = ()
    phase_ns: int = 0
    ttl: int = 64
    tos: int = 0
    destination_port: int = CLASS1_PORT
    source_port: int = CLASS1_PORT
    drift: float = 0.0
    pieces: Sequence[Piece] = ()
    plain: int = 0

    framing: ClassVar[int] = FRAMING_CLASS1
    iops: ClassVar[Sequence[int]] = ()
    riders: ClassVar[Sequence[Rider]] = ()
    iocs: ClassVar[Sequence[int]] = ()
    trailer: ClassVar[int] = 0
    counter_step: ClassVar[int] = 1

    @property
    def frame_id(self) -> int:
        return self.connection_id

    @property
    def cycle_ns(self) -> int:
        return self.rpi_ns

    @property
    def header(self) -> bytes:
        """Everything before the data; sequences, identification and checksums are the engine's."""
        size = COUNT + RUN_IDLE * self.run_idle
        items = (2).to_bytes(2, "little") + ADDRESS_ITEM.to_bytes(2, "little") + ADDRESS_LENGTH.to_bytes(2, "little")
        items += self.connection_id.to_bytes(4, "little") + bytes(4)
        items += DATA_ITEM.to_bytes(2, "little") + (size + self.data_length).to_bytes(2, "little") + bytes(size)
        ports = self.source_port.to_bytes(2, "big") + self.destination_port.to_bytes(2, "big")
        whole = UDP + len(items) + self.data_length
        datagram = ports + whole.to_bytes(2, "big") + bytes(2) + items + bytes(self.data_length)
        packet = emit_ipv4(
            Ipv4Packet(
                self.source_address, self.destination_address, PROTOCOL_UDP, datagram,
                ttl=self.ttl, tos=self.tos, dont_fragment=True,
            )
        )  # fmt: skip
        frame = self.destination + self.source + ETHERTYPE_IPV4.to_bytes(2, "big") + packet
        return frame[: LEAST_PLACE + ADDRESS_LENGTH + ITEM + size]


@dataclass(frozen=True, slots=True)
class Class1ConsumerPlan:
    """What a consumer takes.  Offsets count from the first octet of data, after all headers.

    ``destination`` is the MAC address at which it consumes, its own or a group's; ``destination_address`` the IPv4
    address.  ``multiplier``: of the packet interval, after which the connection times out; ``first_hold_ns``: the same
    before the first packet, without it 10 s or that time, whichever is longer (CIP vol. 1, 3-4.5.2).  ``feeds``,
    ``zeroes`` and ``drift`` as in :class:`pnfarm.engine.channels.schedule.ConsumerPlan`.
    """

    image: int
    port: int
    destination: bytes
    destination_address: IPv4Address
    source_address: IPv4Address
    connection_id: int
    data_length: int
    rpi_ns: int
    multiplier: int
    words: Sequence[tuple[int, int]]
    run_idle: bool = False
    first_hold_ns: int | None = None
    feeds: bool = True
    zeroes: bool = False
    drift: float = 0.0
    pieces: Sequence[Piece] = ()
    plain: int = 0

    framing: ClassVar[int] = FRAMING_CLASS1
    iops: ClassVar[Sequence[int]] = ()
    riders: ClassVar[Sequence[Rider]] = ()

    @property
    def frame_id(self) -> int:
        return self.connection_id

    @property
    def peer(self) -> int:
        return int(self.source_address)

    @property
    def own_address(self) -> int:
        return int(self.destination_address)

    @property
    def cycle_ns(self) -> int:
        return self.rpi_ns

    @property
    def hold_ns(self) -> int:
        return self.rpi_ns * self.multiplier

    @property
    def awaits_ns(self) -> int:
        """How long the first packet is awaited."""
        return max(FIRST_DATA_NS, self.hold_ns) if self.first_hold_ns is None else self.first_hold_ns
