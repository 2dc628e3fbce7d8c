"""Every record of a device in the eyes of Wireshark, from a capture that was never on a wire."""

from dataclasses import replace
from ipaddress import IPv4Address
from uuid import UUID

import pytest
from cm_support import CONTROLLER_MAC, DEVICE_MAC, DRIVE, DRIVE_API, UUID_1, Bench
from record_support import DIAGNOSES, SEVERAL_CARRIERS
from wireshark import tshark, tshark_fields

from pnfarm.links.capture.pcap import PcapngWriter
from pnfarm.protocols.profinet.records.store import IoData
from pnfarm.protocols.profinet.wire.records.identification import ImText, SubstituteValue
from pnfarm.protocols.profinet.wire.records.iod import IodReadReqHeader, IodWriteReqHeader, emit_write_request
from pnfarm.protocols.profinet.wire.rpc.pdu import (
    PacketType,
    RequestArgs,
    ResponseArgs,
    RpcPdu,
    emit_request_args,
    emit_response_args,
    emit_rpc,
    object_uuid,
)
from pnfarm.wire.ethernet import EthernetFrame, emit_ethernet
from pnfarm.wire.ipv4 import Ipv4Packet, emit_ipv4
from pnfarm.wire.udp import UdpDatagram, emit_udp

DEVICE_INTERFACE = UUID("dea00001-6c97-11d1-8271-00a02442df7d")
CONTROLLER_IP, DEVICE_IP = IPv4Address("10.0.0.1"), IPv4Address("10.0.0.2")
READ, WRITE = 2, 3
WARNING = 0x600000
AXIS = (DRIVE_API, 1, 2)
DAP = (0, 0, 1)
DIAGNOSIS = (0x0A, 0x0B, 0x0C, 0x10, 0x11, 0x12, 0x13)
READS = [
    *((index, DAP) for index in range(0xAFF0, 0xAFF5)),
    *((index, DAP) for index in (0xF840, 0xF820, 0xF821, 0xF830, 0xF80C, 0xFBFF)),
    *((index, place) for index in (0x8000, 0x8001, 0xC000, 0xC001, 0xF000, 0xF020) for place in (DAP, AXIS)),
    *((index, AXIS) for index in (0xE000, 0xE001, 0xE002, 0x801E, 0x8028, 0x8029)),
    *((base | n, place) for base in (0x8000, 0xC000, 0xE000, 0xF000) for n in DIAGNOSIS for place in (DAP, AXIS)),
    (0x800B, (DRIVE_API, 1, 1)), (0x800C, (DRIVE_API, 1, 1)), (0x800C, (0, 0, 0x8001)),
]  # fmt: skip


pytestmark = pytest.mark.interop


def tshark_tree(path, number):
    """One frame in full, for a failing test's message."""
    return tshark(path, "-V", "-x", "-Y", f"frame.number=={number}")


class Tape:
    """Both directions of each call, as frames in a file."""

    def __init__(self, path):
        self._writer = PcapngWriter(path)
        self._interface = self._writer.add_interface("records")
        self._count = 0

    def call(self, opnum, request, status, answer):
        self._count += 1
        pdu = RpcPdu(
            PacketType.REQUEST,
            DEVICE_INTERFACE,
            UUID(int=self._count),
            object_uuid=object_uuid(1, DRIVE.device_id, DRIVE.vendor_id),
            opnum=opnum,
            body=emit_request_args(RequestArgs(8192, request), little_endian=True),
        )
        self._put(pdu, CONTROLLER_MAC, DEVICE_MAC, CONTROLLER_IP, DEVICE_IP)
        body = emit_response_args(ResponseArgs(status, answer, 8192), little_endian=True)
        response = replace(pdu, packet_type=PacketType.RESPONSE, body=body)
        self._put(response, DEVICE_MAC, CONTROLLER_MAC, DEVICE_IP, CONTROLLER_IP)

    def _put(self, pdu, source, destination, source_ip, destination_ip):
        datagram = emit_udp(UdpDatagram(34964, 34964, emit_rpc(pdu)), source_ip, destination_ip)
        packet = emit_ipv4(Ipv4Packet(source_ip, destination_ip, 17, datagram))
        frame = emit_ethernet(EthernetFrame(destination, source, 0x0800, packet))
        self._writer.write(self._interface, frame, self._count * 1_000_000, "out")

    def close(self):
        self._writer.close()


