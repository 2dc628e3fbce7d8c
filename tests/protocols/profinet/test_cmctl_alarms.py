"""The controller's AR and its device's alarms: taken, worded, acknowledged; and what ends the AR."""

from __future__ import annotations

from dataclasses import replace

import pytest
from alarm_kit import STEP, alarm, channel
from cmctl_peers import DEVICE_ALARM_REFERENCE, DEVICE_MAC, Line, ScriptedDevice, established, line, with_block

from pnfarm.protocols.profinet.alarms.channel import AlarmAcknowledged, AlarmChannel, PeerAborted
from pnfarm.protocols.profinet.cm.controller.cmctl import CmctlState
from pnfarm.protocols.profinet.cm.controller.events import AlarmIndicated, ArAborted, ArFailed, ArReleased
from pnfarm.protocols.profinet.errors import OK, RtaError, rta_status
from pnfarm.protocols.profinet.wire.alarms.notification import AlarmItem
from pnfarm.protocols.profinet.wire.alarms.rta import RtaType, parse_rta
from pnfarm.protocols.profinet.wire.block import BlockType
from pnfarm.protocols.profinet.wire.cm.connect import AlarmCrBlockReq, AlarmCrBlockRes
from pnfarm.protocols.profinet.wire.rpc.pdu import Opnum
from pnfarm.wire.ethernet import VlanTag

LOCAL = 1


def device_end(**options: int) -> AlarmChannel:
    return channel(DEVICE_ALARM_REFERENCE, LOCAL, **options)


def carry(up: Line, device: AlarmChannel, *, acks: bool = True) -> list[VlanTag]:
    """Alarm frames to and fro until nothing moves; the tags of the controller's."""
    tags = []
    moved = True
    while moved:
        moved = False
        for _, octets in device.to_send():
            moved = True
            if acks or parse_rta(octets).type != RtaType.ACK:
                up.controller.receive_rta(octets, DEVICE_MAC, up.now)
        for mac, octets, tag in up.controller.rta_to_send():
            assert mac == DEVICE_MAC
            moved = True
            tags.append(tag)
            device.receive(parse_rta(octets), up.now)
    return tags


def test_an_alarm_is_acknowledged_at_once_and_reported_as_text() -> None:
    up, device = established(), device_end()
    raised = replace(alarm(2), items=(AlarmItem(0x8000, bytes.fromhex("800008000010")),))
    device.notify(raised, 0)
    device.notify(replace(raised, alarm_type=0x0C), 0)
    device.notify(alarm(3, high=True), 0)
    tags = carry(up, device)
    assert set(tags) == {VlanTag(5), VlanTag(6)}
    words = [event.text for event in up.run() if isinstance(event, AlarmIndicated)]
    assert sorted(words) == [
        "diagnosis appears on slot 1 subslot 0x0002: parametrisation fault (fault, appears)",
        "diagnosis appears on slot 1 subslot 0x0003: USI 0x0010 0000",
        "diagnosis disappears on slot 1 subslot 0x0002: parametrisation fault (fault, appears)",
    ]
    done = device.events()
    assert [type(event) for event in done] == [AlarmAcknowledged] * 3
    assert all(event.status == OK for event in done)
    assert up.controller.next_deadline() is None
    assert not up.controller.dropped


def test_there_is_nothing_to_acknowledge_without_a_connection() -> None:
    up = line()
    assert up.controller.alarms is None
    up.controller.receive_rta(parse_rta(bytes.fromhex("fe01000100141111fffffffe0000")).emit(), DEVICE_MAC, 0)
    assert up.controller.dropped == {"rta-of-another-station": 1}


def test_alarms_are_taken_from_the_confirmation_of_connect_on() -> None:
    up, device = line(), device_end()
    up.controller.connect(up.now)
    up.run()
    assert up.controller.state is CmctlState.W_ARDY
    device.notify(alarm(1), 0)
    carry(up, device)
    assert [type(event) for event in device.events()] == [AlarmAcknowledged]
    assert [type(event) for event in up.run()] == [AlarmIndicated]
    up.ready()
    assert up.controller.state is CmctlState.DATA


