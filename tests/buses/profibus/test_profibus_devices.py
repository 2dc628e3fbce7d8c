"""Devices of a farm by their makers' GSD files, with the built-in master in virtual time."""

import asyncio
from dataclasses import replace

import pytest
from device_cell import CONFIGS, HEAD, parse
from slave_cell import CONTROLLER, DRIVES, ISLAND, ONE, TWO, VALVE, SlaveCell

from pnfarm.cli.farm_file import described
from pnfarm.controller.line import VirtualLine
from pnfarm.drives.parameters.memory import VolatileMemory
from pnfarm.errors import ConfigError
from pnfarm.farm.farm import make_link
from pnfarm.farm.file.reading import FarmFileError, expand_devices, load_farm
from pnfarm.farm.lines import line_ways
from pnfarm.faults.errors import InjectionError
from pnfarm.protocols.profibus.wire.dp import Control, SetAddress, StationStatus
from pnfarm.protocols.profibus.wire.telegram import Sap, Telegram, emit_telegram


@pytest.fixture(scope="module")
def shared():
    cell = SlaveCell(TWO)
    cell.connect()
    return cell


def test_devices_exchange_data_both_ways_and_signals_are_named_values_of_them(shared):
    cell = shared
    cell.signals().set({"part_present": True, "count": 0x01020304})
    cell.signals("valve").set({"slot1_in_1_7": True})
    cell.sent(b"\x81\x02\x03")
    cell.sent(b"\x40", "valve")
    assert cell.inputs() == (bytes.fromhex("0800 010203040000"), True)
    assert cell.inputs("valve") == (b"\x00\x80", True)
    island, valve = cell.signals(), cell.signals("valve")
    assert [island.get(name) for name in ("clamp", "slot2_out_0_1", "slot2_out_0_7", "slot4_out_1_0")] == [
        True, False, True, True,
    ]  # fmt: skip
    assert (valve.get("slot1_out_0_6"), valve.good("slot1_out_0_6"), island.good("clamp")) == (True, True, True)
    assert [(row["state"], row["losses"]) for row in cell.plc.snapshot()] == [("data-exchange", 0)] * 2


def test_a_farm_of_devices_alone_has_its_serial_line():
    config = parse(f"farm: line\nlink: {{kind: serial, pty: auto, baud: 500000}}\n{TWO}")
    assert make_link(config, []).baud == 500_000
    assert [*line_ways(config)] == ["profibus"]


def test_devices_on_a_line_beside_a_network_need_the_line_and_no_drive_on_it():
    network = "{name: axis, model: akd-profinet, ip: 10.77.0.11/24}"
    text = f"farm: both\nlink: {{kind: veth%s}}\ndrives: [{network}]\n{TWO}"
    config = parse(text % ", lines: {profibus: {pty: auto}}")
    assert [*line_ways(config)] == ["profibus"]
    with pytest.raises(FarmFileError, match=r"'island' is on PROFIBUS, and the link has no line for it"):
        parse(text % "")


def test_set_prm_has_the_files_octets_with_the_farm_files_parameters_and_they_are_shown(shared):
    # DP-V1 enabled, Diagnosis off, delay 100; filter 3; hold; the counter's word
    wanted = "80 00 00 00 00 64 03 01 00 00 00 01"
    assert shared.device().details()["parameters"] == wanted
    assert shared.device("valve").details()["parameters"] == "01 02"


def test_the_diagnosis_has_ident_number_and_state_of_the_station(shared):
    diagnosis = shared.station().diagnosis
    assert (diagnosis.ident, diagnosis.master, diagnosis.extended) == (0x1D01, 1, b"")
    assert diagnosis.status & StationStatus.WD_ON
    assert not diagnosis.status & (StationStatus.PRM_FAULT | StationStatus.CFG_FAULT | StationStatus.NOT_SUPPORTED)


@pytest.mark.parametrize("access", ["class-1", "class-2"])
def test_records_of_dp_v1_are_read_back_as_they_were_written(access):
    cell = SlaveCell(TWO, f", access: {access}")
    cell.connect()
    assert cell.record(2, 10, b"kept").ok
    assert cell.record(2, 10).data == b"kept"
    assert cell.record(2, 11).refused[0] == 0xB0
    assert cell.record(3, 10).refused[0] == 0xB2
    assert cell.record(2, 12, bytes(65)).refused[0] == 0xB7
    cell.inject("record-error", params={"error": "access-denied"})
    assert cell.record(2, 10).refused[0] == 0xB6
    cell.clear()
    station = cell.farm.station("island")
    station.power_cycle(cell.world.now)
    cell.farm.settle(station, cell.world.now)
    cell.world.run(0.5)
    cell.connect()
    assert cell.record(2, 10).refused[0] == 0xB0


