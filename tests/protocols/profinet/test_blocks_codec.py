import contextlib
import dataclasses
from uuid import UUID

import pytest
from block_strategies import BLOCKS, octets, statuses, u16, u32, uuids
from cm_support import CAPTURE_NAMES, calls, connect_request
from hypothesis import given, settings
from hypothesis import strategies as st

from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.wire.any_block import emit_blocks, parse_block, parse_blocks
from pnfarm.protocols.profinet.wire.block import Block, BlockType, RawBlock, split_blocks
from pnfarm.protocols.profinet.wire.cm import connect, expected
from pnfarm.protocols.profinet.wire.cm.control import (
    ControlBlock,
    ControlCommand,
    control_response,
)
from pnfarm.protocols.profinet.wire.records import fsu, identification, iod
from pnfarm.protocols.profinet.wire.records.container import ContainerContent, emit_container, parse_container
from pnfarm.protocols.profinet.wire.records.iod import (
    IodReadResHeader,
    IodWriteReqHeader,
    RecordWrite,
    emit_multiple_write_request,
    emit_read_response,
    emit_write_request,
    parse_read_response,
    parse_write_request,
)


@pytest.mark.parametrize("kind", BLOCKS)
def test_what_is_emitted_is_parsed_back(kind):
    @settings(max_examples=40)
    @given(BLOCKS[kind])
    def run(value):
        assert parse_blocks(value.emit()) == (value,)

    run()


@pytest.mark.parametrize("name", CAPTURE_NAMES)
def test_every_captured_connect_control_and_release_pdu_is_reemitted_octet_for_octet(name):
    seen = 0
    for call in calls(name):
        if call.opnum in {0, 1, 4}:
            assert emit_blocks(parse_blocks(call.payload)) == call.payload
            seen += 1
    assert seen >= 6


@pytest.mark.parametrize("name", CAPTURE_NAMES[1:])
def test_every_captured_write_is_reemitted_octet_for_octet(name):
    seen = 0
    for call in calls(name):
        if call.opnum == 3:
            if call.request:
                request = iod.parse_write_request(call.payload)
                assert request.multiple
                assert iod.emit_multiple_write_request(request.header, request.writes) == call.payload
            else:
                assert iod.emit_write_response(iod.parse_write_response(call.payload)) == call.payload
            seen += 1
    assert seen == 2


def test_the_captured_im0_read_is_reemitted_octet_for_octet():
    reads = [c for c in calls(CAPTURE_NAMES[2]) if c.opnum == 2]
    request, response = (c.payload for c in reads)
    assert iod.IodReadReqHeader.parse(request).emit() == request
    record = iod.parse_read_response(response)
    assert iod.emit_read_response(record.header, record.data) == response
    (im0,) = parse_blocks(record.data)
    assert isinstance(im0, identification.Im0)
    assert im0.order_id == b"12345 Abcdefghijk   "
    assert im0.software_revision == ("V", 0, 2, 0)
    assert im0.emit() == record.data


def test_a_real_drives_request_reads_as_its_engineer_would_say_it():
    ar, inputs, outputs, dap, drive, alarm = parse_blocks(connect_request(CAPTURE_NAMES[0]))
    assert (ar.properties, ar.activity_timeout_factor, ar.station_name) == (0x11, 600, b"pn-io-1")
    assert (inputs.iocr_type, outputs.iocr_type) == (1, 2)
    assert (inputs.send_clock_factor, inputs.reduction_ratio, inputs.data_hold_factor) == (128, 1, 3)
    assert (inputs.rt_class, inputs.frame_id, outputs.frame_id) == (2, 0x8061, 0xFFFF)
    assert [a.api for a in inputs.apis] == [0, 0x3A00]
    assert len(dap.apis[0].submodules) == 4
    assert [s.submodule_ident for s in drive.apis[0].submodules] == [0xFFFF, 0x68]
    assert [d.data_length for d in drive.apis[0].submodules[1].data] == [12, 12]
    assert (alarm.rta_retries, alarm.max_alarm_data_length) == (3, 256)


def test_padding_between_the_records_of_a_multiple_write_and_none_after_the_last():
    header = iod.IodWriteReqHeader(0, UUID(int=7), iod.API_NONE, 0xFFFF, 0xFFFF, iod.INDEX_MULTIPLE_WRITE)
    writes = [
        iod.RecordWrite(iod.IodWriteReqHeader(n, UUID(int=7), 0, 1, 1, 100 + n, len(data)), data)
        for n, data in enumerate((b"a", b"bcde", b"", b"fg"), 1)
    ]
    raw = iod.emit_multiple_write_request(header, writes)
    assert len(raw) == 64 + (64 + 4) + (64 + 4) + 64 + (64 + 2)
    assert iod.parse_write_request(raw).writes == tuple(writes)


