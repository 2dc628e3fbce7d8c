"""Connect requests that real controllers sent, octet for octet from UDP 34964, to drives that fit them or do not."""

from __future__ import annotations

import itertools
import json
import statistics
from typing import NamedTuple

import pytest
from interop_rig import Capture, captured_datagrams, running
from tools import needed

from pnfarm.protocols.profinet.wire.any_block import parse_blocks
from pnfarm.protocols.profinet.wire.cm.connect import AlarmCrBlockRes, ArBlockReq, ArBlockRes, ArServerBlock
from pnfarm.protocols.profinet.wire.cm.control import ControlBlock
from pnfarm.protocols.profinet.wire.cm.expected import ModuleDiffBlock
from pnfarm.protocols.profinet.wire.cm.iocr import IocrBlockReq, IocrBlockRes
from pnfarm.protocols.profinet.wire.records.iod import parse_write_request, parse_write_response
from pnfarm.protocols.profinet.wire.rpc.pdu import PacketType, parse_request_args, parse_rpc

#: The drives stand at the addresses of the captured devices and have their vendor, device and ident numbers.
DRIVES = [
    "{name: captured-drive, model: akd-profinet, ip: 192.168.1.13/24, limits: lax, identity: *drive}",
    "{name: rt-labs-dev, model: akd-profinet, ip: 172.16.2.10/24, limits: lax, identity: *sample}",
    "{name: io-device, model: akd-profinet, ip: 192.168.0.10/24, limits: lax, identity: *et200}",
]
IDENTITIES = {
    "*drive": "{vendor: 0x80, device: 1, dap: 2, dap_submodules: {1: 1, 0x8000: 2, 0x8001: 3},"
    " access_point: 0xFFFF, telegrams: {1: {module: 0x100, submodule: 0x68}}}",
    "*sample": "{vendor: 0x493, device: 2, dap: 1, dap_submodules: {1: 1, 0x8000: 0x8000, 0x8001: 0x8001}}",
    "*et200": "{vendor: 0x2A, device: 0x313}",
}
DRIVE, S7_1515, S7_1500 = "drive_connect_api3a00", "pnio-rs_s7-1515_golden", "dacookie_connectrequest"
NAMES = {DRIVE: "captured-drive", S7_1515: "rt-labs-dev", S7_1500: "io-device"}
CONNECT, CONTROL, WRITE, READ = 0, 4, 3, 2
GOOD, BAD = 0x80, 0x00


class Conversation(NamedTuple):
    """What a captured controller asked, and what came back; by operation number, in order."""

    asked: dict[int, list[bytes]]
    answered: dict[int, list[dict]]
    call: dict | None


@pytest.fixture(scope="module")
def line(lab, tmp_path_factory):
    needed("tshark")
    for address in ("192.168.1.12/24", "172.16.2.100/24", "192.168.0.1/24"):
        lab.run("peer", "ip", "address", "add", address, "dev", "plc0")
    folder = tmp_path_factory.mktemp("line")
    drives = DRIVES
    for mark, identity in IDENTITIES.items():
        drives = [drive.replace(mark, identity) for drive in drives]
    with running(lab, folder, drives, name="captures") as farm:
        yield lab, farm, folder


@pytest.fixture(scope="module")
def replayed(line):
    """Replays one captured start-up; the conversation, and a capture of it."""
    lab, _, folder = line
    done = {}

    def replay(name):
        if name in done:
            return done[name]
        datagrams = captured_datagrams(name)
        controller, device, _ = datagrams[0]
        pdus = [(text, parse_rpc(text)) for source, _, text in datagrams if source == controller]
        # the controller's requests up to the end of parametrisation; what follows depends on the device
        requests = [(text, pdu) for text, pdu in pdus if pdu.kind in {PacketType.REQUEST, PacketType.PING}]
        end = next(i for i, (_, pdu) in enumerate(requests) if pdu.kind == PacketType.REQUEST and pdu.opnum == CONTROL)
        requests = requests[: end + 1]
        plan = folder / f"{name}.json"
        plan.write_text(
            json.dumps({"local": controller, "ip": device, "requests": [t.hex() for t, _ in requests]}),
            encoding="utf-8",
        )
        with Capture(lab, folder / f"{name}.pcapng") as capture:
            found = lab.peer_json("peer_raw.py", "replay", plan)
        asked, answered = {}, {}
        for (_, pdu), answer in zip(requests, found, strict=True):
            if pdu.kind == PacketType.REQUEST:
                payload = parse_request_args(pdu.body, little_endian=pdu.little_endian).payload
                asked.setdefault(pdu.opnum, []).append(payload)
                answered.setdefault(pdu.opnum, []).append(answer)
            else:
                assert answer["type"] == "NOCALL"
        done[name] = Conversation(asked, answered, found[-1].get("call")), capture
        return done[name]

    return replay


def connect_of(conversation):
    """The blocks asked and the blocks answered, by their class."""
    asked, answer = conversation.asked[CONNECT][0], conversation.answered[CONNECT][0]
    assert answer["status"] == 0, hex(answer["status"])

    def sorted_out(payload):
        found = {}
        for block in parse_blocks(payload):
            found.setdefault(type(block), []).append(block)
        return found

    return sorted_out(asked), sorted_out(bytes.fromhex(answer["payload"]))


