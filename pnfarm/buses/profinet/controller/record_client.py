"""Records of one device, read or written by hand: what ``pnfarm record`` and ``module list`` run; no clock, no tasks.

The device is found by DCP, by its name or its address.  A read may go without an AR (ReadImplicit); everything else
goes through an AR for device access (IOSAR), which stands beside the controllers' and is released at the end.

State    waits for                       and then
-------  ------------------------------  ------------------------------------
FIND     the device's DCP answer         Connect, or the read without an AR
CONNECT  the AR                          the record's call
ACCESS   the record's answer             Release, or the end
RELEASE  the AR's end                    the end
DONE     nothing                         another read without an AR, if one is asked for
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum, auto
from ipaddress import IPv4Address
from typing import TYPE_CHECKING

from pnfarm.buses.profinet.uuids import uuid_source
from pnfarm.errors import DecodeError, RemoteError
from pnfarm.protocols.deadlines import earliest
from pnfarm.protocols.ip.host import DatagramReceived, IpHost
from pnfarm.protocols.named import Named
from pnfarm.protocols.profinet.cm.controller.cmctl import CmController
from pnfarm.protocols.profinet.cm.controller.events import (
    ArAborted,
    ArEstablished,
    ArFailed,
    ArReleased,
    RecordRead,
    RecordWriteDone,
)
from pnfarm.protocols.profinet.cm.controller.plan import ArPlan
from pnfarm.protocols.profinet.dcp.client import DcpClient, IdentifyAnswered, IdentifyFinished
from pnfarm.protocols.profinet.errors import describe_status
from pnfarm.protocols.profinet.rpc.client import RpcClient
from pnfarm.protocols.profinet.rpc.events import CallFailed, CallReturned
from pnfarm.protocols.profinet.rpc.fragments import Peer
from pnfarm.protocols.profinet.wire.cm.connect import ArType
from pnfarm.protocols.profinet.wire.dcp.blocks import NameBlock
from pnfarm.protocols.profinet.wire.rpc.pdu import RPC_PORT, UUID_PNIO_DEVICE, object_uuid
from pnfarm.wire.ethernet import ETHERTYPE_PROFINET, parse_ethernet

if TYPE_CHECKING:
    from ipaddress import IPv4Interface

    from pnfarm.buses.profinet.controller.records import RecordPlace
    from pnfarm.protocols.profinet.errors import PnioStatus

__all__ = ["TOOL_PORT", "ClientState", "RecordClient", "RecordTask"]

#: UDP port of the client's calls; another one than the controller's, which may use the same interface.
TOOL_PORT = 49_160
#: How long devices may take to answer the search.
SEARCH_NS = 1_000_000_000
STATION_NAME = "pnfarm-record"


@dataclass(frozen=True, slots=True)
class RecordTask:
    """``target``: a station name, or an address.  ``data`` is what is written, None for a read of up to ``length``."""

    target: str | IPv4Address
    place: RecordPlace
    data: bytes | None = None
    length: int = 4096
    implicit: bool = False


class ClientState(StrEnum):
    FIND = "FIND"
    CONNECT = "CONNECT"
    ACCESS = "ACCESS"
    RELEASE = "RELEASE"
    DONE = "DONE"


class _Sign(Named):
    FOUND = auto()
    FOUND_IMPLICIT = auto()  # found, and no AR is needed
    ESTABLISHED = auto()
    ANSWERED = auto()
    ANSWERED_IMPLICIT = auto()
    ENDED = auto()
    NEXT = auto()


_S, _E = ClientState, _Sign

#: (state, sign) -> (next state, name of the action or "").
TRANSITIONS: dict[tuple[ClientState, _Sign], tuple[ClientState, str]] = {
    (_S.FIND, _E.FOUND): (_S.CONNECT, "connect"),
    (_S.FIND, _E.FOUND_IMPLICIT): (_S.ACCESS, "access"),
    (_S.FIND, _E.ENDED): (_S.DONE, ""),
    (_S.CONNECT, _E.ESTABLISHED): (_S.ACCESS, "access"),
    (_S.CONNECT, _E.ENDED): (_S.DONE, ""),
    (_S.ACCESS, _E.ANSWERED): (_S.RELEASE, "release"),
    (_S.ACCESS, _E.ANSWERED_IMPLICIT): (_S.DONE, ""),
    (_S.ACCESS, _E.ENDED): (_S.DONE, ""),
    (_S.RELEASE, _E.ENDED): (_S.DONE, ""),
    (_S.DONE, _E.NEXT): (_S.ACCESS, "access"),
}


class RecordClient:
    """``mac`` and ``own`` are this end's addresses.  Feed it frames and time until :attr:`done`."""

    def __init__(self, task: RecordTask, mac: bytes, own: IPv4Interface, seed: bytes) -> None:
        self.task = task
        self._place = task.place
        self.state = ClientState.FIND
        #: What was read; None for a write, and after a failure.
        self.data: bytes | None = None
        #: The device's, None when it gave none.
        self.status: PnioStatus | None = None
        #: The device that was found.
        self.station: IdentifyAnswered | None = None
        self._failure = ""
        self._mac = mac
        self._dcp = DcpClient(mac, first_xid=int.from_bytes(seed[:3], "big") | 1)
        self._ip = IpHost(mac)
        self._ip.open_ports = {TOOL_PORT}
        self._ip.set_address(own)
        self._client = RpcClient(uuid_source(seed + mac + b"activity"))
        self._machine: CmController | None = None
        self._calls: dict[int, int] = {}
        self._new_uuid = uuid_source(seed + mac)

    @property
    def done(self) -> bool:
        return self.state is ClientState.DONE

    def check(self) -> None:
        """Raise RemoteError with a sentence when the task failed."""
        if self._failure:
            raise RemoteError(self._failure)

    def read_next(self, place: RecordPlace, now: int) -> None:
        """Read another record of the device that was found, without a connection; when :attr:`done`."""
        if self._machine is None:
            # it has no address: that stays the reason
            return
        self._place = place
        self._failure, self.data, self.status = "", None, None
        self._sign(_Sign.NEXT, now)
        self._settle(now)

    def start(self, now: int) -> None:
        target = self.task.target
        if isinstance(target, IPv4Address):
            self._dcp.identify(now=now, window_ns=SEARCH_NS)
        else:
            self._dcp.identify([NameBlock(target)], now=now, window_ns=SEARCH_NS, expected=1)

    def start_at(self, station: IdentifyAnswered, now: int) -> None:
        """Like :meth:`start`, for a device that was found already."""
        self._found(station, now)
        self._settle(now)

    # frames and time

    def receive(self, data: bytes, now: int) -> None:
        """One frame; those of others are ignored."""
        try:
            frame = parse_ethernet(data)
        except DecodeError:
            return
        if frame.ethertype != ETHERTYPE_PROFINET:
            self._ip.receive(frame, now)
        elif frame.destination == self._mac:
            self._dcp.receive(frame, now)
        self._settle(now)

    def to_send(self, now: int) -> list[bytes]:
        for datagram in self._client.to_send(now):
            self._ip.send(datagram.local_port, datagram.peer.ip, datagram.peer.port, datagram.data, now)
        return [*self._dcp.to_send(now), *self._ip.to_send(now)]

    def next_deadline(self) -> int | None:
        return earliest(*self._machines())

    def handle_timeout(self, now: int) -> None:
        for machine in self._machines():
            machine.handle_timeout(now)
        self._settle(now)

    def _machines(self) -> list[DcpClient | IpHost | RpcClient | CmController]:
        shared: list[DcpClient | IpHost | RpcClient | CmController] = [self._dcp, self._ip, self._client]
        return shared if self._machine is None else [*shared, self._machine]

    # the machine

    def _sign(self, sign: _Sign, now: int) -> None:
        """The only writer of the state."""
        row = TRANSITIONS.get((self.state, sign))
        if row is None:
            return
        self.state, action = row
        if action:
            getattr(self, f"_do_{action}")(now)

    def _fail(self, reason: str, now: int) -> None:
        self._failure = self._failure or reason
        self._sign(_Sign.ENDED, now)

    def _do_connect(self, now: int) -> None:
        if self._machine is not None:
            self._machine.connect(now)

    def _do_access(self, _now: int) -> None:
        machine, task = self._machine, self.task
        if machine is None:
            return
        if task.data is not None:
            machine.write_record("record", *self._place, task.data)
        elif task.implicit:
            machine.read_implicit("record", *self._place, task.length)
        else:
            machine.read_record("record", *self._place, task.length)

    def _do_release(self, now: int) -> None:
        if self._machine is not None:
            self._machine.release(now)

    # between the machines

    def _settle(self, now: int) -> None:
        moved = True
        while moved:
            moved = any([self._pump_dcp(now), self._pump_calls(now), self._pump_machine(now)])

    def _pump_dcp(self, now: int) -> bool:
        events = self._dcp.events()
        for event in events:
            if self.state is not ClientState.FIND:
                break
            if isinstance(event, IdentifyAnswered) and self._is_it(event):
                self._found(event, now)
            elif isinstance(event, IdentifyFinished):
                self._fail(f"no station {self._who} answers", now)
        return bool(events)

    @property
    def _who(self) -> str:
        named = isinstance(self.task.target, str)
        return f"of the name {self.task.target}" if named else f"with the address {self.task.target}"

    def _is_it(self, event: IdentifyAnswered) -> bool:
        return self.task.target in {event.info.name, event.info.ip}

    def _found(self, event: IdentifyAnswered, now: int) -> None:
        info = event.info
        self.station = event
        if info.ip is None or not int(info.ip):
            self._fail(f"{info.name or event.mac.hex(':')} has no IP address: give it one first", now)
            return
        self._ip.learn(info.ip, event.mac, now)
        high, low = info.instance or (0, 1)
        vendor_id, device_id = info.vendor_id or 0, info.device_id or 0
        self._machine = CmController(
            ArPlan(
                vendor_id=vendor_id,
                device_id=device_id,
                instance=high << 8 | low,
                controller_name=STATION_NAME,
                controller_mac=self._mac,
                controller_object_uuid=object_uuid(1, 1, 0xFFFF),
                ar_uuid=self._new_uuid(),
                session_key=1,
                submodules=(),
                ar_type=ArType.IOSAR,
                device_access=True,
            )
        )
        implicit = self.task.implicit and self.task.data is None
        self._sign(_Sign.FOUND_IMPLICIT if implicit else _Sign.FOUND, now)

    def _pump_calls(self, now: int) -> bool:
        events = self._ip.events()
        for event in events:
            if isinstance(event, DatagramReceived):
                peer = Peer(event.source_ip, event.source_port)
                self._client.receive(peer, event.destination_port, event.data, now)
        answers = self._client.events()
        for answer in answers:
            key = self._calls.pop(answer.call_id, None)
            if key is None or self._machine is None:
                continue
            if isinstance(answer, CallReturned):
                self._machine.call_returned(key, answer.status, answer.payload, now)
            elif isinstance(answer, CallFailed):
                self._machine.call_failed(key, answer.text, now)
        return bool(events or answers)

    def _pump_machine(self, now: int) -> bool:
        machine, station = self._machine, self.station
        if machine is None or station is None or station.info.ip is None:
            return False
        calls = machine.calls(now)
        for call in calls:
            call_id = self._client.call(
                Peer(station.info.ip, RPC_PORT),
                TOOL_PORT,
                UUID_PNIO_DEVICE,
                machine.plan.device_object_uuid,
                call.opnum,
                call.args_maximum,
                call.payload,
                now,
            )
            self._calls[call_id] = call.key
        events = machine.events()
        for event in events:
            match event:
                case ArEstablished():
                    self._sign(_Sign.ESTABLISHED, now)
                case ArFailed(phase=phase, status=status, reason=reason):
                    self._fail(f"{phase}: {reason if status is None else describe_status(status)}", now)
                case ArAborted(reason=reason):
                    self._fail(reason, now)
                case ArReleased():
                    self._sign(_Sign.ENDED, now)
                case RecordRead() | RecordWriteDone():
                    self._answered(event, now)
                case _:
                    pass  # an AR for device access has no other events
        return bool(calls or events)

    def _answered(self, event: RecordRead | RecordWriteDone, now: int) -> None:
        self.status = event.status
        if isinstance(event, RecordRead):
            self.data = event.data
        if event.status is not None and not event.status.ok:
            self._failure = describe_status(event.status)
        elif event.status is None:
            self._failure = event.reason
        implicit = self.task.implicit and self.task.data is None
        self._sign(_Sign.ANSWERED_IMPLICIT if implicit else _Sign.ANSWERED, now)
