"""``pnfarm.Farm`` in real time on a memory link, and a farm that is reached by its API."""

import asyncio
import concurrent.futures
import threading
import time
from contextlib import asynccontextmanager

import anyio
import pytest
from cell_file import CELL

import pnfarm
from pnfarm.api import serve_farm
from pnfarm.controller.beside import ControllerBeside
from pnfarm.errors import ConfigError, EnvironmentError_, PnfarmError
from pnfarm.farm.capture import CaptureSettings
from pnfarm.farm.farm import Farm as RealFarm
from pnfarm.farm.file.reading import parse_farm
from pnfarm.farm.memory_link import MOST_BEHIND_NS
from pnfarm.farm.wait import require_in_time
from pnfarm.faults import manager
from pnfarm.station.event_log import EventLog
from pnfarm.testing import Rig

FILE = """
farm: memory
link: {kind: memory}
api: 127.0.0.1:0
drives:
  - {name: "axis-{n:02}", count: 2, model: akd-profinet, ip: 10.77.0.11/24}
controller:
  ip: 10.77.0.1/24
  program: {kind: constant, speed_rpm: 60, acknowledge_after: 300ms}
"""
PROGRAM = """
import pnfarm

class Mine(pnfarm.AxisProgram):
    def cycle(self, inputs, outputs, now):
        self.seen = now
"""


@asynccontextmanager
async def served(text=FILE):
    """A farm as ``pnfarm up`` runs it; gives the API's address."""
    farm = RealFarm(parse_farm(text), log=EventLog(quiet=True))
    ControllerBeside(farm)
    async with farm, anyio.create_task_group() as tasks:
        host, port = await tasks.start(serve_farm, farm)
        yield f"http://{host}:{port}"
        tasks.cancel_scope.cancel()


@pytest.mark.parametrize(("took_ms", "is_late"), [(110, False), (130, True)])
def test_what_a_wait_sees_long_behind_its_time_was_not_in_time(took_ms, is_late):
    if is_late:
        with pytest.raises(pnfarm.NotInTime, match=r"the valve was seen after 0\.130 s, and not within 0\.1 s"):
            require_in_time("the valve", took_ms * 1e6, 100_000_000)
    else:
        assert require_in_time("the valve", took_ms * 1e6, 100_000_000) == pytest.approx(0.11)


def test_a_farm_in_memory_runs_in_real_time_with_its_controller_and_without_rights():
    async def work():
        async with pnfarm.Farm.from_text(FILE) as farm:
            await farm.wait_running(10)
            axis = farm.drive("axis-01")
            async with axis.fault("f702", count=1) as fault:
                await axis.wait_for("fault == 702", within=5)
            await axis.wait_for("state == S4 and fault == 0", within=5)
            assert fault.evidence.activations == 1
            # its clock never runs ahead of the machine's
            begun, farm_begun = time.monotonic(), farm.now
            await farm.run(0.2)
            assert 0.2 <= farm.now - farm_begun <= time.monotonic() - begun + 0.01
            async with farm.trace("axis-01", "velocity", length="50ms") as trace:
                assert len((await trace.complete(within=5)).time) == 51
            assert farm.controller("axis-01")["connects"] == 1
            return farm

    before = threading.enumerate()
    farm = asyncio.run(work())
    # nothing is left: the same farm can run again, and no thread of it does
    assert not [t.name for t in threading.enumerate() if t not in before and t.name.startswith("pnfarm")]
    with pytest.raises(ConfigError, match="use it inside `async with`"):
        farm.drive("axis-01")


def test_a_machine_that_stalls_makes_no_watchdog_expire_in_memory():
    async def work():
        async with pnfarm.Farm.from_text(FILE) as farm:
            await farm.wait_running(10)
            before = farm.now
            time.sleep(0.5)  # noqa: ASYNC251 - the stall is the test; the event loop itself stands still: the default watchdog has 48 ms
            assert farm.now - before <= MOST_BEHIND_NS / 1e9 + 0.05
            await farm.run(0.1)
            assert all(drive.connected and not drive.faults for drive in farm.drives)
            assert (await farm.metrics()).value("pnfarm_watchdog_expirations_total") == 0

    asyncio.run(work())


def test_a_cancellation_or_an_exception_ends_the_farm():
    async def work():
        with pytest.raises(TimeoutError):  # noqa: PT012 - a block is what is cancelled
            async with asyncio.timeout(0.3), pnfarm.Farm.from_text(FILE) as farm:
                await farm.fault("silence", on="axis-01")
                await farm.run(3600)
        with pytest.raises(ZeroDivisionError):
            async with pnfarm.Farm.from_text(FILE) as farm:
                raise ZeroDivisionError
        async with pnfarm.Farm.from_text(FILE) as farm:
            with pytest.raises(EnvironmentError_, match="memory"):
                await pnfarm.Farm.from_text(FILE).open()
            assert farm.drive("axis-01").name == "axis-01"

    asyncio.run(work())


