"""Who is on this wire: ListIdentity by broadcast, and the answers that come in the time granted."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from pnfarm.errors import DecodeError
from pnfarm.protocols.enip.wire.cpf import parse_items
from pnfarm.protocols.enip.wire.encapsulation import (
    Command,
    EncapsulationPdu,
    emit_encapsulation,
    parse_encapsulation,
)
from pnfarm.protocols.enip.wire.identity import IdentityItem

if TYPE_CHECKING:
    from pnfarm.protocols.enip.encapsulation import Peer

__all__ = ["Found", "IdentitySearch"]


@dataclass(frozen=True, slots=True)
class Found:
    """A device, and the address from which it answered."""

    peer: Peer
    identity: IdentityItem


class IdentitySearch:
    """One search; ``delay_ms`` is the time over which the devices spread their answers (500 at least).

    ``conflicts`` are addresses at which two devices answered: not the same one again.
    """

    def __init__(self, delay_ms: int = 1000, most: int = 4096) -> None:
        self.delay_ms = delay_ms
        self.found: dict[Peer, Found] = {}
        self.conflicts: set[Peer] = set()
        self.discards = 0
        self._most = most

    def question(self) -> bytes:
        """The datagram to send to port 44818 of everyone."""
        context = self.delay_ms.to_bytes(2, "little") + bytes(6)
        return emit_encapsulation(EncapsulationPdu(Command.LIST_IDENTITY, context=context))

    @property
    def duration_ns(self) -> int:
        """How long answers may take, and half a second for the way."""
        return (max(self.delay_ms, 500) + 500) * 1_000_000

    def datagram(self, data: bytes, peer: Peer) -> Found | None:
        """A device that was not known yet; anything else is None and, if it is no answer, counted."""
        try:
            pdu = parse_encapsulation(data)
            items = parse_items(pdu.data) if pdu.command == Command.LIST_IDENTITY and not pdu.status else ()
        except DecodeError:
            items = ()
        identities = [item for item in items if isinstance(item, IdentityItem)]
        known = self.found.get(peer)
        if not identities or (known is None and len(self.found) >= self._most):
            self.discards += 1
            return None
        if known is not None:
            if (known.identity.vendor_id, known.identity.serial) != (identities[0].vendor_id, identities[0].serial):
                self.conflicts.add(peer)
            return None
        self.found[peer] = Found(peer, identities[0])
        return self.found[peer]
