"""A frame on its way through the decoder, what a family of PDUs says of it, and what they share."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from pnfarm.buses.profinet.decode.stations import Bounded, Stations
from pnfarm.protocols.ip.reassembly import Reassembler

if TYPE_CHECKING:
    from collections.abc import Mapping
    from uuid import UUID

    from pnfarm.buses.profinet.decode.channels import Channel, Template
    from pnfarm.protocols.profinet.rpc_fragments import Reassembly
    from pnfarm.protocols.profinet.wire.blocks_any import Block
    from pnfarm.protocols.profinet.wire.iod import WriteRequest

__all__ = ["Call", "Packet", "Said", "Shared"]


@dataclass(frozen=True, slots=True)
class Packet:
    """One frame: its addresses, and ``payload`` behind the EtherType, any VLAN tag taken off."""

    time_ns: int
    destination: bytes
    source: bytes
    ethertype: int
    payload: bytes


@dataclass(frozen=True, slots=True)
class Said:
    """One thing worth a line.

    ``what`` a few words that stay the same (``Connect.req``); ``text`` the rest; ``counts`` what the summary adds
    up: counter -> reason ("" for none).  ``family`` is another than the frame's own where only its content told.
    """

    what: str
    text: str = ""
    details: Mapping[str, Any] = field(default_factory=dict)
    counts: Mapping[str, str] = field(default_factory=dict)
    family: str = ""


@dataclass(slots=True)
class Call:
    """A request and what its response needs to be understood.  ``client`` and ``server`` are addresses."""

    service: str
    opnum: int
    client: bytes
    server: bytes
    answered: bool = False
    blocks: tuple[Block, ...] = ()
    write: WriteRequest | None = None
    parts: dict[bool, Reassembly] = field(default_factory=dict)


class Shared:
    """What the families know of the capture so far.  ``gap_cycles`` is the longest silence that is not told."""

    def __init__(self, *, gap_cycles: float = 3.0, every_frame: bool = False) -> None:
        self.stations = Stations()
        self.gap_cycles = gap_cycles
        self.every_frame = every_frame
        #: Cyclic channels by destination, source and frame id.
        self.channels: Bounded[tuple[bytes, bytes, int], Channel] = Bounded()
        #: Layouts of a farm file, by the drive's address and whether the drive sends.
        self.templates: dict[tuple[bytes, bool], Template] = {}
        #: Channels that a Connect asked for and nobody has granted yet, keyed as the others.
        self.asked: Bounded[tuple[bytes, bytes, int], Channel] = Bounded(1024)
        #: The last PTCP frame of a station that was told, by its address and frame id: master and domain.
        self.clocks: Bounded[tuple[bytes, int], object] = Bounded()
        self.calls: Bounded[tuple[UUID, int], Call] = Bounded(1024)
        #: Transaction of a DCP request -> its sender's Set blocks.
        self.dcp_sets: Bounded[tuple[bytes, int], Any] = Bounded(1024)
        #: The last parameter request to a drive's record, so that its response has names.
        self.parameter_requests: Bounded[tuple[bytes, int, int, int], bytes] = Bounded()
        self.fragments = Reassembler(Counter())