def test_a_program_in_python_runs_in_the_farms_process(tmp_path):
    program = tmp_path / "mine.py"
    program.write_text(PROGRAM)
    text = FILE.replace("{kind: constant, speed_rpm: 60, acknowledge_after: 300ms}", f"{{python: {program}}}")

    async def work():
        async with pnfarm.Farm.from_text(text) as farm:
            await farm.wait_connected(10)
            await farm.wait_until(lambda: farm.controller("axis-01")["program"]["calls"] > 5, within=5)
            assert farm.program("axis-01").seen > 0

    asyncio.run(work())


@pytest.mark.parametrize(
    ("text", "make", "sentence"),
    [
        (FILE, pnfarm.Plc, "the controller runs in the farm's own process"),
        (
            FILE,
            lambda config: RealFarm(config, capture=CaptureSettings("x.pcapng")),
            "no interface to capture from: use a veth link",
        ),
    ],
)
def test_what_a_memory_link_cannot_do_is_said(text, make, sentence):
    with pytest.raises(ConfigError, match=sentence):
        make(parse_farm(text))


def test_a_controller_that_needs_an_interface_is_refused_before_anything_runs():
    text = FILE.replace("ip: 10.77.0.1/24", "interface: eth9")

    async def work():
        with pytest.raises(ConfigError, match=r"controller\.interface: is not reached from drives in memory"):
            await pnfarm.Farm.from_text(text).open()

    asyncio.run(work())


def test_a_running_farm_is_reached_by_its_api_with_the_same_names():
    async def work():
        async with served() as url, pnfarm.Farm.connect(url) as farm:
            await farm.wait_running(10)
            axis = farm.drive("axis-01")
            async with axis.fault("drive-fault", fault=702, count=1) as fault:
                await axis.wait_for("fault == 702", within=5)
            assert fault.state == "ended"
            assert fault.evidence.activations == 1
            assert fault.drives == ("axis-01",)
            await axis.wait_for("state == S4 and fault == 0", within=5)
            # as a test does for each of its drives
            await asyncio.gather(*(axis.wait_for("state == S4", within=5) for _ in range(8)))
            assert axis.state == "S4"
            assert axis.last_fault == 702
            assert axis.zsw1.operation_enabled
            assert axis.stw1.enable_operation
            assert await axis.parameter("DRV.OPMODE") == await axis.parameter(930)
            assert (await farm.metrics()).value("pnfarm_axis_faults_total", drive="axis-01") == 1
            names = [event.event async for event in farm.events("axis-01", follow=False)]
            assert "fault" in names
            for wrong, sentence in (
                (axis.wait_for("stat == S4", within=1), r"did you mean state\?"),
                (axis.fault("silense")._start(), r"did you mean silence\?"),
                (axis.wait_for("state == S1", within=0.05), r"state == S1 did not hold within 0\.05 s"),
            ):
                with pytest.raises(PnfarmError, match=sentence):
                    await wrong
            left = await axis.fault("not-ready")
            assert left.state == "active"
            other = pnfarm.Farm.connect(url)
            async with other:
                # what one client injects stays when another one leaves
                assert other.drive("axis-01").view["faults_injected"] == [left.id]
            assert (await axis.refresh()).view["faults_injected"] == [left.id]
            return url

        # and goes with its own: checked by the next client

    async def whole():
        async with served() as url:
            async with pnfarm.Farm.connect(url) as farm:
                await farm.fault("not-ready", on="all")
            async with pnfarm.Farm.connect(url) as farm:
                assert [drive.view["faults_injected"] for drive in farm.drives] == [[], []]

    asyncio.run(work())
    asyncio.run(whole())


def test_a_client_clears_its_faults_also_where_the_farm_has_forgotten_others_of_its(monkeypatch):
    monkeypatch.setattr(manager, "KEPT", 1)

    async def work():
        async with served() as url:
            async with pnfarm.Farm.connect(url) as farm:
                for _ in range(2):
                    short = await farm.fault("not-ready", on="axis-01", for_=0.01)
                    while (await short.refresh()).state != "ended":
                        await farm.run(0.01)
                await farm.fault("not-ready", on="axis-02")
            async with pnfarm.Farm.connect(url) as farm:
                assert [drive.view["faults_injected"] for drive in farm.drives] == [[], []]

    asyncio.run(work())


