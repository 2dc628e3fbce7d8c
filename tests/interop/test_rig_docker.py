"""The rig under a real Docker engine: farm, controller and Prometheus from compose.yaml, Grafana's container aside.

Takes some minutes and a gigabyte, so it runs where ``PNFARM_DOCKER=1`` asks for it.
"""

import errno
import json
import os
import signal
import sys
import tempfile
import time
import urllib.parse
from pathlib import Path

import pytest
from refused import PROBE
from rig_dashboards import BOARDS, queries
from rig_engine import BUILT, Engine, why_not

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(os.environ.get("PNFARM_DOCKER") != "1", reason="asked for with PNFARM_DOCKER=1: takes minutes"),
]
#: A test is repeated with the engine as it is: its images are built once.
KEEPS_FIXTURES = True
SERVICES = ("farm", "plc", "prometheus")
#: Where the farm keeps the token that it makes at its first start, and the group that may read it.
TOKEN_FILE, GROUP = "/run/pnfarm/token", "8702"
FARM = "http://127.0.0.1:8702"
PROMETHEUS = "http://127.0.0.1:9090"
NETWORKED = [f"axis-{number:02}" for number in range(1, 9)]
#: Its line is TCP between the two containers.
ON_PROFIBUS = "axis-09"
DRIVES = [*NETWORKED, ON_PROFIBUS]
#: CAP_NET_ADMIN (12) and CAP_NET_RAW (13).
NET_ADMIN, NET_RAW = 1 << 12, 1 << 13


#: What the image holds: programs that a farm has no use for, and files that give their caller another's rights.
HOLDS = """
import json, os, shutil
names = "cc gcc g++ c++ clang ld as make cmake pip pip3 easy_install curl wget ssh".split()
rights = [os.path.join(folder, name) for top in ("/usr", "/opt", "/etc", "/var") for folder, _, names_ in os.walk(top)
          for name in names_ if os.lstat(os.path.join(folder, name)).st_mode & 0o6000]
try:
    import pip
    found = ["pip, as a module"]
except ModuleNotFoundError:
    found = []
print(json.dumps([found + [name for name in names if shutil.which(name)], rights]))
"""


@pytest.fixture(scope="module")
def engine():
    if reason := why_not():
        pytest.skip(reason)
    # the whole suite builds beside other tests; paths of unix sockets are short: not under pytest's own folder
    folder = os.environ.get("PNFARM_RIG")
    made = Engine(Path(folder or tempfile.mkdtemp(prefix="pnfarm-rig-")))
    try:
        if folder is None:
            made.prepare()
        else:
            said = (made.folder / BUILT).read_text("utf-8")
            assert not said, said
        made.start(private=True)
        yield made
    finally:
        made.close()


class Rig:
    """The rig of compose.yaml and ``files`` over it."""

    def __init__(self, engine, *files, environment=None):
        self.engine = engine
        self._files = [word for name in ("compose.yaml", *files) for word in ("-f", name)]
        self._environment = environment or {}
        self.token = ""

    def compose(self, *arguments, timeout=240):
        for name, value in self._environment.items():
            self.engine.environment[name] = value
        # a profile only matters where a file has made one
        return self.engine.docker("compose", "--profile", "plc", *self._files, *arguments, timeout=timeout)

    def up(self):
        self.compose("up", "-d", "--no-build", "--wait", "--wait-timeout", "120", *SERVICES)
        self.token = self.compose("exec", "-T", "farm", "cat", TOKEN_FILE).strip()

    def down(self):
        self.compose("down", "-v", "--timeout", "20")

    def farm(self, path, *, method="GET", body=None):
        status, text = self.engine.ask(f"{FARM}/api/v1/{path}", method=method, token=self.token, body=body)
        assert status < 400, text
        return json.loads(text) if text else None

    def drives(self):
        return {drive["name"]: drive for drive in self.farm("drives")["drives"]}

    def query(self, expression):
        form = urllib.parse.urlencode({"query": expression})
        status, text = self.engine.ask(f"{PROMETHEUS}/api/v1/query?{form}")
        assert status == 200, f"{expression}: {text}"
        return json.loads(text)["data"]["result"]

    def working(self):
        """Names of the drives that exchange data and are in operation."""
        return [name for name, drive in self.drives().items() if drive["connected"] and drive["state"] == "S4"]