def test_a_slave_without_dp_v1_has_no_records(shared):
    assert not shared.record(1, 1, name="valve").ok


def test_outputs_are_zero_and_bad_while_the_master_is_in_clear_and_good_again_behind_it():
    cell = SlaveCell(TWO)
    cell.connect()
    cell.sent(b"\xff\xff\xff")
    cell.plc.master.control(Control.CLEAR_DATA)
    cell.world.run(0.1)
    assert (cell.signals().get("clamp"), cell.signals().good("clamp")) == (False, False)
    assert cell.plc.all_connected
    cell.plc.master.control(0)
    cell.world.run(0.1)
    assert (cell.signals().get("clamp"), cell.signals().good("clamp")) == (True, True)


@pytest.mark.parametrize(("fail_safe", "lost"), [(1, False), (0, True)])
def test_empty_outputs_are_taken_as_zero_only_where_the_file_says_fail_safe(tmp_path, fail_safe, lost):
    (tmp_path / "valve.gsd").write_bytes((CONFIGS / VALVE).read_bytes() + b"Fail_Safe = %d\n" % fail_safe)
    cell = SlaveCell(f"devices: [{{name: valve, gsd: {tmp_path / 'valve.gsd'}, address: 9}}]\n")
    cell.connect()
    cell.sent(b"\xff", "valve")
    station = cell.station("valve")
    station.source = lambda: b""
    cell.world.run(0.03)
    assert cell.device("valve").losses().get("wrong-length", 0) == lost
    assert (cell.signals("valve").get("slot1_out_0_0"), cell.signals("valve").good("slot1_out_0_0")) == (False, False)


def test_a_device_without_dp_v1_has_octets_of_set_prm_that_mean_nothing_of_it(tmp_path):
    text = (CONFIGS / VALVE).read_bytes().replace(b"0x01,0x02", b"0x84,0x02")
    (tmp_path / "valve.gsd").write_bytes(text)
    cell = SlaveCell(f"devices: [{{name: valve, gsd: {tmp_path / 'valve.gsd'}, address: 9}}]\n")
    cell.connect()
    connection = cell.device("valve").connection()
    assert (connection.exchanging, connection.watchdog_ns) == (True, 100_000_000)


@pytest.mark.parametrize("fail_safe", [0, 1])
def test_a_device_without_outputs_is_polled_like_any_other_whatever_its_file_says_of_empty_outputs(tmp_path, fail_safe):
    text = (CONFIGS / VALVE).read_bytes().replace(b"0x11,0x20", b"0x11") + b"Fail_Safe = %d\n" % fail_safe
    (tmp_path / "valve.gsd").write_bytes(text)
    cell = SlaveCell(f"devices: [{{name: valve, gsd: {tmp_path / 'valve.gsd'}, address: 9}}]\n")
    cell.connect()
    assert cell.device("valve").connection().cycle_ns == 5_000_000
    assert cell.farm.station("valve").image.valid


def test_outputs_are_zero_and_bad_when_the_master_is_lost_and_inputs_stay():
    cell = SlaveCell(ONE)
    cell.connect()
    cell.signals().set({"part_present": True})
    cell.sent(b"\x01\x00\x00")
    cell.plc.release(cell.world.now)
    cell.world.run(0.5)
    signals = cell.signals()
    assert (signals.get("clamp"), signals.good("clamp"), signals.get("part_present")) == (False, False, True)
    assert "connection released" in cell.events()


def test_a_plant_on_the_line_has_drives_and_devices():
    cell = SlaveCell(DRIVES + TWO, ", program: {kind: constant, speed_rpm: 60, acknowledge_after: 100ms}")
    cell.connect()
    assert cell.world.run(5.0, until=lambda: cell.plc.all_running)
    cell.signals().set({"part_present": True})
    cell.sent(b"\x01\x00\x00")
    assert cell.inputs()[0][0] == 8
    assert cell.signals().get("clamp") is True
    assert [row["name"] for row in cell.plc.snapshot()] == ["msd-1", "msd-2", "island", "valve"]


# -- what a master does wrong ------------------------------------------------------------------------------------------