def test_no_farm_and_a_token_that_is_missing_are_told_in_one_sentence():
    async def work():
        with pytest.raises(
            EnvironmentError_, match=r"no farm answers at http://127\.0\.0\.1:9: .*, or give its address$"
        ):
            await pnfarm.Farm.connect("http://127.0.0.1:9").open()
        with pytest.raises(ConfigError, match="is not the address of a farm"):
            pnfarm.Farm.connect("ftp://x")
        async with served(FILE.replace("127.0.0.1:0", "{listen: '127.0.0.1:0', token: secret-secret-secret}")) as url:
            with pytest.raises(ConfigError, match="the farm needs its token"):
                await pnfarm.Farm.connect(url).open()
            async with pnfarm.Farm.connect(url, token="secret-secret-secret") as farm:
                assert len(farm.drives) == 2

    asyncio.run(work())


def test_a_rig_gives_plain_functions_and_ends_its_thread(tmp_path):
    file = tmp_path / "rig.pnfarm.yml"
    file.write_text(FILE)
    before = threading.enumerate()
    with Rig(file) as rig:
        rig.wait_running(10)
        axis = rig["axis-01"]
        with axis.inject("f702", count=1) as fault:
            axis.wait_for("fault == 702", within=5)
        assert fault.state == "ended"
        axis.wait_for("state == S4 and fault == 0", within=5)
        assert axis.last_fault == 702
        assert axis.fault is None
        assert axis.snapshot()["state"] == "S4"
        assert rig.wait_until(lambda: axis.velocity > 30, within=5) >= 0
        with pytest.raises(pnfarm.NotInTime, match=r"did not hold within 0\.01 s"):
            rig.wait_until(lambda: False, within=0.01)
        rig.inject("not-ready", on="axis-02")
        assert len(rig.reset()) == 1
        assert "fault" in {event.event for event in axis.events()}
    assert not [t.name for t in threading.enumerate() if t not in before and t.name.startswith("pnfarm")]
    rig.close()
    with pytest.raises(ConfigError, match="the rig is not running"):
        rig.run(1)


def test_signals_of_a_device_are_written_and_awaited_by_the_api():
    async def work():
        text = CELL.replace("drives:", "api: 127.0.0.1:0\ndrives:", 1)
        async with served(text) as url, pnfarm.Farm.connect(url) as farm:
            await farm.wait_connected(20)
            device = await farm.device("island-1").refresh()
            assert device.signals["part_present"] is False
            await device.write({"part_present": True, "pressure": 6.57})
            assert device.signals["part_present"] is True
            assert await device.wait_for("pressure", 6.57, within=1) < 1
            assert await device.wait_for("slot1_input_3", "on", within=1) < 1
            assert device.good("valve")
            with pytest.raises(ConfigError, match="valve: is an output: the controller alone writes it"):
                await device.write({"part_present": False, "valve": True})
            assert device.signals["part_present"] is True
            with pytest.raises(pnfarm.NotInTime, match=r"island-1\.valve = false"):
                await device.wait_for("valve", True, within=0.05)
            with pytest.raises(ConfigError, match="is not a signal, did you mean pressure"):
                await device.wait_for("presure", 1, within=1)
            with pytest.raises(ConfigError, match="there is no device 'island-2'"):
                farm.device("island-2")

    asyncio.run(work())


def test_a_rig_has_the_signals_of_its_devices(tmp_path):
    file = tmp_path / "cell.pnfarm.yml"
    file.write_text(CELL.replace("drives:", "api: off\ndrives:", 1))
    with Rig(file) as rig:
        rig.wait_connected()
        device = rig.device("island-1")
        device.signals["part_present"] = True
        assert device.signals["part_present"] is True
        assert device.wait_for("part_present", True, within=1) < 1
        assert [one.name for one in rig.devices if one.connected] == ["island-1"]
        with pytest.raises(ConfigError, match="the controller alone writes it"):
            device.signals.set({"valve": True})


def test_a_rig_whose_start_is_interrupted_cleans_up(monkeypatch, tmp_path):
    file = tmp_path / "line.pnfarm.yml"
    file.write_text(FILE)
    began, happened = threading.Event(), ["began"]

    async def opened(_farm):
        try:
            began.set()
            await anyio.sleep_forever()
        finally:
            with anyio.CancelScope(shield=True):
                # as the removal of interfaces
                await anyio.sleep(0.01)
            happened.append("cleaned up")

    whole = concurrent.futures.Future.result

    def interrupted(future, *timeout):
        if threading.current_thread() is not threading.main_thread() or len(happened) == 2:
            return whole(future, *timeout)
        began.wait(10)
        happened.append("interrupted")
        raise KeyboardInterrupt

    monkeypatch.setattr(pnfarm.Farm, "open", opened)
    monkeypatch.setattr(concurrent.futures.Future, "result", interrupted)
    rig = Rig(file)
    with pytest.raises(KeyboardInterrupt):
        rig.open()
    assert happened == ["began", "interrupted", "cleaned up"]
