"""A farm file with drives on several buses: one controller for each, and all of them as one to who watches."""

from __future__ import annotations

import asyncio
import re
from pathlib import Path
from typing import Any

import httpx
import pytest
import toybus
from toybus.controlled import CONTROLLED_TOYBUS

from pnfarm import Farm
from pnfarm.api import make_app
from pnfarm.buses import registry
from pnfarm.cli.commands.run import bound
from pnfarm.cli.farm_file import summary
from pnfarm.cli.main import main
from pnfarm.controller.line import VirtualLine
from pnfarm.drives.catalogue import MODELS_VARIABLE
from pnfarm.drives.profiles.profidrive.pkw import Pkw
from pnfarm.errors import ConfigError
from pnfarm.farm.file.reading import FarmFileError, controller_mac, parse_farm
from pnfarm.metrics import FarmCollector
from pnfarm.scenario.definition.file import load_scenario
from pnfarm.scenario.virtual import run_virtual
from pnfarm.testing import Line

FILE = """\
farm: mixed
link: {kind: memory}
drives:
  - {name: pn-1, model: akd-profinet, ip: 10.77.0.11/23, cycle: 16ms}
  - {name: toy-1, model: toy-servo}
  - {name: eip-1, model: akd-ethernetip, ip: 10.77.0.12/23}
  - {name: pn-2, model: akd-profinet, ip: 10.77.0.13/23, cycle: 16ms}
controller:
  ip: 10.77.1.250/23
  program: {kind: constant, speed_rpm: 60, acknowledge_after: 200ms}
  ethernetip: {ip: 10.77.1.251/23, rpi: 10ms}
"""
ORDER = ["pn-1", "toy-1", "eip-1", "pn-2"]
BUSES = ["profinet", "toybus", "ethernetip", "profinet"]


@pytest.fixture(autouse=True)
def toybus_there(monkeypatch):
    monkeypatch.setenv(MODELS_VARIABLE, str(Path(toybus.__file__).resolve().parent / "models"))
    with registry.registered(CONTROLLED_TOYBUS):
        yield


def without(text: str, *names: str) -> str:
    return "".join(
        line for line in text.splitlines(keepends=True) if not any(f"name: {name}," in line for name in names)
    )


def changed(*changes: tuple[str, str], text: str = FILE) -> str:
    for old, new in changes:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    return text


def wrong(text: str) -> list[str]:
    with pytest.raises(FarmFileError) as caught:
        parse_farm(text, "f")
    return str(caught.value).splitlines()


def line_of(text: str = FILE) -> VirtualLine:
    line = asyncio.run(VirtualLine.create(parse_farm(text)))
    assert line.world.run(20.0, until=lambda: line.controllers.all_connected and line.controllers.all_running)
    return line


def velocities(line: VirtualLine) -> list[float]:
    return [float(station.handle.axis.motor.velocity) for station in line.farm.axes]


# -- the farm file


def test_each_bus_with_drives_has_a_controller_with_the_keys_that_it_knows():
    config = parse_farm(
        changed(("  program", "  watchdog_factor: 5\n  pace: 20ms\n  reconnect: {after: 2s}\n  program"))
    )
    profinet, toy, ethernetip = config.controllers
    assert (profinet.watchdog_factor, toy.pace_ns, ethernetip.rpi_ns) == (5, 20_000_000, 10_000_000)
    assert {one.reconnect.after_ns for one in config.controllers} == {2_000_000_000}
    assert {one.program.kind for one in config.controllers} == {"constant"}
    assert (str(profinet.ip.ip), str(ethernetip.ip.ip)) == ("10.77.1.250", "10.77.1.251")
    assert config.controller is profinet


def test_each_controller_is_a_station_of_its_own():
    config = parse_farm(FILE)
    assert [one.name for one in config.controllers] == ["plc", "plc-toybus", "plc-ethernetip"]
    assert len({controller_mac(config, one) for one in config.controllers}) == 3
    named = parse_farm(changed(("rpi: 10ms", "name: scanner"), ("  program", "  name: line\n  program")))
    assert [one.name for one in named.controllers] == ["line", "line-toybus", "scanner"]


