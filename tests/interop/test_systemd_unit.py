"""configs/systemd/pnfarm@.service under a systemd: a farm runs as it is, and what it has no use for is refused."""

from __future__ import annotations

import errno
import json
import sys
from pathlib import Path

import pytest
from machine_code import copy_machine_code
from refused import PROBE
from systemd_boot import CHECKOUT, PROGRAM, PYTHON, ROOT, Boot, why_not

pytestmark = [pytest.mark.interop, pytest.mark.skipif(bool(why_not()), reason=why_not())]
UNIT = ROOT / "configs" / "systemd" / "pnfarm@.service"
USER = 8702
FARM = """\
farm: service
link: {kind: macvlan, parent: card}
state: /var/lib/pnfarm
drives:
  - {name: "axis-{n}", count: 2, model: akd-profinet, ip: 10.77.0.11/24}
"""
#: The probe in the farm's place, with the unit's settings and without them.
PROBED = "[Service]\nType=oneshot\nRestart=no\nExecStart=\nExecStart={python} -IS /etc/pnfarm/probe.py\nStandardOutput=file:/run/{name}\n"
LOOSE = f"[Service]\nUser=pnfarm\nStateDirectory=pnfarm\n{PROBED}"


@pytest.fixture(scope="module")
def boot(tmp_path_factory):
    made = Boot(tmp_path_factory.mktemp("boot"), UNIT)
    try:
        made.write("/opt/pnfarm/bin/pnfarm", f"{PROGRAM}from pnfarm.cli.main import run\nrun()\n", 0o755)
        made.write("/etc/pnfarm/line.pnfarm.yml", FARM)
        made.write("/etc/pnfarm/probe.py", PROBE)
        yield made
    finally:
        made.close()


@pytest.fixture(scope="module")
def farm(boot, tmp_path_factory):
    """The service of a farm of two drives, on a card whose wire is ``wire``."""
    code = tmp_path_factory.mktemp("code")
    copy_machine_code(code)
    boot.copy(code, "/var/cache/pnfarm/pnfarm/code", USER)
    boot.done("ip", "link", "add", "card", "type", "veth", "peer", "name", "wire")
    for name in ("card", "wire"):
        boot.done("ip", "link", "set", name, "up")
    boot.done("systemctl", "start", "pnfarm@line")
    yield boot
    boot.done("systemctl", "stop", "pnfarm@line")
    assert boot.done("systemctl", "show", "-P", "Result", "pnfarm@line").strip() == "success"


def names_on_the_wire(boot):
    scan = [sys.executable, "-m", "pnfarm.cli.main", "scan", "--interface", "wire", "--format", "json"]
    return {device["name"] for device in json.loads(boot.done("env", f"PYTHONPATH={ROOT}", *scan))}


def test_a_farm_runs_as_a_service_of_its_own_user(farm):
    farm.eventually(lambda: names_on_the_wire(farm) == {"axis-1", "axis-2"})
    pid = farm.done("systemctl", "show", "-P", "MainPID", "pnfarm@line").strip()
    status = farm.done("cat", f"/proc/{pid}/status")
    lines = dict(line.split(":\t", 1) for line in status.splitlines() if ":\t" in line)
    assert lines["Uid"].split() == [str(USER)] * 4
    assert {int(lines[kind], 16) for kind in ("CapEff", "CapPrm", "CapBnd", "CapAmb")} == {1 << 12 | 1 << 13}
    assert (lines["NoNewPrivs"], lines["Seccomp"]) == ("1", "2")
    # a service's files are nobody else's
    assert farm.done("stat", "-c", "%a %u", "/var/lib/pnfarm").split() == ["750", str(USER)]


def probed(boot, name, unit):
    boot.write(
        f"/etc/systemd/system/{unit}",
        (LOOSE if name == "loose" else PROBED).format(python=f"{PYTHON}/bin/python3", name=name),
    )
    boot.done("systemctl", "daemon-reload")
    run = boot.run("systemctl", "start", f"pnfarm@{name}" if name != "loose" else unit)
    assert run.returncode == 0, run.stderr + boot.done("tail", "-n", "20", "/run/log")
    return json.loads(boot.done("cat", f"/run/{name}"))


def test_the_service_refuses_what_a_farm_has_no_use_for(boot):
    loose = probed(boot, "loose", "loose.service")
    tight = probed(boot, "tight", "pnfarm@tight.service.d/probe.conf")
    for place in ("/", "/usr/local/bin"):
        assert tight.pop(f"write {place}") == errno.EROFS
    assert tight == loose, CHECKOUT
