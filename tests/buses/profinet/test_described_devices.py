"""Devices of a farm by their makers' GSDML files, with the built-in controller in virtual time."""

import asyncio

import pytest
from device_cell import CONFIGS, CONTROLLER, DRIVES, HEAD, ISLAND, ONE, SCANNER, Cell, parse

from pnfarm.buses.profinet.device.modules import plug_module, pull_module
from pnfarm.buses.profinet.gsdml_file import load_gsdml
from pnfarm.cli.farm_file import described
from pnfarm.controller.line import VirtualLine
from pnfarm.farm.file.reading import FarmFileError, expand_devices, load_farm
from pnfarm.faults.errors import InjectionError
from pnfarm.protocols.profinet.diagnosis import Severity
from pnfarm.protocols.profinet.errors import AccessError, RecordError


@pytest.mark.parametrize("startup", ["legacy", "advanced"])
def test_a_device_connects_in_both_start_up_modes_and_exchanges_data_both_ways(startup):
    cell = Cell(ONE, f", startup: {startup}")
    cell.connect()
    signals = cell.signals()
    signals.set({"part_present": True, "pressure": 4.5, "slot3_value_3": -2})
    cell.sent(b"\x81")
    inputs = cell.plc.plain["island"][1].read()
    assert inputs[:10] == bytes([8, 0]) + (450).to_bytes(2, "big") + bytes(4) + b"\xff\xfe"
    assert [signals.get(f"slot2_output_{bit}") for bit in (0, 1, 7)] == [True, False, True]
    assert signals.good("slot2_output_0")
    (row,) = cell.plc.snapshot()
    assert (row["state"], row["losses"], row["identification"]["order_id"]) == ("DATA", 0, "EX-ISL-100")


def test_outputs_keep_their_value_with_bad_status_when_the_controller_is_lost():
    cell = Cell(ONE)
    cell.connect()
    cell.sent(b"\x01")
    cell.plc.release(cell.world.now)
    cell.world.run(1.0)
    assert cell.signals().get("slot2_output_0") is True
    assert not cell.signals().good("slot2_output_0")


def test_a_pulled_module_has_bad_status_in_both_directions_until_it_is_plugged():
    cell = Cell(ONE)
    cell.connect()
    cell.signals().set({"part_present": True})
    device, station = cell.device(), cell.farm.station("island")
    pull_module(device, 1, None, cell.world.now)
    pull_module(device, 2, None, cell.world.now)
    cell.farm.settle(station, cell.world.now)
    cell.sent(b"\xff")
    inputs = cell.plc.plain["island"][1]
    # submodules with inputs: 1.1, 3.1, 4.1
    assert [inputs.good(number) for number in range(3)] == [False, True, True]
    assert cell.signals().get("slot2_output_0") is False
    assert not cell.signals().good("slot2_output_0")
    assert cell.plc.sessions[0].out_of_use
    plug_module(device, 1, cell.world.now)
    plug_module(device, 2, cell.world.now)
    cell.farm.settle(station, cell.world.now)
    cell.world.run(2.0)
    assert [inputs.good(number) for number in range(3)] == [True, True, True]
    assert inputs.read()[0] == 8
    assert cell.signals().get("slot2_output_0") is True
    assert not cell.plc.sessions[0].out_of_use


def test_many_pulls_at_one_moment_find_room_for_their_frames():
    cell = Cell(ONE)
    cell.connect()
    device, station = cell.device(), cell.farm.station("island")
    for _ in range(3):
        for slot in (1, 2, 3, 4):
            pull_module(device, slot, None, cell.world.now)
            plug_module(device, slot, cell.world.now)
            cell.farm.settle(station, cell.world.now)
    cell.world.run(2.0)
    cell.sent(b"\x01")
    assert cell.signals().get("slot2_output_0") is True