def test_a_file_with_one_bus_is_read_as_before_and_may_have_a_map_as_well():
    one = without(changed(("  ethernetip: {ip: 10.77.1.251/23, rpi: 10ms}\n", "")), "toy-1", "eip-1")
    config = parse_farm(one)
    assert [section.name for section in config.controllers] == ["plc"]
    mapped = parse_farm(one + "  profinet: {watchdog_factor: 7}\n")
    assert mapped.controller.watchdog_factor == 7
    assert controller_mac(mapped, mapped.controllers[0]) == controller_mac(config, config.controllers[0])


def test_a_key_set_from_outside_reaches_one_bus():
    config = parse_farm(FILE).with_overrides({"controller.ethernetip.rpi": "20ms", "controller.watchdog_factor": 9})
    profinet, _, ethernetip = config.controllers
    assert (profinet.watchdog_factor, ethernetip.rpi_ns) == (9, 20_000_000)


def test_a_bus_with_foreign_devices_alone_has_a_controller(tmp_path):
    text = without(changed(("rpi: 10ms", "devices: [{name: valve, eds: valve.eds, ip: 10.77.0.90/23}]")), "eip-1")
    config = parse_farm(text)
    assert [type(one).__name__ for one in config.controllers] == [
        "ProfinetController", "ToyController", "EthernetIpController",
    ]  # fmt: skip


WRONG: list[tuple[str, tuple[str, str], str]] = [
    ("unknown everywhere", ("  program", "  rpj: 1ms\n  program"),
     "f:10: controller.rpj: is not a key here, did you mean rpi?"),
    ("unknown in a map", ("rpi: 10ms", "rpj: 10ms"),
     "f:11: controller.ethernetip.rpj: is not a key here, did you mean rpi?"),
    ("of another bus", ("rpi: 10ms", "cycle: 10ms"),
     "f:11: controller.ethernetip.cycle: is a key of PROFINET, and this is a controller on EtherNet/IP"),
    ("same address", ("ip: 10.77.1.251/23, ", ""),
     "f:9: controller.ip: the controller on EtherNet/IP: 10.77.1.250 belongs to the controller on PROFINET already"),
    ("same address in the map", ("10.77.1.251/23", "10.77.1.250/23"),
     "f:11: controller.ethernetip.ip: 10.77.1.250 belongs to the controller on PROFINET already"),
    ("wrong address in the map", ("10.77.1.251/23", "10.77.1.251"), "f:11: controller.ethernetip.ip: "),
    ("same name", ("rpi: 10ms", "name: plc"),
     "f:11: controller.ethernetip.name: 'plc' belongs to the controller on PROFINET already"),
    ("address of a drive", ("10.77.1.251/23", "10.77.0.13/23"),
     "f:7: drives[3].ip: 'pn-2': 10.77.0.13 belongs to the controller on EtherNet/IP already"),
    ("shared", ("rpi: 10ms", "program: {python: p.py}"),
     "f:11: controller.ethernetip.program.python: is the same on every bus"),
    ("no map", ("{ip: 10.77.1.251/23, rpi: 10ms}", "5"),
     "f:11: controller.ethernetip: is 5; allowed: a mapping with keys for EtherNet/IP alone"),
    ("devices of which bus", ("  program", "  devices: [{name: x}]\n  program"),
     "f:10: controller.devices: may be for PROFINET or EtherNet/IP"),
    ("a flat key of one bus", ("  program", "  watchdog_factor: 0\n  program"),
     "f:10: controller.watchdog_factor: on PROFINET: is 0; allowed: a number from 1 to"),
    ("a flat key of all", ("  program", "  reconnect: 3\n  program"),
     "f:10: controller.reconnect: is 3; allowed: off, or a mapping"),
    ("a value in a map", ("rpi: 10ms", "rpi: 1us"),
     "f:11: controller.ethernetip.rpi: 1us is not a requested packet interval"),
    ("a check of a bus", ("  program", "  pace: 1s\n  program"),
     "f:10: controller.pace: on ToyBus: is longer than the drives wait"),
    ("a check of a bus in a map", ("  program", "  toybus: {pace: 1s}\n  program"),
     "f:10: controller.toybus.pace: is longer than the drives wait"),
    ("a check against drives", ("rpi: 10ms", "rpi: 5ms"),
     "f:11: controller.ethernetip.rpi: 5ms is faster than akd-ethernetip can"),
    ("an interface in memory", ("rpi: 10ms", "interface: eth1"),
     "f:11: controller.ethernetip.interface: is not reached from drives in memory"),
]  # fmt: skip


