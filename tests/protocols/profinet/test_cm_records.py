"""Reading and writing records through the AR machine."""

from dataclasses import replace
from uuid import UUID

import pytest
from cm_support import CAPTURE_NAMES, DRIVE, DRIVE_API, MS, UUID_1, UUID_2, Bench, NoRecords, calls, telegram

from pnfarm.protocols.profinet.cm.device.events import RecordRefused, RecordWritten
from pnfarm.protocols.profinet.cm.device.records import serve_write
from pnfarm.protocols.profinet.errors import AccessError, CmrpcError, ConnectFault, ErrorCode, RecordError, pnio_error
from pnfarm.protocols.profinet.records.store import IoData
from pnfarm.protocols.profinet.wire.any_block import parse_blocks
from pnfarm.protocols.profinet.wire.block import RawBlock
from pnfarm.protocols.profinet.wire.records import identification
from pnfarm.protocols.profinet.wire.records.iod import (
    NIL_UUID,
    IodReadReqHeader,
    IodWriteReqHeader,
    RecordWrite,
    emit_multiple_write_request,
    emit_write_request,
    parse_read_response,
    parse_write_response,
)


class Application:
    """Keeps what is written to index 47 and answers it back; refuses everything else in its own words."""

    def __init__(self):
        self.value = b"\x01\x02\x03\x04"
        self.asked = []

    def read(self, ar, api, slot, subslot, index, max_length, now):
        self.asked.append((ar.uuid if ar else None, api, slot, subslot, index, max_length, now))
        return self.value if index == 47 else RecordError(AccessError.BUSY, 3)

    def write(self, ar, api, slot, subslot, index, data, now):
        if index != 47:
            return RecordError(AccessError.WRITE_LENGTH_ERROR)
        self.value = data
        return None


@pytest.fixture
def bench():
    return Bench(application=Application())


def read(bench, index, slot=0, subslot=1, api=0, length=1024, uuid=UUID_1, target=NIL_UUID, opnum=2, room=32_000):
    request = IodReadReqHeader(5, uuid, api, slot, subslot, index, length, target)
    return bench.call(opnum, request.emit(), room)


def record(bench, index, **place):
    status, answer = read(bench, index, **place)
    assert status.ok, status
    return parse_read_response(answer).data


def write(bench, index, data, slot=0, subslot=1, api=0, uuid=UUID_1):
    return bench.call(3, emit_write_request(IodWriteReqHeader(5, uuid, api, slot, subslot, index), data))


DRIVE_PLACE = {"api": DRIVE_API, "slot": 1, "subslot": 1}


def test_im0_identifies_the_drive(bench):
    bench.establish()
    (im0,) = parse_blocks(record(bench, 0xAFF0))
    assert im0.order_id == b"AKD-P00306-NBPN-0000"
    assert (im0.vendor_id, im0.software_revision, im0.profile_id) == (0x0105, ("V", 1, 17, 0), 0x3A00)


def test_an_implicit_read_needs_no_ar(bench):
    status, answer = read(bench, 0xAFF0, uuid=NIL_UUID, opnum=5)
    assert status.ok
    assert parse_read_response(answer).header.index == 0xAFF0


def test_a_captured_read_of_im0_is_answered_in_its_shape(bench):
    request, response = (c.payload for c in calls(CAPTURE_NAMES[2]) if c.opnum == 2)
    status, answer = bench.call(5, request.replace(request[8:24], bytes(16)))
    assert status.ok
    assert len(answer) == len(response)


@pytest.mark.parametrize(
    ("place", "code"),
    [
        ({"slot": 9}, 0xB2),
        ({"subslot": 9}, 0xB2),
        ({"api": 1}, 0xB4),
        ({"api": 0, "slot": 1}, 0xB2),
        ({"length": 10}, 0xB7),
        ({"room": 100}, 0xB7),
    ],
)
def test_a_wrong_place_or_too_little_room_is_refused_in_the_words_of_pniorw(bench, place, code):
    bench.establish()
    status, answer = read(bench, 0xAFF0, **place)
    assert (status.error_code, status.error_decode, status.error_code1) == (0xDE, 0x80, code)
    assert parse_read_response(answer).data == b""


def test_a_refusal_goes_without_its_header_where_the_caller_has_no_room_for_it(bench):
    bench.establish()
    for room in (0, 3, 63):
        status, answer = read(bench, 0xAFF0, room=room)
        assert (status.error_code, status.error_decode, status.error_code1) == (0xDE, 0x80, 0xB7)
        assert answer == b""


