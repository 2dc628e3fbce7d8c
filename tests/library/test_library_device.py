"""Devices and their signals in Python: asynchronous, blocking, and by a farm's API."""

import asyncio

import pytest
from cell_file import CELL
from device_world import DeviceWorld

import pnfarm
from pnfarm.errors import ConfigError
from pnfarm.library.remote_device import RemoteDevice
from pnfarm.testing import Line, NotInTime


@pytest.fixture(scope="module")
def running():
    """Runs coroutines with one farm that all of them share."""
    farm = pnfarm.Farm.from_text(CELL, virtual=True)
    with asyncio.Runner() as runner:
        runner.run(farm.open())
        runner.run(farm.wait_connected())
        yield lambda work: runner.run(work(farm))
        runner.run(farm.close())


def test_a_device_has_a_name_a_connection_and_signals(running):
    async def work(farm):
        (device,) = farm.devices
        assert device is farm.device("island-1")
        assert device.connected
        assert device.snapshot()["modules"][1]["name"] == "16DI"
        assert {"part_present", "slot1_input_0", "slot2_output_7"} <= set(device.signals)
        assert repr(device) == "<Device island-1, connected, 31 signals>"
        with pytest.raises(ConfigError, match="there is no device 'island-2', did you mean island-1"):
            farm.device("island-2")
        with pytest.raises(ConfigError, match="axis-01 is a drive"):
            farm.device("axis-01")

    running(work)


def test_an_input_is_written_by_assignment_and_reaches_the_controller(running):
    async def work(farm):
        device = farm.device("island-1")
        device.signals["part_present"] = True
        device.signals["pressure"] = 6.5
        await farm.run(0.1)
        assert device.signals["part_present"] is True
        assert device.signals["slot1_input_3"] is True
        assert device.signals["slot3_value_0"] == 650
        await device.write({"part_present": "off", "pressure": 0})
        assert (device.signals["part_present"], device.signals["pressure"]) == (False, 0)

    running(work)


def test_a_signal_is_traced_beside_a_drives_and_triggers(running):
    async def work(farm):
        signals = ["velocity", "island-1.pressure"]
        async with farm.trace("axis-01", signals, trigger="island-1.pressure > 6 bar", length="10ms") as trace:
            farm.device("island-1").signals["pressure"] = 6.5
            recording = await trace.complete(within=1)
        assert recording.triggered_by == "island-1"
        assert recording.at(0.01, "island-1.pressure") == recording.values("pressure")[0] == 6.5
        farm.device("island-1").signals["pressure"] = 0

    running(work)


def test_several_are_written_all_or_none(running):
    async def work(farm):
        signals = farm.device("island-1").signals
        with pytest.raises(ConfigError, match="valve: is an output: the controller alone writes it"):
            signals.set({"part_present": True, "valve": True})
        assert signals["part_present"] is False
        with pytest.raises(ConfigError, match="presure: is not a signal, did you mean pressure"):
            signals["presure"] = 1
        with pytest.raises(ConfigError, match="is not a signal"):
            signals["presure"]

    running(work)


def test_a_force_is_over_what_is_written(running):
    async def work(farm):
        device = farm.device("island-1")
        await device.write({"pressure": 1})
        assert await device.force({"pressure": "6.5"}) == {}
        assert (device.signals["pressure"], device.signals.owner("pressure")) == (6.5, "force")
        assert await device.write({"pressure": 2}) == {"pressure": "force"}
        async with farm.fault("signal-stuck", "island-1", signal="pressure", value=3):
            assert device.signals.owner("pressure") == "fault"
            assert await device.force({"pressure": 7}) == {"pressure": "fault"}
            assert device.signals["pressure"] == 3
        assert device.signals.forced == {"pressure": 7}
        await device.release("pressure")
        assert (device.signals["pressure"], device.signals.owner("pressure")) == (2, "value")

    running(work)


def test_a_wait_lets_time_pass_until_the_value_is_there(running):
    async def work(farm):
        device = farm.device("island-1")

        async def soon():
            await asyncio.sleep(0)
            device.signals["pressure"] = 12.34

        began = farm.now
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(soon())
            await device.wait_for("pressure", 12.34, within="5s")
        assert farm.now - began < 5
        assert await device.wait_for("pressure", lambda value: value > 12, within=1) == 0
        with pytest.raises(NotInTime, match=r"pressure did not become 1 within 0.05 s: island-1.pressure = 12.34 bar"):
            await device.wait_for("pressure", 1, within="50ms")
        with pytest.raises(ConfigError, match="'much' is not a number"):
            await device.wait_for("pressure", "much", within=1)

    running(work)


def test_a_line_in_memory_has_them_too():
    with Line.from_text(CELL) as line:
        line.wait_connected()
        device = line.device("island-1")
        device.signals.set({"part_present": True, "pressure": 1.5})
        assert device.signals["pressure"] == 1.5
        assert device.signals.good("valve")
        assert device.wait_for("part_present", "on", within=1) == 0
        assert [one.name for one in line.devices] == ["island-1"]
        with pytest.raises(NotInTime, match=r"valve did not become True within 0\.1 s: island-1\.valve = false"):
            device.wait_for("valve", True, within=0.1)


class Remote:
    """Asks the API of a farm in memory."""

    def __init__(self, world):
        self.client = self
        self.world = world

    async def ask(self, method, *path, **options):
        return await asyncio.to_thread(method, *path, **options)

    def get(self, *path):
        return self.world.get("/api/v1/" + "/".join(path)).json()

    def patch(self, *path, body, query):
        return self.world.request("PATCH", "/api/v1/" + "/".join(path), json=body, params=query).json()


def test_a_device_of_another_process_is_forced_and_released_by_the_api():
    farm = Remote(DeviceWorld())

    async def work():
        device = await RemoteDevice(farm, {"name": "island-1"}).refresh()
        assert await device.write({"pressure": 1}) == {}
        assert await device.force({"pressure": 2, "code": b"\1"}) == {}
        assert await device.write({"pressure": 3}) == {"pressure": "force"}
        assert (device.signals["pressure"], device.owner("pressure")) == (2, "force")
        await device.release("pressure")
        assert (device.signals["pressure"], device.owner("pressure"), device.owner("code")) == (3, "value", "force")
        await device.release()
        assert device.owner("code") == "default"

    asyncio.run(work())
