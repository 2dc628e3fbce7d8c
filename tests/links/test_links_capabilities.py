"""What a process may do, what its link needs, and the ways to get it that are recommended."""

from __future__ import annotations

import errno
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from pnfarm.errors import EnvironmentError_
from pnfarm.links.kernel import capabilities, namespace_settings
from pnfarm.links.kernel.capabilities import NET_ADMIN, NET_RAW, require_for_link

ROOT = Path(__file__).resolve().parents[2]
BOTH = 1 << NET_ADMIN | 1 << NET_RAW
needs_root = pytest.mark.skipif(
    os.geteuid() != 0 or shutil.which("setpriv") is None, reason="needs root and setpriv (util-linux)"
)


@pytest.mark.parametrize(
    ("kind", "mask", "missing"),
    [
        ("macvlan", 0, ["CAP_NET_ADMIN", "CAP_NET_RAW"]),
        ("veth", 1 << NET_RAW, ["CAP_NET_ADMIN"]),
        ("macvlan", 1 << NET_ADMIN, ["CAP_NET_RAW"]),
        ("tap", 1 << NET_RAW, ["CAP_NET_ADMIN"]),
        ("interface", 1 << NET_ADMIN, ["CAP_NET_RAW"]),
    ],
)
def test_what_a_link_lacks_is_one_sentence(monkeypatch, kind, mask, missing):
    monkeypatch.setattr(capabilities, "effective", lambda: mask)
    with pytest.raises(EnvironmentError_) as caught:
        require_for_link(kind, "farm line-1")
    text = str(caught.value)
    assert text.startswith("farm line-1 lacks CAP_")
    assert re.findall(r"CAP_NET_\w+", text) == missing
    assert "pnfarm doctor" in text
    assert "\n" not in text


@pytest.mark.parametrize(("kind", "mask"), [("macvlan", BOTH), ("tap", 1 << NET_ADMIN), ("memory", 0)])
def test_a_process_with_what_its_link_needs_is_let_through(monkeypatch, kind, mask):
    monkeypatch.setattr(capabilities, "effective", lambda: mask)
    require_for_link(kind, "farm line-1")


def test_the_advice_gives_no_capability_to_an_interpreter_that_others_use(monkeypatch, tmp_path):
    shared, own = tmp_path / "shared" / "python3.11", tmp_path / "venv" / "bin" / "python"
    for place in (shared, own):
        place.parent.mkdir(parents=True)
    shared.write_text("")
    own.symlink_to(shared)
    monkeypatch.setattr(capabilities.sys, "executable", str(own))
    text = capabilities.remedy()
    assert str(shared) not in text
    assert "AmbientCapabilities=" in text
    assert "--ambient-caps=" in text
    assert "never setcap on an interpreter that other programs share" in text
    # a link first becomes a copy
    assert text.index("venv --copies") < text.index("setcap")
    own.unlink()
    own.write_text("")
    assert "--copies" not in capabilities.remedy()
    assert f"setcap cap_net_admin,cap_net_raw+ep {own}" in capabilities.remedy()


def effective_in(status: str) -> int:
    return int(re.search(r"^CapEff:\s*(\w+)", status, re.MULTILINE)[1], 16)


@needs_root
def test_the_recommended_setpriv_gives_these_two_to_an_ordinary_user():
    options = re.findall(r"--(?:inh|ambient)-caps=\S+", capabilities.remedy())
    assert len(options) == 2
    status = subprocess.run(
        ["setpriv", "--reuid=65534", "--regid=65534", "--clear-groups", *options, "cat", "/proc/self/status"],
        check=True, capture_output=True, text=True,
    ).stdout  # fmt: skip
    assert effective_in(status) == BOTH
    assert re.search(r"^Uid:\s+65534", status, re.MULTILINE)


