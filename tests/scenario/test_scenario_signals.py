"""Steps on signals of devices."""

import asyncio
import json

import httpx
import pytest
from api_world import BASE
from cell_file import CELL, DEVICES
from device_world import DeviceWorld
from plain_station import controller_sends

import pnfarm
from pnfarm.cli.commands.run import bound
from pnfarm.errors import ConfigError
from pnfarm.scenario.definition.file import load_scenario
from pnfarm.scenario.report.page import report_html
from pnfarm.scenario.virtual import run_virtual


@pytest.fixture(scope="module")
def farm():
    """A farm, and what runs a scenario of these steps on it."""
    farm = pnfarm.Farm.from_text(CELL, virtual=True)
    with asyncio.Runner() as runner:
        runner.run(farm.open())
        runner.run(farm.wait_connected())
        farm.runner = runner
        yield farm
        runner.run(farm.close())


@pytest.fixture
def carried_out(farm, tmp_path):
    def run(*steps):
        path = tmp_path / "signals.scenario.yml"
        path.write_text("scenario: signals\nsteps:\n" + "".join(f"  - {step}\n" for step in steps))
        return farm.runner.run(farm.run_scenario(path))

    return run


def test_signals_are_written_by_a_step(farm, carried_out):
    result = carried_out("set: {island-1.part_present: true, island-1.pressure: 6.5}", "wait: 10ms")
    assert result.passed
    signals = farm.device("island-1").signals
    assert (signals["part_present"], signals["pressure"]) == (True, 6.5)
    carried_out("repeat: {for: {bar: [1, 2.5]}, steps: [{set: {island-1.pressure: $bar}}]}")
    assert signals["pressure"] == 2.5


def test_a_device_that_loses_its_cable_is_not_connected_until_it_is_back(farm, carried_out):
    result = carried_out(
        "wait: {until: all-connected, within: 10s}",
        "fault: {kind: link-down, on: island-1, as: cable}",
        "expect: {that: not island-1.connected and island-1.powered, within: 1s}",
        "expect: {drive: axis-01, that: connected and not island-1.connected}",
        "clear: cable",
        "wait: {until: all-connected, within: 10s}",
        "expect: {that: island-1.connected}",
    )
    assert result.passed, result.record["cases"]


def test_a_farm_of_devices_alone_has_scenarios(tmp_path):
    (tmp_path / "cell.pnfarm.yml").write_text(
        "farm: cell\nlink: {kind: memory}\ncontroller: {ip: 10.77.0.1/23}\n" + DEVICES
    )
    path = tmp_path / "devices.scenario.yml"
    path.write_text(
        """scenario: devices
farm: cell.pnfarm.yml
steps:
  - wait: {until: all-connected, within: 10s}
  - set: {island-1.pressure: 2}
  - expect: {that: island-1.pressure == 2 and island-1.connected, for: 100ms}
"""
    )
    record, _ = asyncio.run(run_virtual(*bound(load_scenario(path)), traced=True))
    assert record["verdict"] == "passed", record["cases"]


def test_a_force_ends_with_its_release_or_with_the_scenario(farm, carried_out):
    result = carried_out(
        "set: {island-1.pressure: 1, island-1.part_present: false}",
        "force: {island-1.pressure: 6.5, island-1.part_present: true}",
        "set: {island-1.pressure: 2}",
        "expect: {that: island-1.pressure == 6.5}",
        "release: [island-1.pressure]",
        "expect: {that: island-1.pressure == 2 and island-1.part_present}",
        "release: island-1",
        "expect: {that: not island-1.part_present}",
        "force: {island-1.pressure: 9}",
    )
    assert result.passed, result.record["cases"]
    signals = farm.device("island-1").signals
    assert (signals["pressure"], signals.forced) == (2, {})
    told = [entry for entry in result.record["timeline"] if entry["what"] == "event"]
    assert [(entry["drive"], entry["text"]) for entry in told] == [("island-1", "pressure waits: a force has it")]
    assert "force island-1.pressure = 9" in {entry["text"] for entry in result.record["timeline"]}


@pytest.mark.parametrize(
    ("step", "sentence"),
    [
        ("set: {island-2.part_present: true}", "there is no device 'island-2', did you mean island-1?"),
        ("set: {island-1.part_presnt: true}", "island-1 has no signal 'part_presnt', did you mean part_present?"),
        ("set: {island-1.valve: true}", "is an output: the controller alone writes it"),
        ("set: {island-1.pressure: 1000}", "is outside of int16 scaled by 0.01; allowed: -327.68 to 327.67 bar"),
        ("set: {part_present: true}", "'part_present' is not a signal; allowed: STATION.SIGNAL"),
        ("set: {island-1.part_present: [1]}", "island-1.part_present is a list"),
        ("set: 1", "is 1; allowed: a mapping of signals to values"),
        ("force: {island-1.valve: true}", "is an output: the controller alone writes it"),
        ("force: {island-1.presure: 1}", "island-1 has no signal 'presure', did you mean pressure?"),
        ("release: [island-1.presure]", "island-1 has no signal 'presure', did you mean pressure?"),
        ("release: island-2", "there is no device 'island-2', did you mean island-1?"),
        ("release: {island-1: true}", "is a mapping; allowed: a list of STATION.SIGNAL"),
    ],
)
def test_a_step_that_cannot_be_is_reported_before_the_scenario_begins(farm, carried_out, step, sentence):
    before = dict(farm.device("island-1").signals)
    with pytest.raises(ConfigError) as caught:
        carried_out("set: {island-1.part_present: false}", step)
    assert sentence in str(caught.value)
    assert dict(farm.device("island-1").signals) == before


