"""Devices that `pnfarm import` makes of captured PROFINET connections, and what they do with the same Connect."""

import asyncio
from dataclasses import replace
from pathlib import Path

import pytest
import yaml
from captured_controller import CapturedController, differences
from hypothesis import given, settings
from hypothesis import strategies as st
from imported import check_found
from recorded import record
from seen_stations import DEVICE, HEAD, ISLAND, PLC, SECOND, SeenPlant, differing
from wide_device import wide_file, wide_group

from pnfarm.buses.imports import FoundDevice, FoundStation
from pnfarm.controller.line import VirtualLine
from pnfarm.farm.file.reading import parse_farm
from pnfarm.protocols.profinet.cm.ar import CmdevState
from pnfarm.protocols.profinet.gsdml.reader import parse_gsdml
from pnfarm.protocols.profinet.wire.cm.connect import ArBlockReq
from pnfarm.protocols.profinet.wire.cm.expected import (
    DataDescription,
    DiffSubmodule,
    ExpectedApi,
    ExpectedSubmodule,
    ExpectedSubmoduleBlockReq,
    IdentInfo,
    ModuleState,
    submodule_state,
)
from pnfarm.protocols.profinet.wire.dcp import blocks as dcp
from pnfarm.protocols.profinet.wire.records.identification import Im0

CAPTURES = Path(__file__).resolve().parents[3] / "shared" / "captures"
REAL = ("dacookie_connectrequest.pcap", "drive_connect_api3a00.pcap", "pnio-rs_s7-1515_golden.pcap")


def real(name):
    if not (CAPTURES / name).exists():
        pytest.skip("the captures of real controllers are not here")
    return CAPTURES / name


def plain(text):
    return " ".join(text.replace("#", " ").split())


def farm_of(pnfarm, file, folder, *options):
    """The farm file that a capture becomes, in memory."""
    out = folder / "cell.pnfarm.yml"
    found = pnfarm("import", file, "-o", out, *options)
    assert (found.code, found.err) == (0, "")
    text = out.read_text().replace("{kind: macvlan, parent: eth1}", "{kind: memory}").replace("api: 127.0.0.1:8702", "")
    out.write_text(text)
    assert pnfarm("validate", out).code == 0
    return out


def line_of(out):
    return asyncio.run(VirtualLine.create(parse_farm(out.read_text(), out)))


@pytest.mark.parametrize("name", REAL)
def test_a_device_made_of_a_capture_takes_the_captured_start_up_octet_for_octet_and_exchanges_its_data(
    pnfarm, tmp_path, name
):
    file = real(name)
    line = line_of(farm_of(pnfarm, file, tmp_path))
    (station,) = line.farm.stations
    plc = CapturedController(line, file, station)
    answer, statuses = plc.start()
    assert differences(answer) == []
    assert all(status.ok for status in statuses)
    (inputs, outputs) = plc.layouts
    sent = {(p.slot, p.subslot): bytes(range(1, p.data_length + 1)) for p in outputs.data}
    known = [station.signals.signal(one) for one in station.signals.names]
    station.signals.set({one.name: 7 for one in known if one.direction == "input"})
    frame = plc.exchange(sent)
    (ar,) = station.device.cm.ars
    assert ar.state is CmdevState.DATA
    assert len(frame) == 2 + inputs.data_length + 4
    for place in inputs.data:
        data = frame[2 + place.data_offset :][: place.data_length + 1]
        assert data == b"\7" * place.data_length + b"\x80"
    for (slot, subslot), octets in sent.items():
        names = [one.name for one in known if (one.slot, one.subslot, one.direction) == (slot, subslot, "output")]
        assert bytes(station.signals.get(one) for one in names) == octets


PLANT = """
farm: plant
link: {kind: memory}
drives:
  - {name: infeed, model: akd-profinet, ip: 10.77.0.11/24}
  - {name: gripper, model: hiwin-e1, ip: 10.77.0.12/24, limits: lax}
  - {name: press, model: moog-msd, ip: 10.77.0.13/24, limits: lax}
controller: {name: plc, ip: 10.77.0.1/24, cycle: 16ms}
"""


