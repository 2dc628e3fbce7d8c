"""The built-in scanner and drives of the farm, in memory and virtual time: start-up, losses, refusals, release."""

from __future__ import annotations

import pytest
from scanner_line import ScannerLine
from wire_tap import WireTap

from pnfarm.buses.ethernetip.controller.session import TRANSITIONS, SessionState, Sign
from pnfarm.errors import ConfigError
from pnfarm.protocols.enip.connection_check import Refusal
from pnfarm.protocols.enip.status import ConnectionStatus
from pnfarm.protocols.enip.wire.cpf import CommonPacket, UnconnectedData
from pnfarm.protocols.enip.wire.encapsulation import parse_encapsulation
from pnfarm.protocols.enip.wire.epath import ElectronicKey, parse_epath
from pnfarm.protocols.enip.wire.forward_open import ConnectionType, ForwardOpen, parse_forward_open
from pnfarm.protocols.enip.wire.message import parse_request
from pnfarm.testing import Line
from pnfarm.wire.endpoint import StreamClosed, StreamData, StreamEnd
from pnfarm.wire.mac import multicast_mac

IDLE = "{kind: idle}"
DRIVE_PATH = "20062401"


def forward_open(octets: bytes) -> ForwardOpen:
    _, data = CommonPacket.parse(parse_encapsulation(octets).data).items
    assert isinstance(data, UnconnectedData)
    return parse_forward_open(parse_request(data.data).data)


def test_a_drive_is_connected_enabled_and_runs_at_the_speed_of_the_program():
    line = ScannerLine()
    line.connect()
    line.enable()
    line.run(1.0)
    row = line.row()
    assert (row["state"], row["phase"], row["losses"], row["last_reason"]) == ("DATA", "running", 0, "")
    assert float(line.station().handle.axis.motor.velocity) == pytest.approx(60.0, abs=1.0)
    assert row["frames_received"] > 90
    assert row["cycle_seconds"] == 0.01
    assert row["identification"]["name"] == "AKD"
    assert (row["zsw1"] & 0x80, row["stw1"] & 0x80) == (0x80, 0x80)
    assert line.texts()[0] == "connected"


def test_every_session_state_and_sign_has_its_place():
    reached = {state for state, _ in TRANSITIONS.values()}
    assert reached | {SessionState.WAIT} == set(SessionState)
    assert {sign for _, sign in TRANSITIONS} == set(Sign)
    assert all(state is not SessionState.STOPPED for state, _ in TRANSITIONS)


# -- start-up ----------------------------------------------------------------------------------------------------------


def test_the_start_up_has_its_order_on_the_wire_and_the_release_too():
    line = ScannerLine(start=False)
    tap = WireTap(line.plc)
    line.plc.start(line.world.now)
    line.enable()
    assert tap.said == [
        "connect 10.77.0.11:44818",
        "REGISTER_SESSION",
        "GET_ATTRIBUTES_ALL 20012401",
        f"FORWARD_OPEN {DRIVE_PATH}",
    ]
    tap.said.clear()
    line.plc.release(line.world.now)
    assert line.world.run(1.0, until=lambda: line.plc.all_stopped)
    assert tap.said == [f"FORWARD_CLOSE {DRIVE_PATH}", "UNREGISTER_SESSION", "close"]
    assert not line.world.switch.network.ends


def test_forward_open_asks_for_the_manual_s_assemblies():
    line = ScannerLine(start=False)
    tap = WireTap(line.plc)
    line.plc.start(line.world.now)
    line.connect()
    asked = forward_open(tap.octets[-1])
    assert (asked.o_to_t.size, asked.t_to_o.size) == (70, 66)
    assert (asked.o_to_t_rpi_us, asked.t_to_o_rpi_us, asked.timeout_multiplier) == (10_000, 10_000, 2)
    assert asked.t_to_o.kind == ConnectionType.POINT_TO_POINT
    key, *points = parse_epath(asked.path)
    assert key == ElectronicKey(452, 16, 1, 1, 13, compatible=True)
    assert [segment.value for segment in points] == [4, 100, 101, 102]


@pytest.mark.parametrize(
    ("keying", "first"),
    [("off", None), ("exact", ElectronicKey(452, 16, 1, 1, 13))],
)
def test_the_electronic_key_is_as_the_user_wants_it(keying, first):
    line = ScannerLine(start=False, more=f"\n  keying: {keying}")
    tap = WireTap(line.plc)
    line.plc.start(line.world.now)
    line.connect()
    segments = parse_epath(forward_open(tap.octets[-1]).path)
    assert (segments[0] if isinstance(segments[0], ElectronicKey) else None) == first


