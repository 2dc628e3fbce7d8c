"""A third of the library on veth in real time: one farm, one controller, each scenario at drives of its own."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

LIBRARY = Path(__file__).resolve().parents[2] / "configs" / "scenarios"
FARM = """\
farm: libtest
link: {kind: veth}
api: 127.0.0.1:0
drives:
  - {name: "axis-{n:02}", count: 5, model: akd-profinet, ip: 10.77.0.11/24, params: {DRV.OPMODE: 1}}
controller:
  name: plc
  ip: 10.77.0.1/24
  cycle: 16ms
  watchdog_factor: 12
  program: {kind: constant, speed_rpm: 600, acknowledge_after: 200ms}
  reconnect: {after: 200ms}
"""
#: What these break, they break at one drive; the first drive shows that others run on.
BESIDE = {"cable-flap": "axis-02", "wrong-module": "axis-03", "slow-application-ready": "axis-04"}
#: How often a run is repeated that this machine made inconclusive.
TRIES = 3


@pytest.fixture(scope="module")
def line(network, shared_background, tmp_path_factory):
    """Starts a scenario of the library against a running farm whose axes are in operation."""
    folder = tmp_path_factory.mktemp("library")
    file = folder / "libtest.pnfarm.yml"
    file.write_text(FARM)
    farm = shared_background("--log-format", "json", "up", file)
    farm.wait_for('"event": "api listening"')
    (listening,) = [line for line in farm.err.splitlines() if '"api listening"' in line]
    shared_background("plc", file).wait_for('"connected"')

    def start(name: str, axis: str):
        options = ("--set", f"axis={axis}", *(("--set", "others=axis-01") if "others" in text(name) else ()))
        scenario, record = LIBRARY / f"{name}.scenario.yml", folder / f"{name}.json"
        url = json.loads(listening)["url"]
        return shared_background("run", scenario, "--farm", url, "--json", record, *options), record

    return start


def text(name: str) -> str:
    return (LIBRARY / f"{name}.scenario.yml").read_text()


def passes(line, chosen: dict[str, str]) -> None:
    """All at once; what the machine made inconclusive again."""
    for _ in range(TRIES):
        runs = {name: line(name, axis) for name, axis in chosen.items()}
        codes = {name: run.end() for name, (run, _) in runs.items()}
        for name, (run, record) in runs.items():
            assert codes[name] in {0, 3}, run.out + run.err
            found = json.loads(record.read_text())
            assert found["verdict"] == ("passed" if codes[name] == 0 else "inconclusive")
            assert [case["name"] for case in found["cases"]]
            if codes[name] == 0:
                assert {case["verdict"] for case in found["cases"]} == {"passed"}
                assert all(fault["evidence"] != "contradicted" for fault in found["faults"])
        chosen = {name: axis for name, axis in chosen.items() if codes[name] == 3}
        if not chosen:
            return
    pytest.fail(f"inconclusive {TRIES} times: {', '.join(chosen)}")


def test_a_loose_plug_a_wrong_module_and_a_slow_drive_at_once(line):
    passes(line, BESIDE)


def test_a_lost_fieldbus_in_a_line_that_runs(line):
    passes(line, {"f702-recovery": "axis-05"})
