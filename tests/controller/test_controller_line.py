"""The farm and the built-in controller, the whole way through, in virtual time."""

from dataclasses import replace

import pytest
from virtual_line import VirtualLine

from pnfarm.buses.profinet.controller import search
from pnfarm.buses.profinet.controller.search import duplicate_names
from pnfarm.buses.profinet.controller.session import SessionState
from pnfarm.protocols.profinet.dcp.client import IdentifyAnswered, StationInfo
from pnfarm.protocols.profinet.wire.cm.expected import SubmoduleProperties
from pnfarm.protocols.profinet.wire.dcp.blocks import NameBlock
from pnfarm.protocols.profinet.wire.dcp.pdu import SERVICE_IDENTIFY, TYPE_SUCCESS, DcpPdu, emit_dcp, frame_id_of
from pnfarm.wire.ethernet import ETHERTYPE_PROFINET, EthernetFrame, emit_ethernet


@pytest.mark.parametrize("startup", ["legacy", "advanced"])
def test_controller_finds_addresses_connects_and_runs_a_drive(startup):
    line = VirtualLine(startup=startup)
    line.connect()
    line.enable()
    line.run(1.0)
    axis = line.farm.columns.axis[0]
    assert axis.drive.state == 4
    assert axis.motor.velocity == pytest.approx(60.0, abs=0.3)
    assert "ar established" in line.events("axis-01")


def test_a_drive_that_is_not_there_is_sought_again_until_it_comes():
    line = VirtualLine()
    station = line.farm.axes[0]
    station.station.power_off(line.world.now)
    line.run(3.0)
    assert line.plc.sessions[0].measures.connects == 0
    assert line.plc.sessions[0].measures.last_reason == "no station of this name answers"
    station.station.power_on(line.world.now)
    line.farm.settle(station.station, line.world.now)
    line.connect()
    assert line.plc.snapshot()[0]["last_reason"] == ""


def test_a_drive_without_its_address_gets_it_from_the_controller_for_this_power_cycle_only():
    line = VirtualLine()
    station = line.farm.axes[0]
    station.device.dcp.address = None
    station.device.addressing.set_address(None, None, line.world.now)
    line.connect()
    assert str(station.device.ip.address) == "10.77.0.11/23"
    assert line.memory.load("axis-01")["ip"] == ""


def test_twenty_drives_are_found_by_one_roll_call():
    line = VirtualLine(drives=20)
    line.connect()
    for station in line.farm.axes:
        assert "identify-for-another" not in station.device.discards()


def test_a_few_drives_are_asked_for_by_their_names():
    line = VirtualLine(drives=3)
    line.connect()
    for station in line.farm.axes:
        assert station.device.discards()["identify-for-another"] == 2


@pytest.mark.parametrize(("small", "by_name"), [(1.0, True), (0.0, False)])
def test_drives_that_a_roll_call_missed_are_asked_for_by_name_where_they_are_a_small_part_of_all(
    monkeypatch, small, by_name
):
    monkeypatch.setattr(search, "SMALL_PART", small / 2)
    line = VirtualLine(drives=40)
    absent = [station.configured_name for station in line.farm.axes[:18]]
    line.farm.injections.inject({"kind": "link-down", "on": absent}, line.world.now)
    # the roll call, and one more search
    line.run(3.0)
    counted = {station.device.discards().get("identify-for-another", 0) for station in line.farm.axes[18:]}
    assert (min(counted) >= len(absent)) if by_name else counted == {0}


@pytest.mark.parametrize("drives", [2, 20])
def test_a_name_that_two_drives_have_is_reported_with_both_and_the_first_is_run(drives):
    line = VirtualLine(drives=drives)
    twins = line.farm.axes[0], line.farm.axes[-1]
    twins[1].device.dcp.name = "axis-01"
    line.run(1.5)
    entries = [entry for entry in line.plc_log.entries("axis-01") if entry.event == "name given twice"]
    macs = [station.port.mac.hex(":") for station in twins]
    assert entries[0].data["reason"] == (
        f"the name axis-01 is given twice: {macs[0]} and {macs[1]} answer to it; give each station a name of its own"
    )
    assert line.plc.sessions[0].state is SessionState.DATA
    assert line.plc.sessions[0].mac == twins[0].port.mac
    assert line.plc.sessions[-1].measures.last_reason == "no station of this name answers"


