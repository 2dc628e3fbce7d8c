"""The rig's files say what they promise: few rights, no surprise on the network, and names that fit each other."""

import importlib.util
import json
import os
import re
import shutil
import socket
import subprocess
import sys
import threading
from http.server import BaseHTTPRequestHandler, HTTPServer
from ipaddress import IPv4Network
from pathlib import Path

import pytest
import yaml
from rig_dashboards import needs_promtool

from pnfarm.cli.farm_file import read
from pnfarm.farm.file.reading import expand
from pnfarm.vocabulary.durations import parse_duration

ROOT = Path(__file__).resolve().parents[1]
COMPOSE = yaml.safe_load((ROOT / "compose.yaml").read_text("utf-8"))
SERVICES = COMPOSE["services"]
SUBNET = IPv4Network("10.77.0.0/24")


def loaded(name):
    spec = importlib.util.spec_from_file_location(name, ROOT / "configs" / "rig" / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_nothing_of_the_package_stays_outside_of_the_image():
    lines = (ROOT / ".dockerignore").read_text("utf-8").split()
    anywhere = [line.removeprefix("**/") for line in lines if line.startswith("**/")]
    assert sorted(anywhere) == ["*.pyc", "__pycache__"]
    assert not [line for line in lines if line.startswith("pnfarm/")]


@pytest.mark.parametrize("name", SERVICES)
def test_a_service_has_no_right_that_it_does_not_need(name):
    service = SERVICES[name]
    assert service["cap_drop"] == ["ALL"]
    assert "privileged" not in service
    assert "devices" not in service
    own = name in {"farm", "plc"}
    assert service["security_opt"] == ["no-new-privileges:true", *(["seccomp:configs/rig/seccomp.json"] if own else [])]
    # Grafana's image is not part of any test
    assert service.get("read_only", False) == (name != "grafana")
    # what the entry point gives up root with, and gives up then
    change = {"SETUID", "SETGID", "SETPCAP"}
    wanted = {"farm": {"NET_ADMIN", "NET_RAW", *change}, "plc": {"NET_RAW", *change}}
    assert set(service.get("cap_add", ())) == wanted.get(name, set())
    if name in wanted:
        assert service["entrypoint"][0] == "pnfarm-entry"


def allowed_calls():
    """The names of the profile's system calls that some arguments permit."""
    profile = json.loads((ROOT / "configs" / "rig" / "seccomp.json").read_text("utf-8"))
    assert (profile["defaultAction"], profile["defaultErrnoRet"]) == ("SCMP_ACT_ERRNO", 1)
    rules = [rule for rule in profile["syscalls"] if rule["action"] == "SCMP_ACT_ALLOW"]
    assert {rule["action"] for rule in profile["syscalls"]} == {"SCMP_ACT_ALLOW", "SCMP_ACT_ERRNO"}
    return rules


def test_the_profile_of_system_calls_permits_no_group_that_a_farm_has_no_use_for():
    names = {name for rule in allowed_calls() for name in rule["names"]}
    for name in (
        "mount", "umount2", "pivot_root", "ptrace", "process_vm_readv", "init_module", "finit_module", "bpf", "reboot",
        "perf_event_open", "userfaultfd", "io_uring_setup", "keyctl", "setns", "unshare", "clock_settime", "swapon",
    ):  # fmt: skip
        assert name not in names
    families = sorted(rule["args"][0]["value"] for rule in allowed_calls() if rule["names"] == ["socket"])
    assert families == sorted(
        map(int, (socket.AF_UNIX, socket.AF_INET, socket.AF_INET6, socket.AF_NETLINK, socket.AF_PACKET))
    )


UNIT = (ROOT / "configs" / "systemd" / "pnfarm@.service").read_text("utf-8")


def test_the_service_and_the_container_may_open_the_same_kinds_of_sockets():
    (line,) = re.findall(r"^RestrictAddressFamilies=(.+)$", UNIT, re.MULTILINE)
    rules = [rule for rule in allowed_calls() if rule["names"] == ["socket"]]
    assert {getattr(socket, name) for name in line.split()} == {rule["args"][0]["value"] for rule in rules}
    assert {rule["comment"] for rule in rules} == set(line.split())


def test_the_service_has_the_two_capabilities_and_no_others():
    for name in ("AmbientCapabilities", "CapabilityBoundingSet"):
        assert re.findall(f"^{name}=(.*)$", UNIT, re.MULTILINE) == ["CAP_NET_ADMIN CAP_NET_RAW"]


def test_what_the_service_refuses_of_locked_memory_is_among_what_a_farm_with_locked_memory_is_told_to_add():
    assert re.search(r"^SystemCallFilter=~.*@memlock", UNIT, re.MULTILINE)
    (told,) = re.findall(r"SCHED_FIFO, `realtime:`\)\n((?:# {5,}.*\n)+?)#   `", UNIT)
    assert "CAP_IPC_LOCK, LimitMEMLOCK=infinity, SystemCallFilter=@memlock" in told


@pytest.mark.skipif(
    shutil.which("systemd-analyze") is None, reason="systemd-analyze is not installed (apt-get install systemd)"
)
def test_what_systemd_finds_open_in_the_service_is_what_a_farm_is_for():
    command = ["systemd-analyze", "security", "--offline=true", "--no-pager", "--json=short"]
    path = ROOT / "configs" / "systemd" / "pnfarm@.service"
    said = subprocess.run([*command, path], capture_output=True, text=True, check=False)
    rows = json.loads(said.stdout)
    assert len(rows) > 60
    # each of them is what a farm is for, or said in the file
    assert {row["name"] for row in rows if row["set"] is False and row["exposure"]} <= {
        "AmbientCapabilities=", "CapabilityBoundingSet=~CAP_NET_(BIND_SERVICE|BROADCAST|RAW)",
        "CapabilityBoundingSet=~CAP_NET_ADMIN", "DeviceAllow=", "IPAddressDeny=", "MemoryDenyWriteExecute=",
        "PrivateNetwork=", "PrivateUsers=", "ProcSubset=", "RestrictAddressFamilies=~AF_(INET|INET6)",
        "RestrictAddressFamilies=~AF_NETLINK", "RestrictAddressFamilies=~AF_PACKET", "RestrictAddressFamilies=~AF_UNIX",
        "RootDirectory=/RootImage=", "SystemCallFilter=~@resources", "UMask=",
    }  # fmt: skip


def test_the_image_has_a_user_that_is_not_root():
    lines = (ROOT / "Dockerfile").read_text("utf-8").splitlines()
    assert [line for line in lines if line.startswith("USER ")] == ["USER pnfarm"]
    assert 'ENTRYPOINT ["pnfarm-entry", "pnfarm"]' in lines


def test_the_image_is_tagged_and_labelled_by_the_version_that_is_asked_for():
    pnfarm = COMPOSE["x-pnfarm"]
    assert pnfarm["image"] == "pnfarm:${PNFARM_VERSION:-local}"
    arguments = pnfarm["build"]["args"]
    assert arguments["VERSION"] == "${PNFARM_VERSION:-local}"
    assert arguments["REVISION"] == "${PNFARM_REVISION:-}"
    text = (ROOT / "Dockerfile").read_text("utf-8")
    for label, argument in (("version", "VERSION"), ("revision", "REVISION")):
        assert f'org.opencontainers.image.{label}="${{{argument}}}"' in text


def test_the_rigs_sine_is_slow_enough_for_its_prometheus():
    scraped = yaml.safe_load((ROOT / "configs" / "prometheus" / "prometheus.yml").read_text("utf-8"))
    every = parse_duration(scraped["global"]["scrape_interval"])
    controller = read(ROOT / "configs" / "compose.pnfarm.yml").controller
    assert controller.program.period_ns >= 20 * every


def test_every_stage_stands_on_a_base_image_that_may_be_named_by_its_digest():
    text = (ROOT / "Dockerfile").read_text("utf-8")
    assert re.findall(r"^FROM (\S+)", text, re.MULTILINE) == ["${BASE}", "${BASE}"]
    assert "ARG BASE=debian:bookworm-slim\n" in text
    assert SERVICES["farm"]["build"]["args"]["BASE"] == "${PNFARM_BASE:-debian:bookworm-slim}"


def test_the_image_installs_nothing_that_no_hash_names():
    text = (ROOT / "Dockerfile").read_text("utf-8").replace("\\\n", " ")
    installs = re.findall(r"bin/pip (?:install|wheel) [^&\n]+", text)
    assert len(installs) == 4
    for command in installs:
        assert "--require-hashes" in command or {"--no-deps", "--no-index"} <= set(command.split()), command


@pytest.mark.parametrize("name", SERVICES)
def test_ports_are_published_on_this_host_only(name):
    assert all(port.startswith("127.0.0.1:") for port in SERVICES[name].get("ports", ()))


@pytest.mark.parametrize("name", SERVICES)
def test_every_service_has_a_health_check(name):
    if name == "farm":
        assert "HEALTHCHECK" in (ROOT / "Dockerfile").read_text("utf-8")
    else:
        assert SERVICES[name]["healthcheck"]["test"]


def test_what_a_service_mounts_from_the_project_is_there():
    for service in SERVICES.values():
        for volume in service.get("volumes", ()):
            source, _, mode = volume.split(":") if volume.count(":") == 2 else (*volume.split(":"), "")
            if source.startswith("./"):
                assert (ROOT / source).exists()
                assert mode == "ro"
            else:
                assert source in COMPOSE["volumes"]


def test_the_rigs_farm_file_is_valid_and_its_addresses_are_free_of_the_containers():
    config = read(ROOT / "configs" / "compose.pnfarm.yml")
    (pool,) = COMPOSE["networks"]["fieldbus"]["ipam"]["config"]
    assert IPv4Network(pool["subnet"]) == SUBNET
    own = [drive.ip.ip for drive in expand(config) if drive.model != "moog-msd-dp"] + [config.controller.ip.ip]
    assert all(address in SUBNET for address in own)
    assert not any(address in IPv4Network(pool["ip_range"]) for address in own)
    assert SERVICES["farm"]["command"] == ["up", "configs/compose.pnfarm.yml"]
    assert IPv4Network(COMPOSE["x-pnfarm"]["entrypoint"][3]) == SUBNET


def test_one_token_opens_the_api_for_everybody_in_the_rig_and_nobody_knows_it_beforehand():
    api = read(ROOT / "configs" / "compose.pnfarm.yml").api
    assert (api.token, api.token_file) == (None, "/run/pnfarm/token")
    assert SERVICES["farm"]["environment"]["PNFARM_UP_API_TOKEN"] == "${PNFARM_TOKEN:-}"
    for name in ("farm", "plc"):
        assert SERVICES[name]["environment"]["PNFARM_TOKEN_FILE"] == api.token_file
    prometheus = yaml.safe_load((ROOT / "configs" / "prometheus" / "prometheus.yml").read_text("utf-8"))
    (job,) = prometheus["scrape_configs"]
    assert job["authorization"] == {"credentials_file": api.token_file}
    assert job["static_configs"][0]["targets"] == ["farm:8702"]
    for name, mode in (("farm", ""), ("plc", ":ro"), ("prometheus", ":ro")):
        assert f"token:/run/pnfarm{mode}" in SERVICES[name]["volumes"]
        # the group of the image's user, which alone may read it
        assert SERVICES[name]["group_add"] == ["8702"]
    assert "groupadd --system --gid 8702 pnfarm" in (ROOT / "Dockerfile").read_text("utf-8")


def test_no_service_has_a_secret_that_stands_in_this_repository():
    for service in SERVICES.values():
        for name, value in service.get("environment", {}).items():
            if name.endswith(("TOKEN", "PASSWORD")):
                assert re.fullmatch(r"\$\{[A-Z_]+:-\}", value), name


@pytest.mark.parametrize("chosen", ["", "mine-alone"])
def test_grafanas_password_is_the_one_chosen_or_one_that_nobody_knows(chosen, tmp_path):
    shell, option, script = SERVICES["grafana"]["entrypoint"]
    show = tmp_path / "run.sh"
    show.write_text('#!/bin/sh\necho "$GF_SECURITY_ADMIN_PASSWORD"\n')
    show.chmod(0o755)
    line = script.replace("$$", "$").replace("/run.sh", str(show))

    def started():
        environment = {"PATH": os.environ["PATH"], "GF_SECURITY_ADMIN_PASSWORD": chosen}
        return subprocess.run(
            [shell, option, line], capture_output=True, text=True, check=True, env=environment
        ).stdout.strip()

    first, second = started(), started()
    if chosen:
        assert first == second == chosen
    else:
        assert len(first) == 32
        assert first != second


def test_the_image_takes_only_what_the_build_copies():
    """Nothing of a work tree (state, captures, environments) can slip into a layer."""
    ignored = (ROOT / ".dockerignore").read_text("utf-8").splitlines()
    assert "*" in ignored
    taken = {line[1:] for line in ignored if line.startswith("!")}
    copies = re.findall(r"^COPY (?!--from)(.+)$", (ROOT / "Dockerfile").read_text("utf-8"), re.MULTILINE)
    assert taken == {source for line in copies for source in line.split()[:-1]}


ROUTES = """\
Iface\tDestination\tGateway \tFlags\tRefCnt\tUse\tMetric\tMask\t\tMTU\tWindow\tIRTT
eth0\t00000000\t010012AC\t0003\t0\t0\t0\t00000000\t0\t0\t0
eth1\t00004D0A\t00000000\t0001\t0\t0\t0\t00FFFFFF\t0\t0\t0
eth0\t000012AC\t00000000\t0001\t0\t0\t0\t0000FFFF\t0\t0\t0
"""


@pytest.mark.skipif(sys.byteorder != "little", reason="the kernel prints these routes in host order")
def test_the_fieldbus_interface_is_found_whatever_its_number():
    interface_of = loaded("on_fieldbus").interface_of
    assert interface_of(SUBNET, ROUTES) == "eth1"
    assert interface_of(IPv4Network("172.18.0.0/16"), ROUTES) == "eth0"
    assert interface_of(IPv4Network("10.78.0.0/24"), ROUTES) is None


def test_a_container_outside_of_the_fieldbus_is_told_so():
    run = subprocess.run(
        [sys.executable, ROOT / "configs" / "rig" / "on_fieldbus.py", "203.0.113.0/24", "true"],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert run.returncode == 4
    assert run.stderr == "this container has no interface in 203.0.113.0/24: put it into the network `fieldbus`\n"


def test_a_secret_is_given_to_the_command_alone(tmp_path):
    (tmp_path / "db").write_text("a-password\n")
    program = [sys.executable, ROOT / "configs" / "rig" / "with_secret.py", "PGPASSWORD"]
    show = [sys.executable, "-c", "import os; print(os.environ['PGPASSWORD'])"]
    run = subprocess.run([*program, tmp_path / "db", *show], capture_output=True, text=True, check=False)
    assert (run.returncode, run.stdout) == (0, "a-password\n")
    run = subprocess.run([*program, tmp_path / "none", *show], capture_output=True, text=True, check=False)
    assert (run.returncode, run.stdout) == (4, "")
    assert run.stderr == f"the secret {tmp_path / 'none'} cannot be read: No such file or directory\n"


def test_the_controllers_health_check_shows_the_token_of_the_file(tmp_path):
    program = [sys.executable, ROOT / "configs" / "rig" / "all_connected.py"]
    environment = {"PNFARM_API": "http://127.0.0.1:9", "PNFARM_TOKEN_FILE": str(tmp_path / "token")}
    run = subprocess.run(program, capture_output=True, text=True, check=False, env=environment)
    assert run.returncode == 1
    assert "No such file" in run.stderr
    asked = []

    class Farm(BaseHTTPRequestHandler):
        def do_GET(self):
            asked.append(self.headers.get("Authorization"))
            body = b'{"stations": [{"name": "a", "connected": true}]}'
            self.send_response(200)
            self.send_header("Content-Length", str(len(body)))
            self.end_headers()
            self.wfile.write(body)

        def log_message(self, *_):
            pass

    (tmp_path / "token").write_text("a-kept-token\n")
    with HTTPServer(("127.0.0.1", 0), Farm) as server:
        thread = threading.Thread(target=server.handle_request)
        thread.start()
        environment["PNFARM_API"] = f"http://127.0.0.1:{server.server_address[1]}"
        run = subprocess.run(program, capture_output=True, text=True, check=False, env=environment)
        thread.join()
    assert (run.returncode, run.stdout) == (0, "1 of 1 stations exchange data\n")
    assert asked == ["Bearer a-kept-token"]


def test_the_controllers_health_check_says_in_a_sentence_that_nobody_answers():
    run = subprocess.run(
        [sys.executable, ROOT / "configs" / "rig" / "all_connected.py"],
        capture_output=True, text=True, check=False, env={"PNFARM_API": "http://127.0.0.1:9"},
    )  # fmt: skip
    assert run.returncode == 1
    assert run.stderr.startswith("the farm at http://127.0.0.1:9 does not answer: ")


@needs_promtool
def test_prometheus_takes_the_configuration(tmp_path):
    for name in ("prometheus.yml", "pnfarm.rules.yml"):
        text = (ROOT / "configs" / "prometheus" / name).read_text("utf-8")
        text = text.replace("/etc/prometheus/", "").replace("/run/pnfarm/token", "token")
        (tmp_path / name).write_text(text, "utf-8")
    (tmp_path / "token").write_text("x", "utf-8")
    run = subprocess.run(
        ["promtool", "check", "config", "prometheus.yml"], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert run.returncode == 0, run.stdout + run.stderr


#: For each alert a farm that must raise it, and one that must not.
RULE_TESTS = """
rule_files: [RULES]
evaluation_interval: 5s
tests:
  - interval: 5s
    input_series:
      - {series: 'up{job="pnfarm", instance="a"}', values: "1 0x10"}
      - {series: 'up{job="pnfarm", instance="b"}', values: "1 0 1x10"}
      - {series: 'pnfarm_hub_shard_up{shard="gone"}', values: "1 0x10"}
      - {series: 'pnfarm_hub_shard_up{shard="back"}', values: "1 0 1x10"}
      - {series: 'pnfarm_ar_exchanging{drive="lost"}', values: "1 0x20"}
      - {series: 'pnfarm_ar_connects_total{drive="lost"}', values: "1x20"}
      - {series: 'pnfarm_ar_exchanging{drive="never"}', values: "0x20"}
      - {series: 'pnfarm_ar_connects_total{drive="never"}', values: "0x20"}
      - {series: 'pnfarm_axis_fault_active{drive="stands"}', values: "0 702x20"}
      - {series: 'pnfarm_axis_fault_active{drive="acknowledged"}', values: "0 702 0x20"}
      - {series: 'pnfarm_watchdog_expirations_total{instance="a", drive="nervous"}', values: "0+1x20"}
      - {series: 'pnfarm_watchdog_expirations_total{instance="a", drive="calm"}', values: "0 1x20"}
      - {series: 'pnfarm_watchdog_expirations_total{instance="a", drive="innocent", cause="farm"}', values: "0+1x20"}
      - {series: 'pnfarm_watchdog_expirations_total{instance="a", drive="innocent", cause="other"}', values: "0x9"}
      - {series: 'pnfarm_ar_aborts_total{instance="a", drive="aborted", cause="farm"}', values: "0x5 1x15"}
      - {series: 'pnfarm_ar_aborts_total{instance="a", drive="calm", cause="controller"}', values: "0x5 1x15"}
      - {series: 'pnfarm_sign_of_life_errors_total{instance="a", drive="frozen"}', values: "0+4x20"}
      - {series: 'pnfarm_sign_of_life_errors_total{instance="a", drive="calm"}', values: "0 1x20"}
      - {series: 'pnfarm_engine_lateness_seconds_bucket{instance="late", le="0.001"}', values: "0x20"}
      - {series: 'pnfarm_engine_lateness_seconds_bucket{instance="late", le="0.008"}', values: "0+9x20"}
      - {series: 'pnfarm_engine_lateness_seconds_bucket{instance="late", le="+Inf"}', values: "0+9x20"}
      - {series: 'pnfarm_engine_lateness_seconds_bucket{instance="punctual", le="0.001"}', values: "0+9x20"}
      - {series: 'pnfarm_engine_lateness_seconds_bucket{instance="punctual", le="0.008"}', values: "0+9x20"}
      - {series: 'pnfarm_engine_lateness_seconds_bucket{instance="punctual", le="+Inf"}', values: "0+9x20"}
    promql_expr_test:
      - expr: sum by (alertname, instance, drive, shard) (ALERTS{alertstate="firing"})
        eval_time: 50s
        exp_samples:
          - {labels: '{alertname="FarmDown", instance="a"}', value: 1}
          - {labels: '{alertname="ShardAway", shard="gone"}', value: 1}
          - {labels: '{alertname="DriveLostItsController", drive="lost"}', value: 1}
          - {labels: '{alertname="DriveFaultStands", drive="stands"}', value: 1}
          - {labels: '{alertname="ControllerWatchdogExpires", instance="a", drive="nervous"}', value: 1}
          - {labels: '{alertname="FarmLostConnections", instance="a", drive="innocent"}', value: 1}
          - {labels: '{alertname="FarmLostConnections", instance="a", drive="aborted"}', value: 1}
          - {labels: '{alertname="SignOfLifeFails", instance="a", drive="frozen"}', value: 1}
          - {labels: '{alertname="FarmTooLate", instance="late"}', value: 1}
"""


@needs_promtool
def test_alerts_are_raised_for_what_they_are_made_for_and_for_nothing_else(tmp_path):
    path = tmp_path / "tests.yml"
    path.write_text(RULE_TESTS.replace("RULES", str(ROOT / "configs" / "prometheus" / "pnfarm.rules.yml")), "utf-8")
    run = subprocess.run(["promtool", "test", "rules", path], capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stdout + run.stderr
