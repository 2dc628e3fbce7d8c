"""Records that Siemens controllers write at start-up beside those of the standard's usual set, as captured.

0xE050 ARFSUDataAdjust, 0x80B0 CombinedObjectContainer, 0xB050 and 0xB060 of Siemens' device driver.
"""

import pytest
from cm_requests import P
from cm_support import PEER, ROOM, UUID_2, Bench, Plan
from record_support import DATA_PLACE, connect_tool, read, write

from pnfarm.protocols.profinet.cm.device.events import RecordWritten
from pnfarm.protocols.profinet.wire.block import RawBlock
from pnfarm.protocols.profinet.wire.records.container import ContainerContent, emit_container
from pnfarm.protocols.profinet.wire.records.iod import (
    NIL_UUID,
    IodWriteReqHeader,
    RecordWrite,
    emit_multiple_write_request,
    parse_write_response,
)

#: The set of parameters of a captured S7 controller, and another.
FSU = bytes.fromhex("060900200100 0000 060100180100 0000 00000001 bff0dcf98e38cf3c13052323b4b5d901")
OTHER_FSU = FSU[:-1] + b"\x02"
PLL = bytes.fromhex("b05000080100 0000 00010000")
TRACE = bytes.fromhex("b060000c0100 0000 0001ffdc 00000000")
INTERFACE_ADJUST = bytes.fromhex("025000080100 0000 00000001")
AR = {"slot": 0, "subslot": 0}


class Application:
    """Takes what is written, refuses record 13."""

    def __init__(self):
        self.kept = {}

    def read(self, ar, api, slot, subslot, index, max_length, now):
        return self.kept[api, slot, subslot, index]

    def write(self, ar, api, slot, subslot, index, data, now):
        from pnfarm.protocols.profinet.errors import AccessError, RecordError

        if index == 13:
            return RecordError(AccessError.INVALID_PARAMETER)
        self.kept[api, slot, subslot, index] = data
        return None


@pytest.fixture
def bench():
    found = Bench(application=Application())
    found.establish()
    found.events()
    return found


# 0xE050


def test_the_set_of_parameters_of_a_fast_start_up_is_taken_and_read_back(bench):
    assert read(bench, 0xE050, **AR) == b""
    assert write(bench, 0xE050, FSU, **AR) == 0
    assert read(bench, 0xE050, **AR) == FSU
    # the place does not count
    assert read(bench, 0xE050, **DATA_PLACE) == FSU
    assert read(bench, 0xE050, uuid=NIL_UUID, target=Plan().ar.ar_uuid) == FSU
    assert read(bench, 0xE050, uuid=NIL_UUID) == 0xB5


def test_a_connect_may_bring_the_set_of_parameters_before_it_is_written():
    bench = Bench()
    assert bench.connect(extra=(RawBlock(0x010B, b"\0\0" + FSU),))[0].ok
    assert read(bench, 0xE050, **AR) == FSU
    assert write(bench, 0xE050, OTHER_FSU, **AR) == 0
    assert read(bench, 0xE050, **AR) == OTHER_FSU


def test_a_set_of_parameters_goes_with_its_ar(bench):
    assert write(bench, 0xE050, FSU, **AR) == 0
    assert bench.release()[0].ok
    bench.establish()
    assert read(bench, 0xE050, **AR) == b""


@pytest.mark.parametrize(
    ("data", "code"),
    [
        (b"", 0xB1),
        (FSU[:-1], 0xB1),
        (FSU + FSU, 0xB1),
        (INTERFACE_ADJUST, 0xB8),
        (FSU[:4] + b"\2\0" + FSU[6:], 0xB8),
    ],
)
def test_a_set_of_parameters_of_another_shape_is_refused(bench, data, code):
    assert write(bench, 0xE050, data, **AR) == code
    assert read(bench, 0xE050, **AR) == b""


def test_a_tool_for_device_access_writes_no_set_of_parameters(bench):
    connect_tool(bench)
    assert write(bench, 0xE050, FSU, **AR, uuid=UUID_2) == 0xB6
    assert read(bench, 0xE050, **AR, uuid=UUID_2) == b""


# 0xB050, 0xB060


@pytest.mark.parametrize(("index", "subslot", "data"), [(0xB050, 0x8000, PLL), (0xB060, 0x8001, TRACE)])
def test_the_device_drivers_records_are_taken_at_the_interface_and_its_ports_and_read_back(bench, index, subslot, data):
    assert read(bench, index, subslot=subslot) == b""
    assert write(bench, index, data, subslot=subslot) == 0
    assert read(bench, index, subslot=subslot) == data
    assert write(bench, index, data[:-1], subslot=subslot) == 0xB1
    for elsewhere in ({}, DATA_PLACE):
        assert write(bench, index, data, **elsewhere) == 0xB0
        assert read(bench, index, **elsewhere) == 0xB0


# 0x80B0


def contents(*rows):
    return emit_container(ContainerContent(api, slot, subslot, index, data) for api, slot, subslot, index, data in rows)