@needs_root
@pytest.mark.skipif(shutil.which("setcap") is None, reason="needs setcap (libcap2-bin)")
def test_a_copied_interpreter_has_them_and_the_one_it_was_copied_from_has_not():
    system = Path(f"/usr/bin/python{sys.version_info.major}.{sys.version_info.minor}")
    if not system.exists():
        pytest.skip(f"needs an interpreter that everybody may run: {system}")
    show = ["-c", "print(open('/proc/self/status').read())"]
    as_nobody = ["setpriv", "--reuid=65534", "--regid=65534", "--clear-groups", "--inh-caps=-all"]
    with tempfile.TemporaryDirectory(prefix="pnfarm-copy-", dir="/var/tmp") as folder:
        Path(folder).chmod(0o755)
        subprocess.run([system, "-m", "venv", "--copies", "--without-pip", f"{folder}/venv"], check=True)
        copy = Path(f"{folder}/venv/bin/python3")
        assert not copy.is_symlink()
        subprocess.run(["setcap", "cap_net_admin,cap_net_raw+ep", copy], check=True)
        given = subprocess.run([*as_nobody, copy, *show], check=True, capture_output=True, text=True).stdout
        others = subprocess.run([*as_nobody, system, *show], check=True, capture_output=True, text=True).stdout
    assert effective_in(given) == BOTH
    assert effective_in(others) == 0


def test_the_service_has_the_two_capabilities_and_no_others():
    text = (ROOT / "configs" / "systemd" / "pnfarm@.service").read_text("utf-8")
    for key in ("AmbientCapabilities", "CapabilityBoundingSet"):
        assert f"\n{key}=CAP_NET_ADMIN CAP_NET_RAW\n" in text
    assert "\nNoNewPrivileges=yes\n" in text


# -- namespaces


@pytest.fixture
def settings(monkeypatch, tmp_path):
    """Sets what a machine's /proc/sys says."""

    def given(**values):
        for name, value in values.items():
            place = tmp_path / name.replace("__", "/")
            place.parent.mkdir(exist_ok=True)
            place.write_text(f"{value}\n")
        monkeypatch.setattr(namespace_settings, "_SYS", tmp_path)

    return given


def test_a_machine_without_user_namespaces_is_told_its_own_setting(settings):
    settings(user__max_user_namespaces=0, user__max_net_namespaces=9000, kernel__unprivileged_userns_clone=1)
    assert namespace_settings.remedy() == "sudo sysctl -w user.max_user_namespaces=15000"
    text = namespace_settings.why(errno.ENOSPC)
    assert "user.max_user_namespaces = 0" in text
    assert "unprivileged_userns_clone" not in text


@pytest.mark.parametrize(
    ("name", "value", "command"),
    [
        ("kernel__unprivileged_userns_clone", 0, "sudo sysctl -w kernel.unprivileged_userns_clone=1"),
        (
            "kernel__apparmor_restrict_unprivileged_userns",
            1,
            "sudo sysctl -w kernel.apparmor_restrict_unprivileged_userns=0",
        ),
    ],
)
def test_a_distributions_setting_is_named_where_it_forbids(settings, name, value, command):
    settings(**{name: value, "user__max_user_namespaces": 9000})
    assert namespace_settings.remedy() == command
    assert command in namespace_settings.why(errno.EPERM)


def test_where_no_setting_forbids_none_is_blamed(settings):
    settings(user__max_user_namespaces=9000)
    assert "sysctl" not in namespace_settings.remedy()
    assert "raise user.max_user_namespaces" in namespace_settings.why(errno.ENOSPC)


@needs_root
def test_the_doctor_of_a_machine_without_user_namespaces_names_the_setting():
    """In a user namespace of its own, where the limit is set to 0 for what is inside."""
    inside = (
        "echo 0 > /proc/sys/user/max_user_namespaces && "
        f'exec setpriv --bounding-set=-all --inh-caps=-all "{sys.executable}" -m pnfarm.cli.main doctor --format json'
    )
    done = subprocess.run(
        ["unshare", "--user", "--map-root-user", "sh", "-c", inside],
        check=False, capture_output=True, text=True, timeout=120, cwd=ROOT,
    )  # fmt: skip
    if "unshare failed" in done.stderr:
        pytest.skip(f"this machine refuses: {done.stderr}")
    findings = {finding["name"]: finding for finding in json.loads(done.stdout)["findings"]}
    refused = findings["private namespace"]
    assert refused["ok"] is False
    assert "user.max_user_namespaces = 0" in refused["detail"]
    assert refused["remedy"] == "sudo sysctl -w user.max_user_namespaces=15000"
    assert findings["CAP_NET_ADMIN"]["ok"] is False
