"""``pnfarm up`` and ``pnfarm run`` on a memory link: in real time, in one process, without any privilege."""

from __future__ import annotations

import json
import re
import signal
from urllib.request import urlopen

import pytest
from waiting import until

FARM = """\
farm: memtest
link: {kind: memory}
api: 127.0.0.1:0
drives:
  - {name: "axis-{n:02}", count: 2, model: akd-profinet, ip: 10.77.0.11/24}
controller:
  ip: 10.77.0.1/24
  program: {kind: constant, speed_rpm: 60, acknowledge_after: 200ms}
"""
SCENARIO = """\
scenario: memory
farm: memtest.pnfarm.yml
steps:
  - wait: {until: all-connected, within: 10s}
  - expect: {drive: "axis-*", that: state == S4, within: 5s, name: runs}
  - fault: {kind: f702, on: axis-01, as: trip}
  - expect: {drive: axis-01, that: fault == 702, within: 1s, name: trips}
  - clear: trip
  - expect: {drive: axis-01, that: state == S4 and fault == 0, within: 5s, name: comes back}
"""


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "memtest.pnfarm.yml"
    path.write_text(FARM)
    return path


def fault_at(url: str, fault_id: str) -> dict:
    with urlopen(f"{url}/api/v1/faults/{fault_id}", timeout=20) as answer:
        return json.load(answer)


def test_a_held_fault_ends_with_its_client_whatever_ended_that(file, background):
    file.write_text(FARM.partition("controller:")[0])
    farm = background("--log-format", "json", "up", file)
    farm.wait_for('"event": "api listening"')
    url = re.search(r"http://127\.0\.0\.1:\d+", farm.err)[0]
    ends = {signal.SIGINT: "cleared", signal.SIGTERM: "cleared", signal.SIGKILL: "ttl"}
    for number, reason in ends.items():
        name = number.name.lower()
        fields = ("--on", "axis-01", "--hold", "--ttl", "2s", "--as", name, "--api", url)
        client = background("fault", "add", "load", *fields)
        client.wait_for(f"{name}: load active on axis-01")
        first = fault_at(url, name)["expires_seconds"]
        assert until(lambda name=name, first=first: fault_at(url, name)["expires_seconds"] > first), "renewed"
        code = client.stop(number)
        if reason == "cleared":
            # the command cleared it before it ended
            assert (code, client.out.splitlines()[-1]) == (0, f"{name}: ended")
        else:
            assert until(lambda name=name: fault_at(url, name)["state"] == "ended")
        fault = fault_at(url, name)
        assert (fault["state"], fault["drives"]["axis-01"]["reason"]) == ("ended", reason)
        if reason == "ttl":
            assert fault["drives"]["axis-01"]["ended_seconds"] >= fault["expires_seconds"]
    # who and when, in the log as well
    lines = [json.loads(line) for line in farm.err.splitlines() if line.startswith("{")]
    told = [line for line in lines if line["event"] in {"fault requested", "fault cleared by a client"}]
    assert [(line["event"], line["id"]) for line in told] == [
        ("fault requested", "sigint"), ("fault cleared by a client", "sigint"),
        ("fault requested", "sigterm"), ("fault cleared by a client", "sigterm"),
        ("fault requested", "sigkill"),
    ]  # fmt: skip
    assert {(line["who"], line["peer"], line["kind"]) for line in told} == {("loopback", "127.0.0.1", "load")}
    assert all(re.fullmatch(r"\d{4}-\d\d-\d\dT[\d:.]+Z", line["timestamp"]) for line in told)


def test_up_runs_drives_and_controller_and_serves_the_api(file, background, process):
    farm = background("--log-format", "console", "up", file)
    farm.wait_for("memtest: 2 drives on memory, API http://127.0.0.1:")
    url = re.search(r"API (http://127\.0\.0\.1:\d+)/", farm.out)[1]
    farm.wait_for("axis running")
    assert process("fault", "add", "f702", "--on", "axis-01", "--api", url).code == 0
    done = process("inspect", "--format", "json", "--api", url)
    drives = {row["name"]: row for row in json.loads(done.out)["drives"]}
    assert drives["axis-01"]["fault_counts"]["702"] == 1
    assert drives["axis-02"]["controller"]["name"] == "plc"


def test_run_without_virtual_time_starts_the_farm_of_the_scenario(file, process):
    scenario = file.with_name("memory.scenario.yml")
    scenario.write_text(SCENARIO)
    done = process("run", scenario, "--json", file.with_name("found.json"))
    assert done.code == 0, done.out + done.err
    found = json.loads(file.with_name("found.json").read_text())
    assert [(case["name"], case["verdict"]) for case in found["cases"]] == [
        ("runs", "passed"), ("trips", "passed"), ("comes back", "passed"),
    ]  # fmt: skip


def test_run_says_what_a_memory_link_lacks(file, pnfarm):
    scenario = file.with_name("memory.scenario.yml")
    scenario.write_text(SCENARIO)
    found = pnfarm("run", scenario, "--pcap", file.with_name("x.pcapng"))
    assert found.code == 2
    assert "no interface to capture from in real time: add --virtual" in found.err
    file.write_text(FARM.partition("controller:")[0])
    found = pnfarm("run", scenario)
    assert found.code == 2
    assert "add a `controller:` section" in found.err
