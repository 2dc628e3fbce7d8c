"""The machine of a farm file: switches, cams and end stops at their places, as a controller meets them."""

import json

import pytest
from farm_file import CONFIGS, GOOD, parse, the_issue
from hand_line import HandLine

from pnfarm.farm.file.reading import expand, load_farm

MACHINE = "{limit_switches: [-100, 200], end_stops: [-110, 210], cams: [{input: 0, between: [40, 50]}]}"
MOVES = "{lead: 10, gear: 2}"
HOMED, AT_REST, WARNING = 0x0800, 0x2000, 0x0080
#: DRIVE_INPUTS (AKD PROFINET manual 5.8.1).
POSITIVE_SWITCH = 0x8


def line(**params):
    named = {"DRV.OPMODE": 2, "HOME.V_32": 300_000, **params}
    text = ", ".join(f"{name}: {value}" for name, value in named.items())
    return HandLine(telegram=9, params=f"{{{text}}}", machine=MACHINE, load=MOVES)


def homed(plc, within=30.0):
    plc.enable_axis(0x043F)
    plc.send(0x0C3F)
    plc.until(HOMED | AT_REST, within)
    plc.run(0.2)
    #: mm from where the farm began; 5 mm to a turn of the motor
    return float(plc.axis.homing.origin) * 5.0


def test_5_10_3_home_mode_4_finds_the_cam_on_the_input_whose_mode_is_home_switch():
    plc = line(**{"HOME.MODE": 4, "DIN1.MODE": 11})
    assert homed(plc) == pytest.approx(40.0, abs=0.1)
    assert 0.0 < plc.place < 0.1, "it brakes behind the edge"


def test_5_10_3_an_input_of_another_mode_is_no_home_switch():
    plc = line(**{"HOME.MODE": 4})
    plc.enable_axis(0x043F)
    plc.send(0x0C3F)
    plc.run(30.0)
    assert not plc.zsw1 & HOMED, "it went to the positive switch, and back to the negative one"
    assert plc.zsw1 & AT_REST
    assert plc.axis.machine.limit_switch == 1


def test_5_8_1_the_limit_switch_at_its_place_warns_and_shows_in_drive_inputs():
    plc = line(**{"HOME.MODE": 1})
    store = plc.farm.axes[0].store
    plc.enable_axis(0x043F)
    plc.send(0x0C3F)
    plc.until(WARNING)
    assert store.get("DRIVE_INPUTS") & POSITIVE_SWITCH
    assert store.get("HWLS.POSSTATE") == 1
    plc.until(HOMED | AT_REST)
    assert float(plc.axis.homing.origin) * 5.0 == pytest.approx(200.0, abs=0.3)
    assert not store.get("DRIVE_INPUTS") & POSITIVE_SWITCH


def test_a_machine_keeps_its_places_over_a_power_cycle():
    plc = line(**{"HOME.MODE": 4, "DIN1.MODE": 11})
    before = homed(plc)
    station = plc.farm.axes[0]
    station.station.power_off(plc.world.now)
    plc.run(1.0)
    station.station.power_on(plc.world.now)
    plc.connect(10.0)
    plc.run(0.1)
    assert not plc.zsw1 & HOMED
    assert homed(plc) == pytest.approx(before, abs=0.1)


def test_the_example_of_a_machine_homes_at_its_home_switch():
    drive = load_farm(CONFIGS / "linear-axis.pnfarm.yml").drives[0]
    plc = HandLine(
        telegram=drive.telegram,
        params=json.dumps(drive.params),
        machine=drive.machine.model_dump_json(),
        load=drive.load.model_dump_json(exclude_none=True),
    )
    assert homed(plc) == pytest.approx(40.0, abs=0.1)


def test_a_position_is_a_turn_behind_the_gear_where_there_is_no_spindle():
    drive = expand(parse(GOOD.replace("inertia: 2.0e-4", "gear: 4")))[0]
    assert drive.load.revolutions(0.0) == 4.0
    assert drive.load.revolutions(32.0) == 1 / 32.0


@pytest.mark.parametrize(
    ("machine", "field", "what"),
    [
        ("{limit_switches: [10, 20]}", "limit_switches", "no room around 0"),
        ("{end_stops: [null, 0]}", "end_stops", "no room around 0"),
        ("{end_stops: [-1]}", "end_stops", "two positions"),
        ("{cams: [{input: 0, between: [5, 5]}]}", "cams[0].between", "ends before it begins"),
        ("{cams: [{input: 32, between: [5, 6]}]}", "cams[0].input", ""),
        ("{stops: [-1, 1]}", "stops", "did you mean"),
        ("{cams: [" + ", ".join("{input: 0, between: [1, 2]}" for _ in range(5)) + "]}", "cams", "up to 4"),
    ],
)
def test_a_machine_that_cannot_be_is_refused(machine, field, what):
    issue = the_issue(GOOD.replace("    limits:", f"    machine: {machine}\n    limits:"))
    assert issue.field == f"drives[0].machine.{field}"
    assert what in issue.what + issue.allowed
