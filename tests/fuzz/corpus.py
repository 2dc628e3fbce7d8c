"""Good input to start from: what a farm and its controller say to each other, and what real controllers said.

A *layer* is a kind of octets (an Ethernet frame, an RPC PDU, a block of one type ...); the corpus holds some of each.
"""

from __future__ import annotations

import struct
from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from ipaddress import IPv4Address
from pathlib import Path
from uuid import UUID

from drive_object_gsdml import drive_object_gsdml
from gsdml_versions import VERSIONS, gsdml_of
from virtual_line import VirtualLine

from pnfarm.buses.profinet.device.modules import plug_module, pull_module
from pnfarm.buses.profinet.model_gsdml import describe_model
from pnfarm.drives import catalogue
from pnfarm.drives.profiles.profidrive import base_mode
from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.diagnosis import DiagnosisEntry
from pnfarm.protocols.profinet.gsdml.writer import emit_gsdml
from pnfarm.protocols.profinet.lldp.agent import LocalPort, LocalSystem, local_lldpdu
from pnfarm.protocols.profinet.wire.alarms.notification import AlarmItem, AlarmType
from pnfarm.protocols.profinet.wire.any_block import parse_blocks
from pnfarm.protocols.profinet.wire.block import Block, BlockType, RawBlock, split_blocks
from pnfarm.protocols.profinet.wire.cm import connect
from pnfarm.protocols.profinet.wire.dcp.blocks import (
    DeviceIdBlock,
    IpParameterBlock,
    NameBlock,
    OptionId,
    ResponseBlock,
    StationTypeBlock,
    UnknownBlock,
)
from pnfarm.protocols.profinet.wire.dcp.pdu import (
    SERVICE_GET,
    SERVICE_IDENTIFY,
    SERVICE_SET,
    TYPE_REQUEST,
    TYPE_SUCCESS,
    DcpPdu,
    emit_dcp,
    frame_id_of,
)
from pnfarm.protocols.profinet.wire.frame_id import DCP_HELLO, DCP_IDENTIFY_RESPONSE
from pnfarm.protocols.profinet.wire.lldp import tlvs
from pnfarm.protocols.profinet.wire.lldp.pdu import Lldpdu, NameMode, emit_lldp
from pnfarm.protocols.profinet.wire.records import identification, pdev
from pnfarm.protocols.profinet.wire.records import pdev_port as wanted
from pnfarm.protocols.profinet.wire.records.diagnosis import Maintenance, Usi
from pnfarm.protocols.profinet.wire.records.iod import parse_read_response, parse_write_request
from pnfarm.protocols.profinet.wire.rpc.bodies import FackBody
from pnfarm.protocols.profinet.wire.rpc.epm import (
    EntryHandle,
    EptEntry,
    HandleFreed,
    LookupRequest,
    LookupResponse,
    Tower,
    emit_lookup_request,
    emit_lookup_response,
    emit_tower,
)
from pnfarm.protocols.profinet.wire.rpc.pdu import (
    RPC_PORT,
    UUID_EPM,
    Opnum,
    PacketType,
    parse_request_args,
    parse_response_args,
    parse_rpc,
)
from pnfarm.protocols.profinet.wire.snmp import message
from pnfarm.protocols.profinet.wire.snmp.ber import emit_oid
from pnfarm.wire.arp import ArpPacket, emit_arp
from pnfarm.wire.ethernet import ETHERTYPE_LLDP, ETHERTYPE_PROFINET, parse_ethernet
from pnfarm.wire.icmp import IcmpMessage, emit_icmp
from pnfarm.wire.ipv4 import Ipv4Packet, emit_ipv4, parse_ipv4
from pnfarm.wire.udp import parse_udp

__all__ = ["BASE_MODE", "CAPTURES", "Conversation", "Corpus", "gather", "layers"]