@pytest.fixture(scope="module")
def tape(tmp_path_factory):
    bench = Bench(SEVERAL_CARRIERS, io_data=lambda _slot, _subslot, _output: IoData(bytes(range(12)), 0x80, 0x80))
    bench.establish()
    for event in bench.events():
        bench.records.log_book.note(event, 1_000_000_000)
    for entry in DIAGNOSES:
        bench.records.diagnosis.add(entry)
    path = tmp_path_factory.mktemp("records") / "records.pcapng"
    made = Tape(path)
    for index, (api, slot, subslot), block in (
        (0xAFF1, DAP, ImText(0x21, b"pump".ljust(54))),
        (0xAFF2, DAP, ImText(0x22, b"2026-01-31 10:00")),
        (0x801E, AXIS, SubstituteValue(2, 0x80, bytes(12), 0x80)),
    ):
        request = emit_write_request(IodWriteReqHeader(5, UUID_1, api, slot, subslot, index), block.emit())
        status, answer = bench.call(WRITE, request, 8192)
        assert status.ok, (hex(index), status)
        made.call(WRITE, request, status, answer)
    for index, (api, slot, subslot) in READS:
        request = IodReadReqHeader(5, UUID_1, api, slot, subslot, index, 4096).emit()
        status, answer = bench.call(READ, request, 8192)
        assert status.ok, (hex(index), status)
        made.call(READ, request, status, answer)
    made.close()
    return path


#: Wireshark 4.0 reads one block of these and calls the others a long frame; of 0x800A to 0x800C it reads them all.
ONE_BLOCK_READ = {f"0x{base | n:04x}" for base in (0x8000, 0xC000, 0xE000, 0xF000) for n in range(0x10, 0x14)}


def test_no_record_is_malformed_or_worth_a_warning(tape):
    names = "frame.number", "_ws.malformed", "_ws.expert.severity", "_ws.expert.message", "pn_io.index"
    rows = tshark_fields(tape, *names)
    assert len(rows) == 2 * (len(READS) + 3)
    bad = [
        row
        for row in rows
        if row[1]
        or (
            any(int(s) >= WARNING for s in row[2].split(",") if s)
            and not (row[3] == "Long frame" and row[4] in ONE_BLOCK_READ)
        )
    ]
    assert not bad, f"{bad[:5]}\n{tshark_tree(tape, bad[0][0])}"


def test_nothing_of_a_record_is_left_undissected(tape):
    left = tshark_fields(tape, "frame.number", "pn_io.index", where="pn.undecoded_data || data")
    assert not left, f"{left}\n{tshark_tree(tape, left[0][0])}"


def test_the_diagnosis_reads_as_it_was_meant(tape):
    usi, error, severity = "user_structure_identifier", "channel_error_type", "channel_properties.maintenance"
    (row,) = tshark_fields(
        tape,
        *(f"pn_io.{name}" for name in (usi, error, severity, "qualified_channel_qualifier")),
        where="pn_io.index==0xf80c && pn_io.block_type==0x8009",
    )
    usis, errors, severities, qualifiers = row
    assert usis.split(",") == ["0x8002", "0x8000", "0x8003", "0x8000"]  # the manufacturer's stands elsewhere
    assert [int(e, 0) for e in errors.split(",")] == [0x8000, 5, 6, 8, 9, 7]
    assert {int(s, 0) for s in severities.split(",")} == {0, 1, 2, 3}
    assert [int(q, 0) for q in qualifiers.split(",")] == [0x0800_0088, 8]


def test_the_log_and_the_identification_too(tape):
    (log,) = tshark_fields(
        tape, "pn_io.actual_local_time_stamp", "pn_io.local_time_stamp", "pn_io.ar_uuid", where="pn_io.local_time_stamp"
    )
    assert (log[1], log[2].split(",")[-1]) == ("1000000000", str(UUID_1))
    listed = tshark_fields(tape, "pn_io.block_type", where="pn_io.block_type==0x0032")
    assert listed[0][0].split(",")[-3:] == ["0x0030", "0x0031", "0x0032"]
    tags = tshark_fields(tape, "pn_io.im_tag_function", where="pn_io.im_tag_function && udp.length > 200")
    assert tags[0][0].strip() == "pump"