def test_interval_and_timeout_are_those_of_the_file_and_a_group_has_its_own():
    line = ScannerLine(more="\n  rpi: 20ms\n  timeout_multiplier: 4")
    line.connect()
    view = line.station().device.connection()
    assert (view.cycle_ns, view.watchdog_ns) == (20_000_000, 80_000_000)
    other = ScannerLine(group=", rpi: 40ms", more="\n  rpi: 20ms")
    other.connect()
    assert other.station().device.connection().cycle_ns == 40_000_000
    assert other.row()["cycle_seconds"] == 0.04


def test_many_drives_are_connected_each_in_its_own_tick():
    line = ScannerLine(drives=12)
    line.enable()
    line.run(1.0)
    assert {row["losses"] for row in line.plc.snapshot()} == {0}
    providers = [line.plc.columns.ppm[session.provider] for session in line.plc.sessions]
    assert len({int(provider.next_ns) % 10_000_000 for provider in providers}) == 10
    assert len({int(line.plc.columns.cpm[session.consumer].frame_id) for session in line.plc.sessions}) == 12


def test_two_runs_are_the_same():
    def story():
        line = ScannerLine(drives=3)
        line.run(1.0)
        line.cable(up=False)
        line.run(1.0)
        line.cable(up=True)
        line.run(2.0)
        return line.plc.snapshot(), [entry.event for entry in line.log.entries()]

    assert story() == story()


def test_another_identity_is_told_and_the_key_decides():
    line = ScannerLine(group=", identity: {product_code: 77}")
    line.connect()
    assert "identity differs" not in line.texts(), "the plan has the farm file's identity"
    line.station().device.identity.product_code = 78
    line.cable(up=False)
    line.run(0.5)
    line.cable(up=True)
    line.run(2.0)
    assert "identity differs" in line.texts()


# -- refusals ----------------------------------------------------------------------------------------------------------


def refuse(line: ScannerLine, *extended: int) -> list[ForwardOpen]:
    """The drive refuses from now on; what it was asked."""
    asked = []

    def admit(request: ForwardOpen):
        asked.append(request)
        return Refusal(*extended)

    line.station().device.connections.refuse = admit
    return asked


@pytest.mark.parametrize("status", [status.value for status in ConnectionStatus if status not in {0x0127, 0x0128}])
def test_each_refusal_is_told_in_words_and_tried_again_behind_a_pause(status):
    line = ScannerLine(program=IDLE, start=False)
    refuse(line, status)
    line.plc.start(line.world.now)
    line.run(0.25)
    row = line.row()
    assert (row["state"], row["refusals"], row["connects"]) == ("WAIT", 1, 0)
    assert row["last_reason"].startswith("Forward_Open: connection failure: ")
    assert row["last_reason"].endswith(f"(0x{status:04X})")
    failed = line.log.entries("axis-1")[0]
    assert (failed.event, failed.data["status"]) == ("connect failed", [1, status])
    line.station().device.connections.refuse = lambda _: None
    line.connect(within=0.5)


def test_a_wrong_size_is_told_with_the_device_s_own():
    line = ScannerLine(program=IDLE, start=False)
    refuse(line, ConnectionStatus.O_TO_T_SIZE, 72)
    line.plc.start(line.world.now)
    line.run(0.25)
    assert line.row()["last_reason"].endswith("(0x0127): the device has 72 octets with its headers, not 70")


def test_pauses_grow_and_are_bounded():
    line = ScannerLine(program=IDLE, start=False)
    asked = refuse(line, ConnectionStatus.OUT_OF_CONNECTIONS)
    line.plc.start(line.world.now)
    counts = []
    for _ in range(12):
        line.run(1.0)
        counts.append(len(asked))
    # 0.3 s, 0.6 s, and then 1.2 s each
    assert 9 <= counts[-1] <= 12
    assert len({request.triad.serial for request in asked}) == len(asked), "each has a serial number of its own"
    assert len({request.t_to_o_id for request in asked}) == len(asked)


def test_a_drive_with_another_key_is_not_connected():
    line = ScannerLine(program=IDLE, start=False, more="\n  keying: exact")
    settings = line.station().device.adapter.manager.settings
    object.__setattr__(settings, "key", ElectronicKey(452, 16, 1, 2, 1))
    line.plc.start(line.world.now)
    line.run(1.0)
    assert line.row()["last_reason"].endswith("(0x0116)")