@pytest.mark.parametrize(("change", "message"), [w[1:] for w in WRONG], ids=[w[0] for w in WRONG])
def test_what_is_wrong_is_told_once_with_its_line_and_bus(change, message):
    (found,) = wrong(changed(change))
    assert found.startswith(message)


def test_a_map_for_a_bus_without_drives_is_refused():
    (found,) = wrong(without(FILE, "eip-1"))
    assert found.startswith(
        "f:10: controller.ethernetip: is for drives on EtherNet/IP, and this file has none; allowed: "
    )


def test_a_map_is_not_refused_where_the_model_of_its_drives_is_misspelt():
    (found,) = wrong(changed(("model: akd-ethernetip", "model: akd-ethernetipp")))
    assert "drives[2].model" in found


def test_two_controllers_do_not_share_an_interface_or_a_mac():
    text = without(changed(("kind: memory", "kind: veth"), ("  program", "  interface: eth1\n  program")), "toy-1")
    (found,) = wrong(text)
    assert found.startswith("f:9: controller.interface: eth1 is given to the controllers of PROFINET and EtherNet/IP")
    text = changed(("rpi: 10ms", "mac: 02:00:00:00:00:09"), ("  program", "  mac: 02:00:00:00:00:09\n  program"))
    (found,) = wrong(text)
    assert found.startswith(
        "f:12: controller.ethernetip.mac: 02:00:00:00:00:09 belongs to the controller on PROFINET already"
    )


def test_all_that_is_wrong_is_told_in_one_run():
    text = changed(("rpi: 10ms", "rpi: 1us, nam: x"), ("  program", "  pace: 1s\n  watchdog_factor: 0\n  program"))
    assert [found.split(": ")[1] for found in sorted(wrong(text))] == [
        "controller.pace", "controller.watchdog_factor", "controller.ethernetip.nam", "controller.ethernetip.rpi",
    ]  # fmt: skip


def test_validate_names_every_controller():
    text = summary(parse_farm(FILE))
    assert text.endswith(
        "controller plc on PROFINET, controller plc-toybus on ToyBus, controller plc-ethernetip on EtherNet/IP"
    )
    assert summary(
        parse_farm(without(changed(("  ethernetip: {ip: 10.77.1.251/23, rpi: 10ms}\n", "")), "toy-1", "eip-1"))
    ).endswith(", controller plc")


# -- all controllers as one


def test_drives_of_three_buses_run_in_virtual_time():
    line = line_of()
    line.world.run(2.0)
    assert velocities(line) == pytest.approx([60.0] * 4, abs=2)
    rows = line.joined.summary()
    assert [(row["name"], row["bus"]) for row in rows] == list(zip(ORDER, BUSES, strict=True))
    assert all(row["state"] == "DATA" and row["phase"] == "running" for row in rows)
    assert all(line.controllers.exchanging(name) for name in ORDER)
    assert not line.controllers.exchanging("other")


def test_connected_and_running_and_stopped_count_every_controller():
    line = line_of()
    toy = line.farm.axis("toy-1")
    toy.station.power_off(line.world.now)
    line.farm.settle(toy.station, line.world.now)
    line.world.run(0.5)
    assert not line.controllers.all_connected
    assert [one.all_connected for one in line.controllers] == [True, False, True]
    line.controllers.release(line.world.now)
    assert line.world.run(2.0, until=lambda: line.controllers.all_stopped)
    assert all(one.all_stopped for one in line.controllers)
    assert not any(station.device.connected for station in line.farm.axes if station.configured_name != "toy-1")


def test_two_runs_are_the_same():
    assert line_of().joined.summary() == line_of().joined.summary()