def eventually(what, seconds=30.0):
    """``what()`` once it is true."""
    deadline = time.monotonic() + seconds
    while not (found := what()):
        assert time.monotonic() < deadline, f"not within {seconds} s"
        time.sleep(0.5)
    return found


@pytest.fixture(scope="module")
def rig(engine):
    made = Rig(engine)
    try:
        made.up()
        yield made
    finally:
        made.down()


def test_once_the_rig_is_up_every_drive_is_run_by_the_controller(rig):
    eventually(lambda: rig.working() == DRIVES)
    drives = rig.drives()
    for name in NETWORKED:
        assert (drives[name]["ar_state"], drives[name]["controller"]["name"]) == ("DATA", "plc")
        assert drives[name]["cycle_seconds"] == 0.016
    assert (drives[ON_PROFIBUS]["ar_state"], drives[ON_PROFIBUS]["controller"]["name"]) == ("DATA_EXCH", "master 1")
    first = rig.drives()["axis-01"]
    time.sleep(2)
    second = rig.drives()["axis-01"]
    # by the farm's clock: how long a question takes is the machine's affair
    seconds = second["connected_seconds"] - first["connected_seconds"]
    assert seconds > 1
    assert 50 <= (second["frames_received"] - first["frames_received"]) / seconds <= 75


def test_the_controller_runs_the_island_and_a_signal_can_be_written(rig):
    (island,) = rig.farm("devices")["devices"]
    assert (island["name"], island["connected"]) == ("island", True)
    rig.farm("devices/island/signals", method="PATCH", body={"part_present": True})
    signals = {one["name"]: one for one in rig.farm("devices/island/signals")["signals"]}
    assert (signals["part_present"]["value"], signals["clamp"]["good"]) == (True, True)


def test_containers_run_as_a_user_with_the_rights_that_are_written_and_no_others(rig):
    for service, rights in (("farm", NET_ADMIN | NET_RAW), ("plc", NET_RAW)):
        status = rig.compose("exec", "-T", service, "cat", "/proc/1/status")
        lines = dict(line.split(":\t", 1) for line in status.splitlines() if ":\t" in line)
        for kind in ("CapEff", "CapPrm", "CapInh", "CapAmb", "CapBnd"):
            assert int(lines[kind], 16) == rights, kind
        assert lines["NoNewPrivs"] == "1"
        assert lines["Uid"].split() == [GROUP] * 4
        assert lines["Gid"].split() == [GROUP] * 4


def test_the_image_is_no_roots_and_says_what_its_root_needs(rig):
    def run(*options, command):
        image = ("--entrypoint", "pnfarm-entry", "pnfarm:local", *command)
        return rig.engine.docker("run", "--rm", "--network=none", "--no-healthcheck", *options, *image)

    user = run(command=("id", "-u"))
    assert user.strip() == GROUP
    # with an engine's usual rights the entry point changes the user by itself
    assert run("--user", "0", command=("id", "-u")).strip() == GROUP
    with pytest.raises(AssertionError, match=r"(?s): 4\n.*add SETGID, SETUID and SETPCAP"):
        run("--user", "0", "--cap-drop=ALL", command=("id", "-u"))


def contained(rig, program, *options, user=GROUP):
    """What a Python program prints in a container of the image, as JSON."""
    return json.loads(
        rig.engine.docker(
            "run", "--rm", "--network=none", "--no-healthcheck", "--user", user, *options,
            "--entrypoint", "python", "pnfarm:local", "-c", program,
        )
    )  # fmt: skip


def test_the_image_holds_no_compiler_no_installer_and_no_program_with_anothers_rights(rig):
    assert contained(rig, HOLDS, user="0") == [[], []]


