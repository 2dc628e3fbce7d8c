"""Captures with what real devices and their neighbours do beside the usual: order, padding, other protocols."""

from __future__ import annotations

import struct
from dataclasses import replace
from uuid import UUID

import pytest
from recorded import record
from recorded_farm import FARM, described, under_faults

from pnfarm.buses.registry import decoder as make_decoder
from pnfarm.captures.reading import CapturedFrame, FrameReader
from pnfarm.protocols.profinet.errors import RtaError
from pnfarm.protocols.profinet.wire.alarms.rta import rta_error
from pnfarm.protocols.profinet.wire.ptcp import PtcpPdu, PtcpTlv, TlvType, emit_ptcp
from pnfarm.protocols.profinet.wire.records.iod import IodReadReqHeader
from pnfarm.protocols.profinet.wire.rpc.pdu import (
    UUID_PNIO_DEVICE,
    Opnum,
    PacketType,
    RequestArgs,
    RpcPdu,
    emit_request_args,
    emit_rpc,
)


@pytest.fixture(scope="module")
def start_up(tmp_path_factory):
    """The frames between axis-01 and its controller up to some cyclic ones, by what they are."""
    path = tmp_path_factory.mktemp("capture") / "line-1.pcapng"
    record(FARM, path, under_faults)
    decoder = make_decoder()
    found = []
    for frame in FrameReader(path):
        kinds = [line.description.what for line in decoder.feed(frame)]
        ends = {decoder.name(frame.data[:6]), decoder.name(frame.data[6:12])}
        if "axis-02" not in ends and not frame.data[0] & 1:
            found.append((kinds[0] if kinds else "", frame))
    answer = next(n for n, (kind, _) in enumerate(found) if kind == "Connect.res")
    return found[: answer + 40]


def is_cyclic(frame: CapturedFrame) -> bool:
    """Whether a drive's frame, which carries a tag, is one of cyclic data."""
    return frame.data[12:14] == b"\x81\x00" and frame.data[16:18] == b"\x88\x92" and 0x80 <= frame.data[18] < 0xFC


def in_words(frames) -> list[str]:
    return described([replace(frame, number=n) for n, frame in enumerate(frames)])


def test_cyclic_data_that_precede_the_answer_to_connect_are_read_by_what_was_asked_for(start_up):
    answer = next(n for n, (kind, _) in enumerate(start_up) if kind == "Connect.res")
    device = start_up[answer][1].data[6:12]
    frames = [frame for _, frame in start_up]
    early = next(f for f in frames[answer:] if is_cyclic(f) and f.data[6:12] == device)
    request = next(n for n, (kind, _) in enumerate(start_up) if kind == "Connect.req")
    early = replace(early, time_ns=frames[request].time_ns + 1_000_000)
    found = in_words([*frames[: request + 1], early, *frames[request + 1 :]])
    begun = [line for line in found if line.startswith("cyclic data begin") and "ZSW1" in line]
    assert len(begun) == 1
    assert "cycle 16 ms, telegram 1" in begun[0]
    assert not any("layout unknown" in line for line in found)
    # without the answer, too
    cut = in_words([*frames[: request + 1], early])
    assert cut[-1] == begun[0]


def test_a_refused_connect_leaves_no_layout_behind(start_up):
    request = next(n for n, (kind, _) in enumerate(start_up) if kind == "Connect.req")
    answer = next(n for n, (kind, _) in enumerate(start_up) if kind == "Connect.res")
    frames = [frame for _, frame in start_up]
    device = frames[answer].data[6:12]
    early = next(f for f in frames[answer:] if is_cyclic(f) and f.data[6:12] == device)
    octets = bytearray(frames[answer].data)
    status = 14 + 20 + 8 + 80
    little = octets[14 + 20 + 8 + 4] & 0x10
    octets[status : status + 4] = bytes.fromhex("044081db" if little else "db814004")
    found = in_words([*frames[: request + 1], replace(frames[answer], data=bytes(octets)), early])
    assert any(line.startswith("Connect.res IODConnectRes: CMRPC: out of ar resources") for line in found)
    assert "layout unknown" in found[-1]


