"""``pnfarm.Farm`` in virtual time, as Python code uses it."""

import asyncio

import pytest

import pnfarm
from pnfarm.errors import ConfigError, PnfarmError

FILE = """
farm: library
link: {kind: memory}
drives:
  - {name: "axis-{n:02}", count: 2, model: akd-profinet, ip: 10.77.0.11/24}
controller:
  ip: 10.77.0.1/24
  program: {kind: constant, speed_rpm: 60, acknowledge_after: 200ms}
"""
SCENARIO = """
scenario: trip
steps:
  - fault: {kind: f702, on: axis-01, as: trip}
  - expect: {drive: axis-01, that: fault == 702, within: 100ms, name: the drive trips}
  - clear: trip
  - expect: {drive: axis-01, that: "LAST", within: 2s, name: the last}
"""


@pytest.fixture(scope="module")
def running():
    """Runs coroutines with one farm that all of them share."""
    farm = pnfarm.Farm.from_text(FILE, virtual=True)
    with asyncio.Runner() as runner:
        runner.run(farm.open())
        runner.run(farm.wait_running())
        yield lambda work: runner.run(work(farm))
        runner.run(farm.close())


def test_a_fault_is_awaited_and_cleared(running):
    async def work(farm):
        axis = farm.drive("axis-01")
        fault = await axis.fault("f702")
        await axis.wait_for("fault == 702", within="100ms")
        assert axis.active_fault == 702
        assert axis.zsw1.fault_present
        assert (await axis.wait_for("state == S4 and fault == 0", within=5)) > 0.1
        await fault.clear()
        await fault.clear()
        assert fault.state == "ended"
        assert fault.evidence.activations == 1

    running(work)


def test_a_fault_ends_with_its_block_also_after_an_exception(running):
    async def work(farm):
        axis = farm.drive("axis-02")
        fault = axis.fault("silence")
        with pytest.raises(ConfigError, match="was not injected"):
            fault.state  # noqa: B018 - the access is the test
        with pytest.raises(ZeroDivisionError):  # noqa: PT012 - a block is what ends
            async with fault:
                await axis.wait_for("not connected", within=1)
                raise ZeroDivisionError
        assert fault.state == "ended"
        assert fault.evidence.confirmed
        await axis.wait_for("state == S4", within=10)

    running(work)


def test_a_fault_ends_with_its_block_after_a_cancellation(running):
    async def work(farm):
        fault = farm.fault("not-ready", on="axis-*")
        with pytest.raises(TimeoutError):
            async with asyncio.timeout(0), fault:
                await farm.run(3600)
        # cancelled before it began, or ended with its block
        assert not [i for i in farm.core.injections.list() if i.state.value != "ended"]
        await farm.wait_running()

    running(work)


def test_a_moment_counts_and_a_wait_in_vain_tells_the_values(running):
    async def work(farm):
        axis = farm.drive("axis-01")
        async with axis.fault("drive-fault", fault=702, count=1):
            assert await axis.wait_for("not zsw1.operation_enabled and fault == 702", within=1) < 0.1
        await axis.wait_for("state == S4", within=5)
        before = farm.now
        with pytest.raises(pnfarm.NotInTime, match=r"state == S1 did not hold within 0\.25 s: state = S4") as found:
            await axis.wait_for("state == S1", within=0.25)
        assert isinstance(found.value, AssertionError)
        assert isinstance(found.value, PnfarmError)
        assert found.value.exit_code == 1
        assert farm.now - before == pytest.approx(0.25)

    running(work)


def test_what_is_seen_too_late_was_not_in_time(running, monkeypatch):
    """As in a process that stands while it waits."""

    async def work(farm):
        await farm.wait_running()
        axis = farm.drive("axis-01")
        passing = axis._passing

        async def stood(holds, within_ns, *, polled):
            await type(passing).wait(passing, lambda: False, 500_000_000, polled=False)
            return holds()

        async with axis.fault("f702", count=1):
            monkeypatch.setattr(passing, "wait", stood)
            # acknowledged behind 200 ms
            with pytest.raises(pnfarm.NotInTime, match=r"state == S2 was seen after 0\.2\d\d s, and not within 0\.1 s"):
                await axis.wait_for("state == S2", within=0.1)
        monkeypatch.undo()
        await farm.wait_running()

    running(work)


@pytest.mark.parametrize(
    ("call", "sentence"),
    [
        (lambda farm: farm.drive("axis-01").wait_for("stat == S4", within=1), r"did you mean state\?"),
        (lambda farm: farm.drive("axis-01").wait_for("state == S4", within="1 fortnight"), "fortnight"),
        (lambda farm: farm.drive("axis-01").wait_for("state == S4", within=-1), r"within is -1: seconds from 0"),
        (lambda farm: farm.drive("axis-01").wait_for("state == S4", within=float("nan")), "seconds from 0"),
        (lambda farm: farm.drive("axis-01").fault("silense")._start(), r"did you mean silence\?"),
        (lambda farm: farm.fault("silence", on="axis-9")._start(), "axis-9"),
        (lambda farm: farm.fault("silence", probability=2)._start(), "probability"),
        (lambda farm: farm.fault("loss", params=[])._start(), "params"),
        (lambda farm: farm.drive("axis-01").parameter("NO.SUCH"), r"no parameter 'NO\.SUCH'"),
        (lambda farm: farm.run_scenario("/no/such.scenario.yml"), "cannot be read: no such file"),
    ],
)
def test_what_is_wrong_is_one_sentence(running, call, sentence):
    async def work(farm):
        with pytest.raises(PnfarmError, match=sentence):
            await call(farm)

    running(work)