def test_a_record_is_read_back_as_it_was_written_and_before_with_what_the_farm_file_says():
    cell = Cell(ONE)
    device = cell.device()
    assert device.kind.records.read(None, 0, 2, 1, 1, 100, 0) == b"\x01\x00"
    cell.connect()
    assert cell.record(1).data == b"\x01\x00"
    assert cell.record(1, b"\x02\x07").ok
    assert cell.record(1).data == b"\x02\x07"


@pytest.mark.parametrize(
    ("index", "data", "code"),
    [
        (1, b"\x01", AccessError.WRITE_LENGTH_ERROR),
        (1, b"\x01\x00\x00", AccessError.WRITE_LENGTH_ERROR),
        (1, b"\x09\x00", AccessError.INVALID_PARAMETER),
        (99, b"\x00", AccessError.INVALID_INDEX),
    ],
)
def test_a_record_that_the_file_does_not_allow_is_refused_or_with_lax_limits_kept_with_a_warning(index, data, code):
    for limits in ("strict", "lax"):
        cell = Cell(ONE.replace("    ip:", f"    limits: {limits}\n    ip:"))
        cell.connect()
        records = cell.device().kind.records
        answer = records.write(None, 0, 2, 1, index, data, cell.world.now)
        read = records.read(None, 0, 2, 1, index, 100, cell.world.now)
        if limits == "strict":
            assert answer == RecordError(code)
            assert read != data
            assert "record refused" in cell.events()
        else:
            assert answer is None
            assert read == data
            assert "record accepted though it is wrong" in cell.events()


def test_a_device_with_lax_limits_keeps_a_thousand_records_that_its_file_does_not_have():
    records = Cell(ONE.replace("    ip:", "    limits: lax\n    ip:")).device().kind.records
    answers = [records.write(None, 0, 2, 1, 100 + index, b"\x01", 0) for index in range(2000)]
    assert answers == [None] * 1024 + [RecordError(AccessError.INVALID_INDEX)] * 976
    # those that it has, and those of the file, are written nevertheless
    for index, data in ((107, b"\x02"), (1, b"\x02\x07")):
        assert records.write(None, 0, 2, 1, index, data, 0) is None
        assert records.read(None, 0, 2, 1, index, 100, 0) == data


def test_a_record_of_the_file_is_kept_although_the_standard_has_no_such_index(tmp_path):
    file = (
        (CONFIGS / ISLAND)
        .read_text(encoding="utf-8")
        .replace('Item Index="1" Length="2"', 'Item Index="57392" Length="2"')
    )
    (tmp_path / "GSDML-V2.35-Own-Island-20261128.xml").write_text(file, encoding="utf-8")
    cell = Cell(ONE.replace(ISLAND, f"{tmp_path}/GSDML-V2.35-Own-Island-20261128.xml"))
    cell.connect()
    assert cell.record(0xE030, b"\x02\x07").ok
    assert cell.record(0xE030).data == b"\x02\x07"
    assert "invalid index" in cell.record(0xE031, b"\x02\x07").failure


def test_a_refused_record_reaches_the_controller_with_the_code():
    cell = Cell(ONE)
    cell.connect()
    job = cell.record(1, b"\x09\x00")
    assert "invalid parameter" in job.failure


def test_a_power_cycle_keeps_inputs_and_loses_written_records():
    cell = Cell(ONE)
    cell.connect()
    cell.signals().set({"part_present": True})
    cell.record(1, b"\x02\x07")
    station = cell.farm.station("island")
    station.power_off(cell.world.now)
    cell.farm.settle(station, cell.world.now)
    cell.world.run(1.0)
    assert not cell.plc.all_connected
    station.power_on(cell.world.now)
    cell.farm.settle(station, cell.world.now)
    assert cell.device().kind.records.read(None, 0, 2, 1, 1, 100, 0) == b"\x01\x00"
    cell.connect()
    assert cell.signals().get("part_present") is True
    assert cell.plc.plain["island"][1].read()[0] == 8