CAPTURES = Path(__file__).resolve().parents[2].parent / "shared" / "captures"
#: Frames of each capture that are kept; cyclic ones hardly differ.
CYCLIC_KEPT = 20
PARAMETERS = (
    "01010001 1005 03c4 0000", "01020002 1001 03a8 0000 1001 03b3 0000", "02030001 1001 03c4 0000 4201 0001",
    "02040001 1001 0393 0000 4202 0001 0005", "01050001 2000 03c4 0000", "01060001 3001 03c4 0000",
    "01070001 1001 ffff 0000",
)  # fmt: skip
BASE_MODE = tuple(bytes.fromhex(text) for text in PARAMETERS)
RECORDS = (
    0xAFF0,
    0xF000,
    0xF820,
    0xF821,
    0xF830,
    0xF840,
    0xE000,
    0xE001,
    0xE002,
    0xE010,
    0xE050,
    0xC000,
    0x8000,
    0x8028,
    0x8029,
    0x801E,
    0xF80C,
)


class Conversation:
    """A drive and its controller in virtual time; ``frames`` are all acyclic ones, ``(to the drive, octets)``."""

    def __init__(self, startup: str) -> None:
        self.line = VirtualLine(1, cycle="4ms", limits="lax", watchdog=100, startup=startup)
        self.frames: list[tuple[bool, bytes]] = []
        self._tap(self.line.plc.link, to_drive=True)
        self._tap(self.line.farm.link, to_drive=False)
        self.line.connect()
        self._access_records()
        self.line.run(0.3)
        self._tell_alarms()
        self._move_modules()

    def end(self) -> None:
        """The drive aborts, the controller connects again and releases."""
        line = self.line
        station, now = line.farm.axes[0], line.world.now
        station.device.cm.abort_all(5, now)
        line.farm.settle(station.station, now)
        line.run(2.0)
        line.plc.release(line.world.now)
        line.run(1.0)

    def _tell_alarms(self):
        """A diagnosis of each coding comes and goes, and an alarm of high priority."""
        station = self.line.farm.axes[0]
        place = (0x3A00, 1, 2)
        entries = (
            DiagnosisEntry(*place, error_type=0x10),
            DiagnosisEntry(*place, Usi.EXT_CHANNEL, 1, error_type=0x8000, ext_error_type=0x8001, ext_add_value=7),
            DiagnosisEntry(
                *place, Usi.QUALIFIED_CHANNEL, 2, error_type=0x11, ext_error_type=1,
                maintenance=Maintenance.QUALIFIED, qualifier=1 << 27,
            ),
            DiagnosisEntry(*place, 0x1234, data=b"maker"),
        )  # fmt: skip
        for change in (station.device.cm.diagnosis.add, station.device.cm.diagnosis.remove):
            for entry in entries:
                change(entry)
                self._settled(station)
        station.device.cm.alarm(
            AlarmType.PROCESS, place, self.line.world.now, items=(AlarmItem(0x4321, b"12"),), high=True
        )
        self._settled(station)

    def _move_modules(self):
        """A submodule and a whole module are pulled and plugged again."""
        station = self.line.farm.axes[0]
        for subslot in (2, None):
            pull_module(station.device, 1, subslot, self.line.world.now)
            self._settled(station)
            plug_module(station.device, 1, self.line.world.now)
            self._settled(station)

    def _settled(self, station):
        self.line.farm.settle(station.station, self.line.world.now)
        self.line.run(0.05)

    def untap(self) -> None:
        """Record no more."""
        for node in (self.line.plc, self.line.farm):
            del node.link.send

    def _tap(self, link, *, to_drive):
        send = link.send

        def recorded(port, frame):
            self.frames.append((to_drive, bytes(frame)))
            send(port, frame)

        link.send = recorded

    def _access_records(self):
        core = self.line.plc
        session = core.sessions[0]
        machine = session.machine

        def asked(call, *arguments):
            call(object(), *arguments)
            core.touch(session, self.line.world.now)
            self.line.run(0.01)

        for octets in BASE_MODE:
            for index in (47, 0xB02E):
                asked(machine.write_record, 0x3A00, 1, 1, index, octets)
                asked(machine.read_record, 0x3A00, 1, 1, index, 4096)
        for index in RECORDS:
            for api, slot, subslot in ((0, 0, 1), (0x3A00, 1, 2)):
                asked(machine.read_record, api, slot, subslot, index, 4096)
                asked(machine.read_implicit, api, slot, subslot, index, 4096)