# -- losses ------------------------------------------------------------------------------------------------------------


def test_silence_beyond_the_timeout_ends_the_connection_and_the_drive_is_found_again():
    line = ScannerLine()
    line.enable()
    line.cable(up=False)
    line.run(0.155)
    assert line.row()["state"] == "DATA"
    line.run(0.02)
    row = line.row()
    assert (row["state"], row["losses"], row["expirations"]) == ("WAIT", 1, 1)
    assert row["last_reason"] == "no cyclic data for 160 ms"
    assert not line.plc.exchanging("axis-1")
    assert row["phase"] == "offline"
    line.run(2.0)
    line.cable(up=True)
    # the drive's F702 is acknowledged, as the file says
    line.enable(within=4.0)
    row = line.row()
    assert (row["connects"], row["faults"]) == (2, 1)
    assert row["reconnect_seconds"] > 2.0
    assert line.station().fault_counts == {702: 1}


def test_a_drive_without_supply_is_found_again_when_it_is_back():
    line = ScannerLine()
    line.enable()
    line.power(on=False)
    line.run(3.0)
    assert line.row()["losses"] == 1
    assert line.row()["state"] in {"WAIT", "STREAM"}
    line.power(on=True)
    line.enable(within=6.0)
    assert len(line.world.switch.network.ends) == 2, "one stream, both ends"


def test_a_loss_is_told_with_the_time_of_the_interval_that_the_drive_keeps():
    line = ScannerLine(more="\n  rpi: 15ms")
    line.connect()
    line.cable(up=False)
    line.run(0.5)
    assert line.row()["last_reason"] == "no cyclic data for 320 ms", "the drive sends in whole steps of 10 ms"


def test_without_reconnect_a_lost_drive_stays_lost():
    line = ScannerLine(program=IDLE, reconnect="off")
    line.connect()
    line.cable(up=False)
    line.run(1.0)
    line.cable(up=True)
    line.run(3.0)
    assert line.row()["state"] == "STOPPED"


def test_without_reconnect_a_drive_that_was_never_there_is_still_awaited():
    line = ScannerLine(program=IDLE, reconnect="off", start=False)
    line.power(on=False)
    line.plc.start(line.world.now)
    line.run(5.0)
    line.power(on=True)
    line.connect(within=8.0)


def test_an_old_connection_that_the_drive_still_has_is_closed_first():
    line = ScannerLine(program=IDLE, reconnect="{after: 20ms}")
    line.connect()
    line.run(0.5)
    # the scanner hears nothing any more, the drive still does
    line.plc.columns.cpm[line.plc.sessions[0].consumer].source = 1
    line.run(0.4)
    row = line.row()
    assert (row["state"], row["connects"], row["refusals"]) == ("DATA", 2, 0)
    assert "old connection closed" in line.texts()
    assert line.station().fault_counts == {}, "the drive never missed its controller"


@pytest.mark.parametrize("lost", [3, 4], ids=["Forward_Open", "Forward_Close"])
def test_an_old_connection_is_closed_although_the_session_was_lost_with_this_request(monkeypatch, lost):
    line = ScannerLine(program=IDLE, more="\n  timeout_multiplier: 512")
    line.connect()
    line.plc.columns.cpm[line.plc.sessions[0].consumer].source = 1
    sockets, network, sent = line.plc.link.sockets, line.world.switch.network, []
    act = sockets.act

    def break_off(port: int, action) -> None:
        if isinstance(action, StreamData):
            sent.append(action)
            if len(sent) == lost:
                act(port, StreamEnd(action.stream))
                closed = StreamClosed(port, action.stream)
                network.post(port, lambda now: line.plc.socket_event(closed, now), line.world.now)
                return
        act(port, action)

    monkeypatch.setattr(sockets, "act", break_off)
    assert line.world.run(10.0, until=lambda: len(sent) >= lost)
    line.run(1.0)
    row = line.row()
    assert (row["state"], row["connects"], row["refusals"]) == ("DATA", 2, 1)
    assert line.station().fault_counts == {}, "the drive never missed its controller"


