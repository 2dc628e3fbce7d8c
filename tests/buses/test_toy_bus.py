"""A bus in a folder of its own (``toybus``): its drive runs beside PROFINET's, and no file of the package knows it."""

from __future__ import annotations

import asyncio
import re
from pathlib import Path

import httpx
import pytest
import toybus
from toybus.bus import TOYBUS
from toybus.device.device import ToyConnected, ToyLost
from toybus.frames import ETHERTYPE, Order, emit_order, frame, parse_report

from pnfarm.api import make_app
from pnfarm.api.schemas.drive import Drive
from pnfarm.buses import registry
from pnfarm.captures.reading import CapturedFrame
from pnfarm.cli.main import main
from pnfarm.controller.line import VirtualLine
from pnfarm.drives.catalogue import MODELS_VARIABLE
from pnfarm.errors import ConfigError
from pnfarm.farm.file.reading import parse_farm
from pnfarm.farm.views.snapshot import drive_snapshot
from pnfarm.metrics import FarmCollector
from pnfarm.station.event_log import EventLog
from pnfarm.wire.ethernet import parse_ethernet

TOYBUS_FOLDER = Path(toybus.__file__).resolve().parent
FILE = """
farm: mixed
link: {kind: memory}
drives:
  - {name: axis-01, model: akd-profinet, ip: 10.77.0.11/23, cycle: 16ms}
  - {name: toy-01, model: toy-servo}
controller:
  name: plc
  ip: 10.77.1.250/23
  program: {kind: constant, speed_rpm: 60, acknowledge_after: 200ms}
  reconnect: {after: 300ms}
"""
RUNNING = Order(enable=True, speed=600)
MASTER = bytes.fromhex("020000000001")


class ToyLine:
    """A farm of an AKD and a toy servo, PROFINET's controller for the one, a master of the toy bus for the other."""

    def __init__(self) -> None:
        self.log = EventLog(quiet=True)
        self.line = asyncio.run(VirtualLine.create(parse_farm(FILE), log=self.log))
        self.world, self.farm = self.line.world, self.line.farm
        self.metrics = FarmCollector(self.farm)
        self.akd, self.toy = self.farm.axes
        self.reports = []
        self.port = self.world.switch.attach(MASTER, self._receive, name="master")

    def _receive(self, port: int, data: bytes, now: int) -> None:
        found = parse_ethernet(data)
        if found.ethertype == ETHERTYPE:
            self.reports.append(parse_report(found.payload))

    def orders(self, seconds: float, order: Order) -> None:
        """One each 10 ms."""
        for _ in range(round(seconds * 100)):
            self.world.switch.send(self.port.index, frame(self.toy.port.mac, MASTER, emit_order(order)), self.world.now)
            self.world.run(0.01)

    def run_it(self, seconds: float, speed: int = 600) -> None:
        """Wait until it has booted, and let it run; one that runs stops first."""
        self.orders(0.2, Order(enable=False, speed=0))
        self.orders(seconds, Order(enable=True, speed=speed))

    def inject(self, kind: str, on: str, **fields):
        return self.farm.injections.inject({"kind": kind, "on": on, **fields}, self.world.now)

    def metric(self, name: str, **labels: str) -> float:
        wanted = ",".join(f'{key}="{value}"' for key, value in labels.items())
        (value,) = re.findall(rf"(?m)^{name}\{{{wanted}\}} (\S+)$", self.metrics.gather().text().decode())
        return float(value)

    def events(self, drive: str) -> list[type]:
        return [type(entry.what) for entry in self.log.entries(drive)]


@pytest.fixture
def toybus_there(monkeypatch):
    monkeypatch.setenv(MODELS_VARIABLE, str(TOYBUS_FOLDER / "models"))
    with registry.registered(TOYBUS):
        yield


@pytest.fixture
def mixed(toybus_there):
    return ToyLine()


def test_drives_of_two_buses_run_in_one_farm(mixed):
    mixed.run_it(2.0)
    assert mixed.reports[-1].speed == pytest.approx(600, abs=5)
    assert mixed.akd.device.connected
    assert float(mixed.akd.handle.axis.motor.velocity) == pytest.approx(60, abs=2)
    akd, toy = (drive_snapshot(mixed.farm, station, mixed.world.now) for station in mixed.farm.axes)
    assert (akd["state"], toy["state"]) == ("S4", "S4")
    assert (toy["ip"], toy["ar_state"], toy["connected"], toy["frames_received"]) == (None, "TALKING", True, 220)
    assert Drive.model_validate(toy).name == "toy-01"


def test_silence_on_one_bus_stops_its_drive_and_no_other(mixed):
    mixed.run_it(1.0)
    mixed.world.run(1.0)
    assert not mixed.toy.device.connected
    assert mixed.toy.fault_counts == {7: 1}
    assert mixed.akd.device.connected
    assert not mixed.akd.fault_counts
    found = mixed.events("toy-01")
    assert found.index(ToyConnected) < found.index(ToyLost)