def test_the_image_needs_no_shell(rig):
    away = [word for shell in ("dash", "bash", "sh") for word in ("-v", f"/dev/null:/usr/bin/{shell}:ro")]
    image = ("run", "--rm", "--network=none", "--no-healthcheck", *away)
    with pytest.raises(AssertionError, match=r"permission denied|not found"):
        rig.engine.docker(*image, "--entrypoint", "sh", "pnfarm:local", "-c", "true")
    for user in ("0", GROUP):
        said = rig.engine.docker(*image, "--user", user, "pnfarm:local", "validate", "configs/demo.pnfarm.yml")
        assert "configs/demo.pnfarm.yml" in said
    check = json.loads(rig.engine.docker("inspect", "-f", "{{json .Config.Healthcheck.Test}}", "pnfarm:local"))
    assert check[:2] == ["CMD", "python"]


def test_a_container_of_the_rig_refuses_what_a_farm_has_no_use_for(rig):
    """As the farm's own user, and as the root that the entry point gives up."""
    # what the same program may do in a container with an engine's usual rights, and no profile at all
    usual = contained(rig, PROBE, "--security-opt", "seccomp=unconfined", user="0")
    for user, service in (("root", "farm"), (GROUP, "farm"), (GROUP, "plc")):
        said = json.loads(rig.compose("exec", "-T", "--user", user, service, "python", "-c", PROBE))
        for place in ("/", "/rig", "/opt/pnfarm/cache", "/usr/local/bin"):
            assert said.pop(f"write {place}") == errno.EROFS
            assert usual[f"write {place}"] == 0
        assert said.pop("execute in /tmp") == errno.EACCES
        assert usual["execute in /tmp"] == 0
        assert (said.pop("write /tmp"), said.pop("AF_NETLINK"), said.pop("AF_INET")) == (0, 0, 0)
        # root has no rights over the user's files: DAC_OVERRIDE is not given
        assert said.pop("write /var/lib/pnfarm") == (errno.EACCES if user == "root" else 0)
        # an executed process of the user has no capabilities: the farm's own are ambient
        assert said.pop("AF_PACKET") == (0 if user == "root" else errno.EPERM)
        assert said.pop("setuid") == (0 if user == "root" else errno.EPERM)
        # the rest, by the profile of system calls
        assert said == dict.fromkeys(said, errno.EPERM)
        assert {name for name in said if usual[name] == 0} >= {"personality", "ptrace"}
    status = rig.compose("exec", "-T", "farm", "cat", "/proc/1/status")
    assert "Seccomp:\t2\n" in status


def test_the_base_image_may_be_named_by_its_digest(rig):
    digest = rig.engine.docker("inspect", "-f", "{{.Id}}", "debian:bookworm-slim").strip()
    assert digest.startswith("sha256:")
    rig.engine.build_image(base=digest, tag="pnfarm:by-digest")
    layers = [
        rig.engine.docker("inspect", "-f", "{{json .RootFS.Layers}}", image)
        for image in ("pnfarm:local", "pnfarm:by-digest")
    ]
    assert layers[0] == layers[1]


def test_the_token_was_made_at_the_first_start_and_its_group_alone_may_read_it(rig):
    assert len(rig.token) >= 24
    what = rig.compose("exec", "-T", "farm", "stat", "-c", "%a %u %g", TOKEN_FILE)
    assert what.split() == ["640", GROUP, GROUP]
    told = [line for line in rig.compose("logs", "farm").splitlines() if "api listening" in line]
    assert told
    assert all(TOKEN_FILE in line and rig.token not in line for line in told)
    # the command line in the container finds it
    assert rig.compose("exec", "-T", "farm", "pnfarm", "fault", "list").strip() == "no fault is pending or active"


def test_the_engine_was_compiled_when_the_image_was_built(rig):
    for user in ("0", "12345"):
        said = rig.engine.docker(
            "run", "--rm", "--network=none", "--cap-drop=ALL", "--no-healthcheck", "--user", user,
            "--entrypoint", "python", "pnfarm:local", "-m", "pnfarm.engine.warm",
        )  # fmt: skip
        assert float(said.split()[-2]) < 3.0, said


def test_the_api_asks_for_its_token(rig):
    status, text = rig.engine.ask(f"{FARM}/api/v1/drives")
    assert status == 401
    assert "token" in json.loads(text)["detail"]


