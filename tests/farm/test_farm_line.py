"""Whole drives as their controller sees them: real frames and calls on a switch in memory, virtual time."""

from __future__ import annotations

from dataclasses import replace
from ipaddress import IPv4Interface

import pytest
from parameter_requests import results
from record_line import API, MANUAL_3_6_2_REQUEST, MANUAL_3_6_2_RESPONSE, access, changing, reading, record, value_of
from virtual_line import VirtualLine

from pnfarm.drives.parameters.memory import VolatileMemory
from pnfarm.drives.profiles.profidrive.base_mode import (
    parse_request,
    parse_response,
)
from pnfarm.protocols.profinet.diagnosis import DiagnosisEntry
from pnfarm.protocols.profinet.errors import AccessError, RtaError

# -- connection ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("telegram", [1, 350, 7, 9, 354])
def test_every_connected_telegram_exchanges_data(telegram):
    line = VirtualLine(telegram=telegram)
    line.connect()
    assert line.farm.axes[0].store.telegram_number == telegram


def test_telegram_350_brings_the_current_to_the_controller():
    line = VirtualLine(telegram=350)
    line.connect()
    line.enable()
    line.run(1.0)
    axis = line.farm.columns.axis[0]
    expected = round(float(axis.motor.current) / float(axis.motor.settings.peak_current) * 16384)
    consumer = line.plc.columns.cpm[line.plc.sessions[0].consumer]
    assert consumer.words == 3
    assert line.plc.columns.image[0].received[5] == expected != 0


def test_akd_4_2_2_a_cycle_below_16_ms_is_refused_and_the_controller_is_told_why():
    line = VirtualLine(cycle="8ms", limits="lax")
    station = line.farm.axes[0]
    station.station.config = replace(station.station.config, strict=True)
    station.station.power_cycle(line.world.now)
    line.run(2.0)
    session = line.plc.sessions[0]
    assert session.measures.connects == 0
    assert session.measures.refusals > 0
    assert "reduction ratio" in session.measures.last_reason
    refused = next(e for e in line.log.entries("axis-01") if e.event == "connect refused")
    assert "8 ms" in refused.data["detail"]


def test_lax_limits_take_a_1_ms_cycle():
    line = VirtualLine(cycle="1ms", limits="lax", watchdog=10)
    line.connect()
    line.run(0.5)
    assert line.farm.columns.ppm[0].sent > 450


def test_forty_drives_connect_and_run_at_once():
    line = VirtualLine(drives=40)
    line.connect()
    line.enable()
    line.run(0.5)
    assert (line.farm.columns.axis.drive.state[:40] == 4).all()
    assert line.farm.columns.cpm.discarded.sum() == 0


def test_release_closes_the_channels_and_leaves_no_fault():
    line = VirtualLine()
    line.connect()
    line.enable()
    line.plc.release(line.world.now)
    assert line.world.run(1.0, until=lambda: line.plc.all_stopped)
    line.run(0.2)
    station = line.farm.axes[0]
    assert not station.device.ars
    assert line.farm.columns.axis[0].faults.code[0] == 0
    assert not line.farm.columns.ppm.active.any()


def test_telegram_354_brings_its_own_ramps_in_units_of_pn_accscaling():
    line = VirtualLine(telegram=354)
    line.connect()
    line.enable()
    line.run(0.5)
    image = line.plc.columns.image[0]
    image.sent[13], image.sent[14] = 2, 4
    line.run(0.05)
    axis = line.farm.columns.axis[0]
    assert axis.ramp.up == 2 * 763
    assert axis.ramp.down == 4 * 763
    image.sent[13] = 0
    line.run(0.05)
    assert axis.ramp.up == axis.ramp.settings.acceleration


# -- loss ------------------------------------------------------------------------------------------------------------


def test_silent_controller_gives_f702_an_err_rta_and_after_its_return_recovery():
    line = VirtualLine()
    line.connect()
    line.enable()
    line.plc.columns.ppm[0].active = 0
    line.run(0.2)
    station = line.farm.axes[0]
    assert station.device.watchdog_expirations == 1
    assert station.fault_counts == {702: 1}
    aborted = next(e for e in line.log.entries("axis-01") if e.event == "ar aborted")
    assert aborted.data["code2"] == RtaError.CONSUMER_DHT_EXPIRED
    assert line.plc.sessions[0].measures.losses == 1
    assert "aborts" in line.plc.sessions[0].measures.last_reason
    line.enable()
    assert line.farm.columns.axis[0].faults.code[0] == 0
    assert station.device.connects == 2


