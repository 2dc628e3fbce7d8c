"""What captured controllers send beside the standard's tables, and real devices take: the device takes it, too."""

from dataclasses import replace

import pytest
from cm_requests import BASE, drive, iocr, telegram_sub, with_blocks
from cm_support import ALARM_BLOCK, DAP_BLOCK, DRIVE_BLOCK, MS, UUID_2, Bench, Plan

from pnfarm.protocols.profinet.cm.device.events import ArConnected, SubmodulesChanged
from pnfarm.protocols.profinet.wire.any_block import parse_blocks
from pnfarm.protocols.profinet.wire.cm.expected import (
    DataDescription,
    ExpectedSubmodule,
    ExpectedSubmoduleBlockReq,
    IdentInfo,
    ModuleDiffBlock,
    ModuleState,
    SubmoduleProperties,
)
from pnfarm.protocols.profinet.wire.cm.iocr import FrameSlot, IocrApi, IocrBlockRes

P = Plan()
DISCARD = SubmoduleProperties.DISCARD_IOXS


def connected(bench, plan):
    """The event of an accepted Connect, and the blocks of its answer."""
    status, answer = bench.connect(plan)
    assert status.ok, bench.events()
    event = next(e for e in bench.events() if isinstance(e, ArConnected))
    return event, parse_blocks(answer)


def diff(blocks):
    return next((b for b in blocks if isinstance(b, ModuleDiffBlock)), None)


@pytest.mark.parametrize("vlan", [0, 1, 4, 0x0FFF])
def test_any_vlan_id_is_taken_and_the_frames_carry_it(vlan):
    bench = Bench()
    tagged = replace(
        P,
        inputs=replace(P.inputs, tag_header=0xC000 | vlan),
        outputs=replace(P.outputs, tag_header=0xC000 | vlan),
        alarm=replace(P.alarm, tag_header_high=0xC000 | vlan, tag_header_low=0xA000 | vlan),
    )
    event, _ = connected(bench, tagged)
    assert [cr.tag_header for cr in event.iocrs] == [0xC000 | vlan] * 2
    bench.cm.abort(bench.key(), 5, bench.now)
    (frame,) = bench.cm.rta_to_send()
    assert (frame.tag.priority, frame.tag.vid) == (5, vlan)


# Submodules in no IOCR


def beside(*submodules):
    """The drive's module with further submodules that no IOCR names."""
    return drive(submodules=(*P.drive.submodules, *submodules))


def test_an_expected_submodule_in_no_iocr_is_accepted_and_a_missing_one_is_in_the_module_diff_block():
    bench = Bench()
    missing = ExpectedSubmodule(3, 0xFFFF010A, 0, (DataDescription(1, 0),))
    event, blocks = connected(bench, beside(missing))
    ((module,),) = (api.modules for api in diff(blocks).apis)
    assert (module.slot, module.state) == (1, ModuleState.PROPER_MODULE)
    assert [(s.subslot, s.ident_info) for s in module.submodules] == [(3, IdentInfo.NO_SUBMODULE)]
    assert (P.drive.api, 1, 3) in event.unusable
    assert all((p.slot, p.subslot) != (1, 3) for cr in event.iocrs for p in (*cr.data, *cr.iocs))


def test_an_expected_submodule_in_no_iocr_that_is_there_is_no_difference():
    bench = Bench()
    without = (FrameSlot(0, 1, 0), FrameSlot(0, 0x8000, 1), FrameSlot(0, 0x8001, 2))
    shorter = replace(
        P,
        inputs=replace(P.inputs, apis=(IocrApi(0, without), P.inputs.apis[1])),
        outputs=replace(P.outputs, apis=(IocrApi(0, (), without), P.outputs.apis[1])),
    )
    event, blocks = connected(bench, shorter)
    assert diff(blocks) is None
    assert event.unusable == frozenset()
    assert (0, 0, 0x8002) in bench.cm.ars[0].owned


def test_a_telegram_in_no_iocr_connects_without_data():
    bench = Bench()
    dap = (P.inputs.apis[0], IocrApi(P.drive.api, (FrameSlot(1, 1, 4),)))
    status = (P.outputs.apis[0], IocrApi(P.drive.api, (), (FrameSlot(1, 1, 4),)))
    bare = replace(P, inputs=replace(P.inputs, apis=dap), outputs=replace(P.outputs, apis=status))
    event, blocks = connected(bench, bare)
    assert diff(blocks) is None
    assert not any(p.data_length for cr in event.iocrs for p in cr.data)


# DiscardIOXS


def discarding(block):
    """The block's submodules without data, as captured Siemens controllers ask for them."""
    subs = tuple(s if s.type else replace(s, properties=s.properties | DISCARD) for s in block.submodules)
    return replace(block, submodules=subs)


DISCARDED = replace(
    P,
    dap=discarding(DAP_BLOCK),
    drive=discarding(DRIVE_BLOCK),
    # every place without octets at offset 0, the telegram's data there as well
    inputs=replace(
        P.inputs,
        apis=(
            IocrApi(0, tuple(replace(e, frame_offset=0) for e in P.inputs.apis[0].data_objects)),
            IocrApi(P.drive.api, (FrameSlot(1, 1, 0), FrameSlot(1, 2, 0)), (FrameSlot(1, 2, 13),)),
        ),
    ),
    outputs=replace(
        P.outputs,
        apis=(
            IocrApi(0, (), tuple(replace(e, frame_offset=0) for e in P.outputs.apis[0].iocs)),
            IocrApi(P.drive.api, (FrameSlot(1, 2, 1),), (FrameSlot(1, 1, 0), FrameSlot(1, 2, 0))),
        ),
    ),
)