def test_a_session_that_the_drive_ends_is_made_again_beside_the_data():
    line = ScannerLine()
    line.enable()
    device = line.station().device
    (stream,) = device._peers
    received = line.row()["frames_received"]
    device.adapter.encapsulation.end_stream(stream, line.world.now)
    line.farm.settle(line.station().station, line.world.now)
    line.run(0.1)
    assert line.texts()[-1] == "session lost"
    assert line.row()["state"] == "DATA"
    line.run(0.5)
    row = line.row()
    assert line.texts()[-1] == "session resumed"
    assert (row["losses"], row["connects"], row["sessions_lost"]) == (0, 1, 1)
    assert row["frames_received"] - received == pytest.approx(60, abs=1)
    request = line.plc.get_attribute("axis-1", 1, 1, 1, line.world.now)
    line.run(0.1)
    assert request.data == (452).to_bytes(2, "little")
    line.plc.release(line.world.now)
    line.run(0.5)
    assert line.plc.all_stopped
    assert line.station().fault_counts == {}


def test_a_session_stays_beside_cyclic_data_for_longer_than_the_drive_waits_for_messages():
    line = ScannerLine(program=IDLE)
    line.connect()
    assert line.station().device.tcp_ip.inactivity_timeout_s == 120
    line.run(260.0)
    assert (line.row()["sessions_lost"], "session lost" in line.texts()) == (0, False)


def test_a_session_that_cannot_be_made_again_is_lost_once_however_often_it_is_tried():
    line = ScannerLine()
    line.enable()
    device = line.station().device
    (stream,) = device._peers
    line.farm.injections.inject({"kind": "tcp-refuse", "on": "axis-1"}, line.world.now)
    device.adapter.encapsulation.end_stream(stream, line.world.now)
    line.farm.settle(line.station().station, line.world.now)
    line.run(5.0)
    row = line.row()
    assert (row["state"], row["sessions_lost"]) == ("DATA", 1)
    assert line.texts().count("session lost") == 1
    line.farm.injections.clear(None, line.world.now)
    line.run(1.0)
    assert line.texts()[-1] == "session resumed"


def test_a_device_that_does_not_answer_is_given_up_in_time():
    line = ScannerLine(program=IDLE, start=False, more="\n  request_timeout: 1s")
    device = line.station().device
    device.adapter.encapsulation.received = lambda *_: None
    line.plc.start(line.world.now)
    line.run(1.2)
    assert line.row()["last_reason"] == "no reply to RegisterSession"
    assert line.row()["state"] == "WAIT"


# -- run and idle, release ---------------------------------------------------------------------------------------------


def test_idle_takes_the_set_points_away_and_run_brings_them_back():
    line = ScannerLine()
    line.enable()
    line.plc.set_mode(run=False)
    line.run(0.5)
    station = line.station()
    assert not station.handle.image.valid
    assert station.device.connected
    assert line.row()["state"] == "DATA"
    assert not line.row()["zsw1"] & 0x80
    assert line.row()["phase"] == "stopped"
    line.plc.set_mode(run=True)
    line.enable(within=0.5)
    assert station.fault_counts == {}


def test_a_release_says_idle_first_and_raises_no_fault():
    line = ScannerLine()
    line.enable()
    line.plc.release(line.world.now)
    line.run(0.015)
    station = line.station()
    assert not station.handle.image.valid
    assert station.device.connected
    line.run(0.5)
    assert line.plc.all_stopped
    assert line.texts()[-3:] == ["axis stopped", "released", "axis offline"]
    assert not station.device.connected
    assert dict(station.device.losses()) == {}
    assert station.fault_counts == {}
    assert line.plc.next_deadline() is None


def test_a_release_ends_a_start_up_wherever_it_is():
    for milliseconds in (0, 1, 2, 3):
        line = ScannerLine(program=IDLE, start=False)
        line.plc.start(line.world.now)
        line.run(milliseconds / 1000)
        line.plc.release(line.world.now)
        line.run(1.0)
        assert line.plc.all_stopped
        assert not line.station().device.channels.open
        assert not line.world.switch.network.ends


def test_a_release_without_an_answer_ends_in_time():
    line = ScannerLine(program=IDLE, more="\n  request_timeout: 1s")
    line.connect()
    line.cable(up=False)
    line.plc.release(line.world.now)
    line.run(2.0)
    assert line.plc.all_stopped


# -- groups, and several scanners --------------------------------------------------------------------------------------


