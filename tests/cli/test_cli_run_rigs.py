"""``pnfarm run`` on each rig: in virtual time, with a farm of its own on a link, against a running farm."""

import json
import signal
import time
import xml.etree.ElementTree as ET

import pytest

from pnfarm.links.kernel.ownership import interface_prefix

FARM = """\
farm: rigtest
link: {kind: veth}
api: {listen: "127.0.0.1:8702", token: secret-of-the-rig}
drives:
  - name: axis-{n:02}
    count: 2
    model: akd-profinet
    ip: 10.77.0.11/24
    realism: 'off'
controller:
  name: plc
  ip: 10.77.0.1/24
  cycle: 16ms
  watchdog_factor: 60
  program: {kind: constant, speed_rpm: 600, acknowledge_after: 200ms}
  reconnect: {after: 200ms}
"""
#: The second drive does not trip: one expectation of four is wrong.
SAME = """\
scenario: same
budget: 10s
farm: rigtest.pnfarm.yml
steps:
  - wait: {until: state == S4, within: 120s}
  - fault: {kind: f702, on: axis-01, as: trip}
  - expect: {drive: axis-01, that: fault == 702, within: 2s, name: trips}
  - expect: {drive: axis-02, that: fault == 702, within: 100ms, name: the other too}
  - clear: trip
  - expect: {drive: axis-01, that: state == S4, within: 30s, name: comes back}
  - expect: {metric: 'pnfarm_axis_faults_total{drive="axis-01"}', increases: 0, for: 200ms, name: no more}
"""
LONG = """\
scenario: long
farm: rigtest.pnfarm.yml
steps:
  - wait: {until: state == S4, within: 120s}
  - expect: {drive: all, that: connected, name: first}
  - fault: {kind: drive-warning, on: axis-01, params: {warning: 107}, as: warned}
  - power: {off: axis-02}
  - wait: 1h
  - expect: {drive: axis-01, that: connected, name: never reached}
"""
VERDICTS = [("trips", "passed"), ("the other too", "failed"), ("comes back", "passed"), ("no more", "passed")]
TOKEN = {"PNFARM_TOKEN": "secret-of-the-rig"}
API = "http://127.0.0.1:8702"


@pytest.fixture(scope="module")
def folder(tmp_path_factory, network):
    found = tmp_path_factory.mktemp("rig")
    (found / "rigtest.pnfarm.yml").write_text(FARM)
    (found / "same.scenario.yml").write_text(SAME)
    (found / "long.scenario.yml").write_text(LONG)
    return found


@pytest.fixture
def farm(folder, background):
    """A running farm whose axes are in operation, and its controller."""
    up = background("--log-format", "console", "up", folder / "rigtest.pnfarm.yml")
    up.wait_for("rigtest: 2 drives on veth")
    plc = background("plc", folder / "rigtest.pnfarm.yml")
    plc.wait_for('"connected"')
    return up


def verdicts(path):
    record = json.loads(path.read_text())
    return record, [(case["name"], case["verdict"]) for case in record["cases"]]


def test_a_farm_that_the_run_starts_gives_the_verdict_of_virtual_time(folder, process, background, tmp_path):
    same, pcap = folder / "same.scenario.yml", tmp_path / "own.pcapng"
    own = background("run", same, "--json", tmp_path / "own.json", "--pcap", pcap)
    # its farm has made the bridge that the controller's file names
    own.wait_for("wait until")
    background("plc", folder / "rigtest.pnfarm.yml").wait_for('"connected"')
    assert own.end() == 1, own.err
    record, found = verdicts(tmp_path / "own.json")
    assert found == VERDICTS
    assert record["pcap_packets"] > 0
    assert record["lateness"]["farm_budget_seconds"] > 0
    assert record["traces"]
    # progress and results, not the farm's log
    assert own.err == ""
    virtual = process("run", same, "--virtual", "--json", tmp_path / "virtual.json")
    assert virtual.code == 1
    assert verdicts(tmp_path / "virtual.json")[1] == VERDICTS