def test_drives_and_devices_share_a_farm():
    cell = Cell(DRIVES + ONE, ", program: {kind: constant, speed_rpm: 60}")
    cell.connect()
    assert cell.world.run(5.0, until=lambda: cell.plc.all_running)
    cell.signals().set({"part_present": True})
    cell.sent(b"\x01")
    assert [row["name"] for row in cell.plc.snapshot()] == ["axis-1", "axis-2", "island"]
    assert cell.signals().get("slot2_output_0") is True
    assert [axis.configured_name for axis in cell.farm.axes] == ["axis-1", "axis-2"]
    assert not cell.log.entries("axis-1")[-1].event.startswith("fault")


def test_faults_of_the_wire_and_of_connections_act_on_devices():
    cell = Cell(ONE)
    cell.connect()
    injections = cell.farm.injections
    injections.inject({"kind": "ar-abort", "on": ["island"]}, cell.world.now)
    cell.world.run(3.0)
    assert cell.plc.sessions[0].measures.losses == 1
    injections.clear(None, cell.world.now)
    cell.connect()
    injections.inject({"kind": "power-cycle", "on": ["model:EX-ISL-100"], "params": {"off": "1s"}}, cell.world.now)
    cell.world.run(0.5)
    assert not cell.plc.all_connected
    cell.connect()
    injections.inject({"kind": "module-missing", "on": ["island"], "params": {"slot": 1}}, cell.world.now)
    cell.world.run(0.5)
    assert not cell.plc.plain["island"][1].good(0)


def test_a_device_without_modules_connects_and_has_diagnosis_at_its_access_point():
    cell = Cell(f"devices:\n  - {{name: bare, gsdml: {ISLAND}, access_point: DAP 1, ip: 10.77.0.41/24}}\n")
    cell.connect()
    cell.farm.injections.inject({"kind": "diagnosis", "on": ["bare"]}, cell.world.now)
    cell.world.run(0.5)
    (entry,) = cell.device("bare").cm.diagnosis
    assert (entry.slot, entry.subslot) == (0, 1)


def every_choice():
    """(file, access point, slot, module) of each module that an access point takes."""
    for file in (ISLAND, SCANNER):
        gsdml = load_gsdml(CONFIGS / file)
        for dap in gsdml.daps:
            refs = {ref.target: ref for ref in dap.modules}
            free = [ref for ref in refs.values() if not ref.fixed.ranges]
            for ref in free:
                slot = next(iter((*ref.allowed, *ref.used)))
                yield file, dap.id, slot, ref.target
            if not free:
                yield file, dap.id, None, None


def test_every_access_point_of_the_example_files_connects_with_every_module():
    chosen = list(every_choice())
    text = "devices:\n"
    for number, (file, dap, slot, module) in enumerate(chosen):
        slots = "" if slot is None else f", slots: {{{slot}: {module}}}"
        if module == "CARRIER":
            slots = f", slots: {{{slot}: {{module: CARRIER, submodules: {{2: PLUG_IO8, 3: PLUG_OUT4, 4: PLUG_IN2}}}}}}"
        text += f"  - {{name: d-{number}, gsdml: {file}, access_point: {dap}, ip: 10.77.0.{number + 11}/24{slots}}}\n"
    cell = Cell(text, ", program: {kind: constant, enable: false}")
    assert len(chosen) > 15
    cell.connect(30.0)
    cell.world.run(1.0)
    for session in cell.plc.sessions:
        assert not session.out_of_use, session.plan.name
        outputs, inputs = cell.plc.plain[session.plan.name]
        device = cell.device(session.plan.name)
        outputs.write({0: bytes(number % 251 + 1 for number in range(outputs.octets))})
        device.kind.inputs.write({0: bytes(number % 249 + 1 for number in range(inputs.octets))})
    cell.world.run(0.5)
    for session in cell.plc.sessions:
        outputs, inputs = cell.plc.plain[session.plan.name]
        device = cell.device(session.plan.name)
        assert device.kind.outputs.read() == outputs.read(), session.plan.name
        assert inputs.read() == device.kind.inputs.read(), session.plan.name