def test_a_farm_that_stops_tells_its_controllers_at_once():
    line = VirtualLine(drives=2)
    line.connect()
    line.farm.stop(line.world.now)
    line.run(0.001)
    for session in line.plc.sessions:
        assert session.measures.losses == 1
        assert "aborts" in session.measures.last_reason
        assert session.measures.expirations == 0


def test_factory_reset_ends_the_connection_and_clears_name_and_address():
    line = VirtualLine()
    line.connect()
    client = _client(line)
    client.client.reset_to_factory(client.target, now=line.world.now)
    client._finish()
    station = line.farm.axes[0]
    assert not station.device.ars
    assert (station.device.name, station.device.ip.address) == ("", None)
    assert line.plc.sessions[0].measures.losses == 1


def test_silent_drive_is_noticed_by_the_controller_within_its_watchdog():
    line = VirtualLine()
    line.connect()
    line.farm.columns.ppm[0].active = 0
    line.run(0.1)
    assert line.plc.sessions[0].measures.expirations == 1


def test_f702_is_not_raised_before_a_controller_ever_came():
    line = VirtualLine(controller=False)
    line.run(5.0)
    assert line.farm.columns.axis[0].faults.code[0] == 0


def test_power_cycle_keeps_the_fault_history_and_the_controller_comes_back():
    line = VirtualLine()
    line.connect()
    station = line.farm.axes[0]
    station.raise_fault(702, hold=False)
    line.run(0.1)
    station.station.power_cycle(line.world.now)
    line.farm.settle(station.station, line.world.now)
    line.run(0.5)
    line.connect()
    assert 702 in [int(n) for n in line.farm.columns.axis[0].faults.buffer]


# -- memory ----------------------------------------------------------------------------------------------------------


def test_permanent_name_and_address_survive_a_restart_and_temporary_ones_do_not():
    memory = VolatileMemory()
    line = VirtualLine(controller=False, memory=memory)
    station = line.farm.axes[0]
    client = _client(line)
    client.set_name("press-7", permanent=True)
    client.set_ip(IPv4Interface("10.77.0.99/23"), permanent=True)
    assert station.device.name == "press-7"
    again = VirtualLine(controller=False, memory=memory).farm.axes[0]
    assert again.device.name == "press-7"
    assert str(again.device.ip.address) == "10.77.0.99/23"
    client.set_ip(IPv4Interface("10.77.0.100/23"), permanent=False)
    assert str(station.device.ip.address) == "10.77.0.100/23"
    third = VirtualLine(controller=False, memory=memory).farm.axes[0]
    assert third.device.ip.address is None


class _client:  # noqa: N801 - reads as a verb where it is used
    """A DCP tool on the switch."""

    def __init__(self, line: VirtualLine) -> None:
        from pnfarm.protocols.profinet.dcp.client import DcpClient
        from pnfarm.wire.ethernet import parse_ethernet

        self.line = line
        self.mac = bytes.fromhex("020000fffffe")
        self.client = DcpClient(self.mac)
        self.port = line.world.switch.attach(
            self.mac, lambda _i, frame, now: self.client.receive(parse_ethernet(frame), now)
        )
        self.target = line.farm.axes[0].port.mac

    def _finish(self) -> None:
        for frame in self.client.to_send(self.line.world.now):
            self.line.world.switch.send(self.port.index, frame, self.line.world.now)
        self.line.run(0.05)
        (event,) = self.client.events()
        assert event.error is None

    def set_name(self, name: str, *, permanent: bool) -> None:
        self.client.set_name(self.target, name, permanent=permanent, now=self.line.world.now)
        self._finish()

    def set_ip(self, ip: IPv4Interface, *, permanent: bool) -> None:
        self.client.set_ip(self.target, ip, permanent=permanent, now=self.line.world.now)
        self._finish()