@pytest.mark.parametrize(("step", "field"), [("island-1.part_present: true", None), ("island-1.valve: 1", "valve")])
def test_a_scenario_with_a_farm_of_its_own_is_checked_before_the_farm_starts(tmp_path, step, field):
    (tmp_path / "cell.pnfarm.yml").write_text(CELL)
    path = tmp_path / "signals.scenario.yml"
    path.write_text(f"scenario: signals\nfarm: cell.pnfarm.yml\nsteps:\n  - set: {{{step}}}\n")
    scenario = load_scenario(path)
    if field is None:
        binding, _ = bound(scenario)
        assert "slot2_output_7" in binding.devices["island-1"]
        return
    with pytest.raises(ConfigError, match="is an output"):
        bound(scenario)


def test_an_expectation_about_a_device_shows_values_and_units(farm, carried_out):
    result = carried_out(
        "set: {island-1.part_present: true, island-1.pressure: 6.5}",
        "expect: {that: island-1.part_present and island-1.pressure == 6.5 bar and not island-1.valve}",
        "expect: {that: island-1.pressure > 7.25, within: 20ms, name: pressed}",
        "expect: {drive: axis-01, that: connected and island-1.pressure < 7 and island-1.part_present != false}",
    )
    good, bad, mixed = result.record["cases"]
    assert [case["verdict"] for case in (good, bad, mixed)] == ["passed", "failed", "passed"]
    assert bad["message"] == "not true within 20ms on island-1"
    assert bad["measured"] == "island-1: island-1.pressure = 6.5 bar"
    assert bad["drives"] == ["island-1"]
    assert good["values"] == {
        "island-1": {"island-1.part_present": True, "island-1.pressure": 6.5, "island-1.valve": False}
    }
    assert good["name"] == "island-1.part_present and island-1.pressure == 6.5 bar and not island-1.valve"
    assert mixed["shown"]["axis-01"]["island-1.pressure"] == "6.5 bar"


def test_a_wait_is_over_when_a_signal_has_its_value_and_a_fault_begins_then(farm, carried_out):
    result = carried_out(
        "set: {island-1.part_present: false, island-1.pressure: 0}",
        # the engine watches the state, the event loop the device
        "fault: {kind: silence, on: axis-01, when: state == S4 and island-1.pressure >= 2 and velocity > 0, as: quiet}",
        "fault: {kind: signal-stuck, on: island-1, params: {signal: slot1_input_0, value: true}, when: pressure > 2.5}",
        "expect: {drive: axis-01, that: connected, for: 300ms}",
        "parallel: [[{wait: 100ms}, {set: {island-1.pressure: 2}}], {wait: {until: island-1.pressure == 2}}]",
        "wait: 50ms",
        "expect: {that: not island-1.slot1_input_0}",
        "expect: {drive: axis-01, that: not connected, within: 5s}",
        "clear: quiet",
        "set: {island-1.pressure: 3}",
        "expect: {that: island-1.slot1_input_0, within: 10ms}",
        "wait: {until: state == S4, within: 20s}",
    )
    assert result.passed, result.record["cases"]
    began = {fault["kind"]: fault["began_seconds"] for fault in result.record["faults"]}
    assert 0.4 <= began["silence"] <= 0.402
    assert began["signal-stuck"] >= 0.45


@pytest.mark.parametrize(
    ("step", "sentence"),
    [
        ("expect: {that: island-1.part_presnt}", "has no signal 'part_presnt', did you mean part_present?"),
        ("expect: {that: iland-1.part_present}", "there is no device 'iland-1', did you mean island-1?"),
        ("wait: {until: connected and island-1.valv}", "has no signal 'valv', did you mean valve?"),
        ("expect: {drive: axis-01, that: island-2.valve}", "there is no device 'island-2', did you mean island-1?"),
        ("expect: {that: velocity > 3}", "drive: is missing"),
        ("expect: {that: island-1.valve and velocity > 3}", "drive: is missing"),
        ("expect: {that: island-1.pressure > 3 rpm}", "is not measured in rpm; allowed: a number in bar"),
        ("expect: {that: island-1.pressure == 3.005}", "is never 3.005, which is between two of its steps"),
        ("expect: {that: island-1.pressure == 500}", "is outside of int16 scaled by 0.01"),
        ("expect: {that: island-1.pressure}", "is no yes or no"),
        ("expect: {that: island-1.valve > false}", "has no order"),
        ("expect: {that: island-1.valve == 2}", "is never 2; allowed: 0, 1, true or false"),
        ("expect: {that: island-1.pressure - 3 == 0}", "'-' is too much here"),
        ("fault: {kind: f702, on: axis-01, when: island-1.valv}", "has no signal 'valv', did you mean valve?"),
        ("fault: {kind: signal-stuck, on: island-1, when: valv, params: {signal: valve}}", "did you mean valve?"),
        ("fault: {kind: signal-invert, on: island-1, params: {signal: part_presnt}}", "did you mean part_present?"),
        ("fault: {kind: signal-invert, on: island-1, params: {signal: true}}", "island-1 has no signal 'true'"),
        ("fault: {kind: signal-invert, on: iland-1, params: {signal: part_present}}", "did you mean island-1?"),
    ],
)
def test_what_is_wrong_about_a_device_is_reported_with_its_line(farm, carried_out, step, sentence):
    with pytest.raises(ConfigError) as caught:
        carried_out("wait: 1ms", step)
    assert sentence in str(caught.value)
    assert "signals.scenario.yml:4" in str(caught.value)