def test_a_farm_that_is_late_makes_a_failure_inconclusive(folder, background, tmp_path):
    late = folder / "late.scenario.yml"
    late.write_text(
        "scenario: late\nfarm: rigtest.pnfarm.yml\nsteps:\n"
        "  - wait: {until: state == S4, within: 120s}\n"
        "  - wait: 100ms\n"
        "  - expect: {drive: all, that: connected, for: 1h, name: runs on}\n"
        "  - expect: {drive: all, that: connected, name: still}\n"
    )
    run = background("run", late, "--json", tmp_path / "late.json", "--junit", tmp_path / "late.xml")
    # its farm has made the bridge that the controller's file names
    run.wait_for("wait until")
    background("plc", folder / "rigtest.pnfarm.yml").wait_for('"connected"')
    run.wait_for("      wait 100ms")
    time.sleep(0.3)
    run.send(signal.SIGSTOP)
    time.sleep(2.0)  # the watchdog of the connection is 0.96 s
    run.send(signal.SIGCONT)
    assert run.end() == 3, run.err
    record, found = verdicts(tmp_path / "late.json")
    assert record["verdict"] == "inconclusive"
    # the second fails as well: the connection that the farm lost is not back
    assert found == [("runs on", "inconclusive"), ("still", "inconclusive")]
    assert "the farm was itself" in record["cases"][0]["message"]
    assert "engine" in record["cases"][0]["message"]
    assert record["cases"][0]["farm_late_seconds"] > 0.9
    (case, _) = ET.parse(tmp_path / "late.xml").getroot().iter("testcase")
    assert case.find("failure") is None
    assert case.find("skipped").get("message").startswith("inconclusive: true, but no longer after")


def test_ctrl_c_ends_a_run_in_order_and_writes_what_it_found(folder, background, network, tmp_path):
    files = [f"--{kind}={tmp_path / kind}" for kind in ("junit", "html", "json")]
    run = background("run", folder / "long.scenario.yml", *files)
    run.wait_for("wait until")
    background("plc", folder / "rigtest.pnfarm.yml").wait_for('"connected"')
    run.wait_for("      wait 3600s")
    assert run.stop(signal.SIGINT) == 3
    record, found = verdicts(tmp_path / "json")
    assert record["ended_early"] == "interrupted by SIGINT"
    assert found == [("first", "passed"), ("never reached", "not run")]
    assert record["faults"][0]["ended_seconds"] == pytest.approx(record["seconds"], abs=0.01)
    assert ("axis-02", "power on") in [(item.get("drive"), item["text"]) for item in record["timeline"]]
    assert "interrupted by SIGINT" in (tmp_path / "html").read_text()
    assert "not run: interrupted by SIGINT" in (tmp_path / "junit").read_text()
    assert "ended early: interrupted by SIGINT" in run.out
    prefix = interface_prefix("rigtest")
    assert prefix not in network("-o", "link", "show")


def test_a_running_farm_carries_a_scenario_out_until_its_client_or_itself_ends(
    folder, farm, background, process, tmp_path
):
    same, long = folder / "same.scenario.yml", folder / "long.scenario.yml"
    assert process("run", long, "--farm", API, "--token", "wrong").code == 2
    found = process("run", same, "--farm", API, "--json", tmp_path / "api.json", **TOKEN)
    assert found.code == 1, found.err
    assert verdicts(tmp_path / "api.json")[1] == VERDICTS
    assert "FAIL  the other too: not true within 100ms on axis-02" in found.out
    # the farm runs: a run cannot start it
    found = process("run", same)
    assert found.code == 4
    assert "already running" in found.err

    run = background("run", long, "--farm", API, "--json", tmp_path / "json", **TOKEN)
    farm.wait_for("id=warned")
    assert run.stop(signal.SIGINT) == 3
    record, _ = verdicts(tmp_path / "json")
    assert record["ended_early"] == "interrupted by SIGINT"
    assert record["verdict"] == "inconclusive"
    assert json.loads(process("fault", "list", "--format", "json", **TOKEN).out) == {"faults": []}
    assert json.loads(process("inspect", "axis-02", "--format", "json", **TOKEN).out)["state"] != "off"

    run = background("run", long, "--farm", API, "--json", tmp_path / "json", **TOKEN)
    run.wait_for("PASS  first")
    farm.stop(signal.SIGKILL)
    assert run.end() == 4
    record, cases = verdicts(tmp_path / "json")
    assert cases == [("first", "passed"), ("never reached", "not run")]
    assert record["verdict"] == "error"
    assert "the farm was lost" in record["ended_early"]
    assert process("down", folder / "rigtest.pnfarm.yml").code == 0
    # unreachable from the start
    found = process("run", long, "--farm", API)
    assert found.code == 4
    assert "no farm answers" in found.err