@pytest.fixture(scope="module")
def plant(tmp_path_factory):
    """The start-up of three drives in virtual time."""
    file = tmp_path_factory.mktemp("plant") / "plant.pcapng"
    record(PLANT, file)
    return file


def test_with_models_switched_off_drives_are_devices_that_their_controller_connects(pnfarm, plant, tmp_path):
    out = farm_of(pnfarm, plant, tmp_path, "--devices")
    assert yaml.safe_load(out.read_text()).keys() == {"farm", "link", "devices"}
    assert len(list(tmp_path.glob("GSDML-*-pnfarm-*-19700101.xml"))) == 3
    for station in line_of(out).farm.stations:
        plc = CapturedController(line := line_of(out), plant, line.farm.station(station.configured_name))
        answer, statuses = plc.start()
        assert differences(answer) == []
        assert all(status.ok for status in statuses)
        assert len(plc.exchange({})) == 2 + plc.layouts[0].data_length + 4
        (ar,) = plc.station.device.cm.ars
        assert ar.state is CmdevState.DATA


def test_the_built_in_controller_connects_imported_devices_at_the_captured_cycle(pnfarm, plant, tmp_path):
    out = farm_of(pnfarm, plant, tmp_path, "--devices")
    out.write_text(out.read_text() + "controller: {name: plc, ip: 10.77.0.1/24, cycle: 8ms}\n")
    line = line_of(out)
    assert line.world.run(5.0, until=lambda: line.plc.all_connected)


def test_what_was_read_and_written_of_a_device_is_its_identity_and_its_parameters(pnfarm, tmp_path):
    (station,) = line_of(farm_of(pnfarm, real(REAL[2]), tmp_path)).farm.stations
    im0 = station.device.cm.description.im0
    assert (im0.order_id, im0.hardware_revision, im0.software_revision) == ("12345 Abcdefghijk", 3, ("V", 0, 2, 0))
    assert station.device.cm.description.station_type == "P-Net Sample Application"
    records = station.device.kind.records
    assert records.read(None, 0, 3, 1, 0x7B, 100, 0) == bytes.fromhex("00000001")
    assert "serial number 007" in plain((tmp_path / "cell.pnfarm.yml").read_text())


def test_a_device_made_of_a_capture_is_the_same_when_it_is_captured_again_also_from_fragments(pnfarm, tmp_path):
    # so many modules that the Connect comes in several datagrams
    plant = SeenPlant()
    plant.connect((*HEAD, *((0, slot, slot % 7 + 1, 1, slot % 7 + 1, slot % 3, 1) for slot in range(1, 100))))
    plant.write(5, 100, b"\1\2\3")
    (seen,) = check_found(plant.found()).devices
    (tmp_path / "seen.xml").write_bytes(seen.file.octets)
    group = {"name": "island", "gsdml": "seen.xml", "ip": "10.77.0.41/24", "slots": seen.keys["slots"]}
    plc = {"name": "plc", "ip": "10.77.0.1/24", "cycle": "1ms"}
    text = yaml.safe_dump({"farm": "one", "link": {"kind": "memory"}, "devices": [group], "controller": plc})
    file = tmp_path / "again.pcapng"
    record(parse_farm(text, tmp_path / "one.pnfarm.yml"), file, connected=True, epoch_ns=10**18)
    out = farm_of(pnfarm, file, tmp_path)
    assert yaml.safe_load(out.read_text())["devices"][0]["slots"] == seen.keys["slots"]
    (again,) = tmp_path.glob("GSDML-*-pnfarm-island-20010909.xml")
    assert parse_gsdml(again.read_bytes()).modules == parse_gsdml(seen.file.octets).modules