def test_the_example_cell_says_what_it_took_and_runs():
    config = load_farm(CONFIGS / "cell.pnfarm.yml")
    assert list(described(config)) == [
        "island: Island head (DAP 1), slot 1: 16DI, slot 2: 8DO, slot 3: 4AI, slot 4: Valve terminal, 12 valves",
        "island: 16 octets of inputs, 4 of outputs, 61 signals",
        "scanner: Code reader (SCANNER), slot 1: Control, slot 2: Result",
        "scanner: 65 octets of inputs, 1 of outputs, 10 signals",
    ]
    line = asyncio.run(VirtualLine.create(config))
    assert line.world.run(10.0, until=lambda: line.plc.all_connected and line.plc.all_running)


def test_a_safe_module_is_said_not_to_run_its_protocol():
    config = parse(HEAD + ONE)
    *_, safe = described(config)
    assert safe == ("island: PROFIsafe submodule 4.1: it does not run the safety protocol: an F-CPU passivates it")


def test_devices_count_up_and_wait_for_dcp_without_an_address():
    text = HEAD + f"devices:\n  - {{name: 'scan-{{n:02}}', count: 3, start: 5, gsdml: {SCANNER}, ip: 10.77.0.9/24}}\n"
    text += f"  - {{name: last, gsdml: {SCANNER}}}\n"
    devices = expand_devices(parse(text))
    assert [device.name for device in devices] == ["scan-05", "scan-06", "scan-07", "last"]
    assert [str(device.ip) for device in devices[:3]] == ["10.77.0.9/24", "10.77.0.10/24", "10.77.0.11/24"]
    assert devices[3].addresses()[1] == "by DCP"
    assert len({device.mac for device in devices}) == 4


def refusal(text):
    with pytest.raises(FarmFileError) as failed:
        parse(HEAD + text)
    return [(issue.field, issue.line, f"{issue.what}; {issue.allowed}") for issue in failed.value.issues]


@pytest.mark.parametrize(
    ("before", "after", "field", "text"),
    [
        (ISLAND, "gsdml/none.xml", "devices[0].gsdml", "cannot be read: no such file"),
        (ISLAND, "cell.pnfarm.yml", "devices[0].gsdml", "cell.pnfarm.yml, "),
        ("DAP 1", "DAP 7", "devices[0].access_point", "has no access point 'DAP 7', it has"),
        ("access_point: DAP 1", "hello: false", "devices[0].gsdml", "; `access_point`, the ID of one"),
        ("{1: 16DI", "{1: 16DX", "devices[0].slots.1", "did you mean"),
        ("{1: 16DI", "{0: 16DI", "devices[0].slots.0", "is the access point's"),
        ("{1: 16DI", "{1x: 16DI", "devices[0].slots.1x", "is not a slot or subslot"),
        ("Substitute: hold", "Substitute: never", "devices[0].slots.2.parameters", "'never' is given"),
        ("Substitute: hold", "Substitut: hold", "devices[0].slots.2.parameters", "did you mean"),
        ("1.1.0.3", "1.1.7.3", "devices[0].signals.part_present", ""),
        ("1.1.0.3", "9.1.0.3", "devices[0].signals.part_present", "9.1 is not plugged"),
        ("1.1.0.3", "0.1.0.3", "devices[0].signals.part_present", "0.1 has no data"),
        ("name: island", "name: Island_1", "devices[0].name", "is not a station name"),
        ("name: island", "name: island\n    count: 2", "devices[0].name", "cannot all be called"),
        ("ip: 10.77.0.41/24", "ip: 10.77.0.0/24", "devices[0].ip", "is the address of the network"),
        ("ip: 10.77.0.41/24", "hello: true", "devices[0].hello", "does not support DCP Hello"),
        ("ip: 10.77.0.41/24", "telegram: 1", "devices[0].telegram", "is not a key here"),
        ("DAP 1", "DAP 3", "devices[0].slots.4", "takes no module 'FDI4'"),
    ],
)
def test_what_is_wrong_in_devices_is_told_with_its_place(before, after, field, text):
    issues = refusal(ONE.replace(before, after, 1))
    assert field in [place for place, _, _ in issues], issues
    assert any(place == field and text in what and line > 0 for place, line, what in issues), issues


