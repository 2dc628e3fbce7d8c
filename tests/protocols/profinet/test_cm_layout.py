from dataclasses import replace

import pytest
from cm_support import CAPTURE_NAMES, DRIVE, connect_request, telegram
from hypothesis import given, settings
from hypothesis import strategies as st

from pnfarm.protocols.profinet.cm.ar import LayoutError, compute_layout, expected_submodules
from pnfarm.protocols.profinet.description import Plugged
from pnfarm.protocols.profinet.errors import IocrField
from pnfarm.protocols.profinet.wire.any_block import parse_blocks
from pnfarm.protocols.profinet.wire.cm.expected import (
    DataDescription,
    ExpectedApi,
    ExpectedSubmodule,
    ExpectedSubmoduleBlockReq,
    SubmoduleProperties,
    SubmoduleType,
)
from pnfarm.protocols.profinet.wire.cm.iocr import FrameSlot, IocrApi, IocrBlockReq


def captured(name):
    blocks = parse_blocks(connect_request(name))
    expected = expected_submodules(a for b in blocks if isinstance(b, ExpectedSubmoduleBlockReq) for a in b.apis)
    return [b for b in blocks if isinstance(b, IocrBlockReq)], expected


def test_a_real_drives_frames_are_laid_out_as_its_controller_placed_them():
    (inputs, outputs), expected = captured(CAPTURE_NAMES[0])
    layout = compute_layout(inputs, expected)
    place = layout.data_of(1, 2)
    assert (place.data_offset, place.data_length, place.iops_offset) == (5, 12, 17)
    assert [c.iocs_offset for c in layout.iocs if (c.slot, c.subslot) == (1, 2)] == [18]
    assert (layout.cycle_ns, layout.data_hold_ns) == (4_000_000, 12_000_000)
    assert layout.is_input
    layout = compute_layout(outputs, expected, 0x8010)
    assert layout.data_of(1, 2).data_offset == 6
    assert [c.iocs_offset for c in layout.iocs] == [0, 1, 2, 3, 4, 5]
    assert layout.frame_id == 0x8010


@pytest.mark.parametrize("name", CAPTURE_NAMES)
def test_interleaved_offsets_of_real_controllers_are_accepted(name):
    iocrs, expected = captured(name)
    for iocr in iocrs:
        layout = compute_layout(iocr, expected)
        assert layout.data_length == iocr.data_length
        assert len(layout.data) == sum(len(a.data_objects) for a in iocr.apis)


EXPECTED = expected_submodules([
    ExpectedApi(0, 0, 1, (ExpectedSubmodule(1, 1, 0, (DataDescription(1, 0),)),)),
    ExpectedApi(0, 1, 2, (ExpectedSubmodule(1, 1, 1, (DataDescription(1, 4),)),
                          ExpectedSubmodule(2, 1, 2, (DataDescription(2, 6),)),
                          ExpectedSubmodule(3, 1, 3, (DataDescription(1, 2), DataDescription(2, 3))))),
])  # fmt: skip


def cr(kind, data=(), iocs=(), length=40, api=0):
    return IocrBlockReq(kind, 1, 2, length, 0x8000, 32, 1, (IocrApi(api, tuple(data), tuple(iocs)),))


@pytest.mark.parametrize(
    ("iocr", "fault"),
    [
        (cr(3), IocrField.IOCR_TYPE),
        (cr(1, [FrameSlot(1, 1, 0)], api=7), IocrField.API),
        (cr(1), IocrField.NUMBER_OF_IO_DATA_OBJECTS),
        (cr(1, [FrameSlot(9, 1, 0)]), IocrField.DATA_SLOT),
        (cr(1, [FrameSlot(1, 9, 0)]), IocrField.DATA_SUBSLOT),
        (cr(1, [FrameSlot(1, 2, 0)]), IocrField.DATA_SUBSLOT),
        (cr(2, [FrameSlot(1, 1, 0)]), IocrField.DATA_SUBSLOT),
        (cr(1, [FrameSlot(1, 1, 0), FrameSlot(1, 1, 10)]), IocrField.DATA_SUBSLOT),
        (cr(1, [FrameSlot(1, 1, 36)]), IocrField.DATA_FRAME_OFFSET),
        (cr(1, [FrameSlot(1, 1, 0), FrameSlot(1, 3, 4)]), IocrField.DATA_FRAME_OFFSET),
        (cr(1, (), [FrameSlot(9, 1, 0)]), IocrField.IOCS_SLOT),
        (cr(1, (), [FrameSlot(1, 9, 0)]), IocrField.IOCS_SUBSLOT),
        (cr(1, (), [FrameSlot(1, 1, 0)]), IocrField.IOCS_SUBSLOT),
        (cr(2, (), [FrameSlot(1, 2, 0)]), IocrField.IOCS_SUBSLOT),
        (cr(1, (), [FrameSlot(1, 2, 0), FrameSlot(1, 2, 1)]), IocrField.IOCS_SUBSLOT),
        (cr(1, (), [FrameSlot(1, 2, 40)]), IocrField.IOCS_FRAME_OFFSET),
        (cr(1, [FrameSlot(1, 1, 0)], [FrameSlot(1, 2, 4)]), IocrField.IOCS_FRAME_OFFSET),
    ],
)
def test_a_layout_that_cannot_be_names_its_field(iocr, fault):
    with pytest.raises(LayoutError) as caught:
        compute_layout(iocr, EXPECTED)
    assert caught.value.field is fault