def test_what_is_asked_of_a_drive_goes_to_its_controller():
    line = line_of(changed(("cycle: 16ms}\n  - {name: toy", "cycle: 16ms, telegram: 1}\n  - {name: toy")))
    task = Pkw(1, 918)
    with pytest.raises(ConfigError, match="telegram of drive 'pn-1' has no parameter channel"):
        line.controllers.put_parameter_task("pn-1", task)
    with pytest.raises(ConfigError, match="orders of drive 'toy-1' have no parameter channel"):
        line.controllers.put_parameter_task("toy-1", task)
    with pytest.raises(ConfigError, match="cyclic data of drive 'eip-1' have no parameter channel"):
        line.controllers.parameter_answer("eip-1")
    with pytest.raises(ConfigError, match="no controller has a drive 'other'"):
        line.controllers.parameter_answer("other")


def test_one_controller_is_what_it_was():
    line = line_of(without(changed(("  ethernetip: {ip: 10.77.1.251/23, rpi: 10ms}\n", "")), "toy-1", "eip-1"))
    assert line.controllers.snapshot() == line.plc.snapshot()
    assert "bus" not in line.controllers.snapshot()[0]
    with pytest.raises(ConfigError, match="controller plc has no drive 'other'"):
        line.controllers.parameter_answer("other")


PROGRAM = """
from pnfarm import AxisProgram


class Follow(AxisProgram):
    def cycle(self, inputs, outputs, now):
        outputs.stw1 = 0x047F if inputs.zsw1.ready_to_switch_on else 0x047E
        outputs.velocity = 30.0
        self.seen = [axis.name for axis in self.line]
"""


def test_a_program_of_one_s_own_sees_the_axes_of_all_controllers(tmp_path):
    (tmp_path / "follow.py").write_text(PROGRAM)
    text = changed(
        ("{kind: constant, speed_rpm: 60, acknowledge_after: 200ms}", "{python: follow.py}"),
        ("rpi: 10ms", "program: {kind: constant, speed_rpm: 90}"),
    )
    line = asyncio.run(VirtualLine.create(parse_farm(text, tmp_path / "f.pnfarm.yml")))
    line.world.run(10.0)
    assert velocities(line) == pytest.approx([30, 30, 90, 30], abs=2)
    assert line.programs.program("toy-1").seen == ["pn-1", "toy-1", "pn-2"]
    calls = {row["name"]: row["program"] and row["program"]["calls"] for row in line.joined.summary()}
    assert calls["eip-1"] is None
    assert min(calls[name] for name in ("pn-1", "toy-1", "pn-2")) > 100
    asyncio.run(line.close())


def test_frames_of_all_buses_are_captured(tmp_path):
    line = asyncio.run(VirtualLine.create(parse_farm(FILE), pcap=tmp_path / "all.pcapng", epoch_ns=0))
    line.world.run(8.0)
    assert line.controllers.all_running
    asyncio.run(line.close())
    octets = (tmp_path / "all.pcapng").read_bytes()
    plain = line_of()
    plain.world.run(8.0 - (plain.world.now - 10**12) / 1e9)
    assert [row["frames_received"] for row in plain.joined.summary()] == [
        row["frames_received"] for row in line.joined.summary()
    ]
    for station in line.farm.axes:
        assert octets.count(station.port.mac) > 200, station.configured_name


# -- faults, scenarios, metrics, API


def test_metrics_and_the_api_have_the_drives_of_all_buses():
    line = line_of()
    collector = FarmCollector(line.farm)
    line.world.run(1.0)
    text = collector.gather().text().decode()
    for name, bus in zip(ORDER, BUSES, strict=True):
        assert re.search(rf'(?m)^pnfarm_drive_info\{{drive="{name}",model="[^"]+",bus="{bus}"\}} 1', text), name
        (speed,) = re.findall(rf'(?m)^pnfarm_axis_velocity_rpm\{{drive="{name}"\}} (\S+)$', text)
        assert float(speed) == pytest.approx(60, abs=2)
        assert f'pnfarm_ar_exchanging{{drive="{name}"}} 1' in text
    app = make_app(line.farm, now=lambda: line.world.now, poke=lambda: None)

    async def ask(*paths: str) -> list[httpx.Response]:
        transport = httpx.ASGITransport(app)
        async with httpx.AsyncClient(transport=transport, base_url="http://127.0.0.1:8702/api/v1/") as client:
            return [await client.get(path) for path in paths]

    paths = ["drives", *(f"drives/{name}/{what}" for name in ORDER for what in ("controller", "signals"))]
    answers = asyncio.run(ask(*paths))
    assert [drive["name"] for drive in answers[0].json()["drives"]] == ORDER
    # a drive without such a resource says so; nothing fails
    assert {answer.status_code for answer in answers} <= {200, 404}
    collector.close()


