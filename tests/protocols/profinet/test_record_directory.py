"""The table of indexes: what may be read and written, by whom and when, and how the rest is refused."""

from collections import Counter

import pytest
from cm_requests import fitting
from cm_support import CAPTURE_NAMES, DRIVE_API, UUID_1, UUID_2, Bench, calls, connect_request
from record_support import DATA_PLACE, connect_tool, read, read_blocks, write

from pnfarm.protocols.profinet.errors import AccessError, RecordError
from pnfarm.protocols.profinet.records.directory import Access, Index, Part, Scope, find_record
from pnfarm.protocols.profinet.records.store import IoData
from pnfarm.protocols.profinet.wire.records.iod import (
    NIL_UUID,
    IodWriteReqHeader,
    RecordWrite,
    emit_multiple_write_request,
    emit_write_request,
    parse_write_request,
    parse_write_response,
)


class Keeper:
    """An application, or a physical device, that takes everything and says who asked."""

    def __init__(self):
        self.asked = []

    def read(self, ar, api, slot, subslot, index, max_length, now):
        self.asked.append(("read", index, (api, slot, subslot)))
        return b"kept"

    def write(self, ar, api, slot, subslot, index, data, now):
        self.asked.append(("write", index, (api, slot, subslot)))


def io_data(_slot, _subslot, _output):
    return IoData(bytes(12), 0x80, 0x80)


@pytest.mark.parametrize("name", CAPTURE_NAMES[1:])
def test_the_start_up_records_of_real_controllers_are_all_taken(name):
    application = Keeper()
    bench = Bench(fitting(name), application=application)
    assert bench.call(0, connect_request(name), room=712)[0].ok
    payload = next(c.payload for c in calls(name) if c.request and c.opnum == 3)
    status, answer = bench.call(3, payload)
    assert status.ok
    writes = parse_write_request(payload).writes
    assert [int(h.status) for h in parse_write_response(answer)[1:]] == [0] * len(writes)
    kept = [w for w in writes if w.header.index >= 0x8000]
    assert [index for _, index, _ in application.asked] == [w.header.index for w in writes if w not in kept]
    for w in kept:
        h = w.header
        assert read(bench, h.index, h.slot, h.subslot, h.api, uuid=h.ar_uuid) == w.data


@pytest.fixture
def bench():
    return Bench(application=Keeper(), io_data=io_data)


#: In the profiles' range, and the interface's and its ports': of Siemens' device driver.
EDD = {0xB050, 0xB060}
PLACES = [(0, 0, 1), (0, 0, 0x8000), (DRIVE_API, 1, 2), (0, 9, 1), (7, 0, 1), (0xFFFFFFFF, 0xFFFF, 0xFFFF)]


@pytest.mark.parametrize("place", PLACES)
def test_every_index_is_answered_at_every_place_with_and_without_an_ar(place):
    bench = Bench(application=Keeper(), io_data=io_data)
    bench.establish()
    (ar,) = bench.cm.ars
    api, slot, subslot = place
    apis = bench.plugged.apis()
    there = bench.plugged.submodule(*place) is not None
    answers = Counter()
    for index in range(0x10000):
        record = find_record(index)
        for who in (ar, None):
            answer = bench.records.read(who, api, slot, subslot, index, 4096, 5)
            if isinstance(answer, bytes):
                assert record is not None
                assert there or record.scope in {Scope.AR, Scope.DEVICE} or (record.scope is Scope.API and api in apis)
            else:
                assert isinstance(answer, RecordError)
                assert answer.error_code1 in {0xB0, 0xB2, 0xB4, 0xB5}, hex(index)
                assert record is not None or answer.error_code1 == AccessError.INVALID_INDEX
            answers[type(answer).__name__] += 1
        refusal = bench.records.write(ar, api, slot, subslot, index, b"\0", 5)
        if refusal is None:
            assert there
            assert record.access & Access.ANY_WRITE
            assert record.part is Part.APPLICATION
        else:
            assert refusal.error_code1 in {0xB0, 0xB1, 0xB2, 0xB4, 0xB6}, hex(index)
    assert sum(answers.values()) == 0x20000
    if not there:
        assert bench.records._application.asked == []


def test_the_application_has_the_users_and_the_profiles_indexes_and_no_other():
    for index in range(0x10000):
        record = find_record(index)
        own = record is not None and record.part is Part.APPLICATION
        assert own == (index <= 0x7FFF or (0xB000 <= index <= 0xBFFF and index not in EDD)), hex(index)


@pytest.mark.parametrize("index", [0x7FFF, 0xB000, 0xB02E, 0xBFFF, 0])
def test_the_first_and_the_last_of_them_reach_it(bench, index):
    bench.establish()
    assert read(bench, index, **DATA_PLACE) == b"kept"
    assert write(bench, index, b"x", **DATA_PLACE) == 0
    assert bench.records._application.asked == [(verb, index, (DRIVE_API, 1, 2)) for verb in ("read", "write")]