def test_stations_without_end_that_answer_to_one_name_do_not_fill_the_log():
    line = VirtualLine()
    line.run(0.001)
    (xid,) = line.plc._search._asked
    frame_id = frame_id_of(SERVICE_IDENTIFY, TYPE_SUCCESS)
    answer = emit_dcp(DcpPdu(frame_id, SERVICE_IDENTIFY, TYPE_SUCCESS, xid, blocks=(NameBlock("axis-01"),)))
    for number in range(200):
        frame = EthernetFrame(line.plc.port.mac, b"\x06" + number.to_bytes(5, "big"), ETHERTYPE_PROFINET, answer)
        line.plc.receive(line.plc.port.index, emit_ethernet(frame), line.world.now)
    told = [entry for entry in line.plc_log.entries("axis-01") if entry.event == "name given twice"]
    assert 2 <= len(told) < 10
    assert max(len(entry.data["reason"]) for entry in told) < 300


def test_names_given_twice_are_reported_in_order_and_unnamed_stations_do_not_count():
    def answer(mac, name):
        return IdentifyAnswered(1, bytes([2, 0, 0, 0, 0, mac]), StationInfo(name=name), ())

    answers = [
        answer(1, "b"),
        answer(2, "a"),
        answer(3, "b"),
        answer(4, ""),
        answer(5, ""),
        answer(6, None),
        answer(1, "b"),
    ]
    (sentence,) = duplicate_names(answers)
    assert sentence.startswith("the name b is given twice: 02:00:00:00:00:01 and 02:00:00:00:00:03 answer to it")
    assert [s.split()[2] for s in duplicate_names([*answers, answer(7, "a")])] == ["a", "b"]


def test_connect_reconnect_reaction_and_recovery_are_measured():
    line = VirtualLine()
    line.world.switch._latency_ns = 2_000_000
    line.connect()
    line.enable()
    line.farm.columns.ppm[0].active = 0
    line.run(0.2)
    line.enable()
    line.run(0.5)
    (row,) = line.plc.snapshot()
    assert row["connects"] == 2
    assert row["losses"] == 1
    # Identify, Connect, the end of parametrisation and ApplicationReady, each there and back at 2 ms
    assert 0.010 < row["connect_seconds"] < 0.060
    assert 0.3 <= row["reconnect_seconds"] < 1.0
    assert 0.0 < row["reaction_seconds"] <= 0.064
    assert row["faults"] == 1
    # the program waits 200 ms before it acknowledges F702
    assert 0.2 < row["recovery_seconds"] < 1.0


def test_a_fault_is_acknowledged_repeatedly_until_its_cause_is_gone():
    line = VirtualLine()
    line.connect()
    line.enable()
    station = line.farm.axes[0]
    number = station.raise_fault(702, hold=True)
    line.run(4.0)
    assert line.farm.columns.axis[0].faults.code[0] != 0
    station.release_fault(number)
    line.enable(within=4.0)
    assert line.farm.columns.axis[0].faults.counter == 1


def test_another_module_than_expected_is_reported_and_its_axis_stays_offline():
    line = VirtualLine(telegram=350)
    station = line.farm.axes[0]
    other = next(
        m
        for m in station.device.description.modules
        if m.module_ident != station.device.description.modules[0].module_ident
    )
    station.device.cm.plugged.plug(1, other)
    line.run(2.0)
    assert any(entry.event == "module differs" for entry in line.plc_log.entries("axis-01"))
    assert line.farm.columns.axis[0].drive.state == 1


def test_after_a_release_nothing_connects_again():
    line = VirtualLine()
    line.connect()
    line.plc.release(line.world.now)
    line.run(3.0)
    assert line.plc.sessions[0].state is SessionState.STOPPED
    assert not line.farm.axes[0].device.ars


