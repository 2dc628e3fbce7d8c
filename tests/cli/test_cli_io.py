"""``pnfarm io`` against the API of a farm in virtual time."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import httpx
import pytest
import typer
from api_client import Farm
from device_world import DeviceWorld
from plain_station import controller_sends

from pnfarm.cli.completion import complete_signal
from pnfarm.cli.main import make_app


@pytest.fixture(scope="module")
def shared() -> DeviceWorld:
    return DeviceWorld()


@pytest.fixture
def world(shared, monkeypatch):
    shared.signals.set({"part_present": False, "pressure": 0, "code": ""})
    monkeypatch.setattr(httpx, "Client", Farm(shared).client)
    return shared


def test_all_signals_are_listed_with_direction_type_unit_status_and_place(pnfarm, world):
    world.signals.set({"pressure": 6.5})
    done = pnfarm("io")
    assert (done.code, done.err) == (0, "")
    head, *rows = [line.split() for line in done.out.splitlines()]
    assert head == ["STATION", "SIGNAL", "DIRECTION", "TYPE", "VALUE", "UNIT", "STATUS", "OWNER", "PLACE"]
    assert rows[1] == ["island-1", "pressure", "input", "int16", "6.5", "bar", "good", "value", "3.1.0"]
    assert rows[3] == ["island-1", "valve_1", "output", "bool", "false", "bad", "controller", "2.1.0.1"]
    assert pnfarm("io", "island-1").out == done.out


def test_signals_are_read_by_name(pnfarm, world):
    world.signals.set({"pressure": 6.5})
    done = pnfarm("io", "island-1.pressure", "island-1.valve_1")
    assert (done.code, done.out) == (0, "island-1.pressure = 6.5 bar\nisland-1.valve_1 = false (bad)\n")
    (device,) = json.loads(pnfarm("io", "island-1.pressure", "--format", "json").out)["devices"]
    assert (device["device"], [signal["value"] for signal in device["signals"]]) == ("island-1", [6.5])


def test_values_are_written_together_and_shown(pnfarm, world):
    done = pnfarm("io", "island-1.part_present=on", "island-1.pressure=-1.25", "island-1.code=01 ff")
    assert (done.code, done.err) == (0, "")
    assert done.out.splitlines() == [
        "island-1.part_present = true", "island-1.pressure = -1.25 bar", "island-1.code = 01 ff 00 00",
    ]  # fmt: skip
    assert world.signals.get("pressure") == -1.25


def test_a_forced_signal_says_so_until_it_is_released(pnfarm, world):
    done = pnfarm("io", "--force", "island-1.part_present=on", "island-1.pressure=6.5")
    assert (done.code, done.err) == (0, "")
    assert done.out == "island-1.part_present = true (force)\nisland-1.pressure = 6.5 bar (force)\n"
    done = pnfarm("io", "island-1.pressure=1")
    assert done.out == "island-1.pressure = 6.5 bar (force)\n"
    assert done.err == "island-1.pressure: a force has it now; 1 takes effect when that ends\n"
    assert pnfarm("io", "--release", "island-1.pressure").out == "island-1.pressure = 1 bar\n"
    assert list(world.signals.forced) == ["part_present"]
    assert pnfarm("io", "--release", "island-1").code == 0
    assert not world.signals.forced
    for words, why in (
        (("--release", "island-1.pressure=1"), "a force ends without a value"),
        (("--release", "--force"), "exclude each other"),
        (("--force", "island-1.pressure"), "island-1.pressure is given no value"),
        (("--force", "island-1.pressure=1", "island-1"), "island-1.SIGNAL is given no value"),
    ):
        done = pnfarm("io", *words)
        assert (done.code, why in done.err) == (2, True)


def test_nothing_is_written_when_one_value_is_refused(pnfarm, world):
    done = pnfarm("io", "island-1.part_present=on", "island-1.valve_1=on", "island-1.presure=1")
    assert done.code == 2
    assert "island-1: valve_1: is an output: the controller alone writes it" in done.err
    assert "presure: is not a signal, did you mean pressure?" in done.err
    assert world.signals.get("part_present") is False


@pytest.mark.parametrize(
    ("word", "sentence"),
    [
        (
            "island-2",
            "there is no device, drive or model 'island-2', did you mean island-1?; this farm has island-1 axis-01",
        ),
        ("island-2.part_present=1", "there is no device, drive or model 'island-2'"),
        ("island-1=on", "island-1=on: give the signal to write, island-1.SIGNAL=VALUE"),
        ("axis-01.speed", "axis-01 has no signal 'speed'"),
        ("axis-01.velocity=3", "axis-01 is a drive: its signals can only be read; `pnfarm param set` writes"),
        ("island-1.presure", "island-1 has no signal 'presure', did you mean pressure?"),
        ("island-1.xyz", "island-1 has no signal 'xyz'; it has code part_present pressure speed valve_1"),
        ("island-1.pressure=much", "island-1: pressure: 'much' is not a number"),
    ],
)
@pytest.mark.usefixtures("world")
def test_what_is_wrong_is_one_sentence(pnfarm, word, sentence):
    done = pnfarm("io", word)
    assert done.code == 2
    assert sentence in done.err


@pytest.mark.usefixtures("world")
def test_two_values_for_one_signal_are_refused(pnfarm):
    done = pnfarm("io", "island-1.pressure=1", "island-1.pressure=2")
    assert (done.code, "island-1.pressure is given two values" in done.err) == (2, True)


def test_a_station_may_have_dots_in_its_name(pnfarm, monkeypatch):
    monkeypatch.setattr(httpx, "Client", Farm(DeviceWorld(name="island.cell-3.pressure")).client)
    assert pnfarm("io", "island.cell-3.pressure.pressure").out == "island.cell-3.pressure.pressure = 0 bar\n"
    assert "part_present" in pnfarm("io", "island.cell-3.pressure").out


class Stream:
    """A stream of the API, of which a round follows each of ``changes``; then it ends."""

    is_error, is_success = False, True

    def __init__(self, world: DeviceWorld, changes: list[Callable[[], object]]) -> None:
        self.world, self.changes = world, changes

    def iter_lines(self) -> Iterator[str]:
        loop = asyncio.new_event_loop()
        devices = {one.configured_name: one.signals for one in self.world.line.farm.stations if not one.axes}
        parts = self.world.app.state.views.stream({}, None, devices, overview=False)
        for change in (lambda: None, lambda: None, *self.changes):
            change()
            self.world.line.run(0.1)
            yield from loop.run_until_complete(anext(parts)).decode().split("\n")
        loop.run_until_complete(parts.aclose())
        loop.close()


def watched(monkeypatch, world, *streams: Any, sleep: Callable[[float], None] = lambda _: None) -> list[Any]:
    """What clients ask for streams; they get these, errors are raised, and then somebody presses Ctrl-C."""
    asked, left = [], list(streams)

    @contextmanager
    def stream(self: Farm, method: str, path: str, **options: Any) -> Iterator[Stream]:
        asked.append((path, options["params"]))
        if not left:
            raise KeyboardInterrupt
        found = left.pop(0)
        if isinstance(found, Exception):
            raise found
        yield Stream(world, found)

    monkeypatch.setattr(Farm, "stream", stream, raising=False)
    monkeypatch.setattr("pnfarm.cli.commands.io.time.sleep", sleep)
    return asked


def test_changes_are_followed(pnfarm, world, monkeypatch):
    asked = watched(
        monkeypatch, world, [
            lambda: controller_sends(world.signals, b"\x02\0\x07"), lambda: world.signals.set({"part_present": True}),
            lambda: world.signals.set({"pressure": 1}),
        ],
    )  # fmt: skip
    done = pnfarm("io", "island-1.part_present", "island-1.speed", "--watch")
    assert done.code == 0
    assert done.out.splitlines() == [
        "island-1.part_present = false",
        "island-1.speed = 0 (bad)",
        "island-1.speed = 7",
        "island-1.part_present = true",
    ]
    assert asked[0] == ("live", {"device": ["island-1"], "overview": "false"})


def test_all_changes_are_followed_as_json_lines(pnfarm, world, monkeypatch):
    asked = watched(monkeypatch, world, [lambda: world.signals.set({"pressure": 1.5})])
    lines = [json.loads(line) for line in pnfarm("io", "--watch", "--format", "json").out.splitlines()]
    assert [line["name"] for line in lines] == [*world.signals.names, "pressure"]
    assert lines[-1].items() >= {"device": "island-1", "value": 1.5, "unit": "bar", "place": "3.1.0"}.items()
    assert asked[0][1]["device"] == ["all"]


def test_signals_are_followed_also_where_the_farm_has_no_stream_to_give(pnfarm, world, monkeypatch):
    changes = [lambda: world.signals.set({"pressure": 1}), lambda: world.signals.set({"pressure": 2})]
    broken = httpx.ReadTimeout("silent"), httpx.ConnectError("refused")
    watched(monkeypatch, world, *broken, sleep=lambda _: changes.pop(0)())
    done = pnfarm("io", "island-1.pressure", "--watch")
    assert done.out.splitlines() == [f"island-1.pressure = {n} bar" for n in (0, 1, 2)]


def test_following_ends_with_the_farm(pnfarm, world, monkeypatch):
    def gone(*_: Any, **__: Any) -> None:
        raise httpx.ConnectError("refused")

    watched(monkeypatch, world, [], sleep=lambda _: monkeypatch.setattr(Farm, "request", gone))
    done = pnfarm("io", "island-1.pressure", "--watch")
    assert (done.code, "no farm answers" in done.err) == (4, True)


def test_a_farm_without_devices_says_so(pnfarm, world, monkeypatch):
    stations = [station for station in world.line.farm.stations if station.axes]
    monkeypatch.setattr(world.line.farm, "stations", stations)
    rest = "the farm has no devices and no plant; `pnfarm io DRIVE` lists the signals of a drive\n"
    assert pnfarm("io").out == rest


def test_signals_of_a_drive_are_read_by_the_names_of_conditions(pnfarm, world):
    axis = world.line.farm.axes[0].handle.axis
    axis.ramp.setpoint = 300.25
    axis.profidrive.stw1 = 0x047F
    done = pnfarm("io", "axis-01.setpoint", "axis-01.stw1", "axis-01.stw1.on", "island-1.pressure")
    assert (done.code, done.err) == (0, "")
    assert done.out.splitlines() == [
        "axis-01.setpoint = 300.25 rpm", "axis-01.stw1 = 0x047F", "axis-01.stw1.on = true", "island-1.pressure = 0 bar",
    ]  # fmt: skip
    rows = [line.split() for line in pnfarm("io", "axis-01").out.splitlines()]
    assert ["axis-01", "setpoint", "number", "300.25", "rpm", "drive"] in rows
    found = json.loads(pnfarm("io", "axis-01.setpoint", "island-1.pressure", "--format", "json").out)
    (device,), (drive,) = found["devices"], found["drives"]
    assert (device["device"], drive["drive"], drive["signals"][0]["value"]) == ("island-1", "axis-01", 300.25)


def test_signals_of_a_drive_are_followed(pnfarm, world, monkeypatch):
    axis = world.line.farm.axes[0].handle.axis
    axis.ramp.setpoint = 1.0
    speeds = [1.0, 2.5]

    def later(_: float) -> None:
        if not speeds:
            raise KeyboardInterrupt
        axis.ramp.setpoint = speeds.pop(0)

    watched(monkeypatch, world, sleep=later)
    done = pnfarm("io", "axis-01.setpoint", "--watch")
    assert done.out.splitlines() == ["axis-01.setpoint = 1 rpm", "axis-01.setpoint = 2.5 rpm"]


@pytest.mark.usefixtures("world")
@pytest.mark.parametrize(
    ("typed", "words"),
    [
        ("isl", ["island-1"]),
        ("island-1.p", ["island-1.part_present", "island-1.pressure"]),
        ("axis-01.zsw1.fau", ["axis-01.zsw1.fault_present"]),
        ("x", []),
    ],
)
def test_names_are_completed(typed, words):
    context = typer.Context(typer.main.get_command(make_app()))
    assert [word for word, _ in complete_signal(context, typed)] == words