def test_an_unknown_drive_and_a_farm_that_does_not_run(running):
    async def work(farm):
        with pytest.raises(ConfigError, match="no drive 'axis-9'"):
            farm.drive("axis-9")
        idle = pnfarm.Farm.from_text(FILE, virtual=True)
        with pytest.raises(ConfigError, match="use it inside `async with`"):
            idle.drive("axis-01")
        with pytest.raises(ConfigError, match="use it inside `async with`"):
            await idle.metrics()
        await idle.close()

    running(work)


def test_a_share_of_the_drives_and_a_time_to_live_are_fields_not_parameters(running):
    async def work(farm):
        async with farm.fault("not-ready", share="50%", seed=1, ttl=60, as_="half") as fault:
            assert len(fault.drives) == 1
            assert fault.id == "half"
        await farm.wait_running()

    running(work)


def test_parameters_power_and_reset(running):
    async def work(farm):
        axis = farm.drive("axis-02")
        assert await axis.parameter("DRV.OPMODE") == await axis.parameter(930)
        await axis.power_off()
        assert axis.state == "off"
        with pytest.raises(ConfigError, match="switched off"):
            await axis.parameter("DRV.OPMODE")
        await axis.power_on()
        assert axis.state != "S4"
        assert await farm.wait_running(30) > 0.1
        await axis.power_cycle()
        assert axis.state != "S4"
        assert await farm.wait_running(30) > 0.1
        fault = await farm.fault("silence", on="axis-01")
        assert await farm.reset() == [fault.id]
        await farm.wait_running(30)

    running(work)


def test_metrics_have_names_and_labels(running):
    async def work(farm):
        metrics = await farm.metrics()
        both = metrics.value("pnfarm_frames_sent_total")
        assert both > metrics.value("pnfarm_frames_sent_total", drive="axis-01") > 0
        assert "pnfarm_drive_info" in metrics
        with pytest.raises(ConfigError, match=r"did you mean pnfarm_frames_sent_total\?"):
            metrics.value("pnfarm_frame_sent_total")
        with pytest.raises(ConfigError, match="no series with drive"):
            metrics.value("pnfarm_frames_sent_total", drive="axis-9")

    running(work)


def test_events_are_iterated_and_go_on_while_they_are_awaited(running):
    async def work(farm):
        await farm.wait_running()
        before = [event.sequence async for event in farm.events(follow=False)][-1]
        async with farm.drive("axis-01").fault("f702", count=1), asyncio.timeout(60):
            async for event in farm.events("axis-01"):
                if event.event == "fault" and event.sequence > before:
                    break
            assert event.drive == "axis-01"
            assert event.data["number"] == 702
        kept = [event async for event in farm.events(follow=False)]
        assert [e.sequence for e in kept] == sorted(e.sequence for e in kept)
        assert {"axis-01", "axis-02"} <= {e.drive for e in kept}
        await farm.wait_running()

    running(work)


def test_a_trace_is_complete_in_virtual_time(running):
    async def work(farm):
        axis = farm.drive("axis-01")
        async with farm.trace("axis-01", ["velocity"], trigger="fault 702", pre="20ms", length="100ms") as trace:
            with pytest.raises(pnfarm.NotInTime, match=r"is waiting after 0\.1 s"):
                await trace.complete(within=0.1)
            async with axis.fault("f702", count=1):
                recording = await trace.complete(within=2)
        assert recording.time[0] == pytest.approx(-0.02)
        await farm.wait_running()

    running(work)


@pytest.mark.parametrize(("last", "verdict"), [("state == S4", "passed"), ("velocity > 5000", "failed")])
def test_a_scenario_gives_its_verdict(running, tmp_path, last, verdict):
    file = tmp_path / "trip.scenario.yml"
    file.write_text(SCENARIO.replace("LAST", last))

    async def work(farm):
        result = await farm.run_scenario(file)
        assert result.verdict == verdict
        assert [case["name"] for case in result.cases] == ["the drive trips", "the last"]
        if verdict == "passed":
            result.check()
        else:
            with pytest.raises(AssertionError, match=r"scenario trip failed: the last: failed"):
                result.check()
        result.write_junit(tmp_path / "trip.xml")
        result.write_html(tmp_path / "trip.html")
        assert "the drive trips" in (tmp_path / "trip.xml").read_text()
        assert "the drive trips" in (tmp_path / "trip.html").read_text()
        await farm.wait_running()

    running(work)


def test_signals_and_the_controller_are_seen(running):
    async def work(farm):
        axis = farm.drive("axis-01")
        await farm.run("1s")
        assert axis.setpoints.nsoll_a == pytest.approx(60, abs=1)
        assert axis.velocity == pytest.approx(60, abs=1)
        assert farm.controller("axis-01")["name"] == "axis-01"
        with pytest.raises(ConfigError, match="no program in Python"):
            farm.program("axis-01")
        with pytest.raises(ConfigError, match="no drive 'axis-9'"):
            farm.controller("axis-9")

    running(work)


def test_a_farm_that_does_not_run_any_more_has_no_drives():
    async def work():
        async with pnfarm.Farm.from_text(FILE, virtual=True) as farm:
            assert len(farm.drives) == 2
        assert (farm.drives, repr(farm)) == ([], "<Farm library: not running>")

    asyncio.run(work())