def test_frames_are_counted_over_a_reconnection():
    line = VirtualLine()
    line.connect()
    line.enable()
    line.run(1.0)
    (before,) = line.plc.snapshot()
    line.farm.columns.ppm[0].active = 0
    line.run(0.2)
    line.enable()
    (after,) = line.plc.snapshot()
    assert after["connects"] == 2
    assert after["frames_sent"] > before["frames_sent"] > 60
    assert after["frames_received"] > before["frames_received"] > 60


@pytest.mark.parametrize("cycle", ["31.25us", "62.5us", "125us", "250us", "1ms", "512ms"])
def test_a_drive_without_limits_runs_at_every_cycle_from_one_send_clock_unit_on(cycle):
    line = VirtualLine(cycle=cycle, limits="lax")
    line.connect()
    line.enable(20.0)


def test_another_drive_that_answers_at_a_drives_address_is_not_taken_for_it():
    """Both have the address; the Connect for axis-01 goes to where axis-02 said that it was."""
    line = VirtualLine(drives=2)
    first, second = line.farm.axes
    wanted = first.station.config.ip
    second.device.dcp.address = wanted
    second.device.addressing.own_ip = wanted.ip.packed
    for station in (first, second):
        # neither asks whether another has it
        station.device.ip.set_address(wanted)
    plc = line.plc
    learn = plc.ip.learn
    plc.ip.learn = lambda ip, mac, now: learn(ip, second.port.mac if ip == wanted.ip else mac, now)
    line.run(0.5)
    session = plc.sessions[0]
    assert session.mac == first.port.mac
    assert session.measures.connects == 0
    assert session.measures.last_reason.endswith(
        "has the address of axis-01 ({}) and answered".format(first.port.mac.hex(":"))
    )
    plc.ip.learn = learn
    line.connect()
    assert [s.mac for s in plc.sessions] == [first.port.mac, second.port.mac]
    assert {ar.initiator_name for ar in first.device.cm.ars} == {"plc"}


def test_a_drive_that_becomes_ready_and_never_sends_a_frame_is_connected_again():
    """The data hold timer starts with the first frame; without one nothing else would tell."""
    line = VirtualLine()
    (station,) = line.farm.axes
    (session,) = line.plc.sessions
    opened = station.device.channels.open

    def mute(*arguments):
        ar = opened(*arguments)
        for row, _ in ar.providers:
            line.farm.columns.ppm[row].active = 0
        return ar

    station.device.channels.open = mute
    assert line.world.run(5, until=lambda: session.state is SessionState.DATA)
    began = line.world.now
    assert line.world.run(5, until=lambda: session.state is not SessionState.DATA)
    assert line.world.now - began == pytest.approx(2e9, rel=0.1)
    assert session.measures.last_reason == "no input data within the data hold time"
    assert session.measures.losses == 1
    station.device.channels.open = opened
    line.connect()
    line.run(5)
    assert session.measures.losses == 1


def test_a_drive_runs_with_data_that_have_no_status_octets_at_all():
    """DiscardIOXS for the telegram, too: its set points and actual values fill the frames alone."""
    line = VirtualLine()
    (session,) = line.plc.sessions
    bare = tuple(replace(s, properties=SubmoduleProperties.DISCARD_IOXS) for s in session.plan.submodules)
    session.plan = replace(session.plan, submodules=bare)
    line.connect()
    line.enable()
    line.run(3.0)
    assert line.farm.columns.axis[0].motor.velocity == pytest.approx(60.0, abs=0.3)
    (ar,) = line.farm.axes[0].device.ars.values()
    for _, layout in (*ar.providers, *ar.consumers):
        assert {d.iops_offset for d in layout.data} == {c.iocs_offset for c in layout.iocs} == {None}
        assert [d.data_offset for d in layout.data if d.data_length] == [0]
    sent = line.farm.channels.provided(ar.providers[0][0])
    assert any(sent[:4])
    assert not any(sent[4:])
