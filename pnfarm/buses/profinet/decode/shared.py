"""State of the capture that the families of PDUs share."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from pnfarm.buses.decoding.decoder import SharedState
from pnfarm.buses.profinet.decode.channels import Channel, Template
from pnfarm.buses.profinet.decode.observed import Observed
from pnfarm.captures.stations import Bounded

if TYPE_CHECKING:
    from uuid import UUID

    from pnfarm.captures.packet import Capture
    from pnfarm.protocols.profinet.rpc.fragments import Reassembly
    from pnfarm.protocols.profinet.wire.block import Block
    from pnfarm.protocols.profinet.wire.records.iod import WriteRequest

__all__ = ["Call", "Shared"]


@dataclass(slots=True)
class Call:
    """A request with what is needed to decode its response.  ``client`` and ``server`` are addresses.

    ``begin`` is the hash of its first body; ``parts`` are fragments of the request and of the response, None once
    they are whole.
    """

    service: str
    opnum: int
    client: bytes
    server: bytes
    at_ns: int
    answered: bool = False
    blocks: tuple[Block, ...] = ()
    write: WriteRequest | None = None
    begin: int | None = None
    parts: dict[bool, Reassembly | None] = field(default_factory=dict)

    @property
    def incomplete(self) -> bool:
        """Whether fragments of the request are missing."""
        return self.parts.get(True) is not None


class Shared(SharedState[tuple[bytes, bytes, int], Channel, Template, Observed]):
    """Channels are by destination, source and frame id."""

    def __init__(self, capture: Capture) -> None:
        super().__init__(capture)
        #: Channels that a Connect requests and that are not confirmed yet, with the same keys.
        self.asked: Bounded[tuple[bytes, bytes, int], Channel] = Bounded(1024)
        #: The last PTCP frame of a station that got a line, by its address and frame id: master and domain.
        self.clocks: Bounded[tuple[bytes, int], object] = Bounded()
        self.calls: Bounded[tuple[UUID, int], Call] = Bounded(1024)
        #: Transaction of a DCP request -> its sender's Set blocks.
        self.dcp_sets: Bounded[tuple[bytes, int], Any] = Bounded(1024)
        #: The last parameter request to a drive's record, so that its response has names.
        self.parameter_requests: Bounded[tuple[bytes, int, int, int], bytes] = Bounded()
