"""I&M: who carries it, what may be written into it, and that it stays."""

from dataclasses import replace

import pytest
from cm_support import DRIVE, DRIVE_API, UUID_2, Bench
from record_support import DATA_PLACE, SEVERAL_CARRIERS, WITH_IM, connect_tool, read, read_blocks, write

from pnfarm.protocols.profinet.description import ImCarrier
from pnfarm.protocols.profinet.wire.records.identification import ImText
from pnfarm.protocols.profinet.wire.records.iod import NIL_UUID

TAG = ImText(0x21, b"pump".ljust(32) + b"hall 3".ljust(22))
DATE = ImText(0x22, b"2026-02-30 25:61")
SIGNATURE = ImText(0x24, bytes(range(54)))


@pytest.fixture
def bench():
    made = Bench(WITH_IM)
    made.establish()
    return made


def test_what_was_written_is_read_by_anyone_and_reported_once(bench):
    for index, text in ((0xAFF1, TAG), (0xAFF2, DATE), (0xAFF3, ImText(0x23, b"x" * 54)), (0xAFF4, SIGNATURE)):
        assert write(bench, index, text.emit()) == 0
        assert read_blocks(bench, index, uuid=NIL_UUID) == (text,)
    assert bench.records.im.take_written()
    assert bench.records.im.texts[0, 1, 0xAFF1] == TAG.text
    assert [index for _, _, index in bench.records.im.texts] == [0xAFF1, 0xAFF2, 0xAFF3, 0xAFF4]
    assert not bench.records.im.take_written()


def test_what_was_never_written_is_blank_and_a_signature_is_zero(bench):
    assert read_blocks(bench, 0xAFF1) == (ImText(0x21, b" " * 54),)
    assert read_blocks(bench, 0xAFF4) == (ImText(0x24, bytes(54)),)


def test_texts_survive_the_machine_that_took_them():
    texts = {}
    bench = Bench(WITH_IM, texts=texts)
    bench.establish()
    assert write(bench, 0xAFF1, TAG.emit()) == 0
    assert read_blocks(Bench(WITH_IM, texts=texts), 0xAFF1, uuid=NIL_UUID) == (TAG,)
    # whatever a memory gives back, the block has its size
    texts[0, 1, 0xAFF2] = b"short"
    texts[0, 1, 0xAFF3] = b"long" * 50
    bench = Bench(WITH_IM, texts=texts)
    assert read_blocks(bench, 0xAFF2, uuid=NIL_UUID) == (ImText(0x22, b"short".ljust(16)),)
    assert len(read(bench, 0xAFF3, uuid=NIL_UUID)) == 60


def test_texts_are_visible_characters_padded_with_blanks(bench):
    assert write(bench, 0xAFF1, ImText(0x21, b"tag".ljust(54, b"\0")).emit()) == 0
    assert read_blocks(bench, 0xAFF1) == (ImText(0x21, b"tag".ljust(54)),)
    for octets in (b"tab\t", b"\x7f", "ü".encode("latin-1"), b"a\0b"):
        assert write(bench, 0xAFF1, ImText(0x21, octets.ljust(54)).emit()) == 0xB8
    assert read_blocks(bench, 0xAFF1) == (ImText(0x21, b"tag".ljust(54)),)


def test_what_is_no_im_block_changes_nothing(bench):
    assert write(bench, 0xAFF1, TAG.emit()[:-1]) == 0xB1
    assert write(bench, 0xAFF1, TAG.emit() * 2) == 0xB1
    assert write(bench, 0xAFF1, DATE.emit()) == 0xB8
    assert read_blocks(bench, 0xAFF1) == (ImText(0x21, b" " * 54),)
    assert not bench.records.im.take_written()


def test_only_what_im0_calls_supported_is_there():
    bench = Bench(replace(DRIVE, im0=replace(DRIVE.im0, im_supported=0b0010)))
    bench.establish()
    assert isinstance(read(bench, 0xAFF1), bytes)
    assert [read(bench, index) for index in (0xAFF2, 0xAFF4, 0xAFF5)] == [0xB0] * 3
    assert write(bench, 0xAFF2, DATE.emit()) == 0xB0


def test_a_submodule_without_its_own_answers_with_the_devices_and_takes_nothing(bench):
    assert read(bench, 0xAFF0, **DATA_PLACE) == read(bench, 0xAFF0)
    assert write(bench, 0xAFF1, TAG.emit(), **DATA_PLACE) == 0xB6


def test_a_tool_may_write_them_while_no_controller_has_the_device():
    bench = Bench(WITH_IM)
    connect_tool(bench)
    assert write(bench, 0xAFF1, TAG.emit(), uuid=UUID_2) == 0
    bench.establish()
    assert write(bench, 0xAFF1, TAG.emit(), uuid=UUID_2) == 0xB6


def test_several_carriers_have_data_of_their_own_and_are_all_listed():
    bench = Bench(SEVERAL_CARRIERS)
    bench.establish()
    (im0,) = read_blocks(bench, 0xAFF0, **DATA_PLACE)
    assert im0.order_id == b"MODULE-1".ljust(20)
    assert read_blocks(bench, 0xAFF0)[0].order_id == DRIVE.im0.order_id.encode()
    assert write(bench, 0xAFF1, TAG.emit(), api=DRIVE_API, slot=1, subslot=1) == 0
    assert read_blocks(bench, 0xAFF1, **DATA_PLACE) == (TAG,)
    assert read_blocks(bench, 0xAFF1) == (ImText(0x21, b" " * 54),)
    # the module's carrier has I&M1 only, the device's all of them
    assert read(bench, 0xAFF2, **DATA_PLACE) == 0xB0
    listed = read_blocks(bench, 0xF840)
    assert [b.block_type for b in listed] == [0x30, 0x31, 0x32]
    assert [[(a.api, s.slot, s.submodules) for a in b.apis for s in a.slots] for b in listed] == [
        [(0, 0, ((1, 1),)), (DRIVE_API, 1, ((1, 0xFFFF),))],
        [(DRIVE_API, 1, ((1, 0xFFFF),))],
        [(0, 0, ((1, 1),))],
    ]


def test_a_carrier_that_is_pulled_is_not_listed():
    bench = Bench(SEVERAL_CARRIERS)
    bench.plugged.pull(1)
    assert [b.block_type for b in read_blocks(bench, 0xF840, uuid=NIL_UUID)] == [0x30, 0x32]


def test_a_submodule_without_a_carrier_has_no_im():
    bench = Bench(replace(WITH_IM, im_carriers=(ImCarrier(1, 1),)))
    bench.establish()
    assert isinstance(read(bench, 0xAFF0, api=DRIVE_API, slot=1), bytes)
    assert read(bench, 0xAFF0) == 0xB0
    assert write(bench, 0xAFF1, TAG.emit()) == 0xB0
    assert [b.block_type for b in read_blocks(bench, 0xF840)] == [0x30]
