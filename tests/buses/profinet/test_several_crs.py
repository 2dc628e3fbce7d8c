"""Devices with several CRs in each direction of a connection, with the built-in controller in virtual time."""

import asyncio
from collections import Counter

import pytest
from device_cell import CONFIGS, HEAD, Cell
from recorded import record
from wide_device import wide_file, wide_group
from wireshark import tshark, tshark_fields

from pnfarm.buses.profinet.controller import plan
from pnfarm.buses.profinet.device.modules import plug_module, pull_module
from pnfarm.controller.line import VirtualLine
from pnfarm.errors import ConfigError
from pnfarm.farm.file.reading import FarmFileError, parse_farm
from pnfarm.table.channel import IOXS_BAD, IOXS_GOOD

#: A severity of PF_EXPERT.
WARNING = 0x600000


class WideCell(Cell):
    usual = "wide"

    def __init__(self, folder, slots, more="", controller="", inputs=1, outputs=1):
        super().__init__(wide_group(wide_file(folder, inputs, outputs), slots, more), controller)

    @property
    def rows(self):
        """Rows of the device's open providers and consumers."""
        return self.device().channel_rows

    def octets(self, seed):
        """The next octets of each direction, from the controller and from the device."""
        outputs, inputs = self.plc.plain["wide"][0], self.device().kind.inputs
        for place, data in ((outputs, seed), (inputs, seed + 7)):
            place.write({0: bytes((number * 31 + data) % 251 for number in range(place.octets))})

    def arrived(self):
        return self.device().kind.outputs.read() == self.plc.plain["wide"][0].read() and (
            self.plc.plain["wide"][1].read() == self.device().kind.inputs.read()
        )

    def channels(self):
        """(direction, frame id, octets, ms) of each CR as the API shows it."""
        (connection,) = self.device().details()["connections"]
        return [
            (one["direction"], int(one["id"], 16), one["octets"], one["cycle_seconds"] * 1e3)
            for one in connection["channels"]
        ]


@pytest.mark.parametrize(
    ("slots", "octets", "frames"),
    [
        ({1: "1436_1436"}, 1436, [1440]),
        ({1: "720_720", 2: "720_720"}, 1440, [725, 721]),
        ({1: "700_700", 2: "700_700", 3: "700_700", 4: "700_700"}, 2800, [1408, 1402]),
    ],
)
@pytest.mark.parametrize("startup", ["legacy", "advanced"])
def test_a_device_whose_data_need_several_frames_gets_as_many_and_each_octet_arrives(
    tmp_path, slots, octets, frames, startup
):
    cell = WideCell(tmp_path, slots, controller=f", startup: {startup}")
    cell.connect()
    assert (cell.plc.plain["wide"][0].octets, cell.device().kind.inputs.octets) == (octets, octets)
    assert [length for way, _, length, _ in cell.channels() if way == "sent"] == frames
    for seed in range(5):
        cell.octets(seed)
        cell.world.run(0.5)
        assert cell.arrived()
    (row,) = cell.plc.snapshot()
    assert (row["state"], row["losses"]) == ("DATA", 0)
    assert cell.device().losses() == {}


FAST_AND_SLOW = {1: "8_8", 2: "8_8", 3: "16_0", 4: "0_16"}
CYCLES = ", cycles: {2: 64ms, 3: 64ms, 4: 64ms}"


def test_modules_of_another_cycle_have_frames_of_their_own(tmp_path):
    cell = WideCell(tmp_path, FAST_AND_SLOW, ", cycle: 8ms" + CYCLES)
    cell.connect()
    assert [(way, octets, ms) for way, _, octets, ms in cell.channels()] == [
        ("sent", 40, 8.0), ("sent", 40, 64.0), ("received", 40, 8.0), ("received", 40, 64.0)
    ]  # fmt: skip
    ids = [frame_id for _, frame_id, _, _ in cell.channels()]
    assert len(set(ids)) == 4
    cell.octets(1)
    cell.world.run(0.2)
    assert cell.arrived()
    providers, consumers = cell.rows
    columns = cell.farm.columns
    before = [int(columns.ppm[row].sent) for row in providers]
    cell.world.run(0.64)
    assert [int(columns.ppm[row].sent) - count for row, count in zip(providers, before, strict=True)] == [80, 10]
    assert [int(columns.cpm[row].hold_ns) for row in consumers] == [24_000_000, 192_000_000]
    # status of the slow module's inputs, and of the fast one's, in a frame each
    assert [cell.plc.plain["wide"][1].good(number) for number in range(3)] == [True] * 3