def test_prometheus_scrapes_the_farm(rig):
    def sampled():
        return {s["metric"]["drive"]: s["value"][1] for s in rig.query("pnfarm_axis_state")}

    assert [series["value"][1] for series in rig.query('up{job="pnfarm"}')] == ["1"]
    eventually(lambda: sampled() == dict.fromkeys(DRIVES, "4"))
    eventually(lambda: float(rig.query("rate(pnfarm_engine_cycles_total[10s])")[0]["value"][1]) > 100)
    status, text = rig.engine.ask(f"{PROMETHEUS}/api/v1/rules")
    assert status == 200
    assert {rule["health"] for group in json.loads(text)["data"]["groups"] for rule in group["rules"]} <= {
        "ok",
        "unknown",
    }


def test_a_drive_that_falls_silent_is_lost_and_brought_back(rig):
    eventually(lambda: rig.working() == DRIVES)
    before = rig.drives()
    made = rig.farm("faults", method="POST", body={"kind": "timeout", "on": "axis-03"})

    def back():
        drive = rig.drives()["axis-03"]
        return drive["connects"] > before["axis-03"]["connects"] and "axis-03" in rig.working()

    eventually(back)
    now = rig.drives()
    # a stalled machine may lose it once more
    assert sum(now["axis-03"]["aborts"].values()) > sum(before["axis-03"]["aborts"].values())
    assert now["axis-03"]["last_fault"]["number"] == 702
    for name in set(DRIVES) - {"axis-03"}:
        by_farm = now[name]["aborts_by_farm"] - before[name]["aborts_by_farm"]
        assert now[name]["connects"] - before[name]["connects"] <= by_farm, "only what the machine itself lost"
    fault = rig.farm(f"faults/{made['id']}")
    assert fault["state"] == "ended"
    assert fault["evidence"]["activations"] >= 1
    assert fault["evidence"]["confirmed"]
    query = 'pnfarm_axis_faults_total{code="702"}'
    eventually(lambda: "axis-03" in {s["metric"]["drive"] for s in rig.query(query) if s["value"][1] != "0"})


@pytest.mark.parametrize("path", BOARDS, ids=lambda path: path.stem)
def test_this_prometheus_answers_every_query_of_a_dashboard(rig, path):
    """Filters may find nothing, and what counts events needs some; everything else has a value."""
    silent = [
        title
        for title, expression in queries(path, drive="axis-03", seconds=300).items()
        if not rig.query(expression) and not any(filter_ in expression for filter_ in (") > 0", "} > 0", "!= 4"))
    ]
    assert silent == []


def test_a_killed_farm_comes_back_and_its_drives_with_it(rig):
    eventually(lambda: rig.working() == DRIVES)
    (container,) = rig.compose("ps", "-q", "farm").split()
    os.kill(int(rig.engine.docker("inspect", "-f", "{{.State.Pid}}", container)), signal.SIGKILL)

    def restarted():
        return int(rig.engine.docker("inspect", "-f", "{{.RestartCount}}", container)) == 1

    eventually(restarted)
    rig.compose("up", "-d", "--no-build", "--no-recreate", "--wait", "--wait-timeout", "60", *SERVICES)
    # the token is the one of the first start
    eventually(lambda: rig.working() == DRIVES)


def test_nothing_went_wrong_inside(rig):
    said = rig.compose("logs", "farm", "plc")
    for word in ("internal error", "Traceback"):
        assert word not in said


def test_on_a_network_card_the_drives_are_on_its_wire(engine, rig):
    rig.down()
    engine.inside("ip", "link", "add", "card", "type", "veth", "peer", "name", "wire")
    engine.inside("ip", "link", "set", "card", "up")
    engine.inside("ip", "link", "set", "wire", "up")
    on_card = Rig(engine, "compose.macvlan.yaml", environment={"PNFARM_PARENT": "card"})
    try:
        on_card.up()
        eventually(lambda: on_card.working() == DRIVES)
        found = engine.inside(
            sys.executable, "-m", "pnfarm.cli.main", "scan", "--interface", "wire", "--format", "json"
        )
        assert {"plc", *NETWORKED} <= {device["name"] for device in json.loads(found)}
    finally:
        on_card.down()
        engine.inside("ip", "link", "del", "card")
    assert engine.docker("ps", "-aq") == ""
    left = engine.inside("ip", "-br", "link").split()
    assert not [name for name in left if name.startswith(("pnfarm", "pf"))]