def planned(cell, name="island", **other):
    """The master wants something else of a slave from its next start on."""
    station = cell.station(name)
    station.plan = replace(station.plan, **other)
    cell.inject("ar-abort")
    cell.world.run(1.0)
    return station.diagnosis.status


@pytest.mark.parametrize(
    ("identifiers", "taken"),
    [("11 20 00 c1 81 85 01 00 00", True), ("11 20 c1 81 85 01", False), ("11 20 00 c1 81 85 02", False),
     ("11 20", False)],
)  # fmt: skip
def test_chk_cfg_must_name_the_plugged_modules(identifiers, taken):
    cell = SlaveCell(ONE)
    cell.connect()
    status = planned(cell, identifiers=bytes.fromhex(identifiers))
    assert bool(status & StationStatus.CFG_FAULT) == (not taken)
    assert cell.plc.all_connected == taken


@pytest.mark.parametrize("limits", ["strict", "lax"])
@pytest.mark.parametrize(
    ("user", "text"),
    [("80 00 00 00 00 64 02 01 00000001", "slot 1, Input filter is 2, the file allows 0, 1, 3, 10"),
     ("80 00 00 00 00 64 03 01", "8 octets of parameters instead of 12")],
)  # fmt: skip
def test_parameters_that_the_file_does_not_allow_are_refused_or_with_lax_limits_taken_with_a_warning(
    limits, user, text
):
    cell = SlaveCell(ONE.replace("    address:", f"    limits: {limits}\n    address:"))
    cell.connect()
    status = planned(cell, user=bytes.fromhex(user))
    assert bool(status & StationStatus.PRM_FAULT) == (limits == "strict")
    assert cell.plc.all_connected == (limits == "lax")
    found = [entry.what.meaning for entry in cell.log.entries("island") if hasattr(entry.what, "meaning")]
    assert text in found


# -- addresses ---------------------------------------------------------------------------------------------------------


def test_a_device_without_an_address_waits_at_126_for_a_master_and_keeps_what_it_gets():
    memory = VolatileMemory()
    text = f"devices:\n  - {{name: valve, gsd: {VALVE}}}\n"
    cell = SlaveCell(text, None, memory)
    cell.world.run(0.1)
    device = cell.device("valve")
    assert (device.slave.address, device.details()["address_from"]) == (126, "nowhere")
    request = Telegram(126, 2, 0x6D, Sap.SET_SLAVE_ADDRESS, Sap.MASTER, SetAddress(31, 0x1D02).emit())
    device.receive(emit_telegram(request), cell.world.now)
    device.pump(cell.world.now)
    device.follow(cell.world.now)
    assert device.slave.address == 31
    assert "station address changed" in cell.events("valve")
    again = SlaveCell(text, None, memory).device("valve")
    assert (again.slave.address, again.details()["address_from"]) == (31, "master")
    with pytest.raises(ConfigError, match="valve has no station address, and this master sets none"):
        SlaveCell(text)


# -- the farm file -----------------------------------------------------------------------------------------------------


def test_the_farm_file_says_what_was_taken():
    assert list(described(parse(HEAD + TWO))) == [
        "island: Island DP (ident 0x1D01), slot 1: 16DI, slot 2: 8DO, slot 4: Counter",
        "island: 8 octets of inputs, 3 of outputs, 12 of parameters, 91 signals",
        "island: DP-V1, 9.6 kbit/s, 93.75 kbit/s, 500 kbit/s, 1.5 Mbit/s, 12 Mbit/s",
        "valve: Valve DP (ident 0x1D02), slot 1: Valve",
        "valve: 2 octets of inputs, 1 of outputs, 2 of parameters, 24 signals",
        "valve: DP-V0, 9.6 kbit/s, 500 kbit/s, 1.5 Mbit/s",
    ]


def test_the_example_of_a_line_with_drives_and_devices_runs():
    config = load_farm(CONFIGS / "profibus-cell.pnfarm.yml")
    line = asyncio.run(VirtualLine.create(config))
    assert line.world.run(10.0, until=lambda: line.plc.all_connected and line.plc.all_running)


def test_devices_count_up_with_their_addresses():
    text = f"devices:\n  - {{name: 'valve-{{n}}', count: 3, gsd: {VALVE}, address: 20}}\n"
    devices = expand_devices(parse(HEAD + text))
    assert [(device.name, device.addresses()[1]) for device in devices] == [
        ("valve-1", "20"), ("valve-2", "21"), ("valve-3", "22"),
    ]  # fmt: skip


