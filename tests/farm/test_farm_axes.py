"""A drive with several axes on one PROFINET connection, with the built-in controller, in virtual time."""

import pytest
from axes_line import AxesLine

from pnfarm.errors import ConfigError
from pnfarm.farm.file.reading import parse_farm
from pnfarm.farm.views.snapshot import drive_snapshot
from pnfarm.metrics import FarmCollector
from pnfarm.table.channel import OPEN

FILE = """
farm: several
link: {kind: memory}
drives:
  - {name: alone, model: akd-profinet, ip: 10.77.0.11/24}
  - name: cu
    model: akd-profinet
    ip: 10.77.0.12/24
    limits: lax
    axes:
      - {name: x}
      - {name: y, telegram: 350, params: {"DRV.OPMODE": 1}}
      - {name: z, load: {inertia: 0.002}}
controller:
  name: plc
  ip: 10.77.0.250/24
  cycle: 16ms
  program: {kind: constant, speed_rpm: 60, acknowledge_after: 200ms}
  reconnect: {after: 300ms}
"""
AXES = ["alone", "cu.x", "cu.y", "cu.z"]


@pytest.fixture
def line():
    return AxesLine(FILE).connected()


def test_one_connection_carries_every_axis_and_each_runs(line):
    assert [axis.configured_name for axis in line.farm.axes] == AXES
    assert [station.configured_name for station in line.farm.stations] == ["alone", "cu"]
    assert line.states() == [4, 4, 4, 4]
    assert [round(float(axis.handle.axis.motor.velocity)) for axis in line.farm.axes] == [60] * 4
    providers = [row for row in line.farm.columns.ppm if row.active == OPEN]
    assert len(providers) == 2, "one frame for the three axes"
    assert [axis.store.telegram_number for axis in line.farm.axes] == [1, 1, 350, 1]


def test_a_fault_of_one_axis_is_its_own_and_is_acknowledged_alone(line):
    line.axis("cu.y").raise_fault(417, hold=False)
    line.run(0.05)
    assert [axis.fault_counts for axis in line.farm.axes] == [{}, {}, {417: 1}, {}]
    assert [bool(axis.handle.axis.faults.code[0]) for axis in line.farm.axes] == [False, False, True, False]
    assert line.states()[1] == line.states()[3] == 4
    assert line.farm.station("cu").device.connected
    line.run(2.0)
    assert line.states() == [4, 4, 4, 4]


def test_a_lost_controller_faults_every_axis_that_it_fed(line):
    line.farm.injections.inject({"kind": "link-down", "on": ["cu.y"], "for": "500ms"}, line.world.now)
    line.run(0.4)
    assert [bool(axis.handle.axis.faults.code[0]) for axis in line.farm.axes] == [False, True, True, True]
    assert line.farm.station("cu").device.watchdog_expirations <= 1
    line.run(4.0)
    assert line.states() == [4, 4, 4, 4]


def test_a_fault_of_the_node_hits_it_once_and_one_of_an_axis_hits_the_axis(line):
    cable = line.farm.injections.inject({"kind": "link-down", "on": ["cu.*", "cu"], "for": "10ms"}, line.world.now)
    assert list(cable.runs) == ["cu"]
    fault = line.farm.injections.inject({"kind": "drive-fault", "on": ["cu"], "params": {"fault": 417}}, line.world.now)
    assert list(fault.runs) == ["cu.x", "cu.y", "cu.z"]
    own = line.farm.injections.inject({"kind": "drive-fault", "on": ["cu.x"], "params": {"fault": 417}}, line.world.now)
    assert list(own.runs) == ["cu.x"]


def test_a_power_cycle_boots_every_axis_with_its_own_memory(line):
    line.axis("cu.y").store.set("VL.LIMITP", 1234)
    line.axis("cu.y").store.set("DRV.NVSAVE", 1)
    station = line.farm.station("cu")
    line.farm.settle(station, line.world.now)
    assert "drive.2" in station.kept
    assert "drive" not in station.kept
    station.power_cycle(line.world.now)
    line.farm.settle(station, line.world.now)
    assert [axis.handle.axis.powered for axis in station.axes] == [1, 1, 1]
    assert line.axis("cu.y").store.get("VL.LIMITP") == pytest.approx(1234)
    assert line.axis("cu.x").store.get("VL.LIMITP") != pytest.approx(1234)
    line.run(4.0)
    assert line.states() == [4, 4, 4, 4]