def test_metrics_of_both_are_in_one_scrape(mixed):
    assert mixed.metric("pnfarm_drive_info", drive="toy-01", model="toy-servo", bus="toybus") == 1
    assert mixed.metric("pnfarm_drive_info", drive="axis-01", model="akd-profinet", bus="profinet") == 1
    mixed.run_it(1.0)
    assert mixed.metric("pnfarm_ar_state", drive="toy-01") == 1
    assert mixed.metric("pnfarm_frames_received_total", drive="toy-01") == 120
    assert mixed.metric("pnfarm_frames_sent_total", drive="toy-01") == 120
    assert mixed.metric("pnfarm_axis_velocity_rpm", drive="toy-01") == pytest.approx(600, abs=5)
    mixed.world.run(1.0)
    assert mixed.metric("pnfarm_ar_state", drive="toy-01") == 0
    assert mixed.metric("pnfarm_ar_aborts_total", drive="toy-01", reason="silence", cause="controller") == 1
    assert mixed.metric("pnfarm_axis_faults_total", drive="toy-01", code="7") == 1
    assert mixed.metric("pnfarm_ar_state", drive="axis-01") > 0


def test_an_injection_of_the_bus_s_own_acts_and_ends_and_is_counted(mixed):
    mixed.run_it(0.5)
    muted = mixed.inject("toy-mute", "toy-01", **{"for": "200ms"})
    heard = len(mixed.reports)
    mixed.orders(0.1, RUNNING)
    assert len(mixed.reports) == heard
    assert mixed.metric("pnfarm_faults_active", kind="toy-mute") == 1
    mixed.orders(0.3, RUNNING)
    assert len(mixed.reports) > heard
    assert muted.evidence().confirmed
    assert mixed.metric("pnfarm_fault_activations_total", kind="toy-mute", drive="toy-01") == 1


def test_injections_for_any_drive_act_on_it(mixed):
    mixed.run_it(0.5)
    loss = mixed.inject("loss", "toy-01", direction="in")
    heard = len(mixed.reports)
    mixed.orders(0.05, RUNNING)
    assert len(mixed.reports) == heard
    mixed.farm.injections.clear(loss.id, mixed.world.now)
    mixed.run_it(0.5)
    mixed.inject("drive-fault", "toy-01", params={"fault": 7})
    mixed.orders(0.1, RUNNING)
    assert mixed.reports[-1].status & 0x8


def test_what_only_the_other_bus_can_have_is_refused_with_the_reason(mixed):
    with pytest.raises(ConfigError, match="toy-01 has no alarms"):
        mixed.inject("alarm-storm", "toy-01")
    with pytest.raises(ConfigError, match="axis-01 has no reports"):
        mixed.inject("toy-mute", "axis-01")


def test_its_routes_are_in_the_api_beside_those_of_others(mixed):
    mixed.run_it(0.5)
    app = make_app(mixed.farm, now=lambda: mixed.world.now, poke=lambda: None)

    def get(path: str) -> httpx.Response:
        async def ask() -> httpx.Response:
            async with httpx.AsyncClient(
                transport=httpx.ASGITransport(app), base_url="http://127.0.0.1:8702"
            ) as client:
                return await client.get(f"/api/v1/{path}")

        return asyncio.run(ask())

    assert [drive["name"] for drive in get("drives").json()["drives"]] == ["axis-01", "toy-01"]
    assert get("drives/toy-01/orders").json() == {"orders": 70}
    refused = get("drives/toy-01/modules")
    assert (refused.status_code, refused.json()["detail"]) == (404, "toy-01 has no modules: it is a drive on toybus")
    assert get("drives/axis-01/modules").status_code == 200


def test_a_power_cycle_and_a_frame_of_the_other_bus_leave_it_well(mixed):
    mixed.run_it(0.2)
    mixed.toy.station.power_cycle(mixed.world.now)
    mixed.world.switch.send(
        mixed.port.index, mixed.toy.port.mac + MASTER + bytes.fromhex("8892fefe") + bytes(50), mixed.world.now
    )
    mixed.run_it(2.0, speed=300)
    assert mixed.reports[-1].speed == pytest.approx(300, abs=5)
    assert mixed.toy.device.connects == 2


def test_its_command_is_in_the_program_while_it_is_registered(toybus_there, capsys):
    assert main(["toy-order", "600"]) == 0
    assert capsys.readouterr().out == emit_order(Order(enable=True, speed=600)).hex() + "\n"
    assert main(["models", "toy-servo"]) == 0
    assert "Toy servo on the toy bus (Example, toybus)" in capsys.readouterr().out


def test_its_frames_of_a_capture_are_put_into_words_beside_those_of_others(toybus_there):
    decoder = registry.decoder()
    drive = bytes.fromhex("020000000002")
    octets = [
        frame(drive, MASTER, emit_order(RUNNING)),
        frame(MASTER, drive, b"\x03"),
        drive + MASTER + bytes.fromhex("8892 80"),
    ]
    lines = [line for n, data in enumerate(octets) for line in decoder.feed(CapturedFrame(n, n, data))]
    assert [(line.family, line.description.what, line.description.text) for line in lines] == [
        ("toy", "order", "600 rpm"),
        ("toy", "malformed", "no report"),
        ("other", "EtherType 0x8892", "1 octets"),
    ]
    (talk,) = decoder.summary()
    assert (talk["families"], talk["counts"]["orders"]) == ({"toy": 2, "other": 1}, 1)


def test_no_file_of_the_package_knows_it():
    package = Path(registry.__file__).resolve().parents[1]
    assert not [path for path in package.rglob("*.py") if "toy" in path.read_text(encoding="utf-8").lower()]
