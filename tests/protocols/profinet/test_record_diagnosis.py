"""Diagnosis as a controller reads it: by severity, by coding and by scope."""

import pytest
from cm_support import DRIVE_API, Bench, telegram
from record_support import AXIS, DIAGNOSES, FAULT, read, read_blocks

from pnfarm.protocols.profinet.records.store import owned_submodules
from pnfarm.protocols.profinet.wire.records.iod import NIL_UUID

#: Low octet of the index -> error types (0 for the manufacturer's) of the device's diagnosis.
TOLD = {
    0x0A: {5, 8, 0x8000},
    0x0B: {5, 8, 0, 0x8000},
    0x0C: {5, 6, 7, 8, 9, 0, 0x8000},
    0x10: {6, 8},
    0x11: {7},
    0x12: {6, 8},
    0x13: {7},
}


@pytest.fixture
def bench():
    made = Bench()
    made.establish()
    for entry in DIAGNOSES:
        assert made.records.diagnosis.add(entry)
    return made


def told(bench, index, **place):
    return {
        (block.api, block.slot, block.subslot, getattr(item, "error_type", 0))
        for block in read_blocks(bench, index, **place)
        for item in block.items
    }


def expected(number, *, where):
    return {
        (*e.place, e.error_type) for e in DIAGNOSES if e.error_type in TOLD[number] and where(e.place)
    }  # fmt: skip


@pytest.mark.parametrize("number", TOLD)
@pytest.mark.parametrize("place", [AXIS, (DRIVE_API, 1, 2), (0, 0, 0x8001), (0, 0, 1)])
def test_each_index_has_its_severities_and_codings_in_every_scope(bench, number, place):
    api, slot, subslot = place
    spot = {"api": api, "slot": slot, "subslot": subslot}
    assert told(bench, 0x8000 | number, **spot) == expected(number, where=lambda p: p == place)
    assert told(bench, 0xC000 | number, **spot) == expected(number, where=lambda p: p[:2] == (api, slot))
    assert told(bench, 0xE000 | number, **spot) == expected(number, where=lambda _: True)
    assert told(bench, 0xF000 | number, **spot) == expected(number, where=lambda p: p[0] == api)


def test_the_whole_devices_diagnosis_is_read_without_an_ar(bench):
    assert told(bench, 0xF80C, uuid=NIL_UUID) == expected(0x0C, where=lambda _: True)


def test_no_diagnosis_is_a_record_without_octets():
    bench = Bench()
    for index in (0x800A, 0xC00B, 0xF00C, 0xF80C, 0x8013):
        assert read(bench, index, uuid=NIL_UUID) == b""


def test_the_octets_of_one_entry():
    bench = Bench()
    bench.records.diagnosis.add(FAULT)
    data = read(bench, 0x800A, api=DRIVE_API, slot=1, subslot=1, uuid=NIL_UUID)
    assert data.hex(" ", 2) == "0010 0016 0101 0000 3a00 0001 0001 8000 0800 8000 8000 0800 0005"


def test_an_ar_is_told_of_the_submodules_that_it_has_and_no_others():
    bench = Bench()
    bench.plugged.plug(1, telegram(0x100, 0x70, 12, 12))
    bench.establish()
    (ar,) = bench.cm.ars
    # the telegram is another one: the AR expects it, but it has not got it
    assert (DRIVE_API, 1, 2) not in owned_submodules(ar)
    for entry in DIAGNOSES:
        bench.records.diagnosis.add(entry)
    assert told(bench, 0xE00C) == expected(0x0C, where=lambda p: p != (DRIVE_API, 1, 2))
    assert told(bench, 0xF80C) == expected(0x0C, where=lambda _: True)


def test_what_was_pulled_has_no_diagnosis_any_more(bench):
    bench.plugged.pull(1)
    assert told(bench, 0xF80C) == {(0, 0, 0x8001, 0x8000)}
    assert read(bench, 0x800A, api=DRIVE_API, slot=1, subslot=1) == 0xB4