@pytest.mark.parametrize("name", list(NAMES))
def test_a_real_controllers_connect_is_answered_block_by_block(line, replayed, name):
    _, farm, _ = line
    conversation, _ = replayed(name)
    asked, answered = connect_of(conversation)
    drive = farm.ask("drive", name=NAMES[name])
    (wanted,), (got,) = asked[ArBlockReq], answered[ArBlockRes]
    assert (got.ar_type, got.ar_uuid, got.session_key) == (wanted.ar_type, wanted.ar_uuid, wanted.session_key)
    assert got.responder_mac.hex(":") == drive["mac"]
    assert got.udp_rt_port == 0x8892
    crs = {cr.iocr_reference: cr for cr in asked[IocrBlockReq]}
    for cr in answered[IocrBlockRes]:
        assert cr.iocr_type == crs.pop(cr.iocr_reference).iocr_type
    assert not crs
    inputs, outputs = answered[IocrBlockRes]
    assert inputs.frame_id == asked[IocrBlockReq][0].frame_id, "the controller chose it"
    assert 0x8000 <= outputs.frame_id < 0xFC00, "the device chose it"
    (alarm,) = answered[AlarmCrBlockRes]
    assert alarm.alarm_cr_type == 1
    assert 200 <= alarm.max_alarm_data_length <= 1432
    advanced = bool(wanted.properties & 0x40000000)
    servers = answered.get(ArServerBlock, [])
    # advanced start-up asks who answers; legacy start-up leaves it open
    if advanced:
        assert [server.station_name for server in servers] == [NAMES[name].encode()]


@pytest.mark.parametrize("name", list(NAMES))
def test_wireshark_finds_nothing_wrong_with_the_answers(replayed, name):
    _, capture = replayed(name)
    rows = capture.fields(
        "frame.number", "_ws.col.Info", "_ws.expert.message",
        where="eth.src[0:1]==02 && !(ip.src==172.16.2.100 || ip.src==192.168.1.12 || ip.src==192.168.0.1)"
        " && (_ws.malformed || _ws.expert.severity>=6291456)",
    )  # fmt: skip
    assert not rows
    assert capture.fields("frame.number", where="pn_io.opnum==0 && dcerpc.pkt_type==2 && pn_io.error_code==0")


def test_the_drive_that_fits_connects_without_a_difference_and_becomes_ready(replayed):
    conversation, _ = replayed(DRIVE)
    _, answered = connect_of(conversation)
    assert ModuleDiffBlock not in answered
    (end,) = conversation.answered[CONTROL]
    assert end["status"] == 0
    assert conversation.call is not None, "no ApplicationReady"
    assert conversation.call["right"]
    blocks = parse_blocks(bytes.fromhex(conversation.call["payload"]))
    assert [type(block) for block in blocks] == [ControlBlock]


def test_the_drive_that_fits_sends_its_frames_as_the_controller_laid_them_out(replayed):
    """Frame id, length, cycle, offsets and receiver of the captured Connect; not the receiver of its datagrams."""
    conversation, capture = replayed(DRIVE)
    asked, _ = connect_of(conversation)
    inputs, (ar,) = asked[IocrBlockReq][0], asked[ArBlockReq]
    rows = capture.fields(
        "frame.time_relative", "pn_rt.cycle_counter", "frame.len", "pn_rt.ds",
        where=f"eth.dst=={ar.initiator_mac.hex(':')} && pn_rt.frame_id=={inputs.frame_id}",
    )  # fmt: skip
    assert rows, "no cyclic frame came"
    # 14 + 4 of Ethernet and tag, 2 of frame id, the data, 4 of status
    assert {int(row[2]) for row in rows} == {18 + 2 + inputs.data_length + 4}
    steps = [(int(b[1]) - int(a[1])) & 0xFFFF for a, b in itertools.pairwise(rows)]
    unit = inputs.send_clock_factor * inputs.reduction_ratio
    # a machine that stalls skips cycles, and the counter says so; it never counts otherwise
    assert all(step % unit == 0 for step in steps)
    assert statistics.mode(steps) == unit


def test_modules_that_a_drive_has_not_are_named_in_the_module_diff(replayed):
    """rt-labs' sample device: its access point fits, the I/O modules of slots 1 to 4 do not."""
    conversation, _ = replayed(S7_1515)
    _, answered = connect_of(conversation)
    (diff,) = answered[ModuleDiffBlock]
    missing = {(api.api, module.slot) for api in diff.apis for module in api.modules}
    assert missing == {(0, 1), (0, 2), (0, 3), (0, 4)}
    assert conversation.call is not None
    kinds = [type(block) for block in parse_blocks(bytes.fromhex(conversation.call["payload"]))]
    assert kinds == [ControlBlock, ModuleDiffBlock], "ApplicationReady repeats the difference"


def test_an_access_point_of_another_device_is_named_as_wrong(replayed):
    """An ET200SP's project: even the access point differs, and is said so with the ident that is really there."""
    conversation, _ = replayed(S7_1500)
    _, answered = connect_of(conversation)
    (diff,) = answered[ModuleDiffBlock]
    wrong = {(api.api, module.slot): module for api in diff.apis for module in api.modules}
    assert set(wrong) == {(0, slot) for slot in range(7)}
    assert wrong[0, 0].module_ident == 1


@pytest.mark.parametrize("name", [S7_1515, S7_1500])
def test_every_record_of_a_multiple_write_gets_an_answer_of_its_own(replayed, name):
    conversation, _ = replayed(name)
    (payload,), (answer,) = conversation.asked[WRITE], conversation.answered[WRITE]
    request = parse_write_request(payload)
    assert answer["status"] == 0, "the call itself succeeds"
    outer, *inner = parse_write_response(bytes.fromhex(answer["payload"]))
    assert outer.sequence_number == request.header.sequence_number
    assert [(h.slot, h.subslot, h.index) for h in inner] == [
        (w.header.slot, w.header.subslot, w.header.index) for w in request.writes
    ]
    for header in inner:
        if header.slot:
            assert not header.status.ok, f"slot {header.slot} is empty and took a record"