@pytest.mark.parametrize("lost", [0, 1])
@pytest.mark.parametrize("way", ["to the device", "to the controller"])
def test_the_silence_of_one_cr_ends_the_connection_once_and_it_comes_back(tmp_path, lost, way):
    cell = WideCell(tmp_path, FAST_AND_SLOW, ", cycle: 8ms" + CYCLES)
    cell.connect()
    rows = cell.plc.sessions[0].providers if way == "to the device" else cell.rows[0]
    columns = cell.plc.columns if way == "to the device" else cell.farm.columns
    columns.ppm[rows[lost]].next_ns = cell.world.now + 10**12
    cell.world.run(0.29)
    (row,) = cell.plc.snapshot()
    assert row["losses"] == 1
    device = cell.device()
    if way == "to the device":
        assert (device.watchdog_expirations, device.losses()) == (1, {"consumer-dht-expired": 1})
    else:
        assert (row["expirations"], device.watchdog_expirations) == (1, 0)
        assert "no input data within the data hold time" in row["last_reason"]
    cell.connect()
    cell.octets(3)
    cell.world.run(0.3)
    assert cell.arrived()


def test_the_silence_of_all_crs_is_one_expiry(tmp_path):
    cell = WideCell(tmp_path, {1: "720_720", 2: "720_720"})
    cell.connect()
    cell.farm.injections.inject({"kind": "loss", "on": ["wide"], "direction": "in", "for": "200ms"}, cell.world.now)
    cell.world.run(0.2)
    assert cell.device().watchdog_expirations == 1
    assert cell.events("wide").count("watchdog expired") == 1
    assert cell.plc.snapshot()[0]["losses"] == 1


def test_the_device_is_connected_only_when_data_came_on_each_cr(tmp_path):
    cell = WideCell(tmp_path, {1: "720_720", 2: "720_720"})
    assert cell.world.run(5.0, until=lambda: len(cell.rows[1]) == 2)
    consumers = [cell.farm.columns.cpm[row] for row in cell.rows[1]]
    controller, consumers[1].source = int(consumers[1].source), 1
    cell.world.run(1.0)
    assert [int(one.received) > 0 for one in consumers] == [True, False]
    assert not cell.device().connected
    consumers[1].source = controller
    assert cell.world.run(1.0, until=lambda: cell.device().connected)


def test_the_controller_is_in_stop_as_long_as_one_of_its_crs_is(tmp_path):
    cell = WideCell(tmp_path, FAST_AND_SLOW, ", cycle: 8ms" + CYCLES)
    cell.connect()

    rows = [cell.plc.columns.ppm[row] for row in cell.plc.sessions[0].providers]
    for row, status in ((0, 0x25), (1, 0x25), (0, 0x35), (1, 0x35)):
        rows[row].data_status = status
        cell.world.run(0.15)
    modes = [one for one in cell.events("wide") if one.startswith("controller in")]
    assert modes == ["controller in run", "controller in stop", "controller in run"]


def test_a_pulled_module_is_bad_in_its_own_frame_alone(tmp_path):
    cell = WideCell(tmp_path, {1: "720_720", 2: "720_720"})
    cell.connect()
    cell.octets(1)
    cell.world.run(0.1)
    device, station = cell.device(), cell.farm.station("wide")
    pull_module(device, 2, None, cell.world.now)
    cell.farm.settle(station, cell.world.now)
    cell.world.run(0.2)
    inputs = cell.plc.plain["wide"][1]
    assert (inputs.good(0), inputs.good(1)) == (True, False)
    assert (device.kind.outputs.good(0), device.kind.outputs.good(1)) == (True, False)
    # consumer status of each module's outputs, in the frame that has it
    statuses = {}
    for (ar,) in [device.ars.values()]:
        for row, cr in ar.providers:
            octets = device.channels._channels.provided(row)
            statuses |= {one.slot: octets[one.iocs_offset] for one in cr.iocs}
    assert statuses == {1: IOXS_GOOD, 2: IOXS_BAD}
    assert device.channels.io_data(2, 1, True).iocs == IOXS_BAD
    assert device.channels.io_data(1, 1, True).iocs == IOXS_GOOD
    plug_module(device, 2, cell.world.now)
    cell.farm.settle(station, cell.world.now)
    cell.world.run(1.0)
    cell.octets(9)
    cell.world.run(0.2)
    assert cell.arrived()
    assert inputs.good(1)


@pytest.mark.parametrize(
    ("kind", "field"), [("iops-bad", "good"), ("provider-stop", "good"), ("iocs-bad", None), ("data-invalid", "lost")]
)
def test_faults_on_frames_act_on_all_crs_of_the_direction(tmp_path, kind, field):
    cell = WideCell(tmp_path, {1: "720_720", 2: "720_720"}, ", cycle: 8ms")
    cell.connect()
    cell.farm.injections.inject({"kind": kind, "on": ["wide"]}, cell.world.now)
    cell.world.run(0.02 if field != "lost" else 0.2)
    inputs = cell.plc.plain["wide"][1]
    (injection,) = cell.farm.injections.list()
    assert injection.evidence().activations >= 4
    if field == "good":
        assert not inputs.good(0)
        assert not inputs.good(1)
    assert cell.plc.snapshot()[0]["losses"] == (field == "lost")
    cell.farm.injections.clear(None, cell.world.now)
    cell.connect()
    assert inputs.good(0)
    assert inputs.good(1)