def test_a_step_replays_the_values_of_a_file_beside_the_scenario(farm, carried_out, tmp_path):
    (tmp_path / "pressure.csv").write_text("time,pressure\n0,1\n0.1,2.5\n")
    step = "fault: {{kind: signal-replay, on: island-1, params: {{signal: pressure, values: '@{}'}}}}"
    result = carried_out(
        step.format("pressure.csv"),
        "expect: {that: island-1.pressure == 1}",
        "expect: {that: island-1.pressure == 2.5, within: 101ms}",
    )
    assert result.passed, result.record["cases"]
    assert result.record["cases"][1]["held_after_seconds"]["island-1"] == pytest.approx(0.1)
    with pytest.raises(ConfigError, match=r"params\.values: .*presure\.csv cannot be read: no such file"):
        carried_out(step.format("presure.csv"))


def test_a_running_farm_carries_out_a_scenario_about_its_device():
    world = DeviceWorld()
    controller_sends(world.signals, b"\2\0\7")
    text = "scenario: s\nsteps: [expect: {that: island-1.valve_1 and island-1.speed == 7 and island-1.code == '00'}]\n"

    async def run():
        async with httpx.AsyncClient(transport=httpx.ASGITransport(world.app), base_url=f"{BASE}/api/v1") as client:
            refused = await client.post("scenarios", json={"text": text.replace("valve_1", "valve_2")})
            begun = (await client.post("scenarios", json={"text": text})).json()
            for _ in range(200):
                found = (await client.get(f"scenarios/{begun['id']}")).json()
                if found["state"] == "ended":
                    break
                await asyncio.sleep(0.01)
        world.context.close()
        return refused, found

    refused, found = asyncio.run(run())
    assert "did you mean valve_1?" in refused.text
    assert found["verdict"] == "passed"
    assert found["cases"][0]["shown"]["island-1"]["island-1.speed"] == "7"


def test_a_report_shows_the_signals_of_devices_that_steps_name(tmp_path):
    (tmp_path / "cell.pnfarm.yml").write_text(CELL)
    path = tmp_path / "signals.scenario.yml"
    path.write_text("""scenario: signals
farm: cell.pnfarm.yml
steps:
  - wait: {until: all-connected, within: 10s}
  - fault: {kind: signal-flicker, on: island-1, params: {signal: part_present, period: 100ms}, for: 400ms}
  - wait: 2s
  - set: {island-1.pressure: 2.5}
  - expect: {that: island-1.pressure > 6.5 bar, within: 100ms}
  - wait: 2s
  - expect: {drive: axis-01, that: velocity > 5000}
""")
    record, _ = asyncio.run(run_virtual(*bound(load_scenario(path)), traced=True))
    flicker, low, fast = record["traces"]
    assert (flicker["drives"], low["drives"], fast["drives"]) == (["island-1"], ["island-1"], ["axis-01"])
    (bit,) = [column for column in flicker["trace"]["columns"] if column["signal"] == "part_present"]
    assert set(bit["values"]) == {0, 1}
    (pressure,) = [column for column in low["trace"]["columns"] if column["signal"] == "pressure"]
    assert (set(pressure["values"]), pressure["unit"]) == ({0.0, 2.5}, "bar")


def test_a_real_that_is_no_number_fails_and_is_in_every_report(tmp_path):
    reals = DEVICES.replace("type: int16, unit: bar, scale: 0.01", "type: float32")
    assert reals != DEVICES
    (tmp_path / "cell.pnfarm.yml").write_text(
        "farm: cell\nlink: {kind: memory}\ncontroller: {ip: 10.77.0.1/23}\n" + reals
    )
    path = tmp_path / "devices.scenario.yml"
    path.write_text(
        """scenario: devices
farm: cell.pnfarm.yml
steps:
  - set: {island-1.pressure: .nan}
  - expect: {that: island-1.pressure < 2}
"""
    )
    record, _ = asyncio.run(run_virtual(*bound(load_scenario(path))))
    assert record["verdict"] == "failed"
    assert record["cases"][0]["values"] == {"island-1": {"island-1.pressure": "nan"}}
    json.dumps(record, allow_nan=False)
    assert "island-1.pressure = nan" in report_html(record)