def test_multicast_data_come_to_the_group_that_the_drive_names():
    line = ScannerLine(drives=2, more="\n  multicast: true")
    line.connect()
    line.run(1.0)
    groups = [session.group for session in line.plc.sessions]
    assert [row["group"] for row in line.plc.snapshot()] == [str(group) for group in groups]
    assert groups[0] != groups[1]
    for session in line.plc.sessions:
        consumer = line.plc.columns.cpm[session.consumer]
        assert int(consumer.destination) == int.from_bytes(multicast_mac(session.group), "big")
        assert int(consumer.address) == int(session.group)
        assert int(consumer.received) > 90
        assert (multicast_mac(session.group), line.plc.port.index) in line.world.switch.groups
    line.plc.release(line.world.now)
    line.run(0.5)
    assert not line.world.switch.groups


def test_a_drive_that_is_lost_does_not_take_the_group_of_another_one_along():
    """The standard's allocation gives drives 1,024 addresses apart the same group."""
    line = Line.from_text(
        "{farm: wide, link: {kind: memory}, drives: [{name: near, model: akd-ethernetip, ip: 10.77.0.11/16}, "
        "{name: far, model: akd-ethernetip, ip: 10.77.4.11/16}], controller: {name: plc, ip: 10.77.9.1/16, "
        "multicast: true, reconnect: off}}"
    )
    line.wait_connected(10)
    assert line.controller("near")["group"] == line.controller("far")["group"]
    line.inject("link-down", on="near")
    line.run(5)
    assert [line.controller(name)["losses"] for name in ("near", "far")] == [1, 0]
    line.close()


def test_a_second_owner_is_refused_and_takes_over_when_the_first_is_gone():
    line = ScannerLine(program=IDLE)
    line.connect()
    second = line.second()
    line.run(1.0)
    (row,) = second.snapshot()
    assert row["connects"] == 0
    assert row["last_reason"].endswith("(0x0106)")
    assert line.row()["losses"] == 0
    line.plc.release(line.world.now)
    assert line.world.run(3.0, until=lambda: second.all_connected)


def test_a_listener_needs_an_owner_whose_data_go_to_a_group():
    line = ScannerLine(more="\n  multicast: true", start=False)
    listener = line.second(connection="listen-only", program=line_program("idle"))
    line.run(1.0)
    (row,) = listener.snapshot()
    assert row["last_reason"].endswith("(0x0119)")
    line.plc.start(line.world.now)
    line.enable()
    assert line.world.run(3.0, until=lambda: listener.all_connected)
    line.run(1.0)
    assert listener.inputs("axis-1")[0] & 0x80, "it sees that the drive is enabled"
    assert float(line.station().handle.axis.motor.velocity) == pytest.approx(60.0, abs=1.0)
    line.plc.release(line.world.now)
    line.run(1.0)
    (row,) = listener.snapshot()
    assert (row["losses"], row["state"] == "DATA") == (1, False)
    assert line.station().fault_counts == {}


def test_input_only_reads_beside_an_owner_and_without_one():
    line = ScannerLine(program=IDLE, more="\n  connection: input-only")
    line.connect()
    line.run(0.5)
    assert line.plc.inputs("axis-1")[3] == 0
    assert line.row()["frames_sent"] > 40, "heartbeats"
    assert not line.station().handle.image.valid
    owner = line.second(connection="exclusive-owner")
    assert line.world.run(2.0, until=lambda: owner.all_connected)
    line.run(1.0)
    assert line.row()["losses"] == 0


def line_program(kind: str):
    from pnfarm.config.controller import Program

    return Program(kind=kind)


# -- the rest of the interface -----------------------------------------------------------------------------------------


def test_the_snapshot_has_the_keys_of_every_bus():
    line = ScannerLine()
    keys = set(line.row())
    assert keys >= {
        "name", "model", "ip", "state", "phase", "zsw1", "stw1", "connects", "losses", "faults", "cycle_seconds",
        "frames_sent", "frames_received", "unusable", "last_reason",
    }  # fmt: skip


def test_there_is_no_cyclic_parameter_channel_and_no_unknown_drive():
    line = ScannerLine()
    for ask in (
        lambda: line.plc.parameter_answer("axis-1"),
        lambda: line.plc.put_parameter_task("axis-1", None),
        lambda: line.plc.get_attribute("other", 1, 1, 1, 0),
        lambda: line.plc.inputs("other"),
        lambda: line.plc.put_outputs("axis-1", b""),
    ):
        with pytest.raises(ConfigError):
            ask()
    assert not line.plc.exchanging("other")
    assert line.plc.session("other") is None