def test_parameter_access_by_axis_number_reaches_the_axis_and_zero_the_first():
    line = AxesLine(FILE).connected()
    device = line.farm.station("cu").device
    channel = device.kind.records.channels[47]

    def read(axis, pnu=947):
        channel.write_request(bytes((1, 1, axis, 1)) + bytes((0x10, 8)) + pnu.to_bytes(2, "big") + bytes(2), 1)
        return channel.read_response(0xFFFF, 1)

    line.axis("cu.z").raise_fault(417, hold=True)
    line.run(0.1)
    numbers = [int.from_bytes(read(axis)[6:8], "big") for axis in (0, 1, 2, 3)]
    assert numbers == [0, 0, 0, 417]
    assert read(4)[1] & 0x80, "there is no fourth axis"


def test_traces_reactions_snapshots_and_metrics_are_of_each_axis(line):
    collector = FarmCollector(line.farm)
    line.axis("cu.x").raise_fault(417, hold=False)
    line.run(2.0)
    for name in AXES:
        assert drive_snapshot(line.farm, line.axis(name), line.world.now)["name"] == name
    assert len(line.farm.controllers.of("cu.x").situations) == 1
    assert not line.farm.controllers.of("cu.y").situations
    assert [len(line.farm.controllers.of(name).start_ups) for name in AXES] == [1, 1, 1, 1]
    metrics = {metric.name: metric for metric in collector.collect()}
    assert [sample.labels["drive"] for sample in metrics["pnfarm_axis_velocity_rpm"].samples] == AXES
    assert [sample.labels["drive"] for sample in metrics["pnfarm_ar_state"].samples] == ["alone", "cu"]
    stations = [(one.labels["drive"], one.labels["station"]) for one in metrics["pnfarm_axis_info"].samples]
    assert stations == [("cu.x", "cu"), ("cu.y", "cu"), ("cu.z", "cu")], "no series more for a drive with one axis"
    trace = line.farm.traces.start({"signals": ["velocity"], "on": ["cu.*"], "length": "100ms"}, line.world.now)
    line.run(0.5)
    assert {column.drive for column in trace.columns} == {"cu.x", "cu.y", "cu.z"}


def test_a_single_axis_of_a_list_is_in_its_slot_and_takes_faults_under_both_names():
    text = FILE.replace("{name: x}", "{name: x, slot: 3}")
    text = "\n".join(line for line in text.splitlines() if "{name: y" not in line and "{name: z" not in line)
    line = AxesLine(text).connected()
    assert line.states() == [4, 4]
    for on in ("cu", "cu.x"):
        wanted = {"kind": "drive-fault", "on": [on], "params": {"fault": 417}}
        assert list(line.farm.injections.inject(wanted, line.world.now).runs) == ["cu.x"]
    line.run(0.05)
    assert bool(line.axis("cu.x").handle.axis.faults.code[0])


def test_the_name_of_a_drive_with_several_axes_is_no_axis(line):
    with pytest.raises(ConfigError, match=r"cu\.x, cu\.y, cu\.z"):
        line.axis("cu")


@pytest.mark.parametrize(
    ("change", "what"),
    [
        (("limits: lax", "limits: strict"), "has one axis, by its manual"),
        (("{name: z,", "{name: x,"), "x is given twice"),
        (("{name: z,", "{name: z, slot: 0,"), r"drives\[1\]\.axes\[2\]\.slot"),
        (("{name: z,", "{name: z, slot: 32768,"), r"drives\[1\]\.axes\[2\]\.slot"),
        (("{name: z,", "{name: z, slot: 2,"), r"axes\[2\]\.slot: slot 2 is that of axis y; allowed: each slot once"),
        (("{name: x}", "{name: x, slot: 32767}"), r"y is in slot 32768, akd-profinet has axes in slots 1 to 32767"),
        (("telegram: 350", "telegram: 77"), "has no telegram 77"),
        (("{name: x}", "{name: X_1}"), "axes"),
        (("load: {inertia: 0.002}", "motor: {kind: linear, pitch: 20}"), "another kind"),
    ],
)
def test_what_a_farm_file_says_wrongly_of_axes_is_refused_at_its_place(change, what):
    with pytest.raises(ConfigError, match=what):
        parse_farm(FILE.replace(*change))
