"""A drive's modules come, go and change hands under the built-in controller, with data going bad and good again."""

from __future__ import annotations

import asyncio
from dataclasses import replace
from ipaddress import IPv4Interface

import pytest
from virtual_line import VirtualLine

from pnfarm.buses.controller import ControllerHost
from pnfarm.buses.profinet.controller.core import ProfinetCore
from pnfarm.buses.profinet.controller.device_plan import ProfinetPlan
from pnfarm.buses.profinet.controller.identification import UNDER_WAY
from pnfarm.buses.profinet.controller.identity import read_im
from pnfarm.buses.profinet.device.modules import plug_module, pull_module
from pnfarm.errors import ConfigError, DecodeError
from pnfarm.links.base import PortSpec
from pnfarm.protocols.profinet.wire.cm.connect import ArType
from pnfarm.protocols.profinet.wire.rpc.pdu import Opnum
from pnfarm.station.event_log import EventLog

TELEGRAM = (0x3A00, 1, 2)


def row(line: VirtualLine, index: int = 0) -> dict[str, object]:
    return line.plc.snapshot()[index]


def logged(line: VirtualLine, event: str) -> list[dict[str, object]]:
    return [entry.data for entry in line.plc_log.entries("axis-01") if entry.event == event]


def test_a_pulled_module_stops_the_axis_program_says_why_and_keeps_the_connection() -> None:
    line = VirtualLine()
    line.connect()
    line.enable()
    pull_module(line.farm.axes[0].device, 1, None, line.world.now)
    line.farm.settle(line.farm.axes[0].station, line.world.now)
    line.run(0.3)
    shown = row(line)
    assert (shown["state"], shown["phase"], shown["losses"]) == ("DATA", "offline", 0)
    assert shown["unusable"] == ["slot 1 subslot 0x0001: pulled", "slot 1 subslot 0x0002: pulled"]
    assert not line.plc.all_connected
    sent = line.plc.columns.frames[line.plc.sessions[0].provider]
    assert line.plc.columns.ppm[line.plc.sessions[0].provider].words == 0
    _, output = line.plc.sessions[0].layouts
    start = int(line.plc.columns.ppm[0].data_offset)
    (place,) = [d for d in output.data if (d.api, d.slot, d.subslot) == TELEGRAM]
    assert sent[start + place.iops_offset] == 0x40
    bad = {(c.slot, c.subslot) for c in output.iocs if sent[start + c.iocs_offset] == 0x40}
    assert bad == {(1, 1), (1, 2)}


def test_a_plugged_module_is_parametrised_and_its_axis_runs_again() -> None:
    line = VirtualLine()
    line.connect()
    line.enable()
    station = line.farm.axes[0]
    pull_module(station.device, 1, None, line.world.now)
    line.farm.settle(station.station, line.world.now)
    line.run(0.2)
    plug_module(station.device, 1, line.world.now)
    line.farm.settle(station.station, line.world.now)
    line.enable()
    shown = row(line)
    assert (shown["connects"], shown["losses"], shown["unusable"]) == (1, 0, [])
    assert logged(line, "parameters written anew") == [{"reason": ""}, {"reason": ""}]
    line.run(0.5)
    assert line.farm.columns.axis[0].motor.velocity == pytest.approx(60.0, abs=0.5)


def test_parameters_are_written_again_while_the_axis_runs() -> None:
    line = VirtualLine()
    line.connect()
    line.enable()
    line.farm.columns.axis[0].motor.velocity = 60.0
    assert line.plc.reparametrise("axis-01", line.world.now, [TELEGRAM])
    line.run(0.2)
    assert logged(line, "parameters written anew") == [{"reason": ""}]
    assert row(line)["phase"] == "running"
    with pytest.raises(ConfigError):
        line.plc.reparametrise("axis-99", line.world.now)


