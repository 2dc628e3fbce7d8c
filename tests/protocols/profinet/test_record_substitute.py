"""The value that replaces a submodule's outputs: written by its AR, shown beside the outputs, gone with the AR."""

import pytest
from cm_support import DRIVE_API, Bench
from record_support import DATA_PLACE, read, read_blocks, write

from pnfarm.protocols.profinet.records.store import IoData
from pnfarm.protocols.profinet.wire.records.identification import SubstituteValue
from pnfarm.protocols.profinet.wire.records.iod import NIL_UUID

VALUE = SubstituteValue(2, 0x80, bytes(range(12)), 0x80)
ZERO = SubstituteValue(0, 0x80, bytes(12), 0x80)


@pytest.fixture
def bench():
    made = Bench(io_data=lambda _slot, _subslot, _output: IoData(b"x" * 12, 0x80, 0x80))
    made.establish()
    return made


def test_it_is_zero_until_it_is_written_and_then_read_beside_the_outputs(bench):
    assert read_blocks(bench, 0x801E, **DATA_PLACE) == (ZERO,)
    assert write(bench, 0x801E, VALUE.emit(), **DATA_PLACE) == 0
    assert read_blocks(bench, 0x801E, **DATA_PLACE) == (VALUE,)
    assert read_blocks(bench, 0x801E, **DATA_PLACE, uuid=NIL_UUID) == (VALUE,)
    (output,) = read_blocks(bench, 0x8029, **DATA_PLACE)
    assert output.substitute == VALUE.emit()


def test_it_goes_with_the_ar_that_wrote_it(bench):
    write(bench, 0x801E, VALUE.emit(), **DATA_PLACE)
    bench.release()
    assert read_blocks(bench, 0x801E, **DATA_PLACE, uuid=NIL_UUID) == (ZERO,)
    bench.establish()
    assert read_blocks(bench, 0x801E, **DATA_PLACE) == (ZERO,)
    write(bench, 0x801E, VALUE.emit(), **DATA_PLACE)
    assert len(bench.records._io._substitutes) == 1


def test_what_does_not_fit_the_submodule_is_refused(bench):
    short = SubstituteValue(2, 0x80, bytes(11), 0x80)
    assert write(bench, 0x801E, short.emit(), **DATA_PLACE) == 0xB1
    assert write(bench, 0x801E, b"", **DATA_PLACE) == 0xB1
    assert write(bench, 0x801E, VALUE.emit()[:8], **DATA_PLACE) == 0xB1
    assert write(bench, 0x801E, SubstituteValue(3, 0x80, bytes(12), 0x80).emit(), **DATA_PLACE) == 0xB8
    assert read_blocks(bench, 0x801E, **DATA_PLACE) == (ZERO,)


def test_a_submodule_without_outputs_has_none(bench):
    place = {"api": DRIVE_API, "slot": 1, "subslot": 1}
    assert read(bench, 0x801E, **place) == 0xB0
    assert write(bench, 0x801E, VALUE.emit(), **place) == 0xB0
