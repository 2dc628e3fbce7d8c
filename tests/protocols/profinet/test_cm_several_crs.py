"""Several CRs in each direction of one AR, at both ends of context management."""

from collections import Counter
from dataclasses import replace

import pytest
from cmctl_pair import CONTROLLER, SECOND, device_fit_for, pair_of
from cmctl_peers import SUBMODULES, make_plan, plans
from hypothesis import given
from hypothesis import strategies as st

from pnfarm.errors import ConfigError
from pnfarm.protocols.profinet.cm.ar import CmdevState
from pnfarm.protocols.profinet.cm.controller.cmctl import CmctlState
from pnfarm.protocols.profinet.cm.controller.events import ArFailed
from pnfarm.protocols.profinet.cm.controller.frames import divide, plan_frames
from pnfarm.protocols.profinet.cm.controller.plan import PlannedSubmodule
from pnfarm.protocols.profinet.cm.controller.request import connect_payload
from pnfarm.protocols.profinet.errors import CmrpcError, IocrField
from pnfarm.protocols.profinet.wire.any_block import emit_blocks, parse_blocks
from pnfarm.protocols.profinet.wire.cm.iocr import MAX_C_SDU, MIN_C_SDU, FrameSlot, IocrBlockReq, IocrBlockRes, IocrType
from pnfarm.protocols.profinet.wire.rpc.pdu import Opnum

TELEGRAM = 0x3A00
SLOW = (32, 4)
#: A second module of another cycle: two CRs in each direction.
PLAN = make_plan(
    submodules=(*SUBMODULES, PlannedSubmodule(0, 2, 0x200, 1, 0x201, 20, 5, clock=SLOW)), input_crs=2, output_crs=2
)


def limited(inputs=2, outputs=2):
    device = device_fit_for(PLAN)
    return replace(device, limits=replace(device.limits, max_input_crs=inputs, max_output_crs=outputs))


def connect(change=lambda crs: crs, **limits):
    """Status and blocks of the answer to the plan's Connect, with other CRs than planned."""
    blocks = parse_blocks(connect_payload(PLAN, *plan_frames(PLAN)))
    crs = [block for block in blocks if isinstance(block, IocrBlockReq)]
    rest = [block for block in blocks if not isinstance(block, IocrBlockReq)]
    device = pair_of(PLAN, limited(**limits)).device
    device.receive_call(0, Opnum.CONNECT, emit_blocks([rest[0], *change(crs), *rest[1:]]), 4096, CONTROLLER, SECOND)
    ((_, status, answer),) = device.responses()
    return status, parse_blocks(answer) if status.ok else ()