def test_discarded_status_octets_are_taken_as_siemens_controllers_ask_for_them():
    bench = Bench()
    event, blocks = connected(bench, DISCARDED)
    assert diff(blocks) is None
    assert event.unusable == frozenset()
    inputs, outputs = event.iocrs
    assert [(d.slot, d.subslot, d.data_offset, d.iops_offset) for d in inputs.data if d.iops_offset is not None] == [
        (1, 2, 0, 12)
    ]
    assert [(c.slot, c.subslot, c.iocs_offset) for c in outputs.iocs if c.iocs_offset is not None] == [(1, 2, 0)]
    assert len(inputs.data) == 6
    assert len(outputs.iocs) == 6


def test_the_start_up_with_discarded_status_octets_ends_in_data():
    bench = Bench()
    connected(bench, DISCARDED)
    assert bench.prm_end()[0].ok
    assert bench.cm.application_ready(bench.key(), bench.now)
    (changed,) = [e for e in bench.events() if isinstance(e, SubmodulesChanged)]
    assert changed.unusable == frozenset()


@pytest.mark.parametrize("lengths", [(1, 1), (0, 0), (2, 3)])
def test_the_lengths_of_discarded_status_octets_mean_nothing(lengths):
    iocs, iops = lengths
    both = tuple(replace(d, iocs_length=iocs, iops_length=iops) for d in P.drive.submodules[1].data)
    assert Bench().connect(telegram_sub(properties=3 | DISCARD, data=both))[0].ok


def test_data_may_be_without_status_octets_in_both_directions():
    # the data end where the frame ends, and leave no octet for a status
    telegram_alone = (IocrApi(P.drive.api, (FrameSlot(1, 2, 28),), (FrameSlot(1, 2, 0),)),)
    bare = replace(
        telegram_sub(properties=3 | DISCARD),
        inputs=replace(P.inputs, apis=telegram_alone),
        outputs=replace(P.outputs, apis=telegram_alone),
    )
    event, _ = connected(Bench(), bare)
    for cr in event.iocrs:
        (place,) = cr.data
        assert (place.data_offset, place.data_length, place.iops_offset) == (28, 12, None)
        assert [c.iocs_offset for c in cr.iocs] == [None]


# Frame ids and factors


@pytest.mark.parametrize("asked", [0x0000, 0x0100, 0x8000, 0x8888, 0xBBFF, 0xC000, 0xFFFE, 0xFFFF])
def test_an_output_crs_frame_id_is_honoured_where_it_is_of_its_class_and_chosen_elsewhere(asked):
    event, blocks = connected(Bench(), replace(P, outputs=replace(P.outputs, frame_id=asked)))
    (given,) = [b.frame_id for b in blocks if isinstance(b, IocrBlockRes) and b.iocr_type == 2]
    assert given == event.iocrs[1].frame_id
    if 0x8000 <= asked <= 0xBBFF:
        assert given == asked
    else:
        assert 0x8000 <= given <= 0xBBFF
        assert given != P.inputs.frame_id


def test_two_controllers_that_ask_for_one_output_frame_id_get_two():
    bench = Bench(replace(Bench().cm.description, limits=replace(Bench().cm.description.limits, max_ars=2)))
    wished = replace(P, outputs=replace(P.outputs, frame_id=0x8888))
    first, _ = connected(bench, wished)
    other = replace(
        wished,
        ar=replace(wished.ar, ar_uuid=UUID_2, station_name=b"plc-2", initiator_mac=bytes.fromhex("020000000002")),
        inputs=replace(wished.inputs, frame_id=0x8002),
    )
    second, _ = connected(bench, other)
    assert first.iocrs[1].frame_id == 0x8888
    assert second.iocrs[1].frame_id not in {0x8888, 0x8001, 0x8002}


@pytest.mark.parametrize("factor", [0, 1, 24, 0xFFFF])
def test_the_watchdog_factor_of_older_editions_is_not_looked_at(factor):
    event, _ = connected(Bench(), iocr(watchdog_factor=factor, data_hold_factor=5))
    assert event.iocrs[0].data_hold_ns == 5 * 2 * MS


# Order and number of blocks


def test_the_alarm_cr_may_come_before_the_iocrs():
    """Hilscher's and CODESYS' controllers send it second."""
    assert Bench().connect(with_blocks(BASE[0], ALARM_BLOCK, *BASE[1:-1]))[0].ok


def test_one_expected_block_for_each_submodule_s_slot_and_one_for_all_are_the_same():
    answers = {
        bench.connect(with_blocks(*BASE[:3], *expected, BASE[-1]))[1]
        for bench, expected in (
            (Bench(), [ExpectedSubmoduleBlockReq((P.dap, P.drive))]),
            (Bench(), [ExpectedSubmoduleBlockReq((P.dap,)), ExpectedSubmoduleBlockReq((P.drive,))]),
            (Bench(), [ExpectedSubmoduleBlockReq((P.drive,)), ExpectedSubmoduleBlockReq((P.dap,))]),
        )
    }
    assert len(answers) == 1
    assert b"" not in answers
