"""A farm and a controller as a user runs them: processes in a private network namespace."""

from __future__ import annotations

import json
import os
import pty
import re
import shutil
import signal
import subprocess
import time
import urllib.request

import pytest
from forks import PROGRAM, Fork, clean_environment
from own_interfaces import own_interfaces
from waiting import until

from pnfarm.links.kernel.ownership import interface_prefix

FARM = """\
farm: clitest
link: {kind: veth}
api: 127.0.0.1:8702
drives:
  - name: axis-{n:02}
    count: 2
    model: akd-profinet
    ip: 10.77.0.11/24
controller:
  name: plc
  ip: 10.77.0.1/24
  cycle: 16ms
  watchdog_factor: 6
  program: {kind: sine, speed_rpm: 600, period: 4s, acknowledge_after: 200ms}
  reconnect: {after: 200ms}
"""
UP = "clitest: 2 drives on veth, API http://127.0.0.1:8702/"
SOLO_UP = "solo: 2 drives on veth, no API"
#: A command shows what is waited for in so many seconds, on a busy machine, too.
SHOWN_IN = 120.0


@pytest.fixture(scope="module")
def file(tmp_path_factory, network):
    path = tmp_path_factory.mktemp("file") / "clitest.pnfarm.yml"
    path.write_text(FARM)
    return path


@pytest.fixture(scope="module")
def farm(file, shared_background):
    """A farm that runs, for everybody who leaves it running."""
    started = shared_background("--log-format", "console", "up", file)
    started.wait_for(UP)
    return started


@pytest.fixture
def solo_file(tmp_path, network):
    """A farm of one's own, to be stopped and killed."""
    path = tmp_path / "solo.pnfarm.yml"
    path.write_text(FARM.replace("clitest", "solo").replace("127.0.0.1:8702", "off"))
    return path


@pytest.fixture
def solo(solo_file, background):
    started = background("--log-format", "console", "up", solo_file)
    started.wait_for(SOLO_UP)
    return started


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGHUP, signal.SIGQUIT])
def test_a_signal_stops_a_farm_and_leaves_no_interface(solo, network, number):
    assert len(own_interfaces(network)) == 5
    assert solo.stop(number) == 0
    assert own_interfaces(network) == []
    assert "Traceback" not in solo.err


def test_a_farm_and_its_controller_at_work(farm, file, process, background, tmp_path):
    plc = background("plc", file, "--seconds", "60", "--json", tmp_path / "plc.json")
    plc.wait_for('"connected"')

    def states() -> dict[str, str]:
        drives = json.loads(process("inspect", "--format", "json").out)["drives"]
        return {drive["name"]: drive["state"] for drive in drives}

    assert until(lambda: states() == {"axis-01": "S4", "axis-02": "S4"})
    line = process("inspect").out.splitlines()[1]
    assert line.split()[:5] == ["axis-01", "S4", "1", "DATA", "plc"]

    added = process("fault", "add", "f702", "--on", "axis-01", "--param", "hold=true", "--as", "trip")
    assert (added.code, added.out) == (0, "trip: f702 active on axis-01\n")
    (fault,) = json.loads(process("fault", "list", "--format", "json").out)["faults"]
    assert fault["id"] == "trip"
    assert "F702" in process("inspect", "axis-01").out
    assert states()["axis-01"] != "S4"
    assert process("fault", "clear", "trip").out == "cleared trip\n"
    assert until(lambda: states()["axis-01"] == "S4")

    assert process("param", "get", "axis-01", "930").out == "axis-01 930.0 Operating mode = 1\n"
    assert process("param", "set", "axis-01", "930", "-5").code == 2

    events = background("inspect", "axis-01", "--events")
    events.wait_for("fault injected")
    assert events.stop(signal.SIGINT) == 0
    assert "axis-02" not in events.out

    assert plc.stop(signal.SIGTERM) == 0
    summary = json.loads((tmp_path / "plc.json").read_text())
    assert summary["ok"] is True
    assert {drive["name"] for drive in summary["drives"]} == {"axis-01", "axis-02"}
    assert all(drive["frames_received"] > 0 for drive in summary["drives"])