#: The kinds of records that a captured S7-1500 puts in.
CAPTURED = contents(
    (0, 0, 0x8000, 0x8071, INTERFACE_ADJUST), (0, 0, 0x8000, 0xB050, PLL), (0, 0, 0x8001, 0xB060, TRACE)
)


def test_every_record_of_a_container_is_written_and_reported(bench):
    assert write(bench, 0x80B0, CAPTURED, subslot=0x8000) == 0
    assert read(bench, 0x8071, subslot=0x8000) == INTERFACE_ADJUST
    assert read(bench, 0xB050, subslot=0x8000) == PLL
    assert read(bench, 0xB060, subslot=0x8001) == TRACE
    told = [(e.subslot, e.index) for e in bench.events() if isinstance(e, RecordWritten)]
    assert told == [(0x8000, 0x8071), (0x8000, 0xB050), (0x8001, 0xB060)]


def test_a_container_holds_records_of_the_application_and_needs_no_padding_after_the_last(bench):
    place = tuple(DATA_PLACE.values())
    odd = contents((*place, 5, b"abc"), (*place, 6, b"defgh"))
    assert len(odd) % 4 == 1
    assert write(bench, 0x80B0, odd, subslot=0x8000) == 0
    assert bench.records._application.kept == {(*place, 5): b"abc", (*place, 6): b"defgh"}


def test_a_container_cannot_be_read(bench):
    assert write(bench, 0x80B0, CAPTURED, subslot=0x8000) == 0
    assert read(bench, 0x80B0, subslot=0x8000) == 0xB0


def test_a_refused_record_of_a_container_is_the_answer_and_stops_no_other(bench):
    place = tuple(DATA_PLACE.values())
    data = contents((*place, 5, b"a"), (*place, 13, b"b"), (*place, 0xAFF0, b"c"), (*place, 6, b"d"))
    header = IodWriteReqHeader(3, Plan().ar.ar_uuid, 0, 0, 0x8000, 0x80B0)
    outer = IodWriteReqHeader(1, Plan().ar.ar_uuid, 0xFFFFFFFF, 0xFFFF, 0xFFFF, 0xE040)
    after = IodWriteReqHeader(4, Plan().ar.ar_uuid, *place, 7)
    request = emit_multiple_write_request(outer, [RecordWrite(header, data), RecordWrite(after, b"e")])
    status, answer = bench.call(3, request)
    assert status.ok
    _, first, second = parse_write_response(answer)
    assert (first.index, first.status.error_code1) == (0x80B0, 0xB8)
    assert (second.index, second.status.ok) == (7, True)
    assert sorted(key[3] for key in bench.records._application.kept) == [5, 6, 7]
    assert [e.index for e in bench.events() if isinstance(e, RecordWritten)] == [5, 6, 7]


@pytest.mark.parametrize("index", [0x80B0, 0xE040])
def test_a_container_in_a_container_and_a_multiple_write_in_one_are_refused(bench, index):
    place = tuple(DATA_PLACE.values())
    assert write(bench, 0x80B0, contents((*place, 5, b"a"), (*place, index, b"")), subslot=0x8000) == 0xB8
    assert bench.records._application.kept == {}


@pytest.mark.parametrize("data", [CAPTURED[:-1], b"\x04", INTERFACE_ADJUST, CAPTURED + b"\x04\x01\x00"])
def test_a_container_of_another_shape_is_refused_as_a_whole(bench, data):
    assert write(bench, 0x80B0, data, subslot=0x8000) == 0xB1
    assert read(bench, 0x8071, subslot=0x8000) == b""


def test_a_container_is_at_a_submodule_of_its_writer(bench):
    assert write(bench, 0x80B0, CAPTURED, slot=9) == 0xB2
    assert write(bench, 0x80B0, CAPTURED, api=7) == 0xB4
    connect_tool(bench)
    assert write(bench, 0x80B0, CAPTURED, subslot=0x8000, uuid=UUID_2) == 0xB6


def test_each_record_of_a_container_is_refused_for_what_it_is(bench):
    for row, code in (
        ((0, 9, 1, 5, b""), 0xB2),
        ((7, 0, 1, 5, b""), 0xB4),
        ((0, 0, 1, 0x8002, b""), 0xB0),
        ((0, 0, 1, 0xF830, b""), 0xB6),
    ):
        assert write(bench, 0x80B0, contents(row), subslot=0x8000) == code


def test_an_empty_container_writes_nothing(bench):
    assert write(bench, 0x80B0, b"", subslot=0x8000) == 0
    assert [e.index for e in bench.events() if isinstance(e, RecordWritten)] == []


def test_the_start_up_of_a_captured_s7_1500_with_all_four_is_taken():
    """ARProperties 0x60000011: it says that it writes containers."""
    from dataclasses import replace

    bench = Bench()
    plan = replace(P, ar=replace(P.ar, properties=0x60000011), extra=(RawBlock(0x010B, b"\0\0" + FSU),))
    status, _ = bench.call(0, plan.payload(), ROOM, PEER)
    assert status.ok
    assert write(bench, 0xE050, FSU, **AR) == 0
    assert write(bench, 0x80B0, CAPTURED, subslot=0x8000) == 0
    assert bench.prm_end()[0].ok