def test_a_write_whose_answer_has_no_room_writes_nothing():
    bench = Bench(application=Application())
    bench.establish()
    [ar] = bench.cm.ars
    writes = [RecordWrite(IodWriteReqHeader(n, UUID_1, 0, 0, 1, 0xAFF1 + n), b"1234") for n in range(2)]
    several = emit_multiple_write_request(IodWriteReqHeader(9, UUID_1, 0, 0, 0, 0xE040), writes)
    one = emit_write_request(writes[0].header, b"1234")
    touched = []

    class Handler(NoRecords):
        def write(self, ar, api, slot, subslot, index, data, now):
            touched.append(index)

    for payload, room, answered in ((one, 63, 0), (several, 63, 0), (several, 191, 64)):
        served = serve_write(payload, lambda uuid: ar if uuid == ar.uuid else None, Handler(), 0, room)
        assert served.status == pnio_error(ErrorCode.WRITE, ConnectFault.CMRPC, CmrpcError.ARGS_LENGTH_INVALID)
        assert (len(served.payload), touched) == (answered, [])
    for payload, room, count in ((one, 64, 1), (several, 192, 2)):
        served = serve_write(payload, lambda uuid: ar if uuid == ar.uuid else None, Handler(), 0, room)
        assert (served.status.ok, len(served.payload), len(touched)) == (True, room, count)
        touched.clear()


def test_a_read_of_an_unknown_ar_is_refused(bench):
    status, _ = read(bench, 0xAFF0, uuid=UUID_2)
    assert (status.error_code, status.error_decode, status.error_code1, status.error_code2) == (0xDE, 0x81, 0x40, 5)
    status, _ = read(bench, 0xAFF0, uuid=NIL_UUID)
    assert (status.error_code1, status.error_code2) == (8, 5)
    bench.establish()
    status, _ = read(bench, 0xAFF0, opnum=5)
    assert (status.error_code1, status.error_code2) == (0x40, 5)


def test_a_faulty_read_header_names_its_field(bench):
    good = bytearray(IodReadReqHeader(5, NIL_UUID, 0, 0, 1, 0xAFF0, 100).emit())
    for position, octet, codes in ((1, 8, (8, 0)), (3, 61, (8, 1)), (4, 2, (8, 2)), (5, 1, (8, 3))):
        broken = bytes(good[:position]) + bytes([octet]) + bytes(good[position + 1 :])
        status, _ = bench.call(5, broken)
        assert (status.error_code1, status.error_code2) == codes
    status, _ = bench.call(5, bytes(good[:30]))
    assert (status.error_code1, status.error_code2) == (0x40, 0)


def test_the_applications_records_pass_through_with_its_errors(bench):
    bench.establish()
    assert record(bench, 47, **DRIVE_PLACE) == b"\x01\x02\x03\x04"
    assert bench.records._application.asked[-1] == (UUID_1, DRIVE_API, 1, 1, 47, 1024, 0)
    status, answer = read(bench, 0xB02E, **DRIVE_PLACE)
    assert (status.error_decode, status.error_code1, status.error_code2) == (0x80, 0xA7, 3)
    assert parse_read_response(answer).header.index == 0xB02E


def test_a_written_record_reaches_the_application_and_is_reported(bench):
    key = bench.establish()
    bench.events()
    status, answer = write(bench, 47, b"abc", **DRIVE_PLACE)
    assert status.ok
    (header,) = parse_write_response(answer)
    assert (header.index, header.record_data_length, header.status.ok) == (47, 0, True)
    assert bench.events() == [RecordWritten(key, DRIVE_API, 1, 1, 47, b"abc")]
    assert record(bench, 47, **DRIVE_PLACE) == b"abc"


def test_a_refused_write_says_so_in_the_call_and_in_its_header(bench):
    key = bench.establish()
    bench.events()
    status, answer = write(bench, 48, b"abc", **DRIVE_PLACE)
    assert (status.error_code, status.error_decode, status.error_code1) == (0xDF, 0x80, 0xB1)
    (header,) = parse_write_response(answer)
    assert header.status == status
    assert bench.events() == [RecordRefused(key, DRIVE_API, 1, 1, 48, status)]


@pytest.mark.parametrize(
    ("index", "place", "code"),
    [(0xAFF0, {}, 0xB6), (0xF840, {}, 0xB6), (47, {"slot": 5}, 0xB2), (47, {"api": 5}, 0xB4), (0xAFF1, {}, 0xB0)],
)
def test_what_cannot_be_written_is_refused(bench, index, place, code):
    bench.establish()
    assert write(bench, index, b"x", **place)[0].error_code1 == code


