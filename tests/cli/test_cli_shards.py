"""Shards on the command line, and several of them on one machine."""

import json
import signal
import urllib.request

import pytest
from own_interfaces import own_interfaces

IN_MEMORY = """\
farm: line-1
link: {kind: memory}
drives:
  - name: axis-{n:02}
    count: 5
    model: akd-profinet
    ip: 10.77.0.11/24
controller: {ip: 10.77.0.1/24, cycle: 16ms}
"""


def test_validate_names_the_drives_of_a_shard(tmp_path, pnfarm):
    file = tmp_path / "line-1.pnfarm.yml"
    file.write_text(IN_MEMORY)
    found = pnfarm("validate", file, "--shard", "2/2")
    assert (found.code, found.err) == (0, "")
    assert "shard 2/2: 2 of 5 drives: axis-02, axis-04\n" in found.out
    for words in (("validate", file), ("up", file), ("down", file), ("doctor", file)):
        refused = pnfarm(*words, "--shard", "3/2")
        assert refused.code == 2
        assert refused.err.splitlines()[-1].startswith("pnfarm: --shard: there is no shard 3/2")
    many = pnfarm("up", file, "--shard", "1/6")
    assert (many.code, many.err.count("\n")) == (2, 1)
    assert "6 shards are too many for farm line-1: at most 5" in many.err


def test_the_environment_names_the_shard(tmp_path, pnfarm, monkeypatch):
    file = tmp_path / "line-1.pnfarm.yml"
    file.write_text(IN_MEMORY)
    monkeypatch.setenv("PNFARM_UP_SHARD", "x")
    refused = pnfarm("up", file)
    assert refused.code == 2
    assert "PNFARM_UP_SHARD: 'x' is not a shard" in refused.err


ON_WIRE = """\
farm: shardtest
link: {kind: veth, bridge: shbr}
api: off
drives:
  - {name: "axis-{n}", count: 3, model: akd-profinet, ip: 10.77.0.11/24}
controller: {ip: 10.77.0.1/24, cycle: 16ms, watchdog_factor: 12, link: {kind: veth, bridge: shbr}}
"""


def interfaces(network, shard=""):
    return own_interfaces(network, f"shardtest {shard}" if shard else "shardtest")


@pytest.fixture
def file(tmp_path, network):
    network("link", "add", "shbr", "type", "bridge")
    network("link", "set", "shbr", "up")
    path = tmp_path / "shardtest.pnfarm.yml"
    path.write_text(ON_WIRE)
    yield path
    network("link", "del", "shbr")


def test_shards_run_beside_each_other_and_are_cleaned_up_apart(file, network, background, process):
    first = background("--log-format", "console", "up", file, "--shard", "1/2", "--api", "127.0.0.1:8702")
    second = background("--log-format", "console", "up", file, PNFARM_UP_SHARD="2/2")
    first.wait_for("shardtest, shard 1/2: 2 drives on veth shbr")
    second.wait_for("shardtest, shard 2/2: 1 drive on veth shbr")
    view = json.loads(process("inspect", "--format", "json").out)
    assert (view["shard"], [drive["name"] for drive in view["drives"]]) == (
        {"index": 1, "count": 2},
        ["axis-1", "axis-3"],
    )
    assert "shard 1/2 of farm shardtest\n" in process("inspect").out
    with urllib.request.urlopen("http://127.0.0.1:8702/metrics") as reply:
        assert b'pnfarm_shard_info{farm="shardtest",shard="1",shards="2"} 1' in reply.read()
    # the controller of the file runs the drives of both
    plc = process("plc", file, "--seconds", "4", "--format", "json")
    assert plc.code == 0, plc.err
    assert [row["name"] for row in json.loads(plc.out)["drives"]] == ["axis-1", "axis-2", "axis-3"]
    for words, text in (
        (("up", file), "of farm shardtest is already running"),
        (("up", file, "--shard", "1/2"), "shard 1/2 of farm shardtest is already running"),
        (("up", file, "--shard", "3/3"), "of farm shardtest is already running"),
    ):
        refused = process(*words)
        assert refused.code == 4
        assert text in refused.err
    assert second.stop(signal.SIGKILL) == -signal.SIGKILL
    left, running = interfaces(network, "2/2"), interfaces(network, "1/2")
    assert (len(left), len(running)) == (2, 4)
    assert process("down", file).out.splitlines() == [f"removed {name}" for name in sorted(left)]
    assert interfaces(network, "1/2") == running
    again = background("--log-format", "console", "up", file, "--shard", "2/2")
    again.wait_for("shardtest, shard 2/2: 1 drive")
    assert again.stop(signal.SIGKILL) == -signal.SIGKILL
    assert process("down", file, "--shard", "2/2").out.count("removed") == 2
    assert first.stop() == 0
    assert interfaces(network, "1/2") == []
