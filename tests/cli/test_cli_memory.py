"""``pnfarm up`` and ``pnfarm run`` on a memory link: in real time, in one process, without any privilege."""

from __future__ import annotations

import json
import re

import pytest

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