def test_a_multiple_write_goes_on_after_a_record_that_fails(bench):
    bench.establish()
    bench.events()

    def one(index, data, uuid=UUID_1, version=0x0100):
        return RecordWrite(IodWriteReqHeader(1, uuid, DRIVE_API, 1, 1, index, len(data), version), data)

    writes = (one(48, b"x"), one(47, b"abc"), one(47, b"y", UUID_2), one(47, b"z", version=0x0200))
    outer = IodWriteReqHeader(0, UUID_1, 0xFFFFFFFF, 0xFFFF, 0xFFFF, 0xE040)
    status, answer = bench.call(3, emit_multiple_write_request(outer, writes))
    assert status.ok
    header, *inner = parse_write_response(answer)
    assert (header.index, header.record_data_length) == (0xE040, 256)
    assert [(h.status.error_code1, h.status.error_code2) for h in inner] == [(0xB1, 0), (0, 0), (0x40, 5), (8, 2)]
    refused, written = bench.events()
    assert (refused.index, refused.status, written.data) == (48, inner[0].status, b"abc")


def test_a_real_controllers_start_up_records_for_the_physical_device_are_taken_and_kept(bench):
    bench.establish()
    data = bytes.fromhex("025000080100000000000001")
    assert write(bench, 0x8071, data, subslot=0x8000)[0].ok
    assert record(bench, 0x8071, subslot=0x8000) == data
    assert record(bench, 0x8052, subslot=0x8000) == b""
    assert write(bench, 0x8071, b"\x02\x50", subslot=0x8000)[0].error_code1 == 0xB1
    # only an interface or a port has such records
    assert write(bench, 0x8071, data)[0].error_code1 == 0xB0


def test_the_written_uuid_must_be_an_ars(bench):
    status, answer = write(bench, 47, b"", uuid=UUID_2)
    assert (status.error_code, status.error_code1, status.error_code2) == (0xDF, 0x40, 5)
    (header,) = parse_write_response(answer)
    assert (header.ar_uuid, header.index, header.status) == (UUID_2, 47, status)


def test_a_write_that_cannot_be_read_is_refused_with_a_header_all_the_same(bench):
    status, answer = bench.call(3, b"\x00\x08")
    assert (status.error_code1, status.error_code2) == (0x40, 0)
    (header,) = parse_write_response(answer)
    assert header.status == status


def test_record_calls_keep_a_slow_start_up_alive():
    bench = Bench(application=Application())
    bench.connect()
    bench.now = 9_000 * MS
    assert write(bench, 47, b"", **DRIVE_PLACE)[0].ok
    assert bench.cm.next_deadline() == 19_000 * MS
    bench.now = 10_000 * MS
    read(bench, 47, **DRIVE_PLACE)
    assert bench.cm.next_deadline() == 20_000 * MS
    read(bench, 0xAFF0, uuid=NIL_UUID, opnum=5)
    assert bench.cm.next_deadline() == 20_000 * MS


def test_real_identification_by_device_slot_subslot_and_ar(bench):
    bench.establish()
    (api,) = parse_blocks(record(bench, 0xF000, api=DRIVE_API))[0].apis
    assert [(s.slot, s.module_ident, s.submodules) for s in api.slots] == [(1, 0x100, ((1, 0xFFFF), (2, 0x68)))]
    (data,) = parse_blocks(record(bench, 0xC001))
    assert [len(s.submodules) for a in data.apis for s in a.slots] == [4]
    (data,) = parse_blocks(record(bench, 0x8001, subslot=0x8000))
    assert data.apis[0].slots[0].submodules == ((0x8000, 2),)
    (data,) = parse_blocks(record(bench, 0xE001))
    assert [a.api for a in data.apis] == [0, DRIVE_API]
    assert read(bench, 0xF000, api=9)[0].error_code1 == 0xB4
    assert read(bench, 0xC001, slot=9)[0].error_code1 == 0xB2


def test_expected_identification_needs_an_ar(bench):
    assert read(bench, 0xE000, uuid=NIL_UUID, opnum=5)[0].error_code1 == 0xB5
    assert read(bench, 0x8000, uuid=NIL_UUID, opnum=5)[0].error_code1 == 0xB5
    bench.establish()
    (data,) = parse_blocks(record(bench, 0xE000))
    assert [(a.api, s.slot, s.module_ident) for a in data.apis for s in a.slots] == [(0, 0, 2), (DRIVE_API, 1, 0x100)]
    (data,) = parse_blocks(record(bench, 0xC000, api=DRIVE_API, slot=1))
    assert [a.api for a in data.apis] == [DRIVE_API]
    (data,) = parse_blocks(record(bench, 0x8000, api=DRIVE_API, slot=1, subslot=2))
    assert data.apis[0].slots[0].submodules == ((2, 0x68),)
    # an implicit read may name the AR it is about
    assert record(bench, 0xE000, uuid=NIL_UUID, target=UUID_1, opnum=5) == record(bench, 0xE000)