def test_parameter_is_kept_over_a_power_cycle_only_after_drv_nvsave():
    line = VirtualLine()
    line.connect()
    for save, expected in ((False, 0), (True, 4711)):
        access(line, changing(2497, 0x43, 4711))
        if save:
            access(line, changing(2469, 0x41, 1))
        station = line.farm.axes[0]
        station.station.power_cycle(line.world.now)
        line.farm.settle(station.station, line.world.now)
        line.run(0.1)
        line.connect()
        assert value_of(line, 2497) == (expected,)


# -- records ---------------------------------------------------------------------------------------------------------


def test_akd_3_6_2_the_manuals_own_request_gets_the_manuals_own_answer():
    line = VirtualLine()
    line.connect()
    assert access(line, MANUAL_3_6_2_REQUEST) == MANUAL_3_6_2_RESPONSE
    assert line.farm.columns.axis[0].drive.settings.opmode == 2


@pytest.mark.parametrize("index", [47, 0xB02E, 0xB02F])
def test_parameter_access_answers_on_each_of_its_record_indexes(index):
    line = VirtualLine()
    line.connect()
    data = access(line, reading((930, 0, 1)), index=index)
    assert data is not None
    assert parse_response(data).entries[0].values == (1,)


@pytest.mark.parametrize(
    ("pnu", "count", "expected"),
    [
        (922, 1, (1,)),
        (944, 1, (0,)),
        (947, 8, (0,) * 8),
        (964, 1, (0x0105,)),
        (1, 1, None),
        (2, 1, None),
        (5, 1, None),
        (6, 1, None),
        (915, 2, (1, 5)),
        (916, 2, (2, 6)),
    ],
)
def test_profile_parameters_read_over_the_wire(pnu, count, expected):
    line = VirtualLine()
    line.connect()
    values = value_of(line, pnu, 0, count)
    assert len(values) == count
    if expected is not None:
        assert values == expected


def test_one_request_reads_several_parameters_and_errors_name_the_failing_one():
    line = VirtualLine()
    line.connect()
    request = reading((922, 0, 1), (4999, 0, 1), (930, 0, 1))
    data = access(line, request)
    assert data is not None
    response = parse_response(data)
    assert response.response_id == 0x81
    outcome = results(parse_request(request), response)
    assert [type(item).__name__ == "ParameterError" for item in outcome] == [False, True, False]


def test_reading_a_response_without_a_request_is_a_state_conflict():
    line = VirtualLine()
    line.connect()
    event = record(line, 1, 1, 47, api=API)
    assert event.status is not None
    assert event.status.error_code1 == AccessError.STATE_CONFLICT


def test_im0_names_maker_order_number_and_the_manuals_firmware():
    line = VirtualLine()
    line.connect()
    data = record(line, 0, 1, 0xAFF0).data
    assert data is not None
    assert data[6:8] == bytes.fromhex("0105")
    assert b"AKD-P00306-NBPN-0000" in data
    assert data.index(b"V") > 0


def test_pn_velscaling_changes_what_a_set_point_means():
    line = VirtualLine()
    line.connect()
    line.enable()
    access(line, changing(1009, 0x42, 819))
    line.run(1.0)
    assert line.farm.columns.axis[0].motor.velocity == pytest.approx(30.0, abs=0.2)


def test_an_active_fault_is_read_back_by_pnu_947_and_counted_by_944():
    line = VirtualLine()
    line.connect()
    line.farm.axes[0].raise_fault(702, hold=True)
    line.run(0.05)
    assert value_of(line, 947, 0, 2) == (702, 0)
    assert value_of(line, 944) == (1,)


def test_a_makers_own_diagnosis_is_logged_with_its_structure_and_octets():
    line = VirtualLine()
    line.connect()
    (station,) = line.farm.axes
    for entry in (DiagnosisEntry(0x3A00, 1, 2, 0x1234, data=b"maker"), DiagnosisEntry(0x3A00, 1, 2, error_type=0x10)):
        station.device.cm.diagnosis.add(entry)
        line.farm.settle(station.station, line.world.now)
    told = [entry.data["diagnosis"] for entry in line.log.entries("axis-01") if entry.event == "diagnosis appears"]
    assert told == ["USI 0x1234 6D 616B 6572", "parametrisation fault"]