def refusal(text):
    with pytest.raises(FarmFileError) as failed:
        parse(HEAD + text)
    return [(issue.field, issue.line, f"{issue.what}; {issue.allowed}") for issue in failed.value.issues]


@pytest.mark.parametrize(
    ("before", "after", "field", "text"),
    [
        (ISLAND, "gsd/none.gsd", "devices[0].gsd", "cannot be read: no such file"),
        (ISLAND, "cell.pnfarm.yml", "devices[0].gsd", "no line is #Profibus_DP"),
        ("1: 16DI", "1: 16DX", "devices[0].slots.1", "did you mean 16DI"),
        ("1: 16DI", "9: 16DI", "devices[0].slots.9", "the station has slots 1 to 8"),
        ("1: 16DI", "x: 16DI", "devices[0].slots.x", "is not a slot"),
        ("1: 16DI", "1: [16DI]", "devices[0].slots.1.module", "is a list"),
        ('0: {parameters: {Diagnosis: "off"}}', "0: 16DI", "devices[0].slots.0", "the station has slots 1 to 8"),
        ("Substitute: hold", "Substitute: never", "devices[0].slots.2.parameters", "allows zero, hold, substitute"),
        ("Substitute: hold", "Substitut: hold", "devices[0].slots.2.parameters", "did you mean Substitute"),
        ("4: Counter", "7: {parameters: {x: 1}}", "devices[0].slots.7.parameters", "has parameters and no module"),
        ("1.1.0.3", "1.1.7.3", "devices[0].signals.part_present", ""),
        ("1.1.0.3", "1.2.0.3", "devices[0].signals.part_present", "1.2 is not plugged"),
        ("1.1.0.3", "3.1.0.3", "devices[0].signals.part_present", "3.1 is not plugged"),
        ("address: 5", "limits: lax", "devices[0].address", "no master can set it"),
        ("address: 5", "address: 126", "devices[0].address", ""),
        ("address: 5", "address: 125\n    count: 2", "devices[0].address", "counts 2 stations up to 126"),
        ("address: 5", "address: 5\n    ip: 10.0.0.1/24", "devices[0].ip", "is not a key here"),
    ],
)
def test_what_is_wrong_in_devices_is_told_with_its_place(before, after, field, text):
    assert before in ONE
    issues = refusal(ONE.replace(before, after, 1))
    assert any(place == field and text in what and line > 0 for place, line, what in issues), issues


def test_names_and_addresses_are_unique_on_the_line():
    second = f"  - {{name: island, gsd: {VALVE}, address: 5}}\n"
    assert sorted(place for place, _, _ in refusal(ONE + second)) == ["devices[1].address", "devices[1].name"]
    drive = "drives: [{name: msd, model: moog-msd-dp, address: 5}]\n"
    assert [place for place, _, _ in refusal(drive + ONE)] == ["devices[0].address"]
    assert [place for place, _, _ in refusal(ONE + (CONTROLLER % ", address: 5"))] == ["devices[0].address"]


def test_a_cycle_below_that_of_the_file_is_refused():
    with pytest.raises(ConfigError, match="island: a cycle of 500us, its file allows 600us"):
        SlaveCell(ONE + (CONTROLLER % "").replace("5ms", "500us"), None)


# -- faults ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["silence", "link-down", "ar-abort", "wrong-ident", "config-fault", "power-cycle"])
def test_faults_that_need_no_servo_act_on_a_device_and_it_comes_back(kind):
    cell = SlaveCell(TWO)
    cell.connect()
    cell.inject(kind)
    cell.world.run(0.5)
    assert cell.station().losses == 1
    assert cell.station("valve").losses == 0
    cell.clear()
    cell.connect()
    cell.signals().set({"part_present": True})
    cell.world.run(0.1)
    assert cell.inputs() == (bytes.fromhex("0800000000000000"), True)


def test_a_fault_on_a_signal_is_what_the_master_gets_until_it_ends(shared):
    cell = shared
    cell.signals().set({"part_present": False})
    cell.inject("signal-stuck", params={"signal": "part_present", "value": True})
    cell.world.run(0.1)
    assert cell.inputs()[0][0] == 8
    cell.clear(0.1)
    assert cell.inputs()[0][0] == 0


