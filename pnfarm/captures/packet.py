"""A frame in the decoder, its description, and the state that the decoders of all buses share."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from pnfarm.captures.stations import Stations
from pnfarm.protocols.ip.reassembly import Reassembler

if TYPE_CHECKING:
    from collections.abc import Mapping

__all__ = ["Capture", "Description", "Packet"]


@dataclass(frozen=True, slots=True)
class Packet:
    """One frame: its addresses, and ``payload`` behind the EtherType, any VLAN tag taken off."""

    time_ns: int
    destination: bytes
    source: bytes
    ethertype: int
    payload: bytes


@dataclass(frozen=True, slots=True)
class Description:
    """One line of description.

    ``what`` a few words that stay the same (``Connect.req``); ``text`` the rest; ``counts`` what the summary adds
    up: counter -> reason ("" for none).  ``family``: set if only the content shows the family.
    """

    what: str
    text: str = ""
    details: Mapping[str, Any] = field(default_factory=dict)
    counts: Mapping[str, str] = field(default_factory=dict)
    family: str = ""


class Capture:
    """What the decoders of all buses share.

    ``gap_cycles``: a silence longer than so many cycles is described.  ``every_frame``: cyclic frames each get a line.
    """

    def __init__(self, *, gap_cycles: float = 3.0, every_frame: bool = False) -> None:
        self.stations = Stations()
        self.gap_cycles = gap_cycles
        self.every_frame = every_frame
        self.fragments = Reassembler(Counter())
