"""A farm that is killed while faults of a family are in force: interfaces, addresses, memory are whole afterwards."""

from __future__ import annotations

import contextlib
import json
import os
import random
import signal
import sqlite3
import time

import pytest
from forks import PROGRAM, run_fork
from interop_rig import ENVIRONMENT, running

from pnfarm.buses.registry import fault_kinds
from pnfarm.farm.memory.sqlite import FILE_NAME

DRIVES = [
    "{name: 'akd-{n}', count: 2, model: akd-profinet, ip: 10.77.1.1/22, limits: lax}",
    "{name: 'e1-{n}', count: 2, model: hiwin-e1, telegram: 3, ip: 10.77.1.11/22, limits: lax}",
]
#: A drive of no controller, whose name and address a tool sets permanently before the first kill.
SPARE = "{name: spare, model: akd-profinet, ip: 10.77.1.21/22, limits: lax}"
NAME, ADDRESS = "feeder-1", "10.77.1.99"
PLC = """
controller:
  name: plc
  ip: 10.77.3.250/22
  mac: 02:00:00:00:fa:01
  link: {kind: macvlan, parent: plc0}
  cycle: 16ms
  watchdog_factor: 10
  program: {kind: constant, speed_rpm: 60, acknowledge_after: 100ms}
  reconnect: {after: 100ms}
"""
pytestmark = pytest.mark.slow

FAMILIES = sorted({kind.family for kind in fault_kinds().values()})
NEEDED = {"drive-fault": {"fault": 702}, "drive-warning": {"warning": 107}, "digital-input": {"input": 0}}
#: Of the moments at which the farms are killed; another run uses another one and prints it.
SEED = int(os.environ.get("PNFARM_KILL_SEED", random.SystemRandom().randrange(1 << 32)))


class KilledError(Exception):
    """The farm was killed on purpose."""


def interfaces(lab) -> dict[str, tuple]:
    """Every interface of the farm's namespace: kind, MAC address, IP addresses, up or not."""
    shown = json.loads(lab.run("farm", "ip", "-json", "-details", "address", "show").stdout)
    return {
        found["ifname"]: (
            found.get("linkinfo", {}).get("info_kind"),
            found.get("address"),
            tuple(sorted(f"{a['local']}/{a['prefixlen']}" for a in found["addr_info"])),
            "UP" in found["flags"],
            found.get("promiscuity"),
        )
        for found in shown
    }


def memory(folder) -> dict[str, dict]:
    """The drives' memory as the file has it; the file must be whole."""
    with sqlite3.connect(f"file:{folder / FILE_NAME}?mode=ro", uri=True) as file:
        assert file.execute("PRAGMA integrity_check").fetchall() == [("ok",)]
        found: dict[str, dict] = {}
        for station, key, value in file.execute("SELECT station, key, value FROM memory"):
            found.setdefault(station, {})[key] = json.loads(value)
    file.close()
    return found


def kill_in_the_middle(worker, family: str, moment: random.Random) -> list[str]:
    """Put the kinds of a family on random drives, and kill the farm at some moment of it; what was asked for."""
    kinds = [kind for kind in fault_kinds().values() if kind.family == family]
    moment.shuffle(kinds)
    asked = []
    end = time.monotonic() + moment.uniform(0.0, 0.4)
    for kind in kinds:
        drive = moment.choice(["akd-1", "akd-2", "e1-1", "e1-2", "spare"])
        request = {"do": "inject", "kind": kind.name, "on": drive, "params": NEEDED.get(kind.name, {})}
        worker._process.stdin.write(json.dumps(request) + "\n")
        worker._process.stdin.flush()
        asked.append(f"{kind.name} on {drive}")
        if time.monotonic() > end:
            break
    time.sleep(max(0.0, end - time.monotonic()))
    worker._process.send_signal(signal.SIGKILL)
    assert worker._process.wait(10) == -signal.SIGKILL
    return asked


def down(lab, path) -> list[str]:
    done = run_fork(PROGRAM, "down", path, timeout=30, env=ENVIRONMENT, namespaces=lab._pids["farm"])
    assert done.returncode == 0, done.stderr
    return done.stdout.split()


@pytest.fixture(scope="module")
def rig(lab, tmp_path_factory):
    """A farm's folder, what was there before it, and its controller in the other namespace."""
    pytest.importorskip("pnio_dcp", reason="needs the package pnio-dcp")
    folder = tmp_path_factory.mktemp("killed")
    lab.run("farm", "ip", "address", "add", "10.77.3.1/22", "dev", "nic0")
    before = interfaces(lab)
    with running(lab, folder, [*DRIVES, SPARE], rest=f"state: {folder / 'state'}", name="killed") as worker:
        # a name and an address that are set permanently, as an engineering tool does
        mac = worker.ask("drive", name="spare")["mac"]
        suite = [ADDRESS, "255.255.252.0", "0.0.0.0"]
        verbs = [["set_name_of_station", mac, NAME, True], ["set_ip_address", mac, suite, True]]
        assert all(done["ok"] for done in lab.peer_json("peer_dcp.py", "pnio_dcp", json.dumps(verbs)))
    with running(lab, folder, DRIVES, rest=PLC, kind="plc", where="peer", name="killed") as plc:
        yield lab, folder, plc, before


@pytest.mark.parametrize("family", FAMILIES)
def test_a_farm_that_is_killed_in_the_middle_of_a_familys_faults_leaves_everything_whole(rig, family):
    lab, folder, plc, before = rig
    moment = random.Random(f"{SEED} {family}")
    print(f"PNFARM_KILL_SEED={SEED}")  # noqa: T201 - a failing test shows it
    state = f"state: {folder / 'state'}"
    with contextlib.suppress(KilledError), running(lab, folder, [*DRIVES, SPARE], rest=state, name="killed") as worker:
        drives = {drive["name"]: drive for drive in worker.ask("drives")}
        made = set(interfaces(lab)) - set(before)
        assert plc.ask("wait_connected", seconds=20), plc.ask("summary")
        asked = kill_in_the_middle(worker, family, moment)
        raise KilledError
    # what was there before is as it was, and what the farm made is its own
    left = interfaces(lab)
    assert {name: left[name][:4] for name in before} == {name: shown[:4] for name, shown in before.items()}, asked
    assert set(left) - set(before) <= made, asked
    kept = memory(folder / "state")
    assert (kept["spare"]["name"], kept["spare"]["ip"]) == (NAME, f"{ADDRESS}/22")
    if moment.random() < 0.5:
        down(lab, folder / "killed-farm.pnfarm.yml")
        assert interfaces(lab) == before
    # the next start: every drive with its own addresses and what its memory had
    with running(lab, folder, [*DRIVES, SPARE], rest=state, name="killed") as again:
        found = {drive["name"]: drive for drive in again.ask("drives")}
        for name, drive in drives.items():
            assert [found[name][key] for key in ("mac", "ip", "name")] == [drive[key] for key in ("mac", "ip", "name")]
        macs = {shown[1] for shown in interfaces(lab).values()}
        assert {drive["mac"] for drive in drives.values()} <= macs
        assert again.ask("injections") == []
        assert plc.ask("wait_connected", seconds=20), (asked, plc.ask("summary"))
    assert interfaces(lab) == before
