"""Who was on the wire and how it was connected: what a capture's frames say of the plant, for a farm file.

The decoder reports each fact as it finds it.  Of each kind a bounded number is kept, the last of each station counts.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from pnfarm.captures.stations import Bounded
from pnfarm.wire.mac import is_group

if TYPE_CHECKING:
    from ipaddress import IPv4Address

    from pnfarm.protocols.enip.wire.epath import ElectronicKey
    from pnfarm.protocols.enip.wire.forward_open import ForwardOpen, Triad
    from pnfarm.protocols.enip.wire.identity import IdentityItem

__all__ = ["Observed", "SeenAdapter", "SeenOpening"]

#: Further MAC addresses at one IP address.
MOST_OTHERS = 8


@dataclass(slots=True)
class SeenAdapter:
    """A device by what it said of itself, and what originators expect of it; 0 and "" are not known."""

    ip: IPv4Address
    mac: bytes
    vendor: int = 0
    device_type: int = 0
    product_code: int = 0
    product_name: str = ""
    revision: tuple[int, int] = (0, 0)
    #: MAC addresses from which something else answered at its IP address.
    others: list[bytes] = field(default_factory=list)


@dataclass(slots=True)
class SeenOpening:
    """A Forward_Open of class 1; ``points`` are the consumed and the produced assembly.

    ``refused`` says why it was, None before it was answered.
    """

    originator: IPv4Address
    request: ForwardOpen
    points: tuple[int, ...]
    multiplier: int
    refused: str | None = None


class Observed:
    """See the module's docstring.  ``openings``: the last of each originator, device, points and sizes, in the order in
    which they were last asked for."""

    def __init__(self) -> None:
        self.adapters: Bounded[IPv4Address, SeenAdapter] = Bounded()
        self.openings: Bounded[tuple[IPv4Address, IPv4Address, tuple[int, ...], int, int], SeenOpening] = Bounded()
        self._asked: Bounded[tuple[IPv4Address, IPv4Address, Triad], SeenOpening] = Bounded()

    def _adapter(self, ip: IPv4Address, mac: bytes) -> SeenAdapter:
        found = self.adapters.get(ip)
        if found is None:
            found = SeenAdapter(ip, mac)
            if not (is_group(mac) or ip.is_multicast or ip.is_unspecified or ip.is_reserved or ip.is_loopback):
                self.adapters[ip] = found
        elif mac not in {found.mac, *found.others} and len(found.others) < MOST_OTHERS:
            found.others.append(mac)
        return found

    def identified(self, ip: IPv4Address, mac: bytes, item: IdentityItem) -> None:
        """A device's answer to ListIdentity."""
        seen = self._adapter(ip, mac)
        seen.vendor, seen.device_type, seen.product_code = item.vendor_id, item.device_type, item.product_code
        seen.product_name, seen.revision = item.name.decode("latin-1"), item.revision

    def asked(
        self, originator: IPv4Address, device: IPv4Address, mac: bytes, request: ForwardOpen,
        key: ElectronicKey | None, points: tuple[int, ...], multiplier: int,
    ) -> None:  # fmt: skip
        """A Forward_Open for cyclic data."""
        seen = self._adapter(device, mac)
        if key is not None and not seen.vendor:
            seen.vendor, seen.device_type, seen.product_code = key.vendor_id, key.device_type, key.product_code
        place = originator, device, points, request.o_to_t.size, request.t_to_o.size
        self.openings.pop(place, None)
        found = SeenOpening(originator, request, points, multiplier)
        self.openings[place] = self._asked[originator, device, request.triad] = found

    def answered(self, originator: IPv4Address, device: IPv4Address, triad: Triad, refused: str) -> None:
        """Its answer; "": it was accepted."""
        found = self._asked.get((originator, device, triad))
        if found is not None:
            found.refused = refused
