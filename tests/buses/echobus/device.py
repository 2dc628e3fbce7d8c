"""A drive that sends back what its streams and datagrams bring."""

from __future__ import annotations

from ipaddress import IPv4Interface
from typing import TYPE_CHECKING

from toybus.device.device import ToyDevice

from pnfarm.wire.endpoint import (
    Datagram,
    DatagramReceived,
    Services,
    StreamClosed,
    StreamData,
    StreamEnd,
    StreamOpened,
    StreamReceived,
)

if TYPE_CHECKING:
    from pnfarm.wire.endpoint import SocketAction, SocketEvent

#: The echo service (RFC 862).
ECHO = 7
SESSIONS = 3


class EchoDevice(ToyDevice):
    """``streams`` are those open now; a stream that brings ``bye`` is closed from this side."""

    def build(self, kept: dict) -> None:
        super().build(kept)
        self.streams: set[int] = set()
        self.actions: list[SocketAction] = []

    def stop(self, now: int) -> None:
        super().stop(now)
        self.streams.clear()
        self.actions.clear()

    def services(self) -> Services | None:
        node = self.station.config.node
        if node is None:
            return None
        return Services(
            IPv4Interface(f"10.77.0.{node}/23"), streams=(ECHO,), datagrams=(ECHO,), silent=(2222,), sessions=SESSIONS
        )

    def socket_event(self, event: SocketEvent, now: int) -> None:
        match event:
            case StreamOpened():
                self.streams.add(event.stream)
            case StreamReceived():
                self.actions.append(StreamData(event.stream, event.data.upper()))
                if event.data.endswith(b"bye"):
                    self.streams.discard(event.stream)
                    self.actions.append(StreamEnd(event.stream))
            case StreamClosed():
                self.streams.discard(event.stream)
            case DatagramReceived():
                self.actions.append(Datagram(event.service, event.peer, event.data.upper()))

    def pump_sockets(self, now: int) -> list[SocketAction]:
        actions, self.actions = self.actions, []
        return actions
