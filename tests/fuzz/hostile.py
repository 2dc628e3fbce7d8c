"""A hostile station's shots at drives and at their controller: frames of every kind, wrong at every depth.

The *stranger* speaks under its own addresses and never says the UUIDs of a connection or of its controller: whatever
it sends, it may not disturb one. The *impostor* has both: it can end connections, and they must come back.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from ipaddress import IPv4Address
from random import Random
from uuid import UUID

from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.dcp.rules import RESET_MODES, check_ip_suite
from pnfarm.protocols.profinet.wire.alarms.notification import AlarmNotification, acknowledge
from pnfarm.protocols.profinet.wire.alarms.rta import parse_rta
from pnfarm.protocols.profinet.wire.any_block import emit_blocks, parse_blocks
from pnfarm.protocols.profinet.wire.cm.connect import ArBlockReq, ArProperties, ArType
from pnfarm.protocols.profinet.wire.dcp.blocks import (
    FactoryResetBlock,
    FullIpSuiteBlock,
    IpParameterBlock,
    NameBlock,
    ResetToFactoryBlock,
)
from pnfarm.protocols.profinet.wire.dcp.pdu import IDENTIFY_MULTICAST, SERVICE_SET, parse_dcp
from pnfarm.protocols.profinet.wire.frame_id import ALARM_HIGH, ALARM_LOW
from pnfarm.protocols.profinet.wire.lldp.pdu import LLDP_MULTICAST
from pnfarm.protocols.profinet.wire.names import check_station_name
from pnfarm.protocols.profinet.wire.records.iod import IodReadReqHeader, IodWriteReqHeader, emit_write_request
from pnfarm.protocols.profinet.wire.rpc.pdu import (
    NIL_UUID,
    RPC_PORT,
    UUID_EPM,
    UUID_PNIO_CONTROLLER,
    UUID_PNIO_DEVICE,
    Flags1,
    Opnum,
    PacketType,
    RequestArgs,
    RpcPdu,
    emit_request_args,
    emit_rpc,
    parse_rpc,
)
from pnfarm.wire.arp import ArpPacket, emit_arp
from pnfarm.wire.ethernet import (
    ETHERTYPE_ARP,
    ETHERTYPE_IPV4,
    ETHERTYPE_LLDP,
    ETHERTYPE_PROFINET,
    EthernetFrame,
    emit_ethernet,
    parse_ethernet,
)
from pnfarm.wire.ipv4 import Ipv4Packet, emit_ipv4, parse_ipv4
from pnfarm.wire.mac import BROADCAST
from pnfarm.wire.udp import UdpDatagram, emit_udp, parse_udp
from tests.fuzz.corpus import Corpus
from tests.fuzz.malformed import UDP, about_a_call, deep, deep_blocks, deep_rpc, varied_snmp
from tests.fuzz.mutate import mutated, random_octets, variation

__all__ = ["Attacker", "Prey", "Shot"]

MAC, IP = bytes.fromhex("020000666601"), IPv4Address("10.77.1.66")
OWN_UUID = UUID("66666666-0000-4000-8000-000000000001")
OWN_OBJECT = UUID("dea00000-6c97-11d1-8271-006600660066")
#: Octets of UDP data in one frame, and of an RPC body in one PDU.
DATAGRAM, BODY = 1472, 1384
#: Submodules of a drive: api, slot, subslot.
PLACES = ((0, 0, 1), (0, 0, 0x8000), (0, 0, 0x8001), (0x3A00, 1, 1), (0x3A00, 1, 2))
#: Records with what may be in them: the name of a layer of the corpus.
RECORDS = (
    (0xAFF1, "record"), (0xAFF2, "block-0022"), (0xAFF3, "record"), (47, "base-request"), (0xB02E, "base-request"),
    (0x801E, "record"), (0x802B, "pdev"), (0x802F, "pdev"), (0x8071, "pdev"), (0x8090, "record"), (0xE040, "record"),
    (0x80B0, "record"), (0xE050, "record"), (0xB050, "record"), (0xB060, "record"),
    *((index, "record") for index in (0xF841, 0xF842, 0xF80C, 0xF830, 0xF820, 0xE002, 0x8028, 0x8029, 0xFBFF, 0xF831)),
)  # fmt: skip
#: What is kept of inputs that met something new.
KEPT = 2000


@dataclass(frozen=True)
class Prey:
    """One station that is shot at. ``live`` are the UUIDs of its connections; ``references`` of its alarm channels."""

    name: str
    mac: bytes
    ip: IPv4Address
    object_uuid: UUID
    is_drive: bool
    live: Callable[[], Sequence[UUID]]
    references: Callable[[], tuple[int, int]]
    cyclic: Callable[[], bytes]


@dataclass(frozen=True)
class Shot:
    """``frames`` for the switch, ``cyclic`` ones for the engine behind it."""

    kind: str
    prey: Prey
    frames: tuple[bytes, ...] = ()
    cyclic: tuple[bytes, ...] = ()

    def __str__(self) -> str:
        octets = [frame.hex() for frame in (*self.frames, *self.cyclic)]
        return f"{self.kind} at {self.prey.name}: {' '.join(octets)}"


def may_end_connections(frame: bytes, name: str) -> bool:
    """Whether a DCP Set does what ends a device's connections by right: another name, no address, a reset."""
    try:
        ether = parse_ethernet(frame)
        pdu = parse_dcp(ether.payload)
    except DecodeError:
        return False
    if ether.ethertype != ETHERTYPE_PROFINET or pdu.service_id != SERVICE_SET:
        return False
    for block in pdu.blocks:
        match block:
            case NameBlock(name=wanted):
                if wanted != name and (not wanted or check_station_name(wanted) is None):
                    return True
            case (
                IpParameterBlock(address=address, mask=mask, gateway=gateway)
                | FullIpSuiteBlock(address=address, mask=mask, gateway=gateway)
            ):
                if int(address) == 0 and check_ip_suite(address, mask, gateway) is None:
                    return True
            case FactoryResetBlock():
                return True
            case ResetToFactoryBlock(mode=mode):
                if mode in RESET_MODES:
                    return True
            case _:
                pass
    return False