def supervisor_of(line: VirtualLine, name: str = "supervisor") -> ProfinetCore:
    """A second controller in the same world that takes over what the first one allows."""
    link = line.world.link()
    (port,) = asyncio.run(link.open([PortSpec(name, bytes.fromhex("0200000000bb"))]))
    plans = [replace(s.plan, ar_type=ArType.IOSAR, assign_ip=False) for s in line.plc.sessions]
    plan = ProfinetPlan(name, IPv4Interface("10.77.1.251/23"), plans)
    core = ProfinetCore(plan, ControllerHost(link, port, EventLog(quiet=True), b"supervisor"))
    line.world.join(core, [port])
    core.start(line.world.now)
    return core


def test_a_supervisor_takes_the_axis_over_and_gives_it_back() -> None:
    line = VirtualLine()
    session = line.plc.sessions[0]
    session.plan = replace(session.plan, takeover_allowed=True)
    line.connect()
    line.enable()
    supervisor = supervisor_of(line)
    assert line.world.run(3.0, until=lambda: supervisor.all_running and supervisor.all_connected)
    shown = row(line)
    assert (shown["state"], shown["phase"]) == ("DATA", "offline")
    assert {why.partition(": ")[2] for why in shown["unusable"]} == {"controlled by a supervisor"}
    assert [ar.established for ar in line.farm.axes[0].device.ars.values()] == [True, True]
    supervisor.release(line.world.now)
    line.enable()
    line.run(0.5)
    shown = row(line)
    assert (shown["unusable"], shown["connects"], shown["losses"]) == ([], 1, 0)
    assert line.farm.columns.axis[0].motor.velocity == pytest.approx(60.0, abs=0.5)


@pytest.mark.parametrize("output", [False, True])
def test_the_record_of_io_data_has_those_of_the_owner(output: bool) -> None:
    line = VirtualLine()
    session = line.plc.sessions[0]
    session.plan = replace(session.plan, takeover_allowed=True)
    line.connect()
    supervisor = supervisor_of(line)
    assert line.world.run(3.0, until=lambda: supervisor.all_running)
    found = line.farm.axes[0].device.channels.io_data(1, 2, output)
    assert found is not None
    assert (found.iops, found.iocs) == (0x80, 0x80)
    assert any(found.data), "its words, not the zeros of the controller that lost them"


def test_a_supervisor_that_vanishes_gives_the_axis_back() -> None:
    line = VirtualLine()
    session = line.plc.sessions[0]
    session.plan = replace(session.plan, takeover_allowed=True)
    line.connect()
    supervisor = supervisor_of(line)
    assert line.world.run(3.0, until=lambda: supervisor.all_connected)
    supervisor.columns.ppm[0].active = 0
    assert line.world.run(3.0, until=lambda: not row(line)["unusable"] and line.plc.all_running)
    assert row(line)["losses"] == 0


def test_two_hundred_drives_lose_and_get_back_their_modules() -> None:
    line = VirtualLine(drives=200, watchdog=20)
    line.connect(10.0)
    line.enable(10.0)
    for station in line.farm.axes:
        pull_module(station.device, 1, None, line.world.now)
        line.farm.settle(station.station, line.world.now)
    line.run(0.2)
    assert not any(line.plc.columns.image[s.index].valid for s in line.plc.sessions)
    for station in line.farm.axes:
        plug_module(station.device, 1, line.world.now)
        line.farm.settle(station.station, line.world.now)
    line.enable(5.0)
    rows = line.plc.snapshot()
    assert {(r["connects"], r["losses"], r["phase"], tuple(r["unusable"])) for r in rows} == {(1, 0, "running", ())}


# records


def test_records_are_read_and_written_by_hand_with_an_answer_in_words() -> None:
    line = VirtualLine()
    early = line.plc.read_record("axis-01", (0, 0, 1, 0xAFF0), line.world.now)
    assert (early.done, early.ok) == (True, False)
    assert early.failure == "there is no connection (state WAIT)"
    line.connect()
    line.run(0.5)
    text = bytes.fromhex("0021 0038 0100") + b"feed".ljust(32) + b"hall 3".ljust(22)
    write = line.plc.write_record("axis-01", (0, 0, 1, 0xAFF1), text, line.world.now)
    read = line.plc.read_record("axis-01", (0, 0, 1, 0xAFF1), line.world.now)
    implicit = line.plc.read_record("axis-01", (0, 0, 1, 0xAFF1), line.world.now, implicit=True)
    unknown = line.plc.read_record("axis-01", (0, 0, 1, 0x1234), line.world.now)
    assert not read.done
    line.run(0.1)
    assert (write.ok, read.data, implicit.data) == (True, text, text)
    assert (unknown.ok, unknown.data) == (False, None)
    assert "invalid index" in unknown.failure


