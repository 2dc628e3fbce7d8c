"""What the functions of the decoder remember of a capture, all of it bounded."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
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
    from pnfarm.protocols.enip.wire.message import MessageRequest

__all__ = ["Asked", "Route", "Shared"]

#: Requests of one session and sender context that wait for their answers.
MOST_WAITING: Final = 8
#: Who asks again in the same context after this time has given the request before up: requests on their way together
#: follow each other more closely, and time-outs of requests are longer.
GIVEN_UP_NS: Final = 1_000_000_000
#: Sessions with requests.
MOST_ASKED: Final = 512


@dataclass(frozen=True, slots=True)
class Route:
    """Who sends a message to whom; ``to_device`` by the port of the two, and addresses of both kinds."""

    source: End
    destination: End
    source_mac: bytes
    destination_mac: bytes
    to_device: bool
    time_ns: int

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
        """Originator and device, whichever sends."""
        return (self.source, self.destination) if self.to_device else (self.destination, self.source)


@dataclass(slots=True)
class Asked:
    """A request that waits for its answer.

    ``several`` are the requests in a Multiple_Service_Packet, as far as they are kept; ``routed``: it came within an
    Unconnected_Send, whose own answer is there only if something went wrong on the way.
    """

    request: MessageRequest
    at_ns: int = 0
    several: tuple[MessageRequest | None, ...] = ()
    routed: bool = False

    def fits(self, service: int) -> bool:
        return self.request.service == service or (self.routed and service == Service.UNCONNECTED_SEND)


#: What the requests of a session, or of a connection of class 3, have in common with their answers.
AskedKey = tuple[tuple[End, End], int, bytes]


class Shared(SharedState[tuple[IPv4Address, IPv4Address | None, int], Channel, Template, Observed]):
    """Channels are by source, destination (None: a group) and connection id."""

    def __init__(self, capture: Capture) -> None:
        super().__init__(capture)
        self.streams = Streams()
        self.asked: Bounded[AskedKey, deque[Asked]] = Bounded(MOST_ASKED)

    def ask(self, key: AskedKey, asked: Asked) -> None:
        waiting = self.asked.get(key)
        if waiting is None:
            waiting = self.asked[key] = deque(maxlen=MOST_WAITING)
        if waiting and asked.at_ns - waiting[-1].at_ns > GIVEN_UP_NS:
            waiting.clear()
        waiting.append(asked)

    def missed(self, pair: tuple[End, End], *, keep: int) -> None:
        """Answers between two ends are not in the capture: of each context so many requests still wait."""
        for key, waiting in self.asked.items():
            while key[0] == pair and len(waiting) > keep:
                waiting.popleft()

    def answered(self, key: AskedKey, service: int) -> Asked | None:
        """The oldest request of this service that waits; those before it will not be answered any more."""
        waiting = self.asked.get(key)
        while waiting:
            found = waiting.popleft()
            if found.fits(service):
                return found
        return None