def test_a_connection_with_several_crs_makes_a_device_that_takes_it_and_runs_at_its_cycles(pnfarm, tmp_path):
    group = wide_group(wide_file(tmp_path), {1: "8_8", 2: "8_8", 3: "720_720"}, ", cycle: 8ms, cycles: {2: 64ms}")
    text = f"farm: one\nlink: {{kind: memory}}\n{group}controller: {{name: plc, ip: 10.77.0.1/24}}\n"
    file = tmp_path / "wide.pcapng"
    record(parse_farm(text, tmp_path / "one.pnfarm.yml"), file, seconds=0.3, connected=True)
    shown = pnfarm("decode", file).out
    assert all(f"frame id 0x{number:04X}, " in shown for number in range(0x8000, 0x8004))
    assert "impossible" not in shown
    out = farm_of(pnfarm, file, tmp_path)
    (keys,) = yaml.safe_load(out.read_text())["devices"]
    assert (keys["cycle"], keys["cycles"]) == ("8ms", {2: "64ms"})
    assert "cycle 8 ms and 64 ms" in plain(out.read_text())
    line = line_of(out)
    (station,) = line.farm.stations
    answer, _ = CapturedController(line, file, station).start()
    assert differences(answer) == []
    (ar,) = station.device.cm.ars
    assert [cr.reduction_ratio for cr in ar.iocrs] == [8, 64, 8, 64]
    out.write_text(out.read_text() + "controller: {name: plc, ip: 10.77.0.1/24}\n")
    line = line_of(out)
    assert line.world.run(5.0, until=lambda: line.plc.all_connected)
    assert [cr.cycle_ns for cr in line.farm.stations[0].device.cm.ars[0].iocrs] == [cr.cycle_ns for cr in ar.iocrs]


def test_a_project_makes_no_devices(pnfarm, tmp_path):
    file = tmp_path / "project.aml"
    file.write_text("<CAEXFile/>")
    refused = pnfarm("import", file, "--devices")
    assert (refused.code, "--devices is for captures" in refused.err) == (2, True)


def test_without_a_file_to_write_a_device_is_listed_with_how_to_get_it(pnfarm, plant):
    found = pnfarm("import", plant, "--devices")
    assert found.code == 0
    assert "devices" not in yaml.safe_load(found.out)
    assert "infeed: with `-o FARM` it is a device of the farm, by a description file beside FARM" in plain(found.out)


def test_a_file_beside_the_farm_file_is_replaced_with_force_only(pnfarm, plant, tmp_path):
    out = farm_of(pnfarm, plant, tmp_path, "--devices")
    (mine,) = tmp_path.glob("GSDML-*infeed*")
    mine.write_text("mine")
    out.unlink()
    refused = pnfarm("import", plant, "--devices", "-o", out)
    assert (refused.code, mine.name in refused.err, "--force" in refused.err) == (2, True, True)
    assert (mine.read_text(), out.exists()) == ("mine", False)
    assert pnfarm("import", plant, "--devices", "-o", out, "--force").code == 0
    assert parse_gsdml(mine.read_bytes()).vendor_id


# -- several connections, other modules --------------------------------------------------------------------------------


def made(plant, **options):
    """The only device, and its file."""
    check_found(plant.found(**options))
    (one,) = plant.found(**options)
    assert isinstance(one, FoundDevice), one
    return one, parse_gsdml(one.file.octets)


def notes(one):
    return " | ".join((*one.notes, *one.facts))


def test_two_controllers_of_one_device_make_one_with_the_modules_of_both(tmp_path):
    plant = SeenPlant()
    plant.connect((*HEAD, (0, 1, 0x10, 1, 0x11, 2, 0)))
    plant.connect(((0, 2, 0x20, 1, 0x21, 0, 1), (0, 3, 0x30, 1, 0x31, 4, 4)), SECOND)
    one, gsdml = made(plant)
    assert one.keys["slots"] == {1: 0x10, 2: 0x20, 3: 0x30}
    assert gsdml.daps[0].relations.number_of_ars == 2
    assert gsdml.daps[0].shared_device
    assert "refuses" not in notes(one)