@pytest.mark.parametrize(
    ("more", "slots", "inputs", "outputs", "message"),
    [
        ("", {1: "720_720", 2: "720_720"}, 0, 1, "need 2 frames of up to 1440, the device has up to 1 input CR"),
        ("", {1: "720_720", 2: "720_720"}, 1, 0, "need 2 frames of up to 1440, the device has up to 1 output CR"),
        (CYCLES, FAST_AND_SLOW, 1, 0, "in 2 cycles need 2 frames"),
        (", cycles: {7: 64ms}", FAST_AND_SLOW, 1, 1, r"cycles\.7: nothing is plugged there"),
        (", cycles: {2: 3ms}", FAST_AND_SLOW, 1, 1, "2ms or 4ms"),
        (", cycles: {2: 512ms}", FAST_AND_SLOW, 1, 1, "5 cycles of 512ms are too long a watchdog"),
        (", cycles: {x: 64ms}", FAST_AND_SLOW, 1, 1, "is not a slot or subslot"),
    ],
)
def test_what_the_file_does_not_allow_is_a_sentence(tmp_path, more, slots, inputs, outputs, message):
    with pytest.raises((ConfigError, FarmFileError), match=message):
        WideCell(tmp_path, slots, more, ", watchdog_factor: 5", inputs=inputs, outputs=outputs)


def test_more_crs_than_there_are_frame_ids_are_a_sentence(tmp_path, monkeypatch):
    monkeypatch.setattr(plan, "RTC1_UNICAST", range(0x8000, 0x8001))
    with pytest.raises(ConfigError, match="the devices need 2 input CRs, there are 1 frame ids"):
        WideCell(tmp_path, {1: "720_720", 2: "720_720"})


def test_a_foreign_device_may_have_cycles_too(tmp_path):
    path = wide_file(tmp_path)
    foreign = f"{{name: wide, gsdml: {path}, modules: {{1: 8_8, 2: 8_8}}, cycles: {{2: 64ms}}}}"
    text = HEAD + f"devices:\n  - {{name: other, gsdml: {path}, ip: 10.77.0.42/24}}\n"
    text += f"controller: {{name: plc, ip: 10.77.0.1/24, devices: [{foreign}]}}\n"
    line = asyncio.run(VirtualLine.create(parse_farm(text, CONFIGS / "cell.pnfarm.yml")))
    (planned,) = [one for one in line.plc.devices if one.name == "wide"]
    assert (planned.input_crs, planned.output_crs) == (2, 2)
    with pytest.raises(ConfigError, match=r"device wide.*slot 3 in `cycles` has no module"):
        asyncio.run(VirtualLine.create(parse_farm(text.replace("{2: 64ms}", "{3: 64ms}"), CONFIGS / "cell.pnfarm.yml")))


def test_a_shared_device_has_rows_for_the_crs_of_each_controller(tmp_path):
    group = wide_group(wide_file(tmp_path, 65535, 3, ars=4), {1: "8_8"})
    cell = Cell(group)
    columns = cell.farm.columns
    # four controllers, a supervisor and one that is closing, each with up to eight
    assert len(columns.ppm) == len(columns.cpm) == 6 * 8
    cell.usual = "wide"
    cell.connect()


@pytest.mark.interop
def test_wireshark_finds_nothing_wrong_with_a_connection_of_several_crs(tmp_path):
    text = HEAD + wide_group(wide_file(tmp_path), FAST_AND_SLOW, ", cycle: 8ms" + CYCLES)
    config = parse_farm(text + "controller: {name: plc, ip: 10.77.0.1/24}\n", CONFIGS / "cell.pnfarm.yml")
    file, cyclic = tmp_path / "all.pcapng", tmp_path / "cyclic.pcapng"

    def release(line):
        line.world.run(0.2)
        line.plc.release(line.world.now)

    record(config, file, release, seconds=0.2, connected=True)
    shown = ("_ws.malformed", "_ws.expert.message", "_ws.expert.severity")
    wrong = f"_ws.malformed || _ws.short || _ws.expert.severity>={WARNING}"
    bad = tshark_fields(file, *shown, where=f"({wrong}) && !pn_rt.ds")
    # it has one frame id for each direction of an AR, and warns of a second one
    assert not [row for row in bad if row[0] or not all("frameID changed" in one for one in row[1].split(","))], bad
    # and it looks for the data of all CRs in each frame, so that frames are read without their Connect
    tshark(file, "-Y", "pn_rt.ds", "-w", cyclic)
    assert not tshark_fields(cyclic, *shown, where=wrong)
    rows = tshark_fields(cyclic, "pn_rt.frame_id", "pn_rt.ds")
    frames = Counter(tuple(int(value, 0) for value in row) for row in rows)
    assert {frame_id for frame_id, _ in frames} == {0x8000, 0x8001, 0x8002, 0x8003}
    assert {status for _, status in frames} == {0x35}
