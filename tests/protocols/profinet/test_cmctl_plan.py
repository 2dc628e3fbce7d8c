"""The plan of an AR: frame layouts, the Connect request, what is refused and what is warned of."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from cmctl_peers import SUBMODULES, make_plan, plans
from hypothesis import given
from hypothesis import strategies as st

from pnfarm.errors import ConfigError
from pnfarm.protocols.profinet.cm.ar import compute_layout, expected_submodules
from pnfarm.protocols.profinet.cm.controller.frames import plan_frames
from pnfarm.protocols.profinet.cm.controller.plan import ArPlan, ParameterRecord, PlannedSubmodule
from pnfarm.protocols.profinet.cm.controller.request import connect_payload, groups_of_records
from pnfarm.protocols.profinet.wire.any_block import parse_blocks
from pnfarm.protocols.profinet.wire.block import split_blocks
from pnfarm.protocols.profinet.wire.cm.connect import AlarmCrBlockReq, ArBlockReq
from pnfarm.protocols.profinet.wire.cm.expected import ExpectedSubmoduleBlockReq, SubmoduleProperties
from pnfarm.protocols.profinet.wire.cm.iocr import IocrBlockReq

CAPTURES = Path(__file__).resolve().parents[3].parent / "shared" / "captures"


def frame_blocks(plan: ArPlan) -> tuple[list[IocrBlockReq], list[ExpectedSubmoduleBlockReq]]:
    blocks = parse_blocks(connect_payload(plan, *plan_frames(plan)))
    return (
        [b for b in blocks if isinstance(b, IocrBlockReq)],
        [b for b in blocks if isinstance(b, ExpectedSubmoduleBlockReq)],
    )


def test_data_with_its_provider_status_comes_first_and_consumer_status_after_all_data() -> None:
    input_layout, output_layout = plan_frames(make_plan())
    assert [(d.slot, d.subslot, d.data_offset, d.data_length, d.iops_offset) for d in input_layout.data] == [
        (0, 1, 0, 0, 0),
        (0, 0x8000, 1, 0, 1),
        (0, 0x8001, 2, 0, 2),
        (0, 0x8002, 3, 0, 3),
        (1, 1, 4, 0, 4),
        (1, 2, 5, 12, 17),
    ]
    assert [(c.slot, c.subslot, c.iocs_offset) for c in input_layout.iocs] == [(1, 2, 18)]
    assert [(d.slot, d.subslot, d.data_offset, d.iops_offset) for d in output_layout.data] == [(1, 2, 0, 12)]
    assert [c.iocs_offset for c in output_layout.iocs] == [13, 14, 15, 16, 17, 18]


def test_a_short_frame_is_padded_to_forty_octets_and_a_long_one_is_not() -> None:
    assert [layout.data_length for layout in plan_frames(make_plan())] == [40, 40]
    wide = (*SUBMODULES[:-1], replace(SUBMODULES[-1], input_bytes=100))
    assert [layout.data_length for layout in plan_frames(make_plan(submodules=wide))] == [107, 40]


def test_discarded_status_octets_are_in_no_frame_and_the_request_still_names_the_submodule() -> None:
    discard = SubmoduleProperties.DISCARD_IOXS
    without = tuple(s if s.input_bytes else replace(s, properties=discard) for s in SUBMODULES)
    plan = make_plan(submodules=without)
    inputs, outputs = plan_frames(plan)
    assert [(d.data_offset, d.data_length, d.iops_offset) for d in inputs.data] == [(0, 0, None)] * 5 + [(0, 12, 12)]
    assert [c.iocs_offset for c in inputs.iocs] == [13]
    assert [(d.data_offset, d.iops_offset) for d in outputs.data] == [(0, 12)]
    assert [c.iocs_offset for c in outputs.iocs] == [None] * 5 + [13]
    (asked, answered), expected = frame_blocks(plan)
    assert [e.frame_offset for api in asked.apis for e in api.data_objects] == [0] * 6
    assert [e.frame_offset for api in answered.apis for e in api.iocs] == [0] * 5 + [13]
    assert [s.properties for b in expected for a in b.apis for s in a.submodules] == [discard] * 5 + [3]


def test_an_output_only_submodule_has_its_consumer_status_in_the_input_frame() -> None:
    only_output = (PlannedSubmodule(0, 0, 2, 1, 1), PlannedSubmodule(0, 1, 3, 1, 1, output_bytes=4))
    input_layout, output_layout = plan_frames(make_plan(submodules=only_output))
    assert [d.slot for d in input_layout.data] == [0]
    assert [c.slot for c in input_layout.iocs] == [1]
    assert [d.slot for d in output_layout.data] == [1]
    assert [c.slot for c in output_layout.iocs] == [0]


@given(plans())
def test_the_device_side_reads_the_same_layouts_out_of_the_connect_request(plan: ArPlan) -> None:
    iocrs, expected = frame_blocks(plan)
    submodules = expected_submodules([api for block in expected for api in block.apis])
    assert tuple(compute_layout(iocr, submodules) for iocr in iocrs) == plan_frames(plan)


@given(plans())
def test_expected_submodules_come_in_one_block_per_slot(plan: ArPlan) -> None:
    _, blocks = frame_blocks(plan)
    places = [(api.api, api.slot) for block in blocks for api in block.apis]
    assert places == sorted({(s.api, s.slot) for s in plan.submodules})
    assert len(blocks) == len(places)


@pytest.mark.parametrize(("startup", "properties"), [("legacy", 0x00000011), ("advanced", 0x40000011)])
def test_the_start_up_mode_is_in_the_ar_properties(startup: str, properties: int) -> None:
    plan = make_plan(startup=startup)
    ar = next(b for b in parse_blocks(connect_payload(plan, *plan_frames(plan))) if isinstance(b, ArBlockReq))
    assert ar.properties == properties


def test_the_connect_request_of_a_captured_controller_differs_only_in_its_output_offsets() -> None:
    capture = CAPTURES / "drive_connect_api3a00.pcap"
    if not capture.exists():
        pytest.skip("captures of real controllers are not here")
    from scapy.layers.inet import UDP
    from scapy.utils import rdpcap

    packet = next(p for p in rdpcap(str(capture)) if UDP in p and len(p[UDP].payload) > 500)
    captured = split_blocks(bytes(packet[UDP].payload)[80 + 20 :])
    plan = make_plan(
        controller_name="pn-io-1",
        controller_mac=bytes.fromhex("000e8cb06c7e"),
        session_key=1,
        send_clock_factor=128,
        input_frame_id=0x8061,
        alarm_cr=AlarmCrBlockReq(local_alarm_reference=1, max_alarm_data_length=256),
    )
    ours = split_blocks(connect_payload(plan, *plan_frames(plan)))
    assert [b.block_type for b in ours] == [b.block_type for b in captured]
    different = [n for n, (a, b) in enumerate(zip(ours, captured, strict=True)) if a != b]
    assert different == [2]  # that controller puts consumer status before the data of the output frame
    assert len(ours[2].body) == len(captured[2].body)


@pytest.mark.parametrize(
    ("submodules", "sentence"),
    [
        ((), "expects no submodule"),
        ((SUBMODULES[0], SUBMODULES[0]), "is given twice"),
        ((SUBMODULES[0], replace(SUBMODULES[1], module_ident=3)), "one slot has one module"),
        ((replace(SUBMODULES[0], input_bytes=1440),), "1441 octets of input with the status, a frame takes 1440"),
        ((replace(SUBMODULES[0], output_bytes=1440),), "1441 octets of output with the status, a frame takes 1440"),
        ((replace(SUBMODULES[0], input_bytes=-1),), "negative length"),
        ((replace(SUBMODULES[0], properties=1 << 3),), "reduced lengths"),
        ((replace(SUBMODULES[0], properties=1 << 4),), "reduced lengths"),
    ],
)
def test_a_plan_that_cannot_be_laid_out_is_the_users_error(
    submodules: tuple[PlannedSubmodule, ...], sentence: str
) -> None:
    with pytest.raises(ConfigError, match=sentence):
        plan_frames(make_plan(submodules=submodules))


def test_the_object_uuid_names_instance_device_and_vendor() -> None:
    assert str(make_plan().device_object_uuid) == "dea00000-6c97-11d1-8271-000100010105"


@given(st.lists(st.binary(max_size=120), max_size=20), st.integers(0, 600))
def test_multiple_writes_keep_the_order_of_records_and_their_limit(datas: list[bytes], limit: int) -> None:
    records = [ParameterRecord(0, 1, 1, n, data) for n, data in enumerate(datas)]
    groups = groups_of_records(records, limit)
    assert [record for group in groups for record in group] == records
    for group in groups:
        octets = sum(64 + len(r.data) + -len(r.data) % 4 for r in group)
        assert octets <= limit or len(group) == 1