def test_modules_of_a_running_farm_come_and_go_under_its_controllers_eyes(farm, file, process, background):
    plc = background("--log-format", "json", "plc", file, "--seconds", "120")
    plc.wait_for('"connected"')

    def drive_slot() -> dict:
        return json.loads(process("module", "list", "axis-02", "--format", "json").out)["modules"][1]

    assert until(lambda: {s["owner"] for s in drive_slot()["submodules"]} == {"plc"})
    assert "0x0002" in process("module", "list", "axis-02").out

    pulled = process("module", "pull", "axis-02", "1.2")
    assert pulled.code == 0, pulled.err
    assert [s["subslot"] for s in drive_slot()["submodules"]] == ["0x0001"]
    plc.wait_for("submodule pulled on slot 1 subslot 0x0002", 20)
    assert process("module", "pull", "axis-02", "1.2").code == 2
    assert process("module", "pull", "axis-02", "0").code == 2

    plugged = process("module", "plug", "axis-02", "1", "--module", "0x1234", "--format", "json")
    assert json.loads(plugged.out)["modules"][1]["module_ident"] == "0x00001234"
    plc.wait_for("wrong submodule plugged on slot 1 subslot 0x0001", 20)

    assert process("module", "plug", "axis-02", "1").code == 0
    assert (drive_slot()["telegram"], drive_slot()["held"]) == (1, False)
    plc.wait_for("submodule plugged on slot 1 subslot 0x0002", 20)

    added = process("fault", "add", "module-missing", "--on", "axis-02", "--param", "subslot=2", "--as", "gone")
    assert added.out == "gone: module-missing active on axis-02\n"
    assert drive_slot()["held"] is True

    def fault() -> dict:
        return json.loads(process("fault", "list", "gone", "--format", "json").out)["faults"][0]

    assert fault()["evidence"]["activations"] == 1
    assert process("fault", "clear", "gone").code == 0
    assert (drive_slot()["telegram"], drive_slot()["held"], len(drive_slot()["submodules"])) == (1, False, 2)
    assert plc.stop(signal.SIGTERM) == 0


def test_alarm_faults_on_a_running_farm_are_confirmed_by_the_controller(farm, file, process, background):
    plc = background("plc", file, "--seconds", "120")
    plc.wait_for('"connected"')

    def evidence(name: str) -> dict:
        (found,) = json.loads(process("fault", "list", name, "--format", "json").out)["faults"]
        return found["evidence"]

    def connected() -> bool:
        drives = json.loads(process("inspect", "--format", "json").out)["drives"]
        return all(drive["ar_state"] == "DATA" for drive in drives)

    assert until(connected)
    sick = ["diagnosis", "--param", "error=wire-break", "--param", "severity=maintenance-required", "--as", "sick"]
    assert process("fault", "add", *sick, "--on", "axis-01").code == 0
    assert process("fault", "add", "alarm-storm", "--on", "axis-01", "--count", "100", "--as", "storm").code == 0
    assert until(lambda: evidence("storm")["activations"] == 100)
    assert evidence("sick")["confirmed"]
    assert evidence("storm")["confirmed"]
    assert process("fault", "add", "rpc-delay", "--on", "axis-01", "--as", "slow", "-p", "delay=100ms").code == 0
    assert process("fault", "add", "watchdog-expire", "--on", "axis-01", "--as", "late").code == 0
    assert until(lambda: evidence("late")["confirmed"])
    assert until(lambda: connected() and evidence("slow")["activations"] >= 3)
    assert evidence("slow")["confirmed"]
    assert process("fault", "clear").code == 0
    assert plc.stop(signal.SIGTERM) == 0


def test_plc_ends_after_its_seconds_with_a_table(farm, file, process):
    found = process("plc", file, "--seconds", "2", "--format", "table")
    assert found.code == 0, found.err
    assert [line.split()[:2] for line in found.out.splitlines()[-2:]] == [["axis-01", "DATA"], ["axis-02", "DATA"]]


@pytest.fixture
def lonely(network):
    """An interface at whose other end is nobody."""
    network("link", "add", "plc0", "type", "veth", "peer", "name", "plc1")
    for end in ("plc0", "plc1"):
        network("link", "set", end, "up")
    yield "plc0"
    network("link", "del", "plc0")