def test_names_and_addresses_are_unique_among_drives_devices_and_controller():
    second = f"  - {{name: island, gsdml: {SCANNER}, ip: 10.77.0.41/24}}\n"
    assert sorted(place for place, _, _ in refusal(ONE + second)) == ["devices[1].ip", "devices[1].name"]
    drive = "drives: [{name: island, model: akd-profinet, ip: 10.77.0.41/24}]\n"
    assert sorted(place for place, _, _ in refusal(drive + ONE)) == ["devices[0].ip", "devices[0].name"]
    controller = (CONTROLLER % "").replace("10.77.0.1/", "10.77.0.41/").replace("plc", "island")
    assert sorted(place for place, _, _ in refusal(ONE + controller)) == ["devices[0].ip", "devices[0].name"]


def test_an_error_in_one_group_leaves_the_others_checked():
    text = ONE.replace("count: 2", "") + f"  - {{name: b, gsdml: {SCANNER}, ip: wrong}}\n"
    text += f"  - {{name: island, gsdml: {SCANNER}}}\n"
    assert sorted(place for place, _, _ in refusal(text)) == ["devices[1].ip", "devices[2].name"]


def test_a_link_that_does_not_carry_the_bus_is_refused():
    with pytest.raises(FarmFileError, match="does not carry"):
        parse("farm: f\nlink: {kind: serial, pty: auto}\n" + ONE)


def diagnosed(cell, error, **params):
    """The entries while the diagnosis is in force."""
    spec = {"kind": "diagnosis", "on": ["island"], "params": {"error": error, "slot": 1, **params}}
    one = cell.farm.injections.inject(spec, cell.world.now)
    cell.world.run(0.5)
    entries = list(cell.device().cm.diagnosis)
    cell.farm.injections.clear(one.id, cell.world.now)
    cell.world.run(0.5)
    assert not list(cell.device().cm.diagnosis)
    return entries


def test_a_diagnosis_is_raised_by_its_name_in_the_file():
    cell = Cell(ONE)
    cell.connect()
    (overloaded,) = diagnosed(cell, "sensor supply overloaded", channel=2)
    assert (overloaded.slot, overloaded.channel, overloaded.usi, overloaded.error_type) == (1, 2, 0x8000, 256)
    (worn,) = diagnosed(cell, "Valve worn")
    assert (worn.error_type, worn.severities) == (258, {Severity.MAINTENANCE_REQUIRED})
    (group,) = diagnosed(cell, "group b")
    assert (group.usi, group.error_type, group.ext_error_type) == (0x8002, 256, 2)
    (line,) = diagnosed(cell, "gateway line error")
    assert (line.usi, len(line.data)) == (1, 4)
    (number,) = diagnosed(cell, 258)
    assert (number.error_type, number.severities) == (258, {Severity.FAULT})


def test_an_unknown_name_of_a_diagnosis_is_refused_with_what_there_is():
    cell = Cell(ONE)
    cell.connect()
    with pytest.raises(InjectionError, match=r"no diagnosis 'valve wron'.*did you mean valve worn"):
        diagnosed(cell, "valve wron")
    assert not list(cell.device().cm.diagnosis)
    assert not cell.farm.injections.active()


def test_on_a_drive_a_misspelt_name_of_a_diagnosis_is_refused_with_the_likely_one():
    cell = Cell(DRIVES)
    with pytest.raises(InjectionError, match=r"params\.error: is 'wire-brake', did you mean wire-break"):
        cell.farm.injections.inject(
            {"kind": "diagnosis", "on": ["axis-1"], "params": {"error": "wire-brake"}}, cell.world.now
        )