def test_each_cr_has_its_own_frame_id_cycle_and_data_hold_time():
    status, answer = connect()
    assert status.ok
    frame_ids = {b.iocr_reference: b.frame_id for b in answer if isinstance(b, IocrBlockRes)}
    assert list(frame_ids) == [1, 2, 3, 4]
    assert (frame_ids[1], frame_ids[2]) == (0x8000, 0x8001)
    assert len(set(frame_ids.values())) == 4
    both = pair_of(PLAN, limited())
    both.start()
    assert both.controller.state is CmctlState.DATA
    (ar,) = both.device.ars
    assert ar.iocrs == both.controller.layouts
    assert [(cr.is_input, cr.reduction_ratio, cr.data_hold_ns // 1_000_000) for cr in ar.iocrs] == [
        (True, 1, 3), (True, 4, 12), (False, 4, 12), (False, 1, 3)
    ]  # fmt: skip
    assert [[(d.slot, d.data_length) for d in cr.data if d.data_length] for cr in ar.iocrs] == [
        [(1, 12)], [(2, 20)], [(2, 5)], [(1, 12)]
    ]  # fmt: skip


def test_data_exchange_begins_with_the_last_of_the_output_crs():
    both = pair_of(PLAN, limited())
    both.frames = False
    both.start()
    (ar,) = both.device.ars
    assert ar.state is CmdevState.WDATA
    both.device.data_received(ar.key, both.now, 3)
    assert ar.state is CmdevState.WDATA
    both.device.data_received(ar.key, both.now, 4)
    assert ar.state is CmdevState.DATA


def with_place(crs, number, kind, place):
    """One more place in a CR, of the API that the place's slot has."""
    api = TELEGRAM if place.slot == 1 else 0
    found = crs[number]
    known = {one.api: one for one in found.apis}
    entry = known.get(api, replace(found.apis[0], api=api, data_objects=(), iocs=()))
    known[api] = replace(entry, **{kind: (*getattr(entry, kind), place)})
    return [replace(cr, apis=tuple(known.values())) if cr is found else cr for cr in crs]


def replaced(crs, number, **fields):
    return [replace(cr, **fields) if place == number else cr for place, cr in enumerate(crs)]


ROOM = (0x40, CmrpcError.OUT_OF_PROVIDER_CONSUMER_ALARM_RESOURCES)
REFUSALS = {
    "inputs in two CRs": (lambda c: with_place(c, 1, "data_objects", FrameSlot(1, 2, 24)), IocrField.DATA_SUBSLOT),
    "outputs in two CRs": (lambda c: with_place(c, 2, "data_objects", FrameSlot(1, 2, 20)), IocrField.DATA_SUBSLOT),
    "a consumer status in two CRs": (lambda c: with_place(c, 0, "iocs", FrameSlot(2, 1, 39)), IocrField.IOCS_SUBSLOT),
    "an overlap in the last": (
        lambda c: with_place(c, 3, "iocs", FrameSlot(2, 1, 3)), IocrField.DATA_FRAME_OFFSET
    ),
    "a frame id twice": (lambda c: replaced(c, 1, frame_id=0x8000), IocrField.FRAME_ID),
    "a reference twice": (lambda c: replaced(c, 1, iocr_reference=1), IocrField.IOCR_REFERENCE),
    "a phase beyond its own ratio": (lambda c: replaced(c, 0, phase=2), IocrField.PHASE),
    "a data hold time too long": (lambda c: replaced(c, 3, data_hold_factor=0x1E00), IocrField.DATA_HOLD_FACTOR),
    "a CR without anything": (lambda c: replaced(c, 1, apis=()), IocrField.NUMBER_OF_APIS),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSALS)
def test_what_several_crs_may_not_be_is_refused_with_the_field(name):
    change, field = REFUSALS[name]
    status, _ = connect(change)
    assert (status.error_code1, IocrField(status.error_code2)) == (2, field)


def test_more_crs_than_the_device_has_are_refused_for_want_of_room():
    for limits in ({"inputs": 1}, {"outputs": 1}, {"inputs": 3, "outputs": 1}):
        status, _ = connect(**limits)
        assert (status.error_code1, status.error_code2) == ROOM
    assert connect(inputs=3)[0].ok


def test_a_direction_without_a_cr_is_missing_whatever_the_other_has():
    status, _ = connect(lambda crs: [cr for cr in crs if cr.iocr_type == IocrType.INPUT])
    assert (status.error_code1, status.error_code2) == (0x40, CmrpcError.IOCR_MISSING)


def test_output_crs_that_ask_for_one_frame_id_get_two():
    _, answer = connect(lambda crs: [replace(cr, frame_id=0x9000) if cr.iocr_type == 2 else cr for cr in crs])
    given = [b.frame_id for b in answer if isinstance(b, IocrBlockRes) and b.iocr_type == IocrType.OUTPUT]
    assert given[0] == 0x9000
    assert given[1] != 0x9000


def test_an_answer_without_one_of_the_crs_is_a_failure_at_the_controller():
    both = pair_of(PLAN, limited())
    both.controller.connect(both.now)
    (call,) = both.controller.calls(both.now)
    both.device.receive_call(call.key, call.opnum, call.payload, call.args_maximum, CONTROLLER, both.now)
    ((key, status, payload),) = both.device.responses()
    short = [b for b in parse_blocks(payload) if not (isinstance(b, IocrBlockRes) and b.iocr_reference == 4)]
    both.controller.call_returned(key, status, emit_blocks(short), both.now)
    (failed,) = [event for event in both.controller.events() if isinstance(event, ArFailed)]
    assert "0 IOCRBlockRes of the output CR (reference 4)" in failed.reason


@given(plans())
def test_planned_frames_have_each_datum_and_each_status_once_and_in_its_cycle(plan):
    layouts = plan_frames(plan)
    assert all(MIN_C_SDU <= layout.data_length <= MAX_C_SDU for layout in layouts)
    assert [layout.iocr_reference for layout in layouts] == list(range(1, len(layouts) + 1))
    places = Counter((cr.is_input, d.api, d.slot, d.subslot) for cr in layouts for d in cr.data)
    statuses = Counter((cr.is_input, c.api, c.slot, c.subslot) for cr in layouts for c in cr.iocs)
    for one in plan.submodules:
        key = (one.api, one.slot, one.subslot)
        wants = {True: one.provides_input, False: bool(one.output_bytes)}
        assert [places[way, *key] for way in (True, False)] == [wants[True], wants[False]]
        assert [statuses[way, *key] for way in (True, False)] == [wants[False], wants[True]]
        clock = one.clock or (plan.send_clock_factor, plan.reduction_ratio)
        for cr in layouts:
            if any((d.api, d.slot, d.subslot) == key for d in cr.data):
                assert (cr.send_clock_factor, cr.reduction_ratio) == clock
                assert 1 <= cr.phase <= cr.reduction_ratio


@pytest.mark.parametrize(
    ("lengths", "frames"), [((500, 500, 900, 900), 2), ((720, 720, 720), 3), ((1438, 700, 700), 2)]
)
def test_as_few_frames_are_used_as_the_lengths_need(lengths, frames):
    submodules = [PlannedSubmodule(0, slot, 7, 1, 8, octets, octets) for slot, octets in enumerate(lengths)]
    inputs, outputs = divide(submodules, (32, 1), (frames, frames))
    assert (len(inputs), len(outputs)) == (frames, frames)
    with pytest.raises(ConfigError, match=f"need {frames} frames"):
        divide(submodules, (32, 1), (frames - 1, frames))


@given(st.data())
def test_whatever_is_put_where_is_refused_or_in_one_place_of_one_frame(data):
    """Places of the plan at any offset in any CR, in several or in none."""
    planned = [b for b in parse_blocks(connect_payload(PLAN, *plan_frames(PLAN))) if isinstance(b, IocrBlockReq)]
    offsets = st.one_of(st.integers(0, 45), st.integers(0, 0xFFFF))

    def drawn(places):
        chosen = data.draw(st.lists(st.sampled_from(places), max_size=4)) if places else ()
        return tuple(replace(one, frame_offset=data.draw(offsets)) for one in chosen)

    def change(crs):
        return [
            replace(cr, apis=tuple(
                replace(api, data_objects=api.data_objects + drawn(api.data_objects), iocs=drawn(api.iocs) or api.iocs)
                for api in data.draw(st.sampled_from(planned)).apis
            )) if data.draw(st.booleans()) else cr
            for cr in crs
        ]  # fmt: skip

    changed = change(planned)
    status, answer = connect(lambda _: changed)
    if not status.ok:
        assert status.error_code1 == 2
        assert status.error_code2 in list(IocrField)
        return
    assert len([b for b in answer if isinstance(b, IocrBlockRes)]) == 4
    for kind in (IocrType.INPUT, IocrType.OUTPUT):
        crs = [cr for cr in changed if cr.iocr_type == kind]
        for places in ("data_objects", "iocs"):
            keys = [(api.api, p.slot, p.subslot) for cr in crs for api in cr.apis for p in getattr(api, places)]
            assert len(keys) == len(set(keys))