MIXED = """\
farm: climixed
link: {kind: veth}
api: off
drives:
  - {name: pn-1, model: akd-profinet, ip: 10.78.0.11/24}
  - {name: eip-1, model: akd-ethernetip, ip: 10.78.0.12/24}
  - {name: pn-2, model: akd-profinet, ip: 10.78.0.13/24}
controller:
  ip: 10.78.0.1/24
  watchdog_factor: 60
  program: {kind: constant, speed_rpm: 60}
  ethernetip: {ip: 10.78.0.2/24, rpi: 20ms, timeout_multiplier: 64}
"""


def test_plc_runs_a_controller_for_each_bus_of_a_file(tmp_path, network, background, process):
    path = tmp_path / "climixed.pnfarm.yml"
    path.write_text(MIXED)
    background("--log-format", "console", "up", path).wait_for("climixed: 3 drives on veth, no API")
    outcome = process("plc", path, "--seconds", "8", "--format", "json", "--json", tmp_path / "mixed.json")
    assert outcome.code == 0, outcome.err
    found = json.loads((tmp_path / "mixed.json").read_text())
    assert found["controllers"] == [
        {"bus": "profinet", "name": "plc"}, {"bus": "ethernetip", "name": "plc-ethernetip"},
    ]  # fmt: skip
    rows = found["drives"]
    assert [(row["name"], row["bus"]) for row in rows] == [
        ("pn-1", "profinet"), ("eip-1", "ethernetip"), ("pn-2", "profinet"),
    ]  # fmt: skip
    assert all(row["connects"] for row in rows)
    assert interface_prefix("climixed plc") not in network("-br", "link")
    refused = process("plc", path, "--interface", "lo")
    assert refused.code == 2
    assert "controllers on PROFINET and EtherNet/IP, which cannot share one interface" in refused.err


def test_plc_fails_when_a_drive_never_answers(file, process, lonely):
    found = process("plc", file, "--interface", lonely, "--seconds", "1", "--format", "json")
    assert found.code == 1
    assert found.err.splitlines()[-1] == "pnfarm: 2 of 2 drives never exchanged data: axis-01 axis-02"
    assert json.loads(found.out)["ok"] is False


def test_a_controller_that_is_interrupted_has_not_failed(file, background, lonely):
    plc = background("--log-format", "console", "plc", file, "--interface", lonely, "--seconds", "60")
    plc.wait_for("plc: controller of 2 drives on plc0")
    assert plc.stop(signal.SIGINT) == 0


def test_a_second_up_says_that_the_farm_runs(farm, file, process):
    found = process("up", file)
    assert found.code == 4
    assert "farm clitest is already running (pid " in found.err
    assert process("down", file).code == 4
    assert process("inspect").code == 0


def test_a_taken_port_is_told_and_leaves_nothing(farm, file, tmp_path, process, network):
    other = tmp_path / "other.pnfarm.yml"
    other.write_text(FARM.replace("clitest", "other"))
    found = process("up", other)
    assert found.code == 4
    assert "127.0.0.1:8702" in found.err.splitlines()[-1]
    assert "farm started" not in found.err  # its drives never were on the wire
    assert own_interfaces(network, "other") == []


def test_down_removes_what_a_killed_farm_and_a_killed_controller_left(solo, solo_file, process, background, network):
    plc = background("plc", solo_file)
    plc.wait_for('"connected"')
    plc.stop(signal.SIGKILL)
    solo.stop(signal.SIGKILL)
    left = own_interfaces(network)
    assert len(left) == 7
    found = process("down", solo_file)
    assert found.code == 0
    assert sorted(found.out.splitlines()) == sorted(f"removed {name}" for name in left)
    assert own_interfaces(network) == []
    assert process("down", solo_file).out == "nothing left to remove of farm solo\n"


def test_up_clears_away_what_a_killed_run_left(solo, solo_file, background, network):
    solo.stop(signal.SIGKILL)
    assert len(own_interfaces(network)) == 5
    again = background("--log-format", "console", "up", solo_file)
    again.wait_for(SOLO_UP)
    assert len(own_interfaces(network)) == 5
    assert again.stop() == 0


