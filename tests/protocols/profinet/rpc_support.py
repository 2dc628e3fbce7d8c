"""A client's datagrams by hand, and whole clients joined to servers by a network that misbehaves; in virtual time."""

from __future__ import annotations

import heapq
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from ipaddress import IPv4Address
from itertools import count
from uuid import UUID

from pnfarm.protocols.profinet.rpc.client import CallFailed, CallReturned, RpcClient, RpcClientConfig
from pnfarm.protocols.profinet.rpc.endpoints import Endpoint
from pnfarm.protocols.profinet.rpc.server import (
    CallReceived,
    Datagram,
    Peer,
    RpcServer,
    RpcServerConfig,
)
from pnfarm.protocols.profinet.wire.rpc.pdu import (
    BODY_MAX,
    OK,
    RPC_PORT,
    UUID_PNIO_DEVICE,
    Flags1,
    Opnum,
    PacketType,
    PnioStatus,
    RequestArgs,
    RpcPdu,
    drep,
    emit_request_args,
    emit_rpc,
    object_uuid,
    parse_rpc,
)

MS = 1_000_000
ADDRESS = IPv4Address("10.77.0.11")
PEER = Peer(IPv4Address("10.77.0.1"), 49155)
OBJECT = object_uuid(1, 1, 0x0105)
ACTIVITY = UUID("00000008-0000-1010-808e-000e8cb06c7e")
MAC = bytes.fromhex("000e8cb06c7e")
ENDPOINTS = (Endpoint(OBJECT, "AKD"),)


# -- datagrams by hand -----------------------------------------------------------------------------------------------


def server(**settings) -> RpcServer:
    return RpcServer(RpcServerConfig(**settings), ADDRESS)


def request(sequence=0, payload=b"blocks", *, opnum=Opnum.READ, maximum=65536, little=True, **fields) -> RpcPdu:
    stub = emit_request_args(RequestArgs(maximum, payload), little_endian=little)
    pdu = RpcPdu(
        PacketType.REQUEST,
        UUID_PNIO_DEVICE,
        ACTIVITY,
        OBJECT,
        sequence=sequence,
        opnum=opnum,
        body=stub,
        flags1=int(Flags1.IDEMPOTENT),
        drep=drep(little_endian=little),
    )
    return replace(pdu, **fields)


def about(pdu: RpcPdu, kind: PacketType, **fields) -> RpcPdu:
    """A PDU of another kind about the call of ``pdu``."""
    bare = replace(pdu, packet_type=int(kind), flags1=0, body=b"", fragment_number=0)
    return replace(bare, **fields)


def put(to: RpcServer, pdu: RpcPdu, now: int = 0, peer: Peer = PEER) -> list[RpcPdu]:
    """Give the server one PDU and answer what it sends."""
    to.receive(peer, RPC_PORT, emit_rpc(pdu), now, MAC)
    return sent(to, now)


def sent(to: RpcServer, now: int = 0) -> list[RpcPdu]:
    datagrams = to.to_send(now)
    assert all(datagram.local_port == RPC_PORT for datagram in datagrams)
    return [parse_rpc(datagram.data) for datagram in datagrams]


def received(to: RpcServer) -> CallReceived:
    [event] = to.events()
    assert isinstance(event, CallReceived)
    return event


def fragments(pdu: RpcPdu, size=BODY_MAX, flags=0) -> list[RpcPdu]:
    bodies = [pdu.body[at : at + size] for at in range(0, len(pdu.body), size)]
    flags = int(pdu.flags1 | Flags1.FRAGMENT | flags)
    parts = [replace(pdu, body=body, fragment_number=number, flags1=flags) for number, body in enumerate(bodies)]
    parts[-1] = replace(parts[-1], flags1=flags | int(Flags1.LAST_FRAGMENT))
    return parts


# -- whole ends ------------------------------------------------------------------------------------------------------

PERFECT = (1,)


@dataclass
class Station:
    """A server with an application that takes ``think_ns`` for each call, and counts how often it ran each."""

    address: Peer
    answer: Callable[[CallReceived], bytes | tuple[PnioStatus, bytes]] = lambda event: event.payload[::-1]
    think_ns: int = 0
    config: RpcServerConfig = field(default_factory=lambda: RpcServerConfig(endpoints=ENDPOINTS))
    runs: Counter = field(default_factory=Counter)

    def __post_init__(self) -> None:
        self.server = RpcServer(self.config, self.address.ip)