def _swapped(octets: bytes, changes: Iterable[tuple[bytes, bytes]]) -> bytes:
    for old, new in changes:
        octets = octets.replace(old, new)
    return octets


def _rewrapped(frame: bytes, changes: Iterable[tuple[bytes, bytes]]) -> bytes:
    """The frame with other addresses in it, its checksums right again where it is whole."""
    frame = _swapped(frame, changes)
    try:
        ether = parse_ethernet(frame)
        if ether.ethertype != ETHERTYPE_IPV4:
            return frame
        packet = parse_ipv4(ether.payload, verify_checksum=False)
        if packet.protocol == UDP and not packet.more_fragments and not packet.fragment_offset:
            datagram = parse_udp(packet.payload)
            packet = replace(packet, payload=emit_udp(datagram, packet.source, packet.destination))
        return emit_ethernet(replace(ether, payload=emit_ipv4(packet)))
    except (DecodeError, ValueError):
        return frame


class Attacker:
    """``next_shot`` for ever; what ``keep`` is told of becomes a start for others."""

    def __init__(self, rng: Random, corpus: Corpus, preys: Sequence[Prey], controller: Prey, *, impostor: bool) -> None:
        self.rng = rng
        self.impostor = impostor
        self.preys = preys
        self.controller = controller
        self.kept: deque[tuple[str, bytes]] = deque(maxlen=KEPT)
        self.mac = controller.mac if impostor else MAC
        self.ip = controller.ip if impostor else IP
        self.known = corpus.ar_uuids
        #: What is the corpus' controller's becomes this station's own.
        disguise = [
            (corpus.controller_mac, self.mac),
            (corpus.controller_ip.packed, self.ip.packed),
        ]
        if not impostor:
            disguise += [(uuid, OWN_UUID.bytes) for uuid in self.known]
            disguise += [(uuid.bytes, OWN_OBJECT.bytes) for uuid in corpus.controller_objects]
            disguise += [(uuid.bytes_le, OWN_OBJECT.bytes_le) for uuid in corpus.controller_objects]
        self.layers = {
            name: [_swapped(octets, disguise) for octets in pool]
            for name, pool in corpus.layers.items()
            if name != "frame"
        }
        self.layers["ipv4"] = [
            _rewrapped(bytes(12) + b"\x08\0" + octets, disguise)[14:] for octets in self.layers["ipv4"]
        ]
        self.to_drive = [_rewrapped(frame, disguise) for frame in corpus.to_drive]
        self.to_controller = [_rewrapped(frame, disguise) for frame in corpus.to_controller]
        self.corpus = corpus
        self._access = self._access_calls()
        weights = {
            self.frame: 4, self.dcp: 2, self.lldp: 1, self.arp: 1, self.ip_packet: 2, self.rpc: 4, self.call: 5,
            self.record: 3, self.mapper: 1, self.rta: 2, self.snmp: 2, self.cyclic: 2, self.again: 4,
        }  # fmt: skip
        self.makers = [maker for maker, weight in weights.items() for _ in range(weight)]

    def _access_calls(self) -> list[tuple[int, bytes]]:
        """A supervisor's own connections, acyclic and taking over, for what is possible behind a Connect."""
        found = []
        for payload in self.layers["request-0"]:
            blocks = parse_blocks(payload)
            head = next(block for block in blocks if isinstance(block, ArBlockReq))
            mine = replace(head, ar_uuid=OWN_UUID, initiator_object_uuid=OWN_OBJECT, ar_type=ArType.IOSAR)
            access = replace(mine, properties=head.properties | ArProperties.DEVICE_ACCESS)
            others = [mine if block is head else block for block in blocks]
            found += [(Opnum.CONNECT, emit_blocks([access])), (Opnum.CONNECT, emit_blocks(others))]
        return found

    # -- one shot ----------------------------------------------------------------------------------------------------

    def next_shot(self) -> Shot:
        rng = self.rng
        while True:
            prey = rng.choice(self.preys) if rng.random() < 0.85 else self.controller
            maker = rng.choice(self.makers)
            shot = maker(prey)
            if shot is None:
                continue
            if not self.impostor and any(may_end_connections(frame, prey.name) for frame in shot.frames):
                continue
            return shot

    def keep(self, shot: Shot) -> None:
        self.kept.extend((shot.kind, frame) for frame in shot.frames if shot.kind != "cyclic")

    def _sent(self, kind: str, prey: Prey, *frames: bytes) -> Shot:
        """A stranger cannot help to show its own address, whatever its input was."""
        if not self.impostor:
            frames = tuple(frame[:6] + self.mac + frame[12:] for frame in frames)
        return Shot(kind, prey, frames)

    def _ether(self, prey: Prey, ethertype: int, payload: bytes, destination: bytes = b"") -> bytes:
        return emit_ethernet(EthernetFrame(destination or prey.mac, self.mac, ethertype, payload[:1500]))

    def _at(self, prey: Prey, octets: bytes) -> bytes:
        """For this prey instead of the corpus' one, and about its own connections if the attacker knows them."""
        live = prey.live() if self.impostor else ()
        if live:
            uuid = self.rng.choice(live).bytes
            octets = _swapped(octets, [(known, uuid) for known in self.known])
        return octets

    def _frame_at(self, prey: Prey, frame: bytes) -> bytes:
        changes = [(self.corpus.drive_mac, prey.mac), (self.corpus.drive_ip.packed, prey.ip.packed)]
        live = prey.live() if self.impostor else ()
        if live:
            uuid = self.rng.choice(live).bytes
            changes += [(known, uuid) for known in self.known]
        return _rewrapped(frame, changes)

    def _udp(self, prey: Prey, port: int, data: bytes) -> list[bytes]:
        """In fragments when it is long; sometimes one of them is missing or comes twice."""
        rng = self.rng
        octets = emit_udp(UdpDatagram(rng.choice((RPC_PORT, 49152, 49153, 50000)), port, data), self.ip, prey.ip)
        packet = Ipv4Packet(self.ip, prey.ip, UDP, octets, identification=rng.randrange(1 << 16))
        if len(data) <= DATAGRAM:
            return [self._ether(prey, ETHERTYPE_IPV4, emit_ipv4(packet))]
        pieces = [octets[i : i + 1480] for i in range(0, len(octets), 1480)]
        frames = [
            self._ether(
                prey,
                ETHERTYPE_IPV4,
                emit_ipv4(replace(packet, payload=piece, fragment_offset=1480 * n, more_fragments=n + 1 < len(pieces))),
            )
            for n, piece in enumerate(pieces)
        ]
        if rng.random() < 0.3:
            rng.shuffle(frames)
            frames = frames[: rng.randrange(1, len(frames) + 1)]
        return frames

    # -- kinds -------------------------------------------------------------------------------------------------------

    def frame(self, prey: Prey) -> Shot:
        pool = self.to_drive if prey.is_drive else self.to_controller
        if self.rng.random() < 0.1:
            pool = self.to_controller if prey.is_drive else self.to_drive
        frame = self._frame_at(prey, self.rng.choice(pool))
        if self.rng.random() < 0.5:
            frame = prey.mac + frame[6:]
        return self._sent("frame", prey, deep(self.rng, frame, pool))

    def again(self, prey: Prey) -> Shot | None:
        """Something like an input that met something new."""
        if not self.kept:
            return None
        kind, frame = self.rng.choice(self.kept)
        kind = kind.removesuffix(" again")
        return self._sent(f"{kind} again", prey, deep(self.rng, self._frame_at(prey, frame), self.to_drive))

    def dcp(self, prey: Prey) -> Shot:
        octets = variation(self.rng, self.layers["dcp"])
        destination = self.rng.choice((b"", b"", IDENTIFY_MULTICAST))
        return self._sent("dcp", prey, self._ether(prey, ETHERTYPE_PROFINET, octets, destination))

    def lldp(self, prey: Prey) -> Shot:
        octets = variation(self.rng, self.layers["lldp"])
        return self._sent("lldp", prey, self._ether(prey, ETHERTYPE_LLDP, octets, LLDP_MULTICAST))

    def arp(self, prey: Prey) -> Shot:
        rng = self.rng
        if rng.random() < 0.4:
            payload = variation(rng, self.layers["arp"])
        else:
            # the drive's own address among them: a conflict, against which it defends itself
            sender, target = (rng.choice((self.ip, prey.ip, IPv4Address(0))) for _ in range(2))
            payload = emit_arp(
                ArpPacket(rng.choice((1, 2)), self.mac, sender, rng.choice((bytes(6), prey.mac)), target)
            )
        return self._sent("arp", prey, self._ether(prey, ETHERTYPE_ARP, payload, rng.choice((b"", BROADCAST))))

    def ip_packet(self, prey: Prey) -> Shot | None:
        rng = self.rng
        packet = parse_ipv4(rng.choice(self.layers["ipv4"]), verify_checksum=False)
        packet = replace(
            packet,
            source=self.ip,
            destination=prey.ip,
            payload=mutated(rng, packet.payload, self.layers["udp"])[:1480],
            identification=rng.randrange(4),
            more_fragments=rng.random() < 0.4,
            fragment_offset=8 * rng.choice((0, 0, 1, 2, 185, 8191)),
        )
        try:
            octets = emit_ipv4(packet)
        except ValueError:
            octets = random_octets(rng)
        return self._sent("ip", prey, self._ether(prey, ETHERTYPE_IPV4, octets))

    def rpc(self, prey: Prey) -> Shot:
        """PDUs of every type, wrong in the head, in the body, in one block."""
        rng = self.rng
        data = self._at(prey, rng.choice(self.layers["rpc"]))
        try:
            data = about_a_call(
                rng, deep_rpc(rng, data, self.layers["rpc"], rng.choice((4, 5, 6))), self._endpoint(prey)
            )
        except (DecodeError, ValueError):
            data = variation(rng, self.layers["rpc"])
        return self._sent("rpc", prey, *self._udp(prey, self._port(prey), data))

    def _endpoint(self, prey: Prey) -> tuple[UUID, UUID]:
        return (UUID_PNIO_DEVICE if prey.is_drive else UUID_PNIO_CONTROLLER, prey.object_uuid)

    def _port(self, prey: Prey) -> int:
        return self.rng.choice((RPC_PORT,) * 8 + ((49152,) if prey.is_drive else (49153,)))

    def call(self, prey: Prey) -> Shot:
        """Calls whose RPC is in order, with blocks that are not: Connect, Release, Read, Write, Control."""
        rng = self.rng
        opnum = rng.choice((0, 0, 1, 2, 3, 3, 4, 4, 5)) if prey.is_drive else Opnum.CONTROL
        if prey.is_drive and rng.random() < 0.1:
            opnum, payload = rng.choice(self._access)
        else:
            pool = self.layers[f"request-{opnum}"]
            payload = self._at(prey, rng.choice(pool))
            if rng.random() < 0.85:
                payload = deep_blocks(rng, payload, pool, rng.choice((5, 6, 6)))
        if rng.random() < 0.05:
            opnum = rng.choice((0, 1, 2, 3, 4, 5, 6, 255))
        little = rng.random() < 0.7
        room = rng.choice((0, 200, 4096, 65536, 0xFFFFFFFF))
        body = emit_request_args(RequestArgs(room, payload), little_endian=little)
        interface, target = self._endpoint(prey)
        if rng.random() < 0.02:
            interface = UUID_EPM
        head = RpcPdu(
            PacketType.REQUEST, interface, UUID(bytes=rng.randbytes(16)), target,
            sequence=rng.choice((0, 0, 1, 0xFFFFFFFF)), opnum=opnum,
            drep=bytes((0x10 if little else 0, 0, 0)), flags1=rng.choice((0, 0x20, 0x20, 0x08)),
        )  # fmt: skip
        return self._sent("call", prey, *self._pdus(prey, head, body))

    def record(self, prey: Prey) -> Shot | None:
        """Records of every kind, read and written in right and wrong places, under a connection that may be open."""
        rng = self.rng
        if not prey.is_drive:
            return None
        uuids = prey.live() if self.impostor else (OWN_UUID,)
        uuid = rng.choice((*uuids, OWN_UUID))
        api, slot, subslot = rng.choice(PLACES) if rng.random() < 0.9 else (0, rng.getrandbits(4), rng.getrandbits(16))
        index, pool = rng.choice(RECORDS)
        if rng.random() < 0.1:
            index = rng.getrandbits(16)
        data = rng.choice(self.layers[pool])
        if rng.random() < 0.6:
            data = deep_blocks(rng, data, self.layers[pool], rng.choice((5, 6)))
        opnum = rng.choice((Opnum.READ, Opnum.READ_IMPLICIT, Opnum.WRITE, Opnum.WRITE))
        if opnum == Opnum.WRITE:
            payload = emit_write_request(IodWriteReqHeader(1, uuid, api, slot, subslot, index), data)
        else:
            asked = NIL_UUID if opnum == Opnum.READ_IMPLICIT else uuid
            payload = IodReadReqHeader(1, asked, api, slot, subslot, index, rng.choice((0, 64, 8192))).emit()
        body = emit_request_args(RequestArgs(65536, payload), little_endian=True)
        interface, target = self._endpoint(prey)
        head = RpcPdu(PacketType.REQUEST, interface, UUID(bytes=rng.randbytes(16)), target, opnum=opnum, flags1=0x20)
        return self._sent("record", prey, *self._pdus(prey, head, body))

    def mapper(self, prey: Prey) -> Shot:
        """Lookups, and what else the endpoint mapper may be asked."""
        rng = self.rng
        body = variation(rng, self.layers["epm"])
        pdu = RpcPdu(
            PacketType.REQUEST, UUID_EPM, UUID(int=rng.randrange(1, 20)), NIL_UUID, sequence=rng.getrandbits(32),
            opnum=rng.choice((2, 2, 2, 3, 4, 5, 6)), body=body, flags1=0x20, interface_version=3,
            drep=bytes((rng.choice((0x10, 0)), 0, 0)),
        )  # fmt: skip
        return self._sent("mapper", prey, *self._udp(prey, RPC_PORT, emit_rpc(pdu)))

    def _pdus(self, prey: Prey, head: RpcPdu, body: bytes) -> list[bytes]:
        if len(body) <= BODY:
            return self._udp(prey, RPC_PORT, emit_rpc(replace(head, body=body)))
        frames = []
        pieces = [body[i : i + BODY] for i in range(0, len(body), BODY)]
        for number, piece in enumerate(pieces):
            flags = Flags1.FRAGMENT | (Flags1.LAST_FRAGMENT if number + 1 == len(pieces) else 0)
            pdu = replace(head, flags1=int(flags), fragment_number=number, body=piece)
            frames += self._udp(prey, RPC_PORT, emit_rpc(pdu))
        if self.rng.random() < 0.3:
            self.rng.shuffle(frames)
        return frames

    def rta(self, prey: Prey) -> Shot:
        """Alarms, acknowledgements and errors with right and wrong references and numbers."""
        rng = self.rng
        octets = rng.choice(self.layers["rta"])
        try:
            pdu = parse_rta(octets)
            local, remote = prey.references() if rng.random() < 0.8 else (rng.getrandbits(16), rng.getrandbits(16))
            alarm = AlarmNotification(
                rng.randrange(1, 32), rng.choice((0, 0x3A00)), rng.randrange(2), rng.randrange(3),
                specifier=rng.randrange(4), high=pdu.frame_id == ALARM_HIGH,
            )  # fmt: skip
            numbers = (0xFFFF, 0xFFFE, 0, 1, 2, pdu.send_sequence, pdu.ack_sequence, rng.getrandbits(16))
            pdu = replace(
                pdu, frame_id=rng.choice((ALARM_LOW, ALARM_HIGH)), destination=local, source=remote,
                pdu_type=0x10 | rng.choice((1, 1, 1, 2, 3, 3, 4, rng.randrange(16))),
                add_flags=rng.choice((0x11, 0x01, 0)),
                send_sequence=rng.choice(numbers), ack_sequence=rng.choice(numbers),
                body=rng.choice((pdu.body, b"", alarm.emit(), acknowledge(alarm).emit())),
            )  # fmt: skip
            octets = pdu.emit()
        except (DecodeError, ValueError):
            pass
        if rng.random() < 0.4:
            octets = mutated(rng, octets, self.layers["rta"])
        return self._sent("rta", prey, self._ether(prey, ETHERTYPE_PROFINET, octets))

    def snmp(self, prey: Prey) -> Shot:
        return self._sent("snmp", prey, *self._udp(prey, 161, varied_snmp(self.rng, self.layers["snmp"])))

    def cyclic(self, prey: Prey) -> Shot | None:
        """Frames of its own channel: wrong in length, source, counter, status or octets."""
        rng = self.rng
        frame = bytearray(prey.cyclic())
        if len(frame) < 24:
            return None
        match rng.randrange(6):
            case 0:
                del frame[rng.randrange(len(frame)) :]
            case 1:
                frame += rng.randbytes(rng.randrange(1, 900))
            case 2:
                frame[-4:] = rng.randbytes(4)
            case 3:
                frame[12:18] = rng.randbytes(6)
            case 4:
                frame[:] = mutated(rng, bytes(frame), [bytes(frame)])[:1530]
            case _:
                pass
        octets = bytes(frame)
        if not self.impostor or rng.random() < 0.3:
            octets = (
                octets[:6] + (self.mac if rng.random() < 0.7 or not self.impostor else rng.randbytes(6)) + octets[12:]
            )
        return Shot("cyclic", prey, (), (octets,))


def signature(frame: bytes) -> tuple[object, ...]:
    """What kind of answer a frame is: a new one means that an input met something new."""
    try:
        ether = parse_ethernet(frame)
        if ether.ethertype != ETHERTYPE_IPV4:
            return (ether.ethertype, ether.payload[:4], ether.payload[14:20] if ether.payload[:1] == b"\xfe" else b"")
        packet = parse_ipv4(ether.payload)
        if packet.protocol != UDP:
            return (packet.protocol,)
        pdu = parse_rpc(parse_udp(packet.payload).data)
    except DecodeError:
        return ("other",)
    return (pdu.kind, pdu.opnum, pdu.body[:4])