def test_a_broken_wire_reads_as_zero_and_is_reported_for_its_channel(shared):
    cell = shared
    cell.signals().set({"part_present": True})
    cell.inject("wire-break", params={"signal": "part_present"})
    cell.world.run(0.1)
    assert cell.inputs()[0][0] == 0
    # slot 1, input 3, line break
    assert cell.station().diagnosis.extended.hex(" ") == "42 01 80 43 26"
    cell.clear(0.2)
    assert (cell.inputs()[0][0], cell.station().diagnosis.extended) == (8, b"")
    # one whose diagnosis has no room for it is silent
    cell.inject("wire-break", "valve", params={"signal": "slot1_in_0_0"})
    cell.world.run(0.1)
    assert cell.station("valve").diagnosis.extended == b""
    cell.clear(0.1)


def test_two_broken_wires_are_reported_together_and_each_ends_alone(shared):
    cell = shared
    cell.signals().set({"part_present": True})
    first = cell.inject("wire-break", params={"signal": "part_present"})
    second = cell.inject("wire-break", params={"signal": "slot1_in_0_0"})
    cell.world.run(0.2)
    assert cell.station().diagnosis.extended.hex(" ") == "42 01 80 43 26 80 40 26"
    cell.farm.injections.clear(second.id, cell.world.now)
    cell.world.run(0.2)
    assert cell.station().diagnosis.extended.hex(" ") == "42 01 80 43 26"
    cell.farm.injections.clear(first.id, cell.world.now)
    cell.world.run(0.2)
    assert cell.station().diagnosis.extended == b""


@pytest.mark.parametrize("kind", ["drive-warning", "sto", "diagnosis", "module-missing", "reorder"])
def test_a_fault_that_a_device_cannot_have_is_refused(shared, kind):
    with pytest.raises(InjectionError):
        shared.inject(kind, params={"warning": 1} if kind == "drive-warning" else {})


@pytest.mark.parametrize(
    ("code", "more", "octets"),
    [
        (0x1234, {}, "03 12 34"),
        ("bus of the island is disturbed", {}, "03 00 02"),
        ("Valve is worn", {"slot": 2, "channel": 5}, "42 02 81 85 31"),
        ("line break", {"slot": 4, "channel": 1}, "42 08 83 c1 26"),
    ],
)
def test_a_diagnosis_is_raised_by_a_number_or_by_its_name_in_the_file(shared, code, more, octets):
    cell = shared
    cell.inject("diagnosis-request", params={"code": code, **more})
    cell.world.run(0.1)
    diagnosis = cell.station().diagnosis
    assert (diagnosis.extended.hex(" "), bool(diagnosis.status & StationStatus.EXT_DIAG)) == (octets, True)
    cell.clear(0.2)
    assert cell.station().diagnosis.extended == b""


def test_an_unknown_name_of_a_diagnosis_is_refused_with_what_there_is(shared):
    with pytest.raises(InjectionError, match=r"no diagnosis 'valve is wron', did you mean Valve is worn"):
        shared.inject("diagnosis-request", params={"code": "valve is wron"})
    with pytest.raises(InjectionError, match="makes a diagnosis of 11 octets, the file allows 6"):
        shared.inject("diagnosis-request", "valve", params={"code": "overload"})
    with pytest.raises(InjectionError, match="slot 3 has no module"):
        shared.inject("diagnosis-request", params={"code": "overload", "slot": 3})
    cell = SlaveCell(DRIVES)
    with pytest.raises(InjectionError, match="msd-1 is a drive, and has no diagnosis 'overload': give a number"):
        cell.inject("diagnosis-request", "msd-1", params={"code": "overload"})


def test_the_cycles_of_a_device_without_inputs_are_faulty_by_their_acknowledgements(tmp_path):
    (tmp_path / "valve.gsd").write_bytes((CONFIGS / VALVE).read_bytes().replace(b"0x11,0x20", b"0x20"))
    cell = SlaveCell(f"devices: [{{name: valve, gsd: {tmp_path / 'valve.gsd'}, address: 9}}]\n")
    cell.connect()
    missing = cell.inject("drop-cycles", on="valve", count=1)
    cell.world.run(0.1)
    assert missing.evidence().activations == 1
    assert cell.station("valve").retries == 1
    cell.inject("loss", on="valve", direction="out", probability=1.0, params={"frames": "acyclic"})
    cell.world.run(0.1)
    assert (cell.station("valve").retries, cell.station("valve").losses) == (1, 0)