@dataclass(frozen=True)
class Corpus:
    """Everything to start from, and whose addresses and names are in it."""

    to_drive: tuple[bytes, ...]
    to_controller: tuple[bytes, ...]
    captured: tuple[bytes, ...]
    layers: dict[str, list[bytes]]
    drive_mac: bytes
    drive_ip: IPv4Address
    controller_mac: bytes
    controller_ip: IPv4Address
    controller_objects: tuple[UUID, ...]

    @property
    def ar_uuids(self) -> list[bytes]:
        return self.layers["ar-uuid"]


def gather() -> Corpus:
    """Both start-ups of a farm and its controller, and what the captures hold."""
    to_drive: list[bytes] = []
    to_controller: list[bytes] = []
    for startup in ("legacy", "advanced"):
        talk = Conversation(startup)
        talk.end()
        for is_to_drive, frame in talk.frames:
            (to_drive if is_to_drive else to_controller).append(frame)
    captured = tuple(captured_frames())
    line = talk.line
    found = layers([*to_drive, *to_controller, *captured])
    objects = {
        block.initiator_object_uuid
        for payload in found["request-0"]
        for block in parse_blocks(payload)
        if isinstance(block, connect.ArBlockReq)
    }
    return Corpus(
        tuple(to_drive), tuple(to_controller), captured, found,
        line.farm.axes[0].port.mac, IPv4Address("10.77.0.11"), line.plc.port.mac, IPv4Address("10.77.1.250"),
        tuple(sorted(objects)),
    )  # fmt: skip


def captured_frames() -> Iterator[bytes]:
    """Frames of the captures beside the project; none where there are none."""
    for path in sorted(CAPTURES.glob("*.pcap")) if CAPTURES.is_dir() else ():
        data = path.read_bytes()
        order = "<" if data[:4] in {b"\xd4\xc3\xb2\xa1", b"\x4d\x3c\xb2\xa1"} else ">"
        place, cyclic = 24, 0
        while place + 16 <= len(data):
            (length,) = struct.unpack_from(order + "8xI", data, place)
            frame = data[place + 16 : place + 16 + length]
            place += 16 + length
            alike = b"\x88\x92\x80" in frame[:20]
            cyclic += alike
            if not alike or cyclic <= CYCLIC_KEPT:
                yield frame


def layers(frames: Iterable[bytes]) -> dict[str, list[bytes]]:
    """The octets of every layer in these frames, each once."""
    found: dict[str, dict[bytes, None]] = defaultdict(dict)
    for frame in frames:
        found["frame"][frame] = None
        ether = parse_ethernet(frame)
        if ether.ethertype == ETHERTYPE_PROFINET:
            frame_id = int.from_bytes(ether.payload[:2], "big")
            is_dcp = DCP_HELLO <= frame_id <= DCP_IDENTIFY_RESPONSE
            found["dcp" if is_dcp else "rta" if frame_id >= 0xFC00 else "rtc"][ether.payload] = None
        elif ether.ethertype == ETHERTYPE_LLDP:
            found["lldp"][ether.payload] = None
        elif ether.ethertype == 0x0806:
            found["arp"][ether.payload] = None
        elif ether.ethertype == 0x0800:
            _dig_ip(ether.payload, found)
    found["base-request"].update(dict.fromkeys(BASE_MODE))
    for name, octets in (*unheard(), *_descriptions()):
        found[name][octets] = None
    return {name: list(octets) for name, octets in found.items()}