class Network:
    """Clients and stations by address; ``fate`` says, datagram by datagram, after how many ms each copy arrives."""

    def __init__(self, stations: Iterable[Station], fate: Iterable[tuple[int, ...]] = ()) -> None:
        self.stations = {station.address.ip: station for station in stations}
        self.clients: dict[IPv4Address, RpcClient] = {}
        self.ends: dict[IPv4Address, list[CallReturned | CallFailed]] = {}
        self.now = 0
        #: Every datagram that was sent: (from, to, octets).
        self.seen: list[tuple[Peer, Peer, bytes]] = []
        self._fate = iter(fate)
        self._order = count()
        self._due: list[tuple[int, int, Callable[[], None]]] = []

    def client(self, ip: str, config: RpcClientConfig | None = None) -> RpcClient:
        address = IPv4Address(ip)
        numbers = count(int(address) << 64)
        made = self.clients[address] = RpcClient(lambda: UUID(int=next(numbers)), config)
        self.ends[address] = []
        return made

    def call(self, client: RpcClient, station: Station, payload: bytes, port: int = 49152, **options) -> int:
        number = client.call(
            station.address,
            port,
            UUID_PNIO_DEVICE,
            OBJECT,
            options.pop("opnum", Opnum.READ),
            65536,
            payload,
            self.now,
            **options,
        )
        self.flush()
        return number

    def _later(self, delay_ns: int, action: Callable[[], None]) -> None:
        heapq.heappush(self._due, (self.now + delay_ns, next(self._order), action))

    def _carry(self, source: IPv4Address, datagram: Datagram) -> None:
        assert len(datagram.data) <= 1464
        origin = Peer(source, datagram.local_port)
        self.seen.append((origin, datagram.peer, datagram.data))
        station, client = self.stations.get(datagram.peer.ip), self.clients.get(datagram.peer.ip)
        for delay in next(self._fate, PERFECT):
            if station is not None:
                action = lambda: station.server.receive(origin, datagram.peer.port, datagram.data, self.now)  # noqa: E731
            else:
                assert client is not None
                action = lambda: client.receive(origin, datagram.peer.port, datagram.data, self.now)  # noqa: E731
            self._later(delay * MS, action)

    def flush(self) -> None:
        for ip, client in self.clients.items():
            self.ends[ip] += client.events()
            for datagram in client.to_send(self.now):
                self._carry(ip, datagram)
        for ip, station in self.stations.items():
            for event in station.server.events():
                station.runs[event.call] += 1
                self._later(station.think_ns, lambda event=event, station=station: self._respond(station, event))
            for datagram in station.server.to_send(self.now):
                self._carry(ip, datagram)

    def _respond(self, station: Station, event: CallReceived) -> None:
        answer = station.answer(event)
        status, payload = (OK, answer) if isinstance(answer, bytes) else answer
        station.server.respond(event.call, status, payload, self.now)

    def run(self, until: int) -> None:
        """Let everything happen that happens up to ``until``."""
        machines = [*self.clients.values(), *(station.server for station in self.stations.values())]
        for _ in range(200_000):
            coming = [at for machine in machines if (at := machine.next_deadline()) is not None]
            coming += [at for at, _, _ in self._due[:1]]
            due = min(coming, default=None)
            if due is None or due > until:
                self.now = until
                return
            self.now = max(self.now, due)
            arrived = bool(self._due) and self._due[0][0] <= self.now
            while self._due and self._due[0][0] <= self.now:
                heapq.heappop(self._due)[2]()
            if not arrived:
                for machine in machines:
                    machine.handle_timeout(self.now)
            self.flush()
        raise AssertionError("the ends do not come to rest")

    @property
    def outcomes(self) -> list[CallReturned | CallFailed]:
        return [end for ends in self.ends.values() for end in ends]


def big_answer(device: RpcServer, size: int = 10_000) -> list[RpcPdu]:
    put(device, request())
    device.respond(received(device).call, OK, bytes(size), 0)
    return sent(device)
