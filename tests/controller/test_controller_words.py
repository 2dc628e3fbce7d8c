"""What the built-in controller says of devices that answer as a foreign one did: for people, in words."""

from __future__ import annotations

from dataclasses import replace

import pytest
from structlog.testing import capture_logs
from virtual_line import VirtualLine

from pnfarm.protocols.profinet.cm.controller.events import (
    AlarmIndicated,
    ApplicationReadyReceived,
    CmctlEvent,
    RecordRead,
    RecordWriteDone,
)
from pnfarm.protocols.profinet.cm.controller.response import ModuleDeviation
from pnfarm.protocols.profinet.wire.alarms.notification import AlarmItem, AlarmNotification, AlarmType
from pnfarm.protocols.profinet.wire.alarms.texts import alarm_in_words
from pnfarm.protocols.profinet.wire.rpc.pdu import OK, Opnum, PacketType, emit_rpc, parse_rpc


@pytest.fixture
def line() -> VirtualLine:
    line = VirtualLine()
    line.connect()
    return line


def logged(line: VirtualLine, event: CmctlEvent) -> list[tuple[str, str, str]]:
    """What the terminal shows of an event: level, event, detail."""
    line.plc.log.quiet = False
    with capture_logs() as shown:
        line.plc.life.take(line.plc.sessions[0], event, line.world.now)
    return [(entry["log_level"], entry["event"], entry["detail"]) for entry in shown]


def test_a_module_that_differs_is_reported_by_its_sentence(line: VirtualLine) -> None:
    text = "slot 1 subslot 0x0001: wrong submodule, device has 0x00000999"
    ready = ApplicationReadyReceived((ModuleDeviation(0, 1, 1, text, fits=False),), after_plug=False)
    assert logged(line, ready) == [("warning", "module differs", text)]


def test_an_answer_without_any_octet_fails_the_record_in_words(line: VirtualLine) -> None:
    """An RPC response of fragment length 0: what a device sent for an API that it does not have."""
    server = line.farm.axes[0].device.rpc
    to_send = server.to_send

    def emptied(now: int):
        for datagram in to_send(now):
            pdu = parse_rpc(datagram.data)
            is_answer = (pdu.packet_type, pdu.opnum) == (PacketType.RESPONSE, Opnum.READ)
            yield replace(datagram, data=emit_rpc(replace(pdu, body=b""))) if is_answer else datagram

    server.to_send = emptied
    session = line.plc.sessions[0]
    assert session.machine is not None
    session.machine.read_record("t", 0x3A01, 1, 1, 47, 64)
    line.plc.touch(session, line.world.now)
    line.run(0.1)
    ((_, end),) = line.plc.records
    assert end == RecordRead("t", None, reason="the answer has no readable PNIOStatus")
    assert line.plc.all_connected, "a record that failed ended the connection"


def test_ends_of_records_that_nobody_waits_for_are_bounded(line: VirtualLine) -> None:
    """Parameters that the controller writes anew after each plug alarm, for days."""
    for number in range(1000):
        line.plc.life.take(line.plc.sessions[0], RecordWriteDone(number, OK), line.world.now)
    assert (len(line.plc.records), line.plc.records[-1][1].tag) == (64, 999)


@pytest.mark.parametrize(
    ("alarm_type", "octets", "level"),
    [
        # AlarmType diagnosis each time; ChannelProperties.Specifier: appears, disappears and others remain, all gone
        (AlarmType.DIAGNOSIS, "0004 2801 0001 0000 00000000", "warning"),
        (AlarmType.DIAGNOSIS, "0004 3801 0001 0000 00000000", "info"),
        (AlarmType.DIAGNOSIS, "0004 2001 0001 0000 000004d2", "info"),
        (AlarmType.DIAGNOSIS, "0004 3801 0001 0000 00000000 0004 2801 0001 0000 000004d2", "warning"),
        (AlarmType.DIAGNOSIS, "0004 20", "warning"),
        (AlarmType.DIAGNOSIS_DISAPPEARS, "0004 2001 0001 0000 000004d2", "info"),
        (AlarmType.PROCESS, "0004 2001 0001 0000 000004d2", "warning"),
    ],
)
def test_the_end_of_a_diagnosis_is_no_warning_whatever_its_alarm_type(
    line: VirtualLine, alarm_type: AlarmType, octets: str, level: str
) -> None:
    alarm = AlarmNotification(alarm_type, 0, 1, 1, items=(AlarmItem(0x8002, bytes.fromhex(octets)),))
    words = alarm_in_words(alarm)
    assert logged(line, AlarmIndicated(alarm, words)) == [(level, "alarm", words)]


@pytest.mark.parametrize("items", [(), (AlarmItem(0x1234, b"diagdata"),)], ids=["none", "the maker's"])
def test_a_diagnosis_without_channel_data_is_a_warning(line: VirtualLine, items: tuple[AlarmItem, ...]) -> None:
    alarm = AlarmNotification(AlarmType.DIAGNOSIS, 0, 1, 1, items=items)
    assert logged(line, AlarmIndicated(alarm, "words")) == [("warning", "alarm", "words")]


def test_a_submodule_released_by_another_controller_is_not_reported_as_a_supervisors() -> None:
    """AlarmType Released: of a shared device, whose submodules come back one by one when a controller goes."""
    alarm = AlarmNotification(AlarmType.RELEASED, 0, 1, 1)
    assert alarm_in_words(alarm) == "released by its former owner on slot 1 subslot 0x0001"
