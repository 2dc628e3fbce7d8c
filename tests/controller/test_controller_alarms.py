"""Alarms of a drive at the built-in controller: acknowledged on the wire, logged as text, counted."""

from __future__ import annotations

from virtual_line import VirtualLine

from pnfarm.protocols.profinet.alarms.channel import AlarmAcknowledged, AlarmChannel, PeerAborted
from pnfarm.protocols.profinet.errors import RtaError, rta_status
from pnfarm.protocols.profinet.wire.alarms.notification import AlarmItem, AlarmNotification, AlarmType
from pnfarm.protocols.profinet.wire.alarms.rta import RtaType, parse_rta
from pnfarm.protocols.profinet.wire.cm.connect import AlarmCrBlockReq
from pnfarm.wire.ethernet import ETHERTYPE_PROFINET, EthernetFrame, VlanTag, emit_ethernet, parse_ethernet

CHANNEL = (AlarmItem(0x8000, bytes.fromhex("800008000010")),)


class DriveAlarms:
    """An alarm channel in a drive's place: its frames go straight to the controller, the controller's to it."""

    def __init__(self, line: VirtualLine) -> None:
        self.line = line
        self.line.connect()
        session = line.plc.sessions[0]
        self.mac = session.mac
        assert session.machine is not None
        assert session.machine.alarms is not None
        self.channel = AlarmChannel(session.machine.alarms._settings.remote_reference, 1, AlarmCrBlockReq(), 200)
        self.answers: list[EthernetFrame] = []
        self._forward = line.plc.link.send
        line.plc.link.send = self._send

    def _send(self, port: int, data: bytes) -> None:
        frame = parse_ethernet(data)
        if frame.ethertype == ETHERTYPE_PROFINET and frame.payload[:2] in {b"\xfc\x01", b"\xfe\x01"}:
            self.answers.append(frame)
        else:
            self._forward(port, data)

    def exchange(self, *, acknowledge: bool = True) -> list[EthernetFrame]:
        """Alarm frames to and fro until nothing moves; the controller's."""
        plc, now = self.line.plc, self.line.world.now
        seen = []
        while True:
            frames = self.channel.to_send()
            for tag, octets in frames:
                if acknowledge or parse_rta(octets).type != RtaType.ACK:
                    frame = EthernetFrame(plc.port.mac, self.mac, ETHERTYPE_PROFINET, octets, tag)
                    plc.receive(plc.port.index, emit_ethernet(frame), now)
            answers, self.answers = self.answers, []
            if not frames and not answers:
                return seen
            seen += answers
            for answer in answers:
                self.channel.receive(parse_rta(answer.payload), now)


def test_a_drives_alarms_are_acknowledged_logged_in_words_and_counted() -> None:
    line = VirtualLine()
    drive = DriveAlarms(line)
    (row,) = line.plc.snapshot()
    assert (row["alarms_received"], row["last_alarm"]) == (0, "")
    drive.channel.notify(AlarmNotification(AlarmType.DIAGNOSIS, 0x3A00, 1, 2, items=CHANNEL), line.world.now)
    drive.channel.notify(AlarmNotification(AlarmType.DIAGNOSIS_DISAPPEARS, 0x3A00, 1, 2), line.world.now)
    drive.channel.notify(AlarmNotification(AlarmType.PROCESS, 0, 0, 1, high=True), line.world.now)
    answers = drive.exchange()
    assert {(frame.payload[:2].hex(), frame.vlan) for frame in answers} == {
        ("fe01", VlanTag(5)),
        ("fc01", VlanTag(6)),
    }
    assert {frame.destination for frame in answers} == {drive.mac}
    assert [type(event) for event in drive.channel.events()] == [AlarmAcknowledged] * 3
    (row,) = line.plc.snapshot()
    assert row["alarms_received"] == 3
    assert row["last_alarm"] == "diagnosis disappears on slot 1 subslot 0x0002"
    logged = [entry.data for entry in line.plc_log.entries("axis-01") if entry.event == "alarm"]
    assert logged == [
        {
            "detail": "diagnosis appears on slot 1 subslot 0x0002: parametrisation fault (fault, appears)",
            "priority": "low",
        },
        {"detail": "process alarm on slot 0 subslot 0x0001", "priority": "high"},
        {"detail": "diagnosis disappears on slot 1 subslot 0x0002", "priority": "low"},
    ]


def test_a_drive_that_never_acknowledges_loses_its_connection_and_gets_it_back() -> None:
    line = VirtualLine()
    drive = DriveAlarms(line)
    drive.channel.notify(AlarmNotification(AlarmType.DIAGNOSIS, 0x3A00, 1, 2), line.world.now)
    drive.exchange(acknowledge=False)
    for _ in range(3):
        line.run(0.1)
        drive.exchange(acknowledge=False)
        assert line.plc.all_connected
    line.run(0.1)
    assert not line.plc.all_connected
    (row,) = line.plc.snapshot()
    assert row["losses"] == 1
    assert "the alarm channel failed: an AlarmAck was sent 4 times" in row["last_reason"]
    drive.exchange()
    assert drive.channel.events()[-1] == PeerAborted(rta_status(RtaError.ALARM_ACK_SEND_FAILED))
    line.connect()
    (row,) = line.plc.snapshot()
    assert (row["connects"], row["alarms_received"]) == (2, 1)
