"""A drive system on one PROFINET connection: control unit, infeed and three axes of different telegrams."""

import pytest
from axes_line import AxesLine
from imported import check_found
from recorded import record

from pnfarm.buses.profinet.bus import PROFINET
from pnfarm.buses.registry import decoder as make_decoder
from pnfarm.captures.reading import FrameReader
from pnfarm.cli.farm_file import check_impairments
from pnfarm.errors import ConfigError
from pnfarm.farm.file.reading import expand, parse_farm
from pnfarm.farm.injections import add_impairments
from pnfarm.farm.views.snapshot import drive_snapshot
from pnfarm.protocols.profinet.errors import RecordError
from pnfarm.station.signals import find_signal
from pnfarm.table.channel import OPEN
from pnfarm.table.signals import ACTUAL_SLOTS, SETPOINT_SLOTS

FILE = """
farm: system
link: {kind: memory}
drives:
  - name: s
    model: profidrive
    ip: 10.77.0.12/24
    axes:
      - {name: cu, telegram: 390, slot: 2}
      - {name: infeed, telegram: 370}
      - {name: x, telegram: 111, slot: 9}
      - {name: y, telegram: 105, slot: 7}
      - {name: z, telegram: 1}
controller:
  name: plc
  ip: 10.77.0.250/24
  cycle: 2ms
  program: {kind: constant, speed_rpm: 60, acknowledge_after: 200ms}
"""
NAMES = ["s.cu", "s.infeed", "s.x", "s.y", "s.z"]
SLOTS = [2, 3, 9, 7, 8]
#: A control unit has no states.
RUNNING = [1, 4, 4, 4, 4]


@pytest.fixture
def line():
    return AxesLine(FILE).connected()


def faulty(line):
    return [bool(axis.handle.axis.faults.code[0]) for axis in line.farm.axes]


def seen(line, axis, name):
    """An actual value as the controller received it."""
    return int(line.plc.columns.image[NAMES.index(axis)].received[ACTUAL_SLOTS[name]]) & 0xFFFF


def put(line, axis, **words):
    """Set points by hand, in place of the built-in program."""
    row = NAMES.index(axis)
    line.plc.columns.program[row].active = 0
    for name, value in words.items():
        line.plc.columns.image[row].sent[SETPOINT_SLOTS[name]] = value
    line.run(0.05)


def test_one_connection_carries_control_unit_infeed_and_axes_in_the_slots_of_the_file(line):
    assert [axis.configured_name for axis in line.farm.axes] == NAMES
    assert line.states() == RUNNING
    assert line.plc.all_running
    assert len([row for row in line.farm.columns.ppm if row.active == OPEN]) == 1
    plugged = line.farm.station("s").device.cm.plugged
    telegrams = [plugged.module(slot).module_ident & 0xFFF for slot in SLOTS]
    assert telegrams == [axis.store.telegram_number for axis in line.farm.axes] == [390, 370, 111, 105, 1]


@pytest.mark.parametrize("name", NAMES)
def test_a_fault_of_each_object_is_its_own_and_is_acknowledged_alone(line, name):
    line.axis(name).raise_fault(12, hold=False)
    line.run(0.1)
    assert faulty(line) == [each == name for each in NAMES]
    others = [state for each, state in zip(NAMES, line.states(), strict=True) if each not in {name, "s.cu"}]
    assert others == [4] * len(others)
    line.run(2.0)
    assert not any(faulty(line))
    assert line.states() == RUNNING


def test_an_infeed_closes_its_contactor_charges_and_is_ready_then(line):
    """E_ZSW1: 0 to 2 the states, 11 precharged, 12 contactor."""
    state = 0x1847
    put(line, "s.infeed", E_STW1=0x0402)
    assert seen(line, "s.infeed", "E_ZSW1") & state == 0x0001, "ready to switch on, no quick stop is asked for"
    put(line, "s.infeed", E_STW1=0x0403)
    assert seen(line, "s.infeed", "E_ZSW1") & state == 0x1001, "it charges"
    line.run(0.2)
    assert seen(line, "s.infeed", "E_ZSW1") & state == 0x1803
    put(line, "s.infeed", E_STW1=0x040B)
    assert seen(line, "s.infeed", "E_ZSW1") == 0x1A17, "control requested, no coast stop"
    put(line, "s.infeed", E_STW1=0x0409)
    assert seen(line, "s.infeed", "E_ZSW1") & state == 0x0040, "OFF2: the contactor opens, switching on is inhibited"
    line.axis("s.infeed").raise_fault(12, hold=False)
    line.run(0.1)
    assert seen(line, "s.infeed", "E_ZSW1") & 0x0008
    put(line, "s.infeed", E_STW1=0x0480)
    assert not seen(line, "s.infeed", "E_ZSW1") & 0x0008