def changed(frame: CapturedFrame, before: bytes, after: bytes) -> CapturedFrame:
    assert frame.data.count(before) == 1
    return replace(frame, data=frame.data.replace(before, after))


def test_padding_of_any_value_is_not_shown(start_up):
    frames = [
        changed(frame, b"\x00\x07axis-01\x00", b"\x00\x07axis-01\x0f") if kind == "Connect.res" else frame
        for kind, frame in start_up
    ]
    (line,) = [line for line in in_words(frames) if line.startswith("Connect.res")]
    assert line == "Connect.res OK, input frame id 0x8000, output frame id 0x8001"


def test_one_malformed_block_does_not_hide_the_others(start_up):
    frames = [
        changed(frame, b"\x00\x07axis-01\x00", b"\x00\xffaxis-01\x00") if kind == "Connect.res" else frame
        for kind, frame in start_up
    ]
    decoder = make_decoder()
    lines = [line for n, frame in enumerate(frames) for line in decoder.feed(replace(frame, number=n))]
    (line,) = [line.description for line in lines if line.description.what == "Connect.res"]
    assert line.text.startswith("OK, input frame id 0x8000, output frame id 0x8001; malformed block 0x8106: short: ")
    begun = [line.description.text for line in lines if line.description.what == "cyclic data begin"]
    assert begun
    assert all("telegram 1" in text for text in begun)
    talks = decoder.summary()
    assert any(talk["counts"].get("malformed") == 1 for talk in talks)


def test_a_wrong_length_keeps_the_blocks_before_it(start_up):
    frames = [
        changed(frame, b"\x81\x06\x00\x0c\x01\x00", b"\x81\x06\xff\x0c\x01\x00") if kind == "Connect.res" else frame
        for kind, frame in start_up
    ]
    (line,) = [line for line in in_words(frames) if line.startswith("Connect.res")]
    assert line.startswith("Connect.res OK, input frame id 0x8000, output frame id 0x8001; malformed after 4 blocks: ")


def udp(source_port: int, destination_port: int, data: bytes, *, fragment: int = 0, part: bytes | None = None):
    """A frame with one datagram, or with a part of one."""
    datagram = struct.pack(">HHHH", source_port, destination_port, 8 + len(data), 0) + data
    payload = datagram if part is None else part
    head = struct.pack(">BBHHHBBH", 0x45, 0, 20 + len(payload), 7, fragment, 64, 17, 0) + bytes(
        [10, 0, 0, 1, 10, 0, 0, 2]
    )
    total = sum(struct.unpack(">10H", head))
    total = (total & 0xFFFF) + (total >> 16)
    head = head[:10] + struct.pack(">H", ~(total + (total >> 16)) & 0xFFFF) + head[12:]
    octets = b"\x02\0\0\0\0\x02\x02\0\0\0\0\x01\x08\0" + head + payload
    return CapturedFrame(1, 0, octets)


PROBE = b"\x04\x00 is no call"


@pytest.mark.parametrize(
    ("ports", "data", "family"),
    [
        ((137, 137), b"\x80\x01name", "other"),
        ((137, 137), b"", "other"),
        ((5000, 5001), PROBE.ljust(100), "other"),
        ((5000, 34964), b"hello", "other"),
        ((161, 5000), b"\x30\x00", "snmp"),
    ],
)
def test_a_datagram_that_is_no_call_is_other(ports, data, family):
    (line,) = make_decoder().feed(udp(*ports, data))
    assert line.family == family
    if family == "other":
        assert (line.description.what, line.description.text) == (
            "UDP",
            f"port {ports[0]} -> {ports[1]}, {len(data)} octets",
        )


def test_what_comes_to_the_port_of_calls_and_is_cut_short_is_a_malformed_call():
    (line,) = make_decoder().feed(udp(5000, 34964, PROBE))
    assert (line.family, line.description.what) == ("rpc", "malformed")


def test_calls_are_calls_at_whatever_port(start_up):
    decoder = make_decoder()
    lines = [line for n, (_, frame) in enumerate(start_up) for line in decoder.feed(replace(frame, number=n))]
    ready = [line for line in lines if line.description.what.startswith("ApplicationReady")]
    assert len(ready) == 2
    assert {line.family for line in ready} == {"rpc"}