def test_a_record_that_a_lost_connection_takes_along_ends_with_words() -> None:
    line = VirtualLine()
    line.connect()
    line.run(0.5)
    line.farm.axes[0].station.power_off(line.world.now)
    job = line.plc.read_record("axis-01", (0, 0, 1, 0xAFF0), line.world.now)
    line.run(1.0)
    line.farm.axes[0].station.power_on(line.world.now)
    line.farm.settle(line.farm.axes[0].station, line.world.now)
    line.connect(20.0)
    assert job.done
    assert job.failure


# identification


def test_a_drive_is_identified_once_it_is_connected() -> None:
    line = VirtualLine()
    line.connect()
    line.run(0.5)
    shown = row(line)["identification"]
    im0 = line.farm.axes[0].device.description.im0
    assert shown["order_id"] == im0.order_id
    assert shown["serial_number"] == im0.serial_number
    assert shown["software_revision"].startswith(im0.software_revision[0])
    assert (shown["vendor_id"], shown["im_supported"]) == (line.plc.sessions[0].plan.vendor_id, 0b11110)
    assert shown["tag_function"] == ""
    assert logged(line, "identification differs") == []


def test_what_was_written_into_im1_and_im4_shows_after_the_next_connection() -> None:
    line = VirtualLine()
    line.connect()
    line.run(0.5)
    for number, octets in ((1, b"feed".ljust(32) + b"hall 3".ljust(22)), (4, b"\xf0\x0d".ljust(54, b"\0"))):
        text = bytes.fromhex(f"002{number} 0038 0100") + octets
        line.plc.write_record("axis-01", (0, 0, 1, 0xAFF0 + number), text, line.world.now)
        line.run(0.1)
    line.farm.axes[0].device.cm.abort_all(1, line.world.now)
    line.farm.settle(line.farm.axes[0].station, line.world.now)
    line.run(0.2)
    line.connect()
    line.run(0.5)
    shown = row(line)["identification"]
    assert (shown["tag_function"], shown["tag_location"]) == ("feed", "hall 3")
    assert (shown["descriptor"], shown["signature"]) == ("", "f00d")


def test_another_drive_than_the_plans_is_a_warning_and_nothing_more() -> None:
    line = VirtualLine()
    session = line.plc.sessions[0]
    session.plan = replace(session.plan, serial_number="A-1")
    line.connect()
    line.run(0.5)
    (found,) = logged(line, "identification differs")
    assert (found["what"], found["planned"]) == ("serial number", "A-1")
    assert row(line)["state"] == "DATA"


def test_identification_can_be_left_out() -> None:
    line = VirtualLine()
    session = line.plc.sessions[0]
    session.plan = replace(session.plan, read_identification=False)
    line.connect()
    line.run(0.5)
    assert row(line)["identification"] is None


def test_many_drives_are_identified_a_few_at_a_time() -> None:
    line = VirtualLine(drives=40)
    client, under_way, most = line.plc.client, set(), 0
    call = client.call

    def counting(peer, port, interface, object_uuid, opnum, *rest):
        nonlocal most
        call_id = call(peer, port, interface, object_uuid, opnum, *rest)
        if opnum == Opnum.READ:
            under_way.difference_update(under_way - set(client._calls))
            under_way.add(call_id)
            most = max(most, len(under_way))
        return call_id

    client.call = counting
    line.connect()
    line.run(2.0)
    assert all(shown["identification"] for shown in line.plc.snapshot())
    assert 1 <= most <= UNDER_WAY


@pytest.mark.parametrize("data", [b"", b"\x00", bytes.fromhex("0020 0004 0100 0000"), bytes.fromhex("0021 0002 0100")])
def test_a_malformed_im_record_is_a_decode_error(data: bytes) -> None:
    with pytest.raises(DecodeError):
        read_im(None, data)
