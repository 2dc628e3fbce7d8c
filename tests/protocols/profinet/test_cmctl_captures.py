"""The controller's AR against the recorded answers of real devices: what it sends is what a real controller sent."""

from __future__ import annotations

from pathlib import Path

import pytest
from cmctl_peers import make_plan

from pnfarm.protocols.profinet.cm.controller.cmctl import CmController, CmctlState
from pnfarm.protocols.profinet.cm.controller.events import (
    ApplicationReadyReceived,
    ArEstablished,
    Connected,
    RecordWriteDone,
)
from pnfarm.protocols.profinet.cm.controller.plan import ArPlan, ParameterRecord, PlannedSubmodule
from pnfarm.protocols.profinet.wire.any_block import parse_blocks
from pnfarm.protocols.profinet.wire.cm.connect import AlarmCrBlockReq, ArBlockReq
from pnfarm.protocols.profinet.wire.cm.expected import DataDirection, ExpectedSubmoduleBlockReq
from pnfarm.protocols.profinet.wire.cm.iocr import IocrBlockReq
from pnfarm.protocols.profinet.wire.records.iod import parse_write_request
from pnfarm.protocols.profinet.wire.rpc.pdu import (
    Opnum,
    PacketType,
    PnioStatus,
    parse_request_args,
    parse_response_args,
    parse_rpc,
)

CAPTURES = Path(__file__).resolve().parents[3].parent / "shared" / "captures"
NAMES = ("drive_connect_api3a00.pcap", "dacookie_connectrequest.pcap", "pnio-rs_s7-1515_golden.pcap")

Requests = list[tuple[int, bytes]]
Responses = list[tuple[int, PnioStatus, bytes]]


def conversation(name: str) -> tuple[Requests, Responses]:
    """The start-up's requests and responses of both ends, in order."""
    path = CAPTURES / name
    if not path.exists():
        pytest.skip("captures of real controllers are not here")
    from scapy.layers.inet import UDP
    from scapy.utils import PcapReader

    requests: Requests = []
    responses: Responses = []
    with PcapReader(str(path)) as packets:
        for packet in packets:
            if UDP not in packet or len(packet[UDP].payload) <= 80:
                continue
            pdu = parse_rpc(bytes(packet[UDP].payload))
            if pdu.packet_type == PacketType.REQUEST:
                requests.append((pdu.opnum, parse_request_args(pdu.body, little_endian=pdu.little_endian).payload))
            elif pdu.packet_type == PacketType.RESPONSE:
                args = parse_response_args(pdu.body, little_endian=pdu.little_endian)
                responses.append((pdu.opnum, args.status, args.payload))
            if len(responses) == len(requests) and [r[0] for r in requests].count(Opnum.CONTROL) == 2:
                break
    return requests, responses


def plan_of(requests: Requests) -> ArPlan:
    """The plan that the captured controller must have had."""
    blocks = parse_blocks(requests[0][1])
    ar = next(b for b in blocks if isinstance(b, ArBlockReq))
    iocr = next(b for b in blocks if isinstance(b, IocrBlockReq))
    alarm = next(b for b in blocks if isinstance(b, AlarmCrBlockReq))
    submodules = tuple(
        PlannedSubmodule(
            api.api,
            api.slot,
            api.module_ident,
            sub.subslot,
            sub.submodule_ident,
            sub.length(DataDirection.INPUT),
            sub.length(DataDirection.OUTPUT),
        )
        for block in blocks
        if isinstance(block, ExpectedSubmoduleBlockReq)
        for api in block.apis
        for sub in api.submodules
    )
    writes = [w for opnum, payload in requests if opnum == Opnum.WRITE for w in parse_write_request(payload).writes]
    return make_plan(
        ar_uuid=ar.ar_uuid,
        session_key=ar.session_key,
        controller_name=ar.station_name.decode(),
        controller_mac=ar.initiator_mac,
        controller_object_uuid=ar.initiator_object_uuid,
        activity_timeout_factor=ar.activity_timeout_factor,
        startup="advanced" if ar.properties >> 30 & 1 else "legacy",
        submodules=submodules,
        records=tuple(
            ParameterRecord(w.header.api, w.header.slot, w.header.subslot, w.header.index, w.data) for w in writes
        ),
        multiple_write=True,
        multiple_write_octets=1400,
        send_clock_factor=iocr.send_clock_factor,
        reduction_ratio=iocr.reduction_ratio,
        input_frame_id=iocr.frame_id,
        alarm_cr=alarm,
    )


@pytest.mark.parametrize("name", NAMES)
def test_a_recorded_device_is_started_with_the_octets_of_the_recorded_controller(name: str) -> None:
    requests, responses = conversation(name)
    *calls, (ready_opnum, ready) = requests
    *answers, (_, ready_status, ready_answer) = responses
    plan = plan_of(requests)
    controller = CmController(plan)
    controller.connect(0)
    for (opnum, payload), (_, status, answer) in zip(calls, answers, strict=True):
        (call,) = controller.calls(0)
        assert call.opnum == opnum
        if opnum != Opnum.CONNECT:
            assert call.payload == payload
        else:
            # the fixed part and the submodules are the same, only places in the frames are this controller's own
            assert len(call.payload) == len(payload) or name.startswith("dacookie")  # that one adds vendor blocks
            ours = [b for b in parse_blocks(call.payload) if not isinstance(b, IocrBlockReq)]
            assert [b for b in ours if b not in parse_blocks(payload)] == []
        controller.call_returned(call.key, status, answer, 0)
    controller.receive_call("ready", ready_opnum, ready, 0)
    assert controller.responses() == [("ready", ready_status, ready_answer)]
    assert controller.state is CmctlState.DATA
    events = controller.events()
    assert isinstance(events[0], Connected)
    assert all(e.ok for e in events if isinstance(e, RecordWriteDone))
    assert events[-1] == ArEstablished()


def test_the_substitutes_that_a_recorded_drive_names_are_reported_as_text() -> None:
    requests, responses = conversation(NAMES[0])
    controller = CmController(plan_of(requests))
    controller.connect(0)
    for _, status, answer in responses[:-1]:
        (call,) = controller.calls(0)
        controller.call_returned(call.key, status, answer, 0)
    controller.receive_call("ready", *requests[-1], 0)
    connected, ready = (e for e in controller.events() if isinstance(e, Connected | ApplicationReadyReceived))
    assert connected.module_diff == ready.module_diff
    assert [d.text for d in ready.module_diff] == [
        "slot 1 subslot 0x0001: substitute submodule, device has 0x0000FFFF",
        "slot 1 subslot 0x0002: substitute submodule, device has 0x00000068",
    ]
    assert all(d.fits for d in ready.module_diff)