def test_a_fault_of_a_charging_infeed_opens_its_contactor(line):
    put(line, "s.infeed", E_STW1=0x0402)
    put(line, "s.infeed", E_STW1=0x0403)
    line.axis("s.infeed").raise_fault(12, hold=False)
    line.run(0.1)
    assert seen(line, "s.infeed", "E_ZSW1") & 0x184F == 0x0048


def test_a_control_unit_reports_the_faults_of_every_axis_and_a_running_sign_of_life(line):
    """CU_ZSW1: 3 fault, 9 to 11 no warning, fault and safety signal."""
    assert seen(line, "s.cu", "CU_ZSW1") & 0x0FFF == 0x0E00
    put(line, "s.y", STW1=0x0400)
    line.axis("s.y").raise_fault(12, hold=False)
    line.run(0.1)
    assert seen(line, "s.cu", "CU_ZSW1") & 0x0FFF == 0x0A00
    lives = set()
    for _ in range(20):
        line.run(0.002)
        lives.add(seen(line, "s.cu", "CU_ZSW1") >> 12)
    assert lives == set(range(1, 16))
    line.axis("s.cu").raise_fault(12, hold=False)
    line.run(0.1)
    assert seen(line, "s.cu", "CU_ZSW1") & 0x0FFF == 0x0A08


def test_without_control_by_the_plc_a_control_unit_is_acknowledged_with_the_axes(line):
    put(line, "s.cu", CU_STW1=0)
    line.axis("s.cu").raise_fault(12, hold=False)
    line.axis("s.y").raise_fault(12, hold=False)
    line.run(0.1)
    assert faulty(line) == [True, False, False, True, False]
    line.run(2.0)
    assert not any(faulty(line))


def test_digital_inputs_are_set_by_a_fault_and_outputs_are_read_as_signals(line):
    held = line.farm.injections.inject({"kind": "digital-input", "on": "s.cu", "params": {"input": 3}}, line.world.now)
    put(line, "s.cu", CU_STW1=0x0400, A_DIGITAL=0x8005)
    assert seen(line, "s.cu", "E_DIGITAL") == 0x0008
    cu = line.axis("s.cu")
    names = ("e_digital", "e_digital.3", "a_digital", "a_digital.1")
    assert [find_signal(cu.model, name).read(cu) for name in names] == [8, True, 0x8005, False]
    line.farm.injections.clear(held.id, line.world.now)
    put(line, "s.cu", CU_STW1=0, A_DIGITAL=0)
    assert (seen(line, "s.cu", "E_DIGITAL"), find_signal(cu.model, "a_digital").read(cu)) == (0, 0x8005)
    line.farm.injections.inject({"kind": "link-down", "on": "s", "for": "1s"}, line.world.now)
    line.run(0.5)
    assert find_signal(cu.model, "a_digital").read(cu) == 0, "a lost controller switches the outputs off"


def test_impair_of_the_farm_file_sets_an_input_of_one_axis():
    file = FILE.replace("    axes:", "    impair: [{kind: digital-input, on: [s.cu], params: {input: 3}}]\n    axes:")
    check_impairments(parse_farm(file))
    line = AxesLine(file).connected()
    add_impairments(line.farm.injections, expand(parse_farm(file)), line.world.now)
    line.run(0.1)
    assert [int(axis.handle.axis.machine.inputs) for axis in line.farm.axes] == [8, 0, 0, 0, 0]
    with pytest.raises(ConfigError, match=r"means no drive of this group: s to s\.z"):
        check_impairments(parse_farm(file.replace("[s.cu]", "[s.cx]")))