def test_a_restart_with_another_project_counts_and_what_contradicts_is_reported():
    plant = SeenPlant()
    plant.connect()
    plant.connect((*ISLAND[:-2], (0, 2, 0x22, 1, 0x23, 0, 2), (0, 3, 0x30, 1, 0x31, 8, 4)))
    one, _ = made(plant)
    assert one.keys["slots"] == {1: 0x10, 2: 0x22, 3: 0x30}
    assert "slot 2: module 0x00000020 by one connection, 0x00000022 by another, which counts" in notes(one)
    assert "0x00000031 with 4 octets in and 4 out, API 0x0 by one connection" in notes(one)
    # the project of before is refused now
    assert "the farm's device refuses the Connect of plc-1: slot 3 subslot 0x0001" in notes(one)


def test_a_connection_that_was_refused_says_less_than_one_that_was_accepted():
    plant = SeenPlant()
    plant.connect()
    plant.connect((*ISLAND[:-1], (0, 3, 0x33, 1, 0x31, 4, 4)), accepted=False)
    one, _ = made(plant)
    assert one.keys["slots"][3] == 0x30
    assert "a connection was refused in the capture" in notes(one)


WRONG, NONE, SUBSTITUTE = (
    submodule_state(info) for info in (IdentInfo.WRONG, IdentInfo.NO_SUBMODULE, IdentInfo.SUBSTITUTE)
)


@pytest.mark.parametrize(
    ("diff", "slots", "idents", "told"),
    [
        (differing(3, 0, ModuleState.NO_MODULE), {3: None}, [0x31], "slot 3 was empty"),
        (
            differing(3, 0x99, ModuleState.SUBSTITUTE, DiffSubmodule(1, 0x98, WRONG)),
            {3: 0x99},
            [0x98],
            "module 0x00000099 was there in place of 0x00000030",
        ),
        (differing(3, 0x99, ModuleState.WRONG_MODULE), {3: 0x99}, [0x31], "0x00000099 was there"),
        (
            differing(3, 0x99, ModuleState.SUBSTITUTE, DiffSubmodule(1, 0x98, SUBSTITUTE)),
            {3: 0x30},
            [0x31],
            "the device had module 0x00000099 as a substitute",
        ),
        (differing(3, 0x30, ModuleState.PROPER_MODULE, DiffSubmodule(1, 0x98, WRONG)), {3: 0x30}, [0x98], ""),
        (
            differing(3, 0x30, ModuleState.PROPER_MODULE, DiffSubmodule(1, 0, NONE)),
            {3: 0x30},
            [],
            "slot 3 had nothing in subslot 0x0001",
        ),
    ],
)  # fmt: skip
def test_a_device_has_what_was_really_plugged(diff, slots, idents, told):
    plant = SeenPlant()
    plant.connect(diff=[diff])
    one, gsdml = made(plant)
    assert {slot: one.keys["slots"][slot] for slot in slots} == slots
    module = next(module for module in gsdml.modules if 3 in [place for ref in gsdml.daps[0].modules
                  if ref.target == module.id for place in ref.allowed])  # fmt: skip
    assert [submodule.ident for submodule in module.submodules] == idents
    assert told in notes(one)


def test_modules_alike_are_one_entry_and_those_with_other_records_or_lengths_are_not():
    plant = SeenPlant()
    alike = tuple((0, slot, 0x10, 1, 0x11, 2, 0) for slot in (1, 2, 3))
    plant.connect((*HEAD, *alike, (0, 4, 0x10, 1, 0x11, 3, 0)))
    plant.write(2, 5, b"\1\2")
    one, gsdml = made(plant)
    places = {ref.target: ref.allowed.emit() for ref in gsdml.daps[0].modules}
    assert places == {"M_00000010": "1 3", "M_00000010_V2": "2", "M_00000010_V3": "4"}
    assert one.keys["slots"] == dict.fromkeys((1, 2, 3, 4), 0x10)