def unheard() -> Iterator[tuple[str, bytes]]:
    """What neither a farm nor a capture says, but the standard knows: endpoint mapper, blocks of other devices, DCP."""
    drive, other = IPv4Address("10.77.0.11"), IPv4Address("10.77.1.250")
    mac = bytes.fromhex("020000000099")
    for operation in (1, 2):
        yield "arp", emit_arp(ArpPacket(operation, mac, other, bytes(6), drive))
    for data in (b"abcdefgh" * 4, b"x" * 1400):
        echo = emit_icmp(IcmpMessage(8, 0, 1, 1, data))
        yield "icmp", echo
        yield "ipv4", emit_ipv4(Ipv4Packet(other, drive, 1, echo))
    options = (
        NameBlock.ID,
        IpParameterBlock.ID,
        StationTypeBlock.ID,
        DeviceIdBlock.ID,
        OptionId(2, 5),
        OptionId(2, 7),
        OptionId(9, 9),
    )
    everybody = (UnknownBlock(0xFF, 0xFF, b"", None),)
    set_blocks = (
        NameBlock("axis-01", 1),
        IpParameterBlock(drive, IPv4Address("255.255.254.0"), IPv4Address(0), 1),
        UnknownBlock(5, 3, b"\1\0", 0),
    )
    get_blocks = (
        NameBlock("axis-01", 0),
        StationTypeBlock("AKD", 0),
        DeviceIdBlock(0x105, 1, 0),
        ResponseBlock(OptionId(9, 9), 1),
    )
    repair = DcpPdu(frame_id_of(SERVICE_SET, TYPE_REQUEST), SERVICE_SET, TYPE_REQUEST, 4, set_blocks[:2])
    yield "dcp-repair", emit_dcp(repair)
    for pdu in (
        DcpPdu(
            frame_id_of(SERVICE_IDENTIFY, TYPE_REQUEST),
            SERVICE_IDENTIFY,
            TYPE_REQUEST,
            1,
            everybody,
            response_delay_factor=1,
        ),
        DcpPdu(frame_id_of(SERVICE_GET, TYPE_REQUEST), SERVICE_GET, TYPE_REQUEST, 2, requested=options),
        *(
            DcpPdu(frame_id_of(SERVICE_SET, TYPE_REQUEST), SERVICE_SET, TYPE_REQUEST, 3, (block,))
            for block in set_blocks
        ),
        DcpPdu(frame_id_of(SERVICE_SET, TYPE_REQUEST), SERVICE_SET, TYPE_REQUEST, 8, set_blocks),
        repair,
        DcpPdu(frame_id_of(SERVICE_GET, TYPE_SUCCESS), SERVICE_GET, TYPE_SUCCESS, 5, get_blocks),
        DcpPdu(frame_id_of(SERVICE_SET, TYPE_SUCCESS), SERVICE_SET, TYPE_SUCCESS, 6, (ResponseBlock(NameBlock.ID, 0),)),
        DcpPdu(frame_id_of(SERVICE_IDENTIFY, TYPE_SUCCESS), SERVICE_IDENTIFY, TYPE_SUCCESS, 7, get_blocks[:3]),
    ):
        yield "dcp", emit_dcp(pdu)
    handle = EntryHandle(0, UUID(int=7))
    tower = Tower(UUID_EPM, 3, RPC_PORT, IPv4Address("10.77.0.11"))
    entries = (EptEntry(UUID(int=9), tower, "AKD AKD-P00306-NBPN-0000     1 V  1 17  0"),)
    yield "tower", emit_tower(tower)
    for little in (True, False):
        for request in (
            LookupRequest(),
            LookupRequest(object_uuid=None, interface=UUID_EPM),
            LookupRequest(interface=None, handle=handle),
        ):
            yield "epm", emit_lookup_request(request, little_endian=little)
        yield "epm", emit_lookup_response(LookupResponse(handle, entries, 1), little_endian=little)
        yield "epm", handle.emit(little_endian=little)
        yield "epm", HandleFreed(handle, 0).emit(little_endian=little)
        yield "fack", FackBody(4, 1464, 1464, 1).emit(little_endian=little)
    for block in (
        connect.PrmServerBlockReq(UUID(int=3), 1, 600, b"prm-server"),
        connect.PrmServerBlockRes(),
        connect.McrBlockReq(1, 1, 3, b"provider-1"),
        connect.ArRpcBlockReq(49152),
        connect.ArRpcBlockRes(49152),
        connect.ArVendorBlockReq(1, 0, b"vendor"),
        connect.ArVendorBlockRes(1, 0, b"vendor"),
    ):
        raw = split_blocks(block.emit())[0]
        yield f"block-{raw.block_type:04x}", raw.version.to_bytes(2, "big") + raw.body
    yield from _lldp()
    for block in _pdev():
        raw = split_blocks(block.emit())[0]
        yield f"block-{raw.block_type:04x}", raw.version.to_bytes(2, "big") + raw.body
        yield "pdev", block.emit()
    for block_type, size in identification.IM_TEXT_SIZES.items():
        yield f"block-{block_type:04x}", b"\1\0" + b"A" * size
    yield from _managers()


