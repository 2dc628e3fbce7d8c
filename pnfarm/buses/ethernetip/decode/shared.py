"""What the functions of the decoder remember of a capture, all of it bounded."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from ipaddress import IPv4Address
from typing import TYPE_CHECKING, Final

from pnfarm.buses.decoding.decoder import SharedState
from pnfarm.buses.ethernetip.decode.channels import Channel, Template
from pnfarm.buses.ethernetip.decode.observed import Observed
from pnfarm.buses.ethernetip.decode.streams import End, Streams
from pnfarm.captures.stations import Bounded
from pnfarm.protocols.enip.status import Service

if TYPE_CHECKING:
    from pnfarm.captures.packet import Capture
    from pnfarm.protocols.enip.wire.forward_open import ForwardOpen, Triad
    from pnfarm.protocols.enip.wire.message import MessageRequest

__all__ = ["Asked", "Opened", "Route", "Shared"]

#: Requests of one session and sender context that wait for their answers.
MOST_WAITING: Final = 8
#: Sessions with requests, and connections.
MOST_ASKED: Final = 512
MOST_OPENED: Final = 1024


@dataclass(frozen=True, slots=True)
class Route:
    """Who sends a message to whom; ``to_device`` by the port of the two, and addresses of both kinds."""

    source: End
    destination: End
    source_mac: bytes
    destination_mac: bytes
    to_device: bool

    @property
    def device_mac(self) -> bytes:
        return self.destination_mac if self.to_device else self.source_mac

    @property
    def device(self) -> IPv4Address:
        return self.destination[0] if self.to_device else self.source[0]

    @property
    def originator(self) -> IPv4Address:
        return self.source[0] if self.to_device else self.destination[0]

    @property
    def pair(self) -> tuple[End, End]:
        """Originator and device, whoever sends."""
        return (self.source, self.destination) if self.to_device else (self.destination, self.source)


@dataclass(slots=True)
class Asked:
    """A request that waits for its answer.

    ``several`` are the requests in a Multiple_Service_Packet, as far as they are kept; ``routed``: it came within an
    Unconnected_Send, whose own answer is there only if something went wrong on the way.
    """

    request: MessageRequest
    several: tuple[MessageRequest | None, ...] = ()
    routed: bool = False

    def fits(self, service: int) -> bool:
        return self.request.service == service or (self.routed and service == Service.UNCONNECTED_SEND)


@dataclass(frozen=True, slots=True)
class Opened:
    """A Forward_Open that succeeded; ``keys`` are those of its channels."""

    request: ForwardOpen
    keys: tuple[tuple[IPv4Address, IPv4Address | None, int], ...] = field(default=())


#: What the requests of a session, or of a connection of class 3, have in common with their answers.
AskedKey = tuple[tuple[End, End], int, bytes]


class Shared(SharedState[tuple[IPv4Address, IPv4Address | None, int], Channel, Template, Observed]):
    """Channels are by source, destination (None: a group) and connection id."""

    def __init__(self, capture: Capture) -> None:
        super().__init__(capture)
        self.streams = Streams()
        self.asked: Bounded[AskedKey, deque[Asked]] = Bounded(MOST_ASKED)
        #: Connections by their device and what names them.
        self.opened: Bounded[tuple[IPv4Address, Triad], Opened] = Bounded(MOST_OPENED)

    def ask(self, key: AskedKey, asked: Asked) -> None:
        waiting = self.asked.get(key)
        if waiting is None:
            waiting = self.asked[key] = deque(maxlen=MOST_WAITING)
        waiting.append(asked)

    def answered(self, key: AskedKey, service: int) -> Asked | None:
        """The oldest request of this service that waits; those before it will not be answered any more."""
        waiting = self.asked.get(key)
        while waiting:
            found = waiting.popleft()
            if found.fits(service):
                return found
        return None