def test_records_of_the_start_up_are_parameters_and_what_strict_limits_refuse_makes_them_lax():
    plant = SeenPlant()
    plant.connect()
    plant.write(1, 100, b"\1\2\3")
    plant.write(1, 101, b"\1")
    plant.write(1, 101, b"\2")
    plant.write(0, 0x8071, bytes(12), subslot=0x8000)
    plant.write(1, 0xF555, b"\1")
    plant.write(1, 102, b"\1", taken=False)
    plant.end_parameters()
    one, gsdml = made(plant)
    assert [(r.index, r.defaults()) for r in gsdml.modules[0].submodules[0].records] == [
        (100, b"\1\2\3"), (101, b"\2"),
    ]  # fmt: skip
    assert gsdml.daps[0].interfaces[0].records == ()
    assert "limits" not in one.keys
    assert "with several values, of which the last counts: 101 (0x0065) of slot 1, subslot 0x0001" in notes(one)
    assert "that the device refused were written: 102 (0x0066)" in notes(one)
    assert "no device of a farm has were written: 62805 (0xF555)" in notes(one)
    plant.write(1, 200, b"\1")
    one, _ = made(plant)
    assert one.keys["limits"] == "lax"
    assert "written to the running device: 200 (0x00C8) of slot 1, subslot 0x0001: limits are lax" in notes(one)


def test_what_the_farm_cannot_do_with_a_connection_is_reported():
    plant = SeenPlant()
    plant.connect(change=lambda block: replace(block, ar_type=0x10) if isinstance(block, ArBlockReq) else block)
    one, _ = made(plant)
    assert "the farm's device refuses the Connect of plc-1: ARType 0x0010 is not supported" in notes(one)


def test_a_device_without_an_access_point_in_its_connection_gets_one():
    plant = SeenPlant()
    plant.connect(ISLAND[-1:])
    one, gsdml = made(plant)
    assert one.keys["slots"] == {3: 0x30}
    assert gsdml.daps[0].ident == 1
    assert "slot 0 is in no connection: its access point is assumed" in notes(one)


def test_an_access_point_in_another_slot_and_data_in_slot_0_are_played():
    plant = SeenPlant()
    moved = tuple((api, 5, *rest) for api, _, *rest in HEAD)
    plant.connect((*moved, (0, 0, 0x10, 1, 0x11, 2, 2)))
    one, gsdml = made(plant)
    assert (gsdml.daps[0].slot, one.keys["slots"]) == (5, {0: 0x10})
    assert "refuses" not in notes(one)


def test_stations_without_a_connection_are_listed_as_before():
    plant = SeenPlant()
    plant.observed.said(DEVICE, (dcp.NameBlock("island"), dcp.DeviceIdBlock(0xFF01, 7)))
    assert [type(one) for one in plant.found()] == [FoundStation]


# -- whatever is in a capture ------------------------------------------------------------------------------------------

_IDENTS = st.sampled_from([0, 1, 0x10, 0x11, 0xFFFF_FFFF])
_LENGTHS = st.sampled_from([0, 0, 1, 2, 8, 1438, 1439, 1440, 0xFFFF])
_SUBSLOTS = st.sampled_from([0, 1, 2, 0x8000, 0x8001, 0x8100, 0x9000, 0xFFFF])
_SLOTS = st.sampled_from([0, 1, 2, 3, 0x7FFF, 0xFFFF])
_APIS = st.sampled_from([0, 0, 0x3A00, 0xFFFF_FFFF])


@st.composite
def _submodules(draw):
    kind = draw(st.integers(0, 0x3F))
    ways = (1, 2) if kind & 3 == 3 else (draw(st.integers(0, 3)),)
    data = tuple(DataDescription(way, draw(_LENGTHS), draw(st.integers(0, 2)), draw(st.integers(0, 2))) for way in ways)
    return ExpectedSubmodule(draw(_SUBSLOTS), draw(_IDENTS), kind, data)