def _descriptions() -> Iterator[tuple[str, bytes]]:
    """Files of makers: the project's own, one of each schema version, and a small one with a little of everything."""
    for name in (name for name, entry in catalogue.models().items() if entry.bus == "profinet"):
        yield "gsdml", emit_gsdml(describe_model(catalogue.model(name))).encode()
    for version in VERSIONS:
        yield "gsdml", gsdml_of(version).encode()
    yield "gsdml", drive_object_gsdml().encode()
    yield "fmu", (Path(__file__).parents[1] / "plant" / "fmu_sources" / "bench.xml").read_bytes()
    yield "gsdml", (Path(__file__).parents[1] / "protocols" / "profinet" / "gsdml_miniature.xml").read_bytes()
    for path in sorted((Path(__file__).parents[2] / "configs" / "gsdml").glob("*.xml")):
        yield "gsdml", path.read_bytes()
    for path in sorted((Path(__file__).parents[2] / "configs" / "gsd").glob("*.gsd")):
        yield "gsd", path.read_bytes()


def _managers() -> Iterator[tuple[str, bytes]]:
    """What SNMP managers ask of a drive."""
    system, interfaces, lldp = (1, 3, 6, 1, 2, 1, 1), (1, 3, 6, 1, 2, 1, 2, 2, 1), (1, 0, 8802, 1, 1, 2, 1)
    names = ((*system, 1, 0), (*system, 3, 0), (*interfaces, 10, 1), (*lldp, 3, 7, 1, 3, 1), (*lldp, 5, 3791), (0, 0))
    texts = tuple(message.VarBind((*system, arc, 0), message.octets(b"here")) for arc in (4, 5, 6))
    values = (
        message.integer(-129), message.counter64(2**64 - 1), message.gauge32(2**32 - 1), message.time_ticks(10**9),
        message.object_id(names[3]), message.Value(message.IP_ADDRESS, b"\12\0\0\1"),
        message.Value(message.END_OF_MIB_VIEW),
    )  # fmt: skip
    asked = tuple(message.VarBind(name) for name in names)
    told = tuple(message.VarBind(names[0], value) for value in values)
    for version in (message.VERSION_1, message.VERSION_2C):
        for pdu in (
            message.Pdu(message.GET, 1, varbinds=asked[:4]),
            message.Pdu(message.GET_NEXT, 2**31 - 1, varbinds=asked),
            message.Pdu(message.GET_BULK, -1, 1, 20, varbinds=asked),
            message.Pdu(message.SET, 3, varbinds=texts),
            message.Pdu(message.RESPONSE, 4, 2, 1, varbinds=told),
            message.OtherPdu(0xA7, b"\2\1\5"),
        ):
            yield "snmp", message.emit_snmp(message.SnmpMessage(version, b"public" if version else b"private", pdu))
    for name in names:
        yield "oid", emit_oid(name)


def _lldp() -> Iterator[tuple[str, bytes]]:
    mac = bytes.fromhex("020000000099")
    system = LocalSystem(mac, "switch-1", "SCALANCE X208", IPv4Address("10.77.0.2"))
    for mode in NameMode:
        for time_to_live in (20, 0):
            pdu = local_lldpdu(replace(system, name_mode=mode), LocalPort(3, mac, "port 3"), time_to_live)
            yield "lldp", emit_lldp(pdu)
    more = (
        tlvs.MeasuredDelays(1, 2, 3, 4, 5),
        tlvs.PortAlias(b"left"),
        tlvs.MrpPortStatus(UUID(int=5), 1),
        tlvs.PtcpStatus(mac, UUID(int=6), UUID(int=7), 1 << 31, 2, 3, 4),
        tlvs.MauTypeExtension(256),
        tlvs.MrpInterconnectionPortStatus(1, 2, 3),
        tlvs.RawTlv(127, b"\0\x80\xc2\1\0\1"),
    )
    yield "lldp", emit_lldp(Lldpdu(tlvs.ChassisId(4, mac), tlvs.PortId(3, mac), 120, more))