def test_a_fault_that_needs_what_one_bus_lacks_is_refused_with_the_drive_s_name():
    line = line_of()
    with pytest.raises(ConfigError, match="toy-1 has no alarms"):
        line.farm.injections.inject({"kind": "alarm-storm", "on": "toy-1"}, line.world.now)
    line.farm.injections.inject({"kind": "loss", "on": "all", "probability": 1.0, "for": "2s"}, line.world.now)
    line.world.run(1.0)
    assert not any(line.controllers.exchanging(name) for name in ORDER)
    line.world.run(10.0)
    assert all(line.controllers.exchanging(name) for name in ORDER)


STEPS = """\
scenario: mixed
farm: mixed.pnfarm.yml
steps:
  - wait: {until: state == S4, within: 20s}
  - expect: {drive: all, that: velocity > 50 rpm, within: 3s}
"""


def carried_out(folder: Path, steps: str) -> dict[str, Any]:
    (folder / "mixed.pnfarm.yml").write_text(FILE)
    (folder / "mixed.scenario.yml").write_text(STEPS + steps)
    record, _ = asyncio.run(run_virtual(*bound(load_scenario(folder / "mixed.scenario.yml"))))
    return record


def test_one_scenario_runs_drives_of_all_buses(tmp_path):
    record = carried_out(
        tmp_path,
        "  - fault: {kind: power-cycle, on: all}\n"
        "  - expect: {drive: all, that: connected == 0, within: 1s}\n"
        "  - expect: {drive: all, that: state == S4, within: 20s}\n",
    )
    assert record["verdict"] == "passed", record["cases"]
    # each bus whose events tell it has the way back into the record of what the controllers did
    assert [one["drive"] for one in record["controllers"]] == ["pn-1", "eip-1", "pn-2"]
    assert all(len(one["start_ups"]) == 2 for one in record["controllers"])


def test_a_scenario_that_uses_one_bus_s_words_for_all_drives_is_refused_with_the_place(tmp_path):
    with pytest.raises(ConfigError, match=r":6: .*akd-ethernetip has no signal 'stw1'.* allowed: state, "):
        carried_out(tmp_path, "  - expect: {drive: all, that: stw1 == 0x47F, within: 3s}\n")


def test_a_scenario_s_fault_that_a_drive_cannot_have_is_an_error_with_the_reason(tmp_path):
    record = carried_out(tmp_path, "  - fault: {kind: iops-bad, on: toy-1}\n")
    assert record["verdict"] == "error"
    assert "toy-1 has no frames of PROFINET, which iops-bad needs" in str(record["cases"])


def test_the_farm_runs_in_real_time_in_memory():
    async def story() -> list[Any]:
        async with Farm(parse_farm(FILE)) as farm:
            assert await farm.wait_connected(20)
            return [farm.controller(name) for name in ORDER]

    rows = asyncio.run(asyncio.wait_for(story(), 60))
    assert [row["bus"] for row in rows] == BUSES
    assert all(row["state"] == "DATA" for row in rows)


def test_a_line_for_tests_has_all_controllers():
    with Line.from_text(FILE) as line:
        line.wait_connected()
        line.wait_running()
        assert [line.controller(name)["bus"] for name in ORDER] == BUSES


def test_validate_accepts_a_file_with_several_controllers(tmp_path, capsys):
    file = tmp_path / "mixed.pnfarm.yml"
    file.write_text(FILE)
    assert main(["validate", str(file)]) == 0
    assert "controller plc-ethernetip on EtherNet/IP" in capsys.readouterr().out