_MODULES = st.builds(ExpectedApi, _APIS, _SLOTS, _IDENTS, st.lists(_submodules(), max_size=4).map(tuple))
_STATES = st.sampled_from([0, 1, 7, WRONG, NONE, SUBSTITUTE, submodule_state(), 0xFFFF])
_DIFFS = st.builds(differing, _SLOTS, _IDENTS, st.integers(0, 4), st.builds(DiffSubmodule, _SUBSLOTS, _IDENTS, _STATES))
_WORDS = st.text(max_size=40) | st.sampled_from(["island", "A\x85b", "\ud800", "x" * 250, "{name}", "&<\"'>", "a.b"])
_IM0 = st.builds(
    Im0, st.integers(0, 0xFFFF), st.binary(max_size=20), st.binary(max_size=16), st.integers(0, 0xFFFF),
    st.tuples(st.characters(max_codepoint=255), *[st.integers(0, 255)] * 3),
)  # fmt: skip
_INDEXES = st.sampled_from([0, 1, 0x8071, 0xB02E, 0x80B0, 0xF555])
_WRITES = st.tuples(_SLOTS, _INDEXES, st.binary(max_size=4))
_CHANGES = st.sampled_from([
    None, lambda block: replace(block, station_name=b"\xff\0") if isinstance(block, ArBlockReq) else block,
])  # fmt: skip


@settings(max_examples=50, deadline=None)
@given(st.data())
def test_whatever_was_asked_of_devices_the_farm_file_and_their_files_can_be_read(data):
    plant = SeenPlant()
    for number in range(data.draw(st.integers(1, 4))):
        device = bytes((2, 0, 0, 0, 0, number % 2))
        plc = data.draw(st.sampled_from([PLC, SECOND]))
        plant.connect(device=device, plc=plc, diff=data.draw(st.lists(_DIFFS, max_size=2)), change=data.draw(_CHANGES))
        modules = tuple(data.draw(st.lists(_MODULES, max_size=5)))
        (connection,) = [one for key, one in plant.observed.connections.items() if key[:2] == (plc, device)][-1:]
        rest = tuple(block for block in connection.request if not isinstance(block, ExpectedSubmoduleBlockReq))
        plant.ask((*rest, ExpectedSubmoduleBlockReq(modules)), plc, device)
        plant.observed.said(device, (dcp.NameBlock(data.draw(_WORDS)), dcp.StationTypeBlock(data.draw(_WORDS))))
        for slot, index, octets in data.draw(st.lists(_WRITES, max_size=4)):
            plant.write(slot, index, octets, plc=plc, device=device, subslot=data.draw(_SUBSLOTS))
        plant.observed.read(device, data.draw(_SLOTS), 1, 0xAFF0, data.draw(_IM0).emit())
    made_of = check_found(plant.found(models=data.draw(st.booleans())))
    for octets in made_of.files.values():
        assert parse_gsdml(octets).daps


def test_thousands_of_submodules_and_devices_make_files_that_can_be_read_or_are_reported():
    plant = SeenPlant()
    plant.connect()
    (connection,) = plant.observed.connections.values()
    rest = tuple(block for block in connection.request if not isinstance(block, ExpectedSubmoduleBlockReq))
    for number, (count, length) in enumerate(((4600, 0), (1000, 0), (3, 1439), (60, 1439))):
        one = DataDescription(1, length)
        subs = tuple(ExpectedSubmodule(subslot, 1, 1 if length else 0, (one,)) for subslot in range(1, count + 1))
        plant.ask(
            (*rest, ExpectedSubmoduleBlockReq((ExpectedApi(0, 1, 1, subs),))), PLC, bytes((2, 1, 0, 0, 0, number))
        )
    result = check_found(plant.found())
    assert [len(result.devices), len(result.others)] == [2, 3]
    reported = " ".join(one.facts[0] for one in result.others)
    assert "at most 4096" in reported


def test_devices_alike_share_a_file():
    plant = SeenPlant()
    for number in range(30):
        plant.connect(device=bytes((2, 0, 0, 0, 1, number)))
        plant.observed.said(bytes((2, 0, 0, 0, 1, number)), (dcp.NameBlock(f"island-{number}"),))
    result = check_found(plant.found())
    assert (len(result.devices), len(result.files)) == (30, 1)
