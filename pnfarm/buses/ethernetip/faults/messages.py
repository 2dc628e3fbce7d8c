"""Messages of EtherNet/IP, as the gate of streams takes them: cut out of a stream, classified, corrupted."""

from __future__ import annotations

from typing import Final

from pnfarm.errors import DecodeError
from pnfarm.faults.gate.socket_gate import DATAGRAM, STREAM
from pnfarm.protocols.enip.status import Service
from pnfarm.protocols.enip.wire.cpf import CommonPacket, ConnectedData, UnconnectedData
from pnfarm.protocols.enip.wire.encapsulation import HEADER_OCTETS, Command, parse_encapsulation, parse_header
from pnfarm.protocols.enip.wire.message import REPLY

__all__ = ["ANSWER", "CLASSES", "MESSAGES", "OPEN", "EncapsulationCutter", "message_class"]

#: Answers to Forward_Open and Large_Forward_Open; answers of the other objects; :data:`STREAM` is all the rest.
OPEN: Final = f"{STREAM}-open"
ANSWER: Final = f"{STREAM}-answer"
MESSAGES: Final = frozenset({STREAM, OPEN, ANSWER, DATAGRAM})
CLASSES: Final = MESSAGES
_DATA: Final = frozenset({Command.SEND_RR_DATA, Command.SEND_UNIT_DATA})
_OPENING: Final = frozenset({Service.FORWARD_OPEN, Service.LARGE_FORWARD_OPEN})


class EncapsulationCutter:
    """Follows the headers in what comes on a stream; any octets do, as every length is one."""

    def __init__(self) -> None:
        self._header = b""
        #: Octets of the present message that are still to come after its header.
        self._left = 0

    def pieces(self, data: bytes) -> list[tuple[bool, bytes]]:
        """See :class:`pnfarm.faults.gate.socket_gate.Cutter`."""
        found: list[tuple[bool, bytes]] = []
        place = 0
        while place < len(data):
            begin, first = place, not self._left and not self._header
            if not self._left:
                part = data[place : place + HEADER_OCTETS - len(self._header)]
                self._header += part
                place += len(part)
                if len(self._header) == HEADER_OCTETS:
                    self._left = parse_header(self._header).length
                    self._header = b""
            taken = min(self._left, len(data) - place)
            self._left -= taken
            place += taken
            found.append((first, data[begin:place]))
        return found


def message_class(message: bytes) -> str:
    """The class of a message that a drive sends; any octets have one."""
    try:
        pdu = parse_encapsulation(message)
        if pdu.command not in _DATA:
            return STREAM
        items = CommonPacket.parse(pdu.data).items
    except DecodeError:
        return STREAM
    for item in items:
        if isinstance(item, ConnectedData):
            return ANSWER
        if isinstance(item, UnconnectedData) and item.data:
            service = item.data[0] & ~REPLY
            return OPEN if service in _OPENING else STREAM if service == Service.FORWARD_CLOSE else ANSWER
    return STREAM