def test_an_alarm_ack_that_is_never_acknowledged_aborts_the_ar_with_code_9() -> None:
    up, device = established(alarm_cr=AlarmCrBlockReq(rta_timeout_factor=2, local_alarm_reference=LOCAL)), device_end()
    device.notify(alarm(1), up.now)
    start = up.now
    carry(up, device, acks=False)
    up.run()
    for attempt in range(1, 5):
        up.now = start + attempt * 2 * STEP
        assert up.controller.next_deadline() == up.now
        up.controller.handle_timeout(up.now - 1)
        assert up.controller.rta_to_send() == []
        up.controller.handle_timeout(up.now)
        if attempt < 4:
            carry(up, device, acks=False)
    (end,) = up.run()
    assert isinstance(end, ArAborted)
    assert (end.by_device, end.error_code1, end.error_code2) == (False, 0xFD, RtaError.ALARM_ACK_SEND_FAILED)
    assert "sent 4 times without a transport ACK" in end.reason
    carry(up, device)
    assert device.events()[-1] == PeerAborted(rta_status(9))
    assert up.controller.state is CmctlState.CLOSED
    assert up.controller.next_deadline() is None


@pytest.mark.parametrize("ready", [True, False])
def test_a_faulty_alarm_ends_the_ar_in_every_state(ready: bool) -> None:
    up = line()
    up.controller.connect(up.now)
    up.run()
    if ready:
        up.ready()
        up.run()
    pdu = replace(parse_rta(bytes.fromhex("fe01 0001 0014 1111 ffff fffe 0000")), body=alarm(1, high=True).emit())
    up.controller.receive_rta(pdu.emit(), DEVICE_MAC, up.now)
    (end,) = up.run()
    if ready:
        assert isinstance(end, ArAborted)
        assert end.error_code2 == RtaError.ALARM_IND_ERROR
    else:
        assert isinstance(end, ArFailed)
        assert end.phase == "application-ready"
    ((_, octets, tag),) = up.controller.rta_to_send()
    assert octets[-4:].hex() == "cf81fd0b"
    assert tag == VlanTag(5)


def test_the_shorter_one_of_both_limits_holds() -> None:
    def long_alarms(status: object, payload: bytes) -> tuple[object, bytes]:
        return status, with_block(payload, AlarmCrBlockRes(1, DEVICE_ALARM_REFERENCE, 300), BlockType.ALARM_CR_RES)

    wanted = AlarmCrBlockReq(local_alarm_reference=LOCAL, max_alarm_data_length=1432)
    up = established(ScriptedDevice({Opnum.CONNECT: long_alarms}), alarm_cr=wanted)
    device = device_end(max_alarm_data_length=1432)
    device.notify(alarm(1, size=272), 0)
    carry(up, device)
    assert [type(event) for event in up.run()] == [AlarmIndicated]
    device.notify(alarm(1, size=273), 0)
    carry(up, device)
    (end,) = up.run()
    assert isinstance(end, ArAborted)
    assert end.error_code2 == RtaError.ALARM_DATA_TOO_LONG


def test_alarms_end_with_the_ar() -> None:
    up, device = established(), device_end()
    up.controller.release(up.now)
    assert isinstance(up.run()[-1], ArReleased)
    device.notify(alarm(1), 0)
    assert carry(up, device) == []
    assert up.run() == []
    assert up.controller.dropped == {"rta-closed": 1}


def test_alarm_frames_that_do_not_fit_are_counted() -> None:
    up = established()
    good = parse_rta(bytes.fromhex("fe01 0001 0014 1301 fffe ffff 0000"))
    for pdu in (good, replace(good, source=7), replace(good, pdu_type=0x23), replace(good, pdu_type=0x19)):
        up.controller.receive_rta(pdu.emit(), DEVICE_MAC, 0)
    assert up.controller.dropped == {"rta-late-ack": 1, "rta-reference": 1, "rta-version": 1, "rta-type": 1}
    assert up.run() == []