def test_down_leaves_a_running_controller_its_own(solo, solo_file, process, background, network):
    plc = background("plc", solo_file)
    plc.wait_for('"connected"')
    solo.stop(signal.SIGKILL)
    assert process("down", solo_file).code == 0
    assert len(own_interfaces(network)) == 2
    assert plc.stop() == 0
    assert own_interfaces(network) == []


def test_logs_of_a_farm_nobody_watches_are_json_alone(solo_file, background):
    farm = background("up", solo_file)
    farm.wait_for("farm started")
    assert farm.stop() == 0
    assert farm.out == ""
    assert "farm started" in [json.loads(line)["event"] for line in farm.err.splitlines()]


def test_beyond_loopback_the_api_wants_the_token_that_the_log_tells(solo_file, background, process):
    farm = background("up", solo_file, PNFARM_UP_API="0.0.0.0:8703")
    farm.wait_for("api listening")
    (told,) = [entry for line in farm.err.splitlines() if (entry := json.loads(line))["event"] == "api listening"]
    refused = process("inspect", "--api", "127.0.0.1:8703")
    assert refused.code == 2
    assert "PNFARM_TOKEN" in refused.err
    assert process("inspect", "--api", "127.0.0.1:8703", PNFARM_TOKEN=told["token"]).code == 0
    assert farm.stop() == 0


def test_stopping_does_not_wait_for_somebody_who_watches(solo_file, background):
    farm = background("up", solo_file, "--api", "127.0.0.1:8704")
    farm.wait_for("api listening")
    events = background("inspect", "--events", "--api", "127.0.0.1:8704")
    events.wait_for("state changed")
    began = time.monotonic()
    assert farm.stop() == 0
    assert time.monotonic() - began < 10
    assert events.stop(0) == 0


def test_health_and_metrics_are_served(farm):
    with urllib.request.urlopen("http://127.0.0.1:8702/api/v1/readyz", timeout=10) as reply:
        assert json.load(reply)["ready"] is True
    with urllib.request.urlopen("http://127.0.0.1:8702/metrics", timeout=10) as reply:
        assert b"pnfarm_build_info" in reply.read()


def test_scan_finds_the_drives(farm, process, background, network):
    (bridge,) = [name for name in own_interfaces(network, "clitest") if name.endswith("-br")]
    network("link", "add", "scan0", "type", "veth", "peer", "name", "scan1")
    try:
        network("link", "set", "scan1", "master", bridge)
        for end in ("scan0", "scan1"):
            network("link", "set", end, "up")
        # LLDP is listened for as long as a neighbour may take: both at once
        drawn = background("scan", "--interface", "scan0", "--seconds", "1")
        found = process("scan", "--interface", "scan0", "--seconds", "1", "--format", "json")
        table = process("scan", "--interface", "scan0", "--seconds", "1", "--no-lldp")
        assert drawn.end() == 0
    finally:
        network("link", "del", "scan0")
    assert found.code == 0, found.err
    devices = json.loads(found.out)
    assert [(device["name"], device["ip"], device["roles"]) for device in devices] == [
        ("axis-01", "10.77.0.11", ["device"]),
        ("axis-02", "10.77.0.12", ["device"]),
    ]
    assert devices[0]["vendor_id"] == 0x0105
    assert table.out.splitlines()[1].split()[:2] == ["axis-01", "AKD"]
    # the farm's own bridge lets LLDP through
    assert [[(n["station"], n["port"], n["ip"]) for n in device["neighbours"]] for device in devices] == [
        [("axis-01", "port-001", "10.77.0.11")],
        [("axis-02", "port-001", "10.77.0.12")],
    ]
    assert all(device["answers_dcp"] for device in devices)
    assert "LLDP" not in table.out
    assert "scan0: 2 heard by LLDP" in drawn.out
    assert "├─ axis-01 port-001  " in drawn.out
    assert "└─ axis-02 port-001  " in drawn.out


def test_scan_of_a_wire_with_nobody_says_so(lonely, process):
    found = process("scan", "--interface", lonely, "--seconds", "0.3", "--no-lldp")
    assert (found.code, found.out) == (0, "plc0: no device answers to DCP\n")
    assert (
        json.loads(process("scan", "--interface", lonely, "--seconds", "0.3", "--no-lldp", "--format", "json").out)
        == []
    )


