"""configs/systemd/pnfarm@.service under a systemd: a farm runs as it is, and what it has no use for is refused."""

import errno
import json

import pytest
from machine_code import copy_machine_code
from refused import PROBE
from systemd_boot import PROGRAM, PYTHON, ROOT, Boot, why_not

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
#: The probe in the farm's place.
PROBED = f"""\
Type=oneshot
Restart=no
ExecStart=
ExecStart={PYTHON}/bin/python3 -IS /etc/pnfarm/probe.py
StandardOutput=truncate:/run/probed
"""


@pytest.fixture(scope="module")
def boot(tmp_path_factory):
    made = Boot(tmp_path_factory.mktemp("boot"), UNIT)
    try:
        made.write("/opt/pnfarm/bin/pnfarm", f"{PROGRAM}from pnfarm.cli.main import run\nrun()\n", 0o755)
        # an interpreter may have its library where it was built, in a home
        made.write(
            "/etc/systemd/system/pnfarm@.service.d/python.conf",
            f"[Service]\nEnvironment=LD_LIBRARY_PATH={PYTHON}/lib\n",
        )
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
    scan = ["/opt/pnfarm/bin/pnfarm", "scan", "--interface", "wire", "--format", "json"]
    return {device["name"] for device in json.loads(boot.done("env", f"LD_LIBRARY_PATH={PYTHON}/lib", *scan))}


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


def probed(boot, service):
    """What the probe says as the only process of a service."""
    boot.done("systemctl", "daemon-reload")
    boot.done("systemctl", "start", service)
    return json.loads(boot.done("cat", "/run/probed"))


def test_the_service_refuses_what_a_farm_has_no_use_for(boot):
    boot.write("/etc/systemd/system/loose.service", f"[Service]\nUser=pnfarm\nStateDirectory=pnfarm\n{PROBED}")
    boot.write("/etc/systemd/system/pnfarm@tight.service.d/probe.conf", f"[Service]\n{PROBED}")
    # what the same program may do as the same user with nothing but that
    loose, tight = probed(boot, "loose.service"), probed(boot, "pnfarm@tight.service")
    for place in ("/", "/usr/local/bin"):
        assert (loose[f"write {place}"], tight[f"write {place}"]) == (errno.EACCES, errno.EROFS)
    for needed in ("write /tmp", "write /var/lib/pnfarm", "AF_PACKET", "AF_NETLINK", "AF_INET"):
        assert tight[needed] == 0
    assert loose["AF_PACKET"] == errno.EPERM
    assert {tight["AF_VSOCK"], tight["AF_ALG"]} == {errno.EAFNOSUPPORT}
    calls = {
        "bpf", "init_module", "io_uring_setup", "keyctl", "mknod", "mount", "perf_event_open", "personality", "ptrace",
        "setns", "setuid", "unshare",
    }  # fmt: skip
    assert {name for name in calls if tight[name] != errno.EPERM} == set()
    assert {name for name in calls if loose[name] != errno.EPERM} >= {"personality", "ptrace", "unshare"}