def test_parameters_diagnosis_and_traces_are_of_the_axis_in_its_slot(line):
    device = line.farm.station("s").device
    line.axis("s.y").raise_fault(12, hold=True)
    line.run(0.1)
    assert [(entry.slot, entry.error_type) for entry in device.cm.diagnosis] == [(7, 0x900B)]
    records, now = device.kind.records, line.world.now
    read = bytes((1, 1, 0, 1)) + bytes((0x10, 8)) + (947).to_bytes(2, "big") + bytes(2)
    codes = []
    for slot in SLOTS:
        assert records.write(None, 0x3A00, slot, 1, 0xB02E, read, now) is None
        codes.append(int.from_bytes(records.read(None, 0x3A00, slot, 1, 0xB02E, 512, now)[6:8], "big"))
    assert codes == [0, 0, 0, 12, 0]
    assert isinstance(records.write(None, 0x3A00, 4, 1, 0xB02E, read, now), RecordError), "slot 4 has no axis"
    trace = line.farm.traces.start(
        {"signals": ["a_digital", "cu_zsw1.no_group_fault"], "on": ["s.cu"], "length": "20ms"}, line.world.now
    )
    line.run(0.1)
    assert {column.signal.name for column in trace.columns} == {"a_digital", "cu_zsw1.no_group_fault"}


def test_a_power_cycle_brings_every_object_back(line):
    line.farm.injections.inject({"kind": "power-cycle", "on": ["s.y"], "params": {"off": "200ms"}}, line.world.now)
    line.run(0.1)
    assert line.states() == [0] * 5, "the supply is the station's"
    line.run(6.0)
    assert line.states() == RUNNING


@pytest.fixture(scope="module")
def capture(tmp_path_factory):
    path = tmp_path_factory.mktemp("capture") / "system.pcapng"
    record(FILE, path, lambda line: line.farm.axis("s.y").raise_fault(12, hold=False), seconds=0.5)
    return path


def test_a_capture_shows_each_axis_with_its_slot_and_its_own_words(capture):
    decoder = make_decoder()
    frames = FrameReader(capture)
    lines = [f"{x.description.what} {x.description.text}" for frame in frames for x in decoder.feed(frame)]
    connect = next(line for line in lines if line.startswith("Connect.req"))
    assert "slot 2 telegram 390 (module 0x10186), slot 3 telegram 370 (module 0x10172)" in connect
    begin = next(line for line in lines if line.startswith("cyclic data begin") and "slot 2: CU_ZSW1 0x" in line)
    assert "; slot 3: E_ZSW1 0x" in begin
    assert "; slot 9: ZSW1 0x" in begin
    assert any(line.startswith("E_ZSW1 of slot 3 ") and "line contactor closed set" in line for line in lines)
    assert any(line.startswith("ZSW1 of slot 7 ") and "fault present set" in line for line in lines)
    assert any(line.startswith("CU_ZSW1 of slot 2 ") and "no group fault reset" in line for line in lines)
    assert not any(line.startswith("ZSW1 of slot 8 ") and "fault present" in line for line in lines)


def test_a_farm_file_of_a_capture_has_the_axes_in_their_slots(capture):
    decoder = make_decoder()
    PROFINET.observe(decoder.buses["profinet"])
    for frame in FrameReader(capture):
        list(decoder.feed(frame))
    (drive,) = parse_farm(check_found(PROFINET.found(decoder.buses["profinet"])).text).drives
    found = [(axis.slot, axis.telegram) for axis in drive.axes]
    assert found == [(2, 390), (3, 370), (7, 105), (8, 1), (9, 111)]
    assert drive.limits == "strict"


def test_conditions_name_the_bits_of_an_infeed(line):
    infeed = line.axis("s.infeed")
    names = ("zsw1.precharging_completed", "zsw1.line_contactor_closed", "stw1.inhibit_motor_operation")
    assert [find_signal(infeed.model, name).read(infeed) for name in names] == [True, True, False]
    shown = drive_snapshot(line.farm, infeed, line.world.now)
    assert shown["zsw1_bits"][-1] == "line_contactor_closed"