@pytest.mark.parametrize("index", [0x8002, 0x8009, 0x8030, 0xAFF5, 0xAFFF, 0xC002, 0xD000, 0xE041, 0xF001,
                                   0xF80A, 0xF850, 0xF860, 0xFC00, 0xFFFF])  # fmt: skip
def test_what_the_device_does_not_have_is_an_invalid_index(bench, index):
    bench.establish()
    assert read(bench, index) == 0xB0
    assert write(bench, index, b"") == 0xB0


@pytest.mark.parametrize(
    ("index", "code"),
    [
        (Index.REAL_IDENTIFICATION_SUBSLOT, 0xB6),
        (Index.RECORD_OUTPUT_DATA, 0xB6),
        (Index.IM0, 0xB6),
        (0x800C, 0xB6),
        (Index.MODULE_DIFF, 0xB6),
        (Index.LOG_DATA, 0xB6),
        (Index.API_DATA, 0xB6),
        (Index.CONNECTION_MONITORING, 0xB6),
    ],
)
def test_what_is_only_read_denies_a_write(bench, index, code):
    bench.establish()
    assert write(bench, index, b"x") == code


@pytest.mark.parametrize("index", [0xC001, 0xC00A])
def test_a_slot_is_asked_for_under_an_api_that_it_has(bench, index):
    assert read(bench, index, uuid=NIL_UUID, slot=1, api=0) == 0xB2
    assert read(bench, index, uuid=NIL_UUID, slot=9) == 0xB2
    assert read(bench, index, uuid=NIL_UUID, slot=0, api=5) == 0xB4
    assert isinstance(read(bench, index, uuid=NIL_UUID, slot=1, api=DRIVE_API, subslot=77), bytes)


@pytest.mark.parametrize("index", [0xE000, 0xE001, 0xE002, 0xE00A, 0xE013])
def test_a_record_of_an_ar_needs_one_and_an_implicit_read_may_name_it(bench, index):
    assert read(bench, index, uuid=NIL_UUID) == 0xB5
    bench.establish()
    assert read(bench, index, uuid=NIL_UUID) == 0xB5
    assert read(bench, index, uuid=NIL_UUID, target=UUID_1) == read(bench, index, api=99, slot=99)
    assert isinstance(read(bench, index), bytes)


@pytest.mark.parametrize("index", [0xF00A, 0xF000, 0xF020])
def test_a_record_of_an_api_needs_nothing_else(bench, index):
    assert isinstance(read(bench, index, uuid=NIL_UUID, slot=99, subslot=99), bytes)
    assert read(bench, index, uuid=NIL_UUID, api=99) == 0xB4


def test_an_answer_is_never_longer_than_the_room_and_no_room_takes_no_answer(bench):
    bench.establish()
    whole = read(bench, 0xAFF0)
    assert read(bench, 0xAFF0, length=len(whole)) == whole
    assert read(bench, 0xAFF0, length=len(whole) - 1) == 0xB7
    assert read(bench, 0xAFF0, length=0) == 0xB7
    # a record without octets has room anywhere
    assert read(bench, 0x800A, length=0) == b""


def test_connection_monitoring_is_triggered_by_a_read_of_nothing():
    bench = Bench()
    bench.connect()
    before = bench.cm.next_deadline()
    bench.now = 1_000_000_000
    assert read(bench, 0xFBFF) == b""
    assert bench.cm.next_deadline() == before + 1_000_000_000


def test_an_implicit_read_triggers_the_monitoring_of_the_connection_that_it_names_and_no_other_read_does():
    bench = Bench()
    bench.connect()
    before = bench.cm.next_deadline()
    bench.now = 1_000_000_000
    assert read(bench, 0xFBFF, uuid=NIL_UUID) == b""
    assert read(bench, 0xF820, uuid=NIL_UUID, target=UUID_1)
    assert bench.cm.next_deadline() == before
    assert read(bench, 0xFBFF, uuid=NIL_UUID, target=UUID_1) == b""
    assert bench.cm.next_deadline() == before + 1_000_000_000


def test_nothing_is_written_between_the_end_of_the_parameters_and_the_application_being_ready(bench):
    bench.connect()
    assert write(bench, 47, b"x", **DATA_PLACE) == 0
    bench.prm_end()
    assert write(bench, 47, b"x", **DATA_PLACE) == 0xB5
    assert read(bench, 47, **DATA_PLACE) == b"kept"
    bench.cm.application_ready(bench.key(), bench.now)
    assert write(bench, 47, b"x", **DATA_PLACE) == 0