def _pdev() -> Iterator[Block]:
    checks = (
        wanted.CheckPeers((wanted.ExpectedPeer(b"port-001", b"plc"),)),
        wanted.CheckLineDelay(100),
        wanted.CheckMauType(16),
        wanted.CheckLinkState(0, 1),
        wanted.CheckSyncDifference(3),
        wanted.CheckMauTypeDifference(1),
    )
    adjusts = (
        wanted.AdjustDomainBoundary(1),
        wanted.AdjustDomainBoundary(1, 2),
        wanted.AdjustMulticastBoundary(1),
        wanted.AdjustMauType(16),
        wanted.AdjustLinkState(0, 1),
        wanted.AdjustPeerToPeerBoundary(1),
        wanted.AdjustDcpBoundary(1),
        wanted.AdjustPreambleLength(0),
    )
    yield pdev.PortDataCheck(0, 0x8001, checks)
    yield pdev.PortDataCheck(0, 0x8001, checks[:1])
    yield pdev.PortDataAdjust(0, 0x8001, adjusts)
    yield pdev.PortDataReal(0, 0x8001, b"port-001", (pdev.PeerReal(b"port-003", b"switch", 0, bytes(6)),), 16)
    yield pdev.PortStatistic(1, 2, 3, 4, 5, 6)
    yield pdev.InterfaceDataReal(b"axis-01", bytes(6), *[IPv4Address("10.77.0.11")] * 3)
    yield pdev.InterfaceAdjust(1)
    inner = split_blocks(pdev.PortStatistic().emit())
    yield pdev.MultipleBlock(0, 0, 0x8001, inner * 2)


def _dig_ip(payload: bytes, found: dict[str, dict[bytes, None]]) -> None:
    found["ipv4"][payload] = None
    packet = parse_ipv4(payload)
    found["icmp" if packet.protocol == 1 else "udp"][packet.payload] = None
    if packet.protocol != 17:
        return
    datagram = parse_udp(packet.payload)
    found["rpc"][datagram.data] = None
    try:
        pdu = parse_rpc(datagram.data)
    except DecodeError:
        return
    found["rpc-body"][pdu.body] = None
    if pdu.interface == UUID_EPM:
        return
    if pdu.kind == PacketType.REQUEST:
        found["request-args"][pdu.body] = None
        payload = parse_request_args(pdu.body, little_endian=pdu.little_endian).payload
        found[f"request-{pdu.opnum}"][payload] = None
        if pdu.opnum == Opnum.WRITE:
            for write in parse_write_request(payload).writes:
                found["record"][write.data] = None
    elif pdu.kind == PacketType.RESPONSE:
        found["response-args"][pdu.body] = None
        payload = parse_response_args(pdu.body, little_endian=pdu.little_endian).payload
        found[f"response-{pdu.opnum}"][payload] = None
        if pdu.opnum in {Opnum.READ, Opnum.READ_IMPLICIT} and payload:
            _dig_record(parse_read_response(payload).data, found)
    else:
        return
    if payload:
        found["blocks"][payload] = None
        _dig_blocks(payload, found)


def _dig_record(data: bytes, found: dict[str, dict[bytes, None]]) -> None:
    found["record"][data] = None
    _dig_blocks(data, found)
    try:
        response = base_mode.parse_response(data)
    except DecodeError:
        return
    if response.response_id & 0x7F in {1, 2}:
        found["base-response"][data] = None


def _keep_block(block: RawBlock, found: dict[str, dict[bytes, None]]) -> None:
    """Its version and its body; a parser of blocks is fed with both."""
    octets = block.version.to_bytes(2, "big") + block.body
    found["block"][octets] = None
    found[f"block-{block.block_type:04x}"][octets] = None


def _dig_blocks(payload: bytes, found: dict[str, dict[bytes, None]]) -> None:
    try:
        blocks = split_blocks(payload)
    except DecodeError:
        return  # records and what follows a header need not be blocks
    for block in blocks:
        _keep_block(block, found)
        if block.block_type == BlockType.AR_REQ:
            found["ar-uuid"][block.body[2:18]] = None