headers = {
    "write": st.builds(iod.IodWriteReqHeader, u16, uuids, u32, u16, u16, u16.filter(lambda i: i != 0xE040)),
    "write-res": st.builds(iod.IodWriteResHeader, u16, uuids, u32, u16, u16, u16, u32, u16, u16, statuses),
    "read": st.builds(iod.IodReadReqHeader, u16, uuids, u32, u16, u16, u16, u32),
    "implicit": st.builds(iod.IodReadReqHeader, u16, st.just(iod.NIL_UUID), u32, u16, u16, u16, u32, uuids),
    "read-res": st.builds(iod.IodReadResHeader, u16, uuids, u32, u16, u16, u16, st.just(0), u16, u16),
}


@settings(max_examples=40)
@given(headers["write"], octets, headers["write-res"], headers["read"] | headers["implicit"], headers["read-res"])
def test_record_headers_are_parsed_back(write, data, write_res, read, read_res):
    parsed = iod.parse_write_request(iod.emit_write_request(write, data))
    assert parsed.writes[0].data == data
    assert dataclasses.replace(parsed.header, record_data_length=0) == write
    assert iod.parse_write_response(iod.emit_write_response([write_res])) == (write_res,)
    assert iod.IodReadReqHeader.parse(read.emit()) == read
    record = iod.parse_read_response(iod.emit_read_response(read_res, data))
    assert (record.data, record.header.record_data_length) == (data, len(data))


PARSERS = (
    parse_blocks,
    split_blocks,
    iod.parse_write_request,
    iod.parse_write_response,
    iod.IodReadReqHeader.parse,
    iod.parse_read_response,
)


def only_decode_errors(parser, data):
    with contextlib.suppress(DecodeError):
        parser(data)


@settings(max_examples=400)
@given(st.binary(max_size=200), st.sampled_from(PARSERS))
def test_any_octets_give_a_value_or_a_decode_error(data, parser):
    only_decode_errors(parser, data)


@settings(max_examples=600)
@given(st.sampled_from(sorted(Block.KINDS)), st.binary(max_size=120), u16)
def test_any_body_of_any_known_block_gives_a_value_or_a_decode_error(block_type, body, version):
    only_decode_errors(parse_block, RawBlock(block_type, body, version))


@pytest.mark.parametrize("name", CAPTURE_NAMES)
def test_captured_pdus_with_one_octet_changed_or_cut_off_stay_harmless(name):
    for call in calls(name):
        payload = call.payload
        for position in range(0, min(len(payload), 500), 3):
            for octet in (0x00, 0xFF, payload[position] ^ 0x01):
                broken = payload[:position] + bytes([octet]) + payload[position + 1 :]
                for parser in PARSERS:
                    only_decode_errors(parser, broken)
            only_decode_errors(parse_blocks, payload[:position])


def test_a_block_shorter_than_its_version_is_refused():
    with pytest.raises(DecodeError, match="bad-length"):
        split_blocks(bytes.fromhex("010100010100"))


def test_an_unknown_block_is_kept_as_it_is():
    raw = RawBlock(0x010B, b"\x01\x02", 0x0100).emit()
    assert parse_blocks(raw) == (RawBlock(BlockType.AR_FSU_REQ, b"\x01\x02"),)


def test_the_answer_to_a_control_block_says_done_for_the_same_session():
    request = ControlBlock(BlockType.PRM_END_REQ, UUID(int=5), 3, ControlCommand.PRM_END)
    answer = control_response(request)
    assert (answer.block_type, answer.command, answer.session_key, answer.ar_uuid) == (0x8110, 8, 3, UUID(int=5))


def test_submodule_states_read_as_on_the_wire_of_a_real_drive():
    sub = expected.DiffSubmodule(2, 0x68, 0x8800)
    assert (sub.ident_info, sub.ar_info) == (expected.IdentInfo.SUBSTITUTE, expected.ArInfo.OWN)
    assert expected.submodule_state(expected.IdentInfo.SUBSTITUTE) == 0x8800
    assert expected.submodule_state(expected.IdentInfo.WRONG) == 0x9000


