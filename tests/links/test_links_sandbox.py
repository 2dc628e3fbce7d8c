"""A private namespace as root and as an ordinary user; each try in a process of its own."""

import json
import os
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

from pnfarm.farm.doctor.machine import Finding, examine
from pnfarm.links.kernel.probe import TRIALS

ROOT = Path(__file__).resolve().parents[2]
NOBODY = 65534

# Everything is used once while still root: the interpreter may lie where an ordinary user cannot read.
AS_NOBODY = f"""
    import asyncio, ctypes, os
    from pnfarm.links.kernel import probe, sandbox
    libc = ctypes.CDLL(None)
    if os.geteuid() == 0:
        libc.unshare(0x40000000)  # a rehearsal in a namespace of its own loads every module
        for trial in (probe._veth, probe._macvlan, probe._packet_socket):
            trial()
        os.setgroups([])
        os.setresgid({NOBODY}, {NOBODY}, {NOBODY})
        os.setresuid({NOBODY}, {NOBODY}, {NOBODY})
        libc.prctl(4, 1, 0, 0, 0)  # PR_SET_DUMPABLE: an ordinary user owns its /proc/self
"""


def has_root():
    status = Path("/proc/self/status").read_text()
    effective = int(status.split("CapEff:")[1].split()[0], 16)
    return os.geteuid() == 0 and bool(effective >> 21 & 1)  # CAP_SYS_ADMIN


needs_root = pytest.mark.skipif(not has_root(), reason="needs root with its capabilities")


def can_become_a_user():
    """True for an ordinary user, and for a root who may put on the shoes of one."""
    if os.geteuid() != 0:
        return True
    return has_root() and Path("/proc/self/setgroups").read_text() == "allow\n"


needs_a_user = pytest.mark.skipif(not can_become_a_user(), reason="this root cannot become an ordinary user")


def run(program):
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(program)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def skip_without_namespaces(result):
    if result["refused"]:
        pytest.skip(f"this machine refuses: {result['refused']}")
    return result


ENTER = """
import json, os, socket
from pnfarm.errors import EnvironmentError_
from pnfarm.links.kernel.sandbox import enter_sandbox
try:
    box = enter_sandbox()
except EnvironmentError_ as exc:
    print(json.dumps({"refused": str(exc)}))
else:
    lo = socket.create_server(("127.0.0.1", 0)).getsockname()[0]
    print(json.dumps({"refused": "", "kind": box.kind, "notes": box.notes, "uid": os.geteuid(), "lo": lo,
        "interfaces": [name for _, name in socket.if_nameindex()], "sys": os.listdir("/sys/class/net")}))
"""


@needs_root
def test_as_root_the_network_is_private_and_loopback_is_up():
    result = skip_without_namespaces(run(ENTER))
    assert result["kind"] == "root"
    assert "eth0" not in result["interfaces"]
    assert "lo" in result["interfaces"]
    assert result["lo"] == "127.0.0.1"
    if not result["notes"]:
        assert set(result["sys"]) == set(result["interfaces"])


@needs_a_user
def test_an_ordinary_user_is_root_inside_and_nothing_outside():
    result = skip_without_namespaces(run(textwrap.dedent(AS_NOBODY) + ENTER))
    assert result["kind"] == "user"
    assert result["uid"] == 0
    assert "eth0" not in result["interfaces"]
    assert result["lo"] == "127.0.0.1"


@needs_a_user
def test_an_ordinary_user_can_make_every_link_that_needs_no_device():
    results = run(textwrap.dedent(AS_NOBODY) + "\nimport json\nprint(json.dumps(probe.try_everything()))")
    if results["namespace"]:
        pytest.skip(f"this machine refuses: {results['namespace']}")
    assert set(results) == set(TRIALS)
    assert [results[name] for name in ("veth", "macvlan", "packet-socket")] == [None] * 3
    if not os.access("/dev/net/tun", os.F_OK) or Path("/dev/net/tun").stat().st_mode & 0o006 != 0o006:
        assert "/dev/net/tun" in results["tap"]
    if os.geteuid() == 0:
        assert results["scheduler"] == "Operation not permitted"


def test_a_sandbox_after_a_thread_is_refused():
    result = run("""
        import json, threading
        from pnfarm.errors import InternalError
        from pnfarm.links.kernel.sandbox import enter_sandbox
        threading.Thread(target=threading.Event().wait, daemon=True).start()
        try:
            enter_sandbox()
        except InternalError as exc:
            print(json.dumps(str(exc)), flush=True)
        import os; os._exit(0)
    """)
    assert "before threads start" in result


def test_the_sandbox_starts_no_thread_by_being_imported():
    assert (
        run("import json, os, pnfarm.links.kernel.sandbox; print(json.dumps(len(os.listdir('/proc/self/task'))))") == 1
    )


@needs_root
def test_without_rights_and_namespaces_the_refusal_says_what_would_help():
    # a namespace in which no further namespaces are allowed
    result = run("""
        import ctypes, json, os
        from pathlib import Path
        from pnfarm.errors import EnvironmentError_
        from pnfarm.links.kernel import sandbox
        libc = ctypes.CDLL(None)
        assert libc.unshare(0x10000000) == 0
        Path("/proc/self/uid_map").write_text("0 0 1")
        Path("/proc/sys/user/max_net_namespaces").write_text("0")
        try:
            sandbox.enter_sandbox()
        except EnvironmentError_ as exc:
            print(json.dumps(str(exc)))
    """)
    assert "max_net_namespaces" in result


# -- doctor


def test_every_refusal_of_the_doctor_comes_with_its_remedy():
    findings = examine()
    names = [finding.name for finding in findings]
    assert len(set(names)) == len(names)
    assert {"python", "numba", "CAP_NET_ADMIN", "CAP_NET_RAW", "macvlan", "veth", "tap", "real-time scheduling"} <= set(
        names
    )
    for finding in findings:
        assert isinstance(finding, Finding)
        assert finding.detail
        if finding.ok is False:
            assert finding.remedy
        if finding.ok:
            assert not finding.remedy


def test_the_doctor_tells_a_machine_without_rights(monkeypatch):
    from pnfarm.farm.doctor import machine

    refused = dict.fromkeys(TRIALS, "Operation not permitted") | {
        "veth": "not tried: no private namespace to try it in"
    }
    monkeypatch.setattr(machine, "effective", lambda: 0)
    monkeypatch.setattr(machine, "_try", lambda: refused)
    monkeypatch.setattr(machine.shutil, "which", lambda _: None)
    by_name = {finding.name: finding for finding in examine()}
    for name in ("CAP_NET_ADMIN", "CAP_NET_RAW", "private namespace", "macvlan", "packet socket"):
        assert by_name[name].ok is False
        assert by_name[name].remedy
    for name in ("veth", "tap", "real-time scheduling", "memory lock", "tshark"):
        assert by_name[name].ok is None


def test_a_trial_that_breaks_down_is_no_verdict(monkeypatch):
    from pnfarm.farm.doctor import machine

    monkeypatch.setattr(machine.sys, "executable", "/nowhere/python")
    by_name = {finding.name: finding for finding in examine()}
    assert by_name["macvlan"].ok is None
    assert "unknown" in by_name["macvlan"].detail