def test_data_without_octets_takes_the_place_of_its_status_alone():
    layout = compute_layout(cr(1, [FrameSlot(0, 1, 3)]), EXPECTED)
    assert (layout.data[0].data_length, layout.data[0].iops_offset) == (0, 3)


def discarding(sub):
    return replace(sub, properties=sub.properties | SubmoduleProperties.DISCARD_IOXS)


def test_discarded_status_octets_take_no_place_and_their_offsets_count_for_nothing():
    # as captured: every submodule without data at offset 0, under the data of another
    expected = {key: discarding(sub) for key, sub in EXPECTED.items() if sub.type == SubmoduleType.NO_IO}
    assert expected
    places = [FrameSlot(slot, subslot, 0) for _, slot, subslot in expected]
    inputs = compute_layout(cr(1, [*places, FrameSlot(1, 1, 0)]), EXPECTED | expected)
    assert [(d.data_length, d.iops_offset) for d in inputs.data[:-1]] == [(0, None)] * len(places)
    assert inputs.data[-1].iops_offset == inputs.data[-1].data_length
    outputs = compute_layout(cr(2, (), [*places, FrameSlot(1, 1, 0)]), EXPECTED | expected)
    assert [c.iocs_offset for c in outputs.iocs] == [None] * len(places) + [0]
    beyond = compute_layout(cr(1, [FrameSlot(0, 1, 0xFFFF)]), EXPECTED | expected)
    assert beyond.data[0].data_length == 0


def test_data_without_status_octets_lie_side_by_side():
    expected = {key: discarding(sub) for key, sub in EXPECTED.items()}
    layout = compute_layout(cr(1, [FrameSlot(1, 1, 0), FrameSlot(1, 3, 4)], [FrameSlot(1, 2, 0)]), expected)
    assert [(d.data_offset, d.data_length, d.iops_offset) for d in layout.data] == [(0, 4, None), (4, 2, None)]
    with pytest.raises(LayoutError):
        compute_layout(cr(1, [FrameSlot(1, 1, 0), FrameSlot(1, 3, 3)]), expected)


small = st.integers(0, 12)


@settings(max_examples=200)
@given(
    st.integers(1, 2),
    st.lists(st.builds(FrameSlot, st.integers(0, 2), st.integers(1, 4), small), max_size=4),
    st.lists(st.builds(FrameSlot, st.integers(0, 2), st.integers(1, 4), small), max_size=4),
)
def test_no_two_data_of_an_accepted_layout_share_an_octet(kind, data, iocs):
    try:
        layout = compute_layout(cr(kind, data, iocs, 20), EXPECTED)
    except LayoutError:
        return
    taken = [o for d in layout.data for o in range(d.data_offset, d.iops_offset + 1)]
    taken += [c.iocs_offset for c in layout.iocs]
    assert len(taken) == len(set(taken))
    assert max(taken) < 20


def test_slot_1_follows_the_expected_telegram_when_the_catalogue_has_it():
    plugged = Plugged(DRIVE)
    assert plugged[1, 2].submodule_ident == 0x69
    plugged.follow(1, 0x100)
    assert plugged[1, 2].submodule_ident == 0x68
    plugged.follow(1, 0x999)
    assert plugged[1, 2].submodule_ident == 0x68
    assert plugged.apis() == (0, 0x3A00)
    assert len(plugged) == len(list(plugged)) == 6


def test_a_pulled_or_forced_slot_does_not_follow_until_it_is_restored():
    plugged = Plugged(DRIVE)
    plugged.pull(1)
    plugged.follow(1, 0x100)
    assert (1, 2) not in plugged
    plugged.plug(1, telegram(0x777, 1, 2, 2))
    plugged.follow(1, 0x100)
    assert plugged.module(1).module_ident == 0x777
    plugged.restore(1)
    plugged.follow(1, 0x100)
    assert plugged.module(1).module_ident == 0x100
    with pytest.raises(KeyError):
        plugged[5, 1]
    plugged.restore(5)
    assert plugged.module(5) is None
    assert DRIVE.module(0, 2) is DRIVE.dap
    assert DRIVE.module(0, 3) is None
    assert plugged.submodule(0, 1, 2) is None
    assert plugged.submodule(0x3A00, 1, 2) is plugged[1, 2]


def test_lax_limits_ask_for_no_least_cycle():
    assert DRIVE.min_cycle_ns == 0
    strict = replace(DRIVE, limits=replace(DRIVE.limits, strict=True, min_cycle_ns=16_000_000))
    assert strict.min_cycle_ns == 16_000_000
    assert replace(strict, min_device_interval=1024).min_cycle_ns == 32_000_000