def test_identification_of_version_1_0_has_no_api_field():
    slot = identification.IdentificationSlot(1, 0x100, ((2, 0x68),))
    value = identification.IdentificationData(0x13, (identification.IdentificationApi(0, (slot,)),), 0x0100)
    assert value.emit().hex() == "001300120100" + "0001" + "0001" + "00000100" + "0001" + "0002" + "00000068"
    assert parse_blocks(value.emit()) == (value,)
    with pytest.raises(ValueError, match="exactly API 0"):
        dataclasses.replace(value, apis=(identification.IdentificationApi(1, ()),)).emit()


def test_reading_uuids_and_raw_blocks_keeps_their_version():
    raw = RawBlock(0x0777, b"abc", 0x0102)
    assert (raw.length, raw.version_high, raw.version_low) == (5, 1, 2)


@pytest.mark.parametrize("padding", [b"", b"\0", b"\x0f", b"\xff\xff", b"abc"])
def test_padding_may_hold_anything_and_be_missing(padding):
    server = parse_block(RawBlock(BlockType.AR_SERVER_RES, b"\x00\x01a" + padding))
    assert server == connect.ArServerBlock(b"a")
    multicast = parse_block(RawBlock(BlockType.MCR_REQ, bytes(8) + b"\x00\x01a" + padding))
    assert multicast == connect.McrBlockReq(0, 0, 0, b"a")
    header = IodWriteReqHeader(1, UUID(int=5), 0, 1, 1, 2)
    assert parse_write_request(emit_write_request(header, b"value") + padding).writes[0].data == b"value"
    answer = emit_read_response(IodReadResHeader(1, UUID(int=5), 0, 1, 1, 2), b"value")
    assert parse_read_response(answer + padding).data == b"value"


def test_more_than_padding_can_be_is_refused():
    for block in (RawBlock(BlockType.AR_SERVER_RES, bytes(6)), RawBlock(BlockType.MCR_REQ, bytes(14))):
        with pytest.raises(DecodeError, match="trailing"):
            parse_block(block)
    header = IodWriteReqHeader(1, UUID(int=5), 0, 1, 1, 2)
    with pytest.raises(DecodeError, match="trailing"):
        parse_write_request(emit_write_request(header, b"value") + bytes(4))


def test_the_records_of_a_multiple_write_are_found_whatever_pads_them():
    header = IodWriteReqHeader(1, UUID(int=5), 0, 1, 1, 2)
    outer = IodWriteReqHeader(0, UUID(int=5), 0xFFFFFFFF, 0xFFFF, 0xFFFF, 0xE040)
    identification = [RecordWrite(dataclasses.replace(header, index=n), b"v" * n) for n in (1, 2, 3, 5)]
    octets = bytearray(emit_multiple_write_request(outer, identification))
    place = 64
    for record in identification[:-1]:
        end = place + 64 + len(record.data)
        place = end + -len(record.data) % 4
        octets[end:place] = b"\x0f" * (place - end)
    assert [write.data for write in parse_write_request(bytes(octets)).writes] == [r.data for r in identification]


def test_a_container_is_read_as_a_controller_wrote_it_and_written_the_same():
    # the first two blocks of a captured CombinedObjectContainer
    octets = bytes.fromhex(
        "0401001c0100" "0000" "00000000" "0000" "8000" "0000" "8071" "025000080100000000000001"
        "040100200100" "0000" "00000000" "0000" "8001" "0000" "b060" "b060000c010000000001ffdc00000000"
    )  # fmt: skip
    found = parse_container(octets)
    assert [(c.slot, c.subslot, c.index, len(c.data)) for c in found] == [
        (0, 0x8000, 0x8071, 12),
        (0, 0x8001, 0xB060, 16),
    ]
    assert emit_container(found) == octets
    odd = (ContainerContent(0, 1, 1, 5, b"abc"), ContainerContent(0x3A00, 1, 2, 6, b"d"))
    padded = bytearray(emit_container(odd))
    assert parse_container(padded) == odd
    padded[23] = 0x0F
    assert parse_container(padded) == odd
    with pytest.raises(DecodeError):
        parse_container(octets[:-1])


def test_the_set_of_parameters_of_a_fast_start_up_reads_as_captured():
    octets = bytes.fromhex("0609002001000000060100180100000000000001bff0dcf98e38cf3c13052323b4b5d901")
    (block,) = parse_blocks(octets)
    assert block == fsu.ArFsuDataAdjust((fsu.FsParameter(1, UUID("bff0dcf9-8e38-cf3c-1305-2323b4b5d901")),))
    assert block.emit() == octets


def test_a_typed_parser_refuses_a_block_of_another_type():
    with pytest.raises(DecodeError, match="bad-type"):
        connect.ArBlockRes.of(RawBlock(BlockType.AR_REQ, b""))
