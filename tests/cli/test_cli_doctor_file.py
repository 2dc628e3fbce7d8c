"""``pnfarm doctor FILE``: what a farm file needs of this machine, and whether it is there."""

import json
import socket
from pathlib import Path

import pytest

from pnfarm.cli.farm_file import read
from pnfarm.cli.file_doctor import examine_file, judge, judge_cycles
from pnfarm.farm.load import Load, load_of

ROOT = Path(__file__).resolve().parents[2]


def farm(tmp_path, text, drives="[{name: a, model: akd-profinet, ip: 10.0.0.1/24}]"):
    file = tmp_path / "line.pnfarm.yml"
    file.write_text(f"farm: line\n{text}\ndrives: {drives}\n", "utf-8")
    return file


def findings(file):
    return {finding.name: finding for finding in examine_file(read(file))}


def test_a_farm_in_memory_needs_no_interface_and_no_budget(tmp_path):
    found = findings(farm(tmp_path, "link: {kind: memory}\napi: off"))
    assert found.keys() == {"link"}
    assert found["link"].ok


def test_a_state_folder_in_the_users_home_is_looked_for_there(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    found = findings(farm(tmp_path, "link: {kind: memory}\napi: off\nstate: ~/drives"))
    assert found["state"].detail == f"{tmp_path}/home/drives can be written"


def test_an_interface_that_does_not_exist_is_told_with_those_that_do(tmp_path, pnfarm):
    file = farm(tmp_path, "link: {kind: tap, bridge: nobridge0}\napi: off")
    done = pnfarm("doctor", file)
    assert done.code == 4
    assert "nobridge0 does not exist" in done.out
    assert f"that {file} needs" in done.out
    told = json.loads(pnfarm("doctor", file, "--format", "json").out)
    (bridge,) = (one for one in told["findings"] if one["name"] == "bridge")
    assert (told["ok"], bridge["ok"]) == (False, False)
    assert bridge["remedy"]


def test_the_address_of_the_api_must_be_free(tmp_path):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        file = farm(tmp_path, f"link: {{kind: memory}}\napi: 127.0.0.1:{port}")
        found = findings(file)["API"]
        assert found.ok is False
        assert f"127.0.0.1:{port}" in found.detail
    assert findings(file)["API"].ok


def test_a_folder_for_the_memory_of_the_drives_must_be_one(tmp_path):
    (tmp_path / "taken").write_text("", "ascii")
    assert findings(farm(tmp_path, "link: {kind: memory}\napi: off\nstate: ./new/folder"))["state"].ok
    found = findings(farm(tmp_path, "link: {kind: memory}\napi: off\nstate: ./taken/folder"))["state"]
    assert found.ok is False
    assert "cannot be written" in found.detail


def test_load_counts_frames_and_steps_at_the_cycles_of_the_drives_and_their_controllers(tmp_path):
    drives = (
        "[{name: 'a-{n}', count: 4, model: akd-profinet, ip: 10.0.0.1/24, cycle: 16ms}, "
        "{name: 'b-{n}', count: 10, model: hiwin-e1, ip: 10.0.0.11/24}, "
        "{name: 'c-{n}', count: 2, model: akd-ethernetip, ip: 10.0.0.31/24, rpi: 20ms}, "
        "{name: 'd-{n}', count: 3, model: moog-msd-dp, address: 5}]"
    )
    controller = "controller: {ip: 10.0.0.100/24, cycle: 2ms, ethernetip: {ip: 10.0.0.101/24}, profibus: {address: 1}}"
    load = load_of(read(farm(tmp_path, f"link: {{kind: memory}}\napi: off\n{controller}", drives)))
    # slaves on a line are polled and have no cyclic frames
    assert load.drives == 16
    assert load.frames == pytest.approx(2 * (4 / 0.016 + 10 / 0.002 + 2 / 0.02))
    assert load.steps == pytest.approx(4 / 0.004 + 10 / 0.00075 + 2 / 0.004)


@pytest.mark.parametrize(
    ("drives", "ok", "word"), [(16, True, "about"), (300, None, "little room"), (500, False, "too much")]
)
def test_the_budget_is_one_processor_and_leaves_room_for_storms(drives, ok, word):
    # a cycle of 1 ms; 1 us a frame and 0.4 us a step
    found = judge(Load(drives, drives * 2000.0, drives * 1333.0), 1000.0, 400.0, "")
    assert found.ok is ok
    assert word in found.detail
    assert bool(found.remedy) is (ok is not True)


def test_frames_that_are_all_due_at_once_must_fit_into_the_shortest_cycle(tmp_path):
    drives = (
        "[{name: 'a-{n}', count: 200, model: akd-profinet, ip: 10.0.0.1/16, cycle: 32ms},\n"
        "{name: b, model: hiwin-e1, ip: 10.0.1.1/16, cycle: 1ms}]"
    )
    config = read(farm(tmp_path, "link: {kind: memory}\napi: off", drives))
    load = load_of(config)
    (late,) = judge_cycles(config, load, 2500.0)
    assert (late.ok, late.line) == (None, 5)
    assert "201 stations are due at once, which takes 1 ms; the shortest cycle is 1 ms, of b" in late.detail
    assert "estimated" in late.detail
    (good,) = judge_cycles(config, load, 500.0)
    assert (good.ok, good.remedy) == (True, "")
    assert judge_cycles(config, load, None) == []


def test_a_budget_that_could_not_be_measured_says_why():
    found = judge(Load(1, 125.0, 250.0), None, 400.0, "no namespace")
    assert found.ok is None
    assert "no namespace" in found.detail


@pytest.mark.interop
def test_the_budget_of_a_farm_on_a_network_is_measured_on_this_machine(tmp_path):
    found = findings(farm(tmp_path, "link: {kind: veth}\napi: off"))["processor time"]
    if "not measured" in found.detail:
        pytest.skip(found.detail)
    assert found.ok
    assert "1 drive, 125 frames a second" in found.detail
    assert "us a frame" in found.detail