def test_the_module_difference_can_be_read_again():
    bench = Bench()
    bench.plugged.plug(1, telegram(0x100, 0x70, 12, 12))
    bench.establish()
    (diff,) = parse_blocks(record(bench, 0xE002))
    assert diff.apis[0].modules[0].submodules[0].submodule_ident == 0x70
    clean = Bench()
    clean.establish()
    assert record(clean, 0xE002) == b""


def test_ar_data_lists_the_open_ars(bench):
    assert record(bench, 0xF820, uuid=NIL_UUID, opnum=5) == b""
    bench.establish()
    (data,) = parse_blocks(record(bench, 0xF820))
    (entry,) = data.ars
    assert (entry.ar_uuid, entry.initiator_station_name, entry.remote_alarm_reference) == (UUID_1, b"plc-1", 5)
    assert [(c.iocr_type, c.frame_id) for c in entry.iocrs] == [(1, 0x8001), (2, 0x8000)]
    assert entry.apis == (0, DRIVE_API)
    (data,) = parse_blocks(record(bench, 0xF020, api=DRIVE_API))
    assert data.ars[0].apis == (DRIVE_API,)
    assert read(bench, 0xF020, api=9)[0].error_code1 == 0xB4


def test_apis_and_the_carrier_of_im0(bench):
    bench.establish()
    assert parse_blocks(record(bench, 0xF821)) == (identification.ApiData((0, DRIVE_API)),)
    submodule, device = parse_blocks(record(bench, 0xF840))
    assert (submodule.block_type, device.block_type) == (0x30, 0x32)
    assert submodule.apis[0].slots[0].submodules == ((1, 1),)


def test_io_data_of_one_submodule():
    values = {False: IoData(b"in" * 6, 0x80, 0x80), True: IoData(b"out" * 4, 0x80, 0x60)}
    bench = Bench(io_data=lambda _slot, _subslot, output: values[output])
    bench.establish()
    place = {"api": DRIVE_API, "slot": 1, "subslot": 2}
    (data,) = parse_blocks(record(bench, 0x8028, **place))
    assert (data.data, data.iops) == (b"in" * 6, b"\x80")
    (data,) = parse_blocks(record(bench, 0x8029, **place))
    assert (data.data, data.iocs, data.substitute_active) == (b"out" * 4, b"\x60", 0)
    assert data.substitute == bytes.fromhex("00140012010000006000000000000000000000000080")
    assert read(bench, 0x8029, api=DRIVE_API, slot=1, subslot=1)[0].error_code1 == 0xB0
    assert read(bench, 0x8028, api=DRIVE_API, slot=1, subslot=1)[0].ok
    assert read(Bench(), 0x8028, uuid=NIL_UUID, opnum=5)[0].error_code1 == 0xB5


def test_an_application_without_records_has_no_valid_index():
    bench = Bench()
    bench.establish()
    assert read(bench, 47)[0].error_code1 == 0xB0
    assert write(bench, 47, b"")[0].error_code1 == 0xB0


def test_im1_to_im4_are_there_when_the_drive_says_so():
    bench = Bench(replace(DRIVE, im0=replace(DRIVE.im0, im_supported=0b0110)))
    bench.establish()
    text = b"pump".ljust(32) + b"hall 3".ljust(22)
    assert write(bench, 0xAFF1, identification.ImText(0x21, text).emit())[0].ok
    assert parse_blocks(record(bench, 0xAFF1)) == (identification.ImText(0x21, text),)
    assert parse_blocks(record(bench, 0xAFF2)) == (identification.ImText(0x22, b" " * 16),)
    assert read(bench, 0xAFF3)[0].error_code1 == 0xB0
    assert write(bench, 0xAFF1, identification.ImText(0x22, b" " * 16).emit())[0].error_code1 == 0xB8
    assert write(bench, 0xAFF1, RawBlock(0x21, b"x").emit())[0].error_code1 == 0xB1
    assert write(bench, 0xAFF1, b"")[0].error_code1 == 0xB1


def test_unknown_target_uuids_read_like_no_ar(bench):
    target = UUID(int=1)
    assert read(bench, 0xE001, uuid=NIL_UUID, target=target, opnum=5)[0].error_code1 == 0xB5
