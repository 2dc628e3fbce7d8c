"""What a scanner says over its streams, as text: one line for each message that matters."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.protocols.enip.status import Service
from pnfarm.protocols.enip.wire.cpf import CommonPacket, ConnectedData, UnconnectedData
from pnfarm.protocols.enip.wire.encapsulation import Command, parse_encapsulation
from pnfarm.protocols.enip.wire.message import parse_request
from pnfarm.wire.endpoint import StreamData, StreamEnd

if TYPE_CHECKING:
    from pnfarm.buses.ethernetip.controller.core import EthernetIpCore
    from pnfarm.wire.endpoint import Peer, SocketAction

__all__ = ["WireTap"]


class WireTap:
    """Wraps the sockets of a scanner before it starts; ``said`` has what it did, ``octets`` what it sent."""

    def __init__(self, core: EthernetIpCore) -> None:
        self.said: list[str] = []
        self.octets: list[bytes] = []
        self._sockets = core.link.sockets
        self._act, self._connect = self._sockets.act, self._sockets.connect
        self._sockets.act, self._sockets.connect = self.act, self.connect

    def connect(self, port: int, peer: Peer) -> int:
        self.said.append(f"connect {peer[0]}:{peer[1]}")
        return self._connect(port, peer)

    def act(self, port: int, action: SocketAction) -> None:
        match action:
            case StreamData(data=data):
                self.octets.append(data)
                self.said.append(self._words(data))
            case StreamEnd():
                self.said.append("close")
        self._act(port, action)

    @staticmethod
    def _words(data: bytes) -> str:
        pdu = parse_encapsulation(data)
        if pdu.command not in {Command.SEND_RR_DATA, Command.SEND_UNIT_DATA}:
            return Command(pdu.command).name
        for item in CommonPacket.parse(pdu.data).items:
            if isinstance(item, UnconnectedData):
                request = parse_request(item.data)
            elif isinstance(item, ConnectedData):
                request = parse_request(item.data[2:])
            else:
                continue
            prefix = "connected " if isinstance(item, ConnectedData) else ""
            return f"{prefix}{Service(request.service).name} {request.path.hex()}"
        return "?"