def test_a_controller_writes_its_own_submodules_alone(bench):
    from dataclasses import replace

    from cm_support import DAP_BLOCK, INPUTS_BLOCK, OUTPUTS_BLOCK, FrameSlot, IocrApi

    # it does not want the ports
    slots = (FrameSlot(0, 1, 0), FrameSlot(0, 0x8000, 1))
    bench.establish(
        dap=replace(DAP_BLOCK, submodules=DAP_BLOCK.submodules[:2]),
        inputs=replace(INPUTS_BLOCK, apis=(IocrApi(0, slots), INPUTS_BLOCK.apis[1])),
        outputs=replace(OUTPUTS_BLOCK, apis=(IocrApi(0, (), slots), OUTPUTS_BLOCK.apis[1])),
    )
    block = bytes.fromhex("025000080100000000000001")
    assert write(bench, 0x8071, block, subslot=0x8000) == 0
    assert write(bench, 0x802F, block, subslot=0x8001) == 0xB6
    assert write(bench, 47, b"x", subslot=0x8001) == 0xB6
    assert write(bench, 47, b"x", subslot=0x8000) == 0


def test_a_tool_writes_parameters_beside_a_controller_but_nothing_that_is_the_controllers(bench):
    bench.establish()
    connect_tool(bench)
    place = {**DATA_PLACE, "uuid": UUID_2}
    assert write(bench, 0xB02E, b"x", **place) == 0
    assert write(bench, 0x801E, b"x", **place) == 0xB6
    assert write(bench, 0xAFF1, b"x", uuid=UUID_2) == 0xB6
    assert write(bench, 0x8071, b"x", subslot=0x8000, uuid=UUID_2) == 0xB6
    bench.release()
    # I&M is a tool's when no controller is there; the device has none, so that the next reason shows
    assert write(bench, 0xAFF1, b"x", uuid=UUID_2) == 0xB0
    assert write(bench, 0x8071, b"x", subslot=0x8000, uuid=UUID_2) == 0xB6


def test_without_an_ar_nothing_is_written(bench):
    status, _ = bench.call(3, emit_write_request(IodWriteReqHeader(5, NIL_UUID, 0, 0, 1, 47), b"x"))
    assert (status.error_code1, status.error_code2) == (0x40, 5)


def test_a_multiple_write_inside_of_another_is_refused_and_its_neighbours_are_not(bench):
    bench.establish()

    def one(index, data, api=DRIVE_API, slot=1, subslot=2):
        return RecordWrite(IodWriteReqHeader(1, UUID_1, api, slot, subslot, index, len(data)), data)

    inner = emit_multiple_write_request(
        IodWriteReqHeader(0, UUID_1, 0xFFFFFFFF, 0xFFFF, 0xFFFF, 0xE040), [one(47, b"never")]
    )
    writes = [one(47, b"odd"), RecordWrite(
        IodWriteReqHeader(2, UUID_1, 0xFFFFFFFF, 0xFFFF, 0xFFFF, 0xE040, len(inner[64:])), inner[64:]
    ), one(48, b"more")]  # fmt: skip
    outer = IodWriteReqHeader(0, UUID_1, 0xFFFFFFFF, 0xFFFF, 0xFFFF, 0xE040)
    status, answer = bench.call(3, emit_multiple_write_request(outer, writes))
    assert status.ok
    assert [h.status.error_code1 for h in parse_write_response(answer)[1:]] == [0, 0xB0, 0]
    assert [index for _, index, _ in bench.records._application.asked] == [47, 48]


def test_a_handler_of_the_physical_device_gets_its_records_and_only_there():
    pdev = Keeper()
    bench = Bench(pdev=pdev)
    bench.establish()
    assert read(bench, 0x802A, subslot=0x8001) == b"kept"
    assert read(bench, 0x802A) == 0xB0
    assert read(bench, 0xF841, uuid=NIL_UUID) == b"kept"
    assert write(bench, 0x802B, b"x", subslot=0x8001) == 0
    assert write(bench, 0x802A, b"x", subslot=0x8001) == 0xB6
    assert write(bench, 0xF841, b"x") == 0xB6
    assert [(verb, index) for verb, index, _ in pdev.asked] == [("read", 0x802A), ("read", 0xF841), ("write", 0x802B)]


def test_without_one_nothing_is_known_of_the_real_interface(bench):
    bench.establish()
    for index in (0x802A, 0x8072, 0x8080):
        assert read(bench, index, subslot=0x8000) == 0xB0
    assert [read(bench, index) for index in (0xF831, 0xF841, 0xF842)] == [0xB0] * 3
    # a request for IRT is not taken in silence
    assert write(bench, 0x802C, bytes.fromhex("0205 0008 0100 0000 00000000"), subslot=0x8000) == 0xB0


def test_the_log_book_is_a_record():
    bench = Bench()
    bench.establish()
    for event in bench.events():
        bench.records.log_book.note(event, 7)
    bench.now = 9
    (data,) = read_blocks(bench, 0xF830)
    assert (data.time_stamp, [(e.time_stamp, e.ar_uuid) for e in data.entries]) == (9, [(7, UUID_1)])


def test_an_ar_without_submodules_is_in_the_devices_list_and_in_no_apis():
    bench = Bench()
    bench.establish()
    connect_tool(bench)
    (data,) = read_blocks(bench, 0xF820)
    assert [entry.ar_uuid for entry in data.ars] == [UUID_1, UUID_2]
    (data,) = read_blocks(bench, 0xF020)
    assert [entry.ar_uuid for entry in data.ars] == [UUID_1]