def test_scan_of_an_interface_that_is_not_there(network, process):
    found = process("scan", "--interface", "none0")
    assert found.code == 4
    assert "none0" in found.err


def test_without_privileges_scan_up_and_plc_say_what_is_missing_before_they_compile(
    solo_file, network, process, tmp_path
):
    if os.geteuid() != 0 or shutil.which("setpriv") is None:
        pytest.skip("needs root and setpriv (util-linux), to give privileges up")
    network("link", "add", "bare0", "type", "veth", "peer", "name", "bare1")
    network("link", "set", "bare0", "up")

    def without(*line: str) -> subprocess.CompletedProcess[str]:
        drop = ["setpriv", "--bounding-set=-all", "--inh-caps=-all", *process.command(*line)]
        empty = {**os.environ, "XDG_CACHE_HOME": str(tmp_path / "cache")}
        return subprocess.run(drop, check=False, capture_output=True, text=True, timeout=120, env=empty)

    try:
        scan, up = without("scan", "--interface", "bare0"), without("up", str(solo_file))
        plc = without("plc", str(solo_file), "--interface", "bare0")
    finally:
        network("link", "del", "bare0")
    assert (scan.returncode, up.returncode, plc.returncode) == (4, 4, 4)
    assert "CAP_NET_RAW" in scan.stderr
    assert up.stderr.startswith("pnfarm: farm solo lacks CAP_NET_ADMIN (it makes network interfaces) and CAP_NET_RAW")
    assert plc.stderr.startswith("pnfarm: controller plc lacks CAP_NET_RAW")
    assert "compiling" not in up.stderr + plc.stderr
    assert not list((tmp_path / "cache").rglob("*.nbi"))


def in_a_terminal(*arguments: str, wanted: str, number: int) -> tuple[int, str]:
    """Run a command in a terminal of 80 columns, and stop it with a signal once a line shows what is wanted.

    Its exit code and what the terminal showed, without control sequences.
    """
    terminal, inner = pty.openpty()
    environment = clean_environment(COLUMNS="80", LINES="24", TERM="xterm")
    process = Fork(PROGRAM, *arguments, env=environment, stdin=inner, stdout=inner, stderr=inner)
    os.close(inner)
    shown = b""
    end = time.monotonic() + SHOWN_IN
    os.set_blocking(terminal, False)
    sent = False
    while True:
        try:
            shown += os.read(terminal, 65536)
        except BlockingIOError:
            time.sleep(0.02)
        except OSError:  # the other end is closed
            break
        if not sent and (re.search(wanted, plain(shown), re.MULTILINE) or time.monotonic() > end):
            process.send_signal(number)
            sent = True
    os.close(terminal)
    return process.wait(SHOWN_IN), plain(shown)


def plain(shown: bytes) -> str:
    return re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", shown.decode(errors="replace"))


def test_in_a_terminal_the_controller_draws_a_table(farm, file):
    wanted = r"^axis-01 +DATA +running +16 ms +0 "
    code, shown = in_a_terminal("plc", str(file), wanted=wanted, number=signal.SIGINT)
    assert code == 0
    assert re.search(wanted, shown, re.MULTILINE), shown
    assert "Traceback" not in shown


def test_in_a_terminal_up_shows_its_drives(solo_file):
    wanted = r"^axis-02 +akd-profinet +02(:[0-9a-f]{2}){5} +10\.77\.0\.12/24"
    code, shown = in_a_terminal("up", str(solo_file), wanted=wanted, number=signal.SIGINT)
    assert code == 0
    assert re.search(wanted, shown, re.MULTILINE), shown


def test_a_signal_ends_the_first_compilation(solo_file, background, network, tmp_path):
    farm = background("up", solo_file, XDG_CACHE_HOME=str(tmp_path / "cache"))
    farm.wait_for("compiling the engine")
    began = time.monotonic()
    assert farm.stop() == 0
    assert time.monotonic() - began < 10
    assert own_interfaces(network) == []


def test_a_farm_whose_interfaces_are_taken_away_says_so_and_ends(solo, network):
    assert until(lambda: bool(own_interfaces(network)))
    network("link", "del", next(name for name in own_interfaces(network) if name[-1].isdigit()))
    assert solo.end() == 4
    assert "was removed under the running farm" in solo.err
    assert own_interfaces(network) == []