def test_a_long_datagram_that_is_no_call_is_of_the_kind_other_once_complete():
    data = bytes(3000)
    datagram = struct.pack(">HHHH", 5000, 5001, 8 + len(data), 0) + data
    decoder = make_decoder()
    assert decoder.feed(udp(5000, 5001, data, fragment=0x2000, part=datagram[:1480])) == []
    (line,) = decoder.feed(udp(5000, 5001, data, fragment=1480 // 8, part=datagram[1480:]))
    assert (line.family, line.description.what) == ("other", "UDP")


# -- PTCP


PORT_MAC = bytes.fromhex("00099143e068")
#: As captured from a device's port.
DELAY_REQUEST = bytes.fromhex(
    "0180c200000e 00099143e068 8892 ff40" + "00" * 12 + "001c 0000 00000000 0c06 00099143e068 0000"
)


def ptcp(pdu: PtcpPdu, source: bytes = PORT_MAC) -> CapturedFrame:
    octets = bytes.fromhex("010ecf000400") + source + b"\x88\x92" + emit_ptcp(pdu)
    return CapturedFrame(pdu.sequence, pdu.sequence * 100_000_000, octets.ljust(60, b"\0"))


def synced(sequence: int, master: str) -> CapturedFrame:
    domain = bytes.fromhex(master) + UUID(int=7).bytes
    return ptcp(PtcpPdu(0x0080, sequence, tlvs=(PtcpTlv(TlvType.SUBDOMAIN, domain),)))


def test_a_cable_measurement_is_shown_once_and_counted():
    frames = [CapturedFrame(n, n * 200_000_000, DELAY_REQUEST.ljust(60, b"\0")) for n in range(10)]
    decoder = make_decoder()
    lines = [line for frame in frames for line in decoder.feed(frame)]
    assert [(line.family, line.description.what) for line in lines] == [("ptcp", "PTCP")]
    assert lines[0].description.text == "DelayReq, sequence 28, port 00:09:91:43:e0:68, further ones are only counted"
    (talk,) = decoder.summary()
    assert talk["families"] == {"ptcp": 10}
    assert talk["cyclic"] == []


def test_another_master_of_the_clock_is_shown():
    masters = ["020000000001"] * 3 + ["020000000002"] * 3
    found = described([synced(n, master) for n, master in enumerate(masters, 1)])
    assert [line.partition(", domain")[0] for line in found] == [
        "PTCP RTSync (clock), sequence 1, master 02:00:00:00:00:01",
        "PTCP RTSync (clock), sequence 4, master 02:00:00:00:00:02",
    ]


def test_every_frame_of_ptcp_is_a_line_when_asked_for():
    decoder = make_decoder(every_frame=True)
    lines = [line for n in range(1, 6) for line in decoder.feed(synced(n, "020000000001"))]
    assert len(lines) == 5
    assert "further ones" not in lines[0].description.text


def test_a_cut_ptcp_frame_is_malformed():
    (line,) = make_decoder().feed(CapturedFrame(1, 0, DELAY_REQUEST[:30]))
    assert (line.family, line.description.what) == ("ptcp", "malformed")


def test_a_read_that_is_sent_again_is_no_other_one():
    header = IodReadReqHeader(
        sequence_number=1, ar_uuid=UUID(int=5), api=0, slot=0, subslot=1, index=0xAFF0, record_data_length=64
    )
    args = emit_request_args(RequestArgs(64, header.emit()), little_endian=True)
    call = RpcPdu(PacketType.REQUEST, UUID_PNIO_DEVICE, UUID(int=9), opnum=Opnum.READ, body=args)
    frames = [udp(49_152, 34_964, emit_rpc(replace(call, sequence=number))) for number in (1, 1, 2)]
    decoder = make_decoder()
    found = [line.description for frame in frames for line in decoder.feed(frame)]
    asked = "slot 0 subslot 0x0001 index 0xAFF0 (I&M0)"
    assert [(one.what, one.text) for one in found] == [("Read.req", asked), ("Read.req", "again"), ("Read.req", asked)]
    assert [list(one.counts) for one in found] == [["reads"], ["repeated"], ["reads"]]


def test_a_start_with_the_octets_of_an_earlier_one_is_another_start(start_up):
    """A controller that makes the same UUIDs at each start."""
    frames = [frame for _, frame in start_up]
    later = [replace(frame, time_ns=frame.time_ns + 300 * 10**9) for frame in frames]
    once, twice = in_words(frames), in_words([*frames, *later])
    for begin in ("Connect.req AR", "Connect.res OK", "PrmEnd.req AR", "cyclic data begin"):
        assert sum(line.startswith(begin) for line in twice) == 2 * sum(line.startswith(begin) for line in once) > 0
    assert not any(line.endswith(" again") for line in twice)


def test_data_before_the_answer_to_another_connect_are_those_of_the_new_connection(start_up):
    """The time between two connections is no gap, and the old layout does not count any more."""
    frames = [frame for _, frame in start_up]
    later = [replace(frame, time_ns=frame.time_ns + 300 * 10**9) for frame in frames]
    request, answer = (
        next(n for n, (kind, _) in enumerate(start_up) if kind == f"Connect.{way}") for way in ("req", "res")
    )
    device = frames[answer].data[6:12]
    early = next(f for f in later[answer:] if is_cyclic(f) and f.data[6:12] == device)
    early = replace(early, time_ns=later[request].time_ns + 1_000_000)
    found = in_words([*frames, *later[: request + 1], early, *later[request + 1 :]])
    assert sum(line.startswith("cyclic data begin") for line in found) == 4
    assert not any(line.startswith("gap") for line in found)


@pytest.mark.parametrize(("api", "told"), [(0, "index 0x002F"), (0x3A00, "index 0x002F (parameter access)")])
def test_record_47_is_parameter_access_in_the_api_of_drives_alone(api, told):
    header = IodReadReqHeader(
        sequence_number=1, ar_uuid=UUID(int=5), api=api, slot=3, subslot=1, index=47, record_data_length=64
    )
    args = emit_request_args(RequestArgs(64, header.emit()), little_endian=True)
    call = RpcPdu(PacketType.REQUEST, UUID_PNIO_DEVICE, UUID(int=9), opnum=Opnum.READ, body=args)
    (line,) = in_words([udp(49_152, 34_964, emit_rpc(call))])
    assert line.endswith(f"subslot 0x0001 {told}")


def test_a_cancel_is_of_the_call_with_its_number():
    """Siemens' controllers leave its operation 0, which is that of Connect."""
    header = IodReadReqHeader(
        sequence_number=1, ar_uuid=UUID(int=5), api=0, slot=0, subslot=1, index=0xAFF0, record_data_length=64
    )
    args = emit_request_args(RequestArgs(64, header.emit()), little_endian=True)
    call = RpcPdu(PacketType.REQUEST, UUID_PNIO_DEVICE, UUID(int=9), opnum=Opnum.READ, body=args, sequence=3)
    cancel = replace(call, packet_type=PacketType.CL_CANCEL, opnum=0, body=b"")
    found = in_words([udp(5000, 34964, emit_rpc(pdu)) for pdu in (call, cancel, replace(cancel, sequence=4))])
    assert found[0].startswith("Read.req ")
    assert found[1:] == ["RPC cl_cancel of Read", "RPC cl_cancel "]


def test_the_end_of_a_connection_tells_the_last_frame_of_all_that_its_peer_sent():
    plc, drive = bytes.fromhex("020000000001"), bytes.fromhex("020000000002")

    def frame(milliseconds, to, source, payload):
        octets = to + source + b"\x88\x92" + payload
        return CapturedFrame(1, milliseconds * 1_000_000, octets.ljust(60, b"\0"))

    def data(frame_id):
        return frame_id.to_bytes(2, "big") + bytes(40) + bytes.fromhex("00203500")

    # two connections, the second with another frame id
    frames = [frame(0, plc, drive, data(0x8000)), frame(5000, plc, drive, data(0x8001))]
    frames.append(frame(5006, drive, plc, rta_error(1, 1, RtaError.CONSUMER_DHT_EXPIRED).emit()))
    assert described(frames)[-1].endswith("; last cyclic frame of 02:00:00:00:00:02 6.0 ms ago")
