"""A frame in the decoder, its description, and the state that the decoders of all buses share."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from pnfarm.captures.stations import Bounded, Stations
from pnfarm.protocols.ip.reassembly import Reassembler

if TYPE_CHECKING:
    from collections.abc import Mapping
    from ipaddress import IPv4Address

    from pnfarm.wire.ipv4 import Ipv4Packet

__all__ = ["SAME_NS", "Capture", "Description", "Packet"]

#: Largest time between copies of one frame at several interfaces.
SAME_NS = 20_000_000
#: IP packets of all stations whose fragments are collected at a time.
_FRAGMENTED = 64


@dataclass(frozen=True, slots=True)
class Packet:
    """One frame: its addresses, and ``payload`` after the EtherType, any VLAN tag taken off.

    ``cut`` octets of it are not in the capture.
    """

    time_ns: int
    destination: bytes
    source: bytes
    ethertype: int
    payload: bytes
    cut: int = 0


@dataclass(frozen=True, slots=True)
class Description:
    """One line of description.

    ``what`` a few words that stay the same (``Connect.req``), empty for what only counts; ``text`` the rest; ``counts``
    what the summary adds up: counter -> reason ("" for none).  ``family``: set if only the content shows the family.
    ``ends``: source and destination, set if they are not those of the frame with which it became known.
    """

    what: str
    text: str = ""
    details: Mapping[str, Any] = field(default_factory=dict)
    counts: Mapping[str, str] = field(default_factory=dict)
    family: str = ""
    ends: tuple[bytes, bytes] | None = None


class Capture:
    """What the decoders of all buses share.

    ``gap_cycles``: a silence longer than so many cycles is described.  ``every_frame``: cyclic frames each get a line.
    """

    def __init__(self, *, gap_cycles: float = 3.0, every_frame: bool = False) -> None:
        self.stations = Stations()
        self.gap_cycles = gap_cycles
        self.every_frame = every_frame
        self._dropped = Counter[str]()
        self._fragments = Reassembler(self._dropped, _FRAGMENTED)
        #: The last packets that were joined, and when.
        self._joined: Bounded[tuple[IPv4Address, IPv4Address, int, int], int] = Bounded(_FRAGMENTED)

    def joined(self, fragment: Ipv4Packet, now: int) -> Ipv4Packet | None:
        """The whole IP packet that a fragment completes; None for any other, and for a copy of one."""
        key = fragment.source, fragment.destination, fragment.protocol, fragment.identification
        before = self._joined.get(key)
        if before is not None and abs(now - before) < SAME_NS:
            return None
        whole = self._fragments.receive(fragment, now)
        if whole is not None:
            self._joined[key] = now
        return whole

    @property
    def incomplete(self) -> int:
        """Fragmented IP packets that are not whole so far, or never were."""
        return self._dropped.total() + self._fragments.pending
