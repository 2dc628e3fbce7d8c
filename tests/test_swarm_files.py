"""compose.swarm.yaml and configs/kubernetes say what they promise, and their names and numbers fit each other."""

import hashlib
import re
import subprocess
from ipaddress import IPv4Network
from pathlib import Path

import pytest
import yaml
from rig_dashboards import needs_promtool

from pnfarm.cli.farm_file import read
from pnfarm.farm.file.reading import expand

ROOT = Path(__file__).resolve().parents[1]
STACK = yaml.safe_load((ROOT / "compose.swarm.yaml").read_text("utf-8"))
SERVICES = STACK["services"]
CONFIG = read(ROOT / "configs" / "swarm" / "farm.pnfarm.yml")
OBJECTS = {
    (item["kind"], item["metadata"]["name"]): item
    for name in ("farm.yaml", "hub.yaml")
    for item in yaml.safe_load_all((ROOT / "configs" / "kubernetes" / name).read_text("utf-8"))
}


@pytest.mark.parametrize("name", ["farm", "hub", "plc", "prometheus", "grafana"])
def test_a_service_has_no_right_that_it_does_not_need(name):
    change = {"SETUID", "SETGID", "SETPCAP"}
    wanted = {"farm": {"NET_ADMIN", "NET_RAW", *change}, "plc": {"NET_RAW", *change}}
    assert SERVICES[name]["cap_drop"] == ["ALL"]
    assert set(SERVICES[name].get("cap_add", ())) == wanted.get(name, set())
    assert "privileged" not in SERVICES[name]
    # Grafana's image is not part of any test
    assert SERVICES[name].get("read_only", False) == (name != "grafana")


def test_a_task_runs_the_shard_of_its_slot_and_there_is_one_for_each():
    shards = "${PNFARM_SHARDS:-3}"
    assert SERVICES["farm"]["environment"]["PNFARM_UP_SHARD"] == "{{.Task.Slot}}/" + shards
    assert SERVICES["farm"]["deploy"]["replicas"] == shards


@pytest.mark.parametrize("name", ["farm", "plc", "db", "prometheus", "grafana"])
def test_what_may_not_run_twice_stops_before_the_next_one_starts(name):
    assert SERVICES[name]["deploy"]["update_config"]["order"] == "stop-first"
    assert SERVICES[name]["deploy"]["rollback_config"]["order"] == "stop-first"


def test_a_mute_shard_is_not_killed_for_it_and_a_waiting_one_neither():
    check = SERVICES["farm"]["healthcheck"]
    assert "healthz" in check["test"][-1]
    assert check["start_period"] == "600s"


def test_every_secret_and_every_config_of_a_service_is_one_of_the_stacks():
    for service in SERVICES.values():
        for kind in ("secrets", "configs"):
            for one in service.get(kind, ()):
                assert (one if isinstance(one, str) else one["source"]) in STACK[kind]
    assert all(secret["external"] for secret in STACK["secrets"].values())
    for config in STACK["configs"].values():
        path = re.sub(r"\$\{\w+:-(.*)\}", r"\1", config["file"])
        # of an older engine, which takes the least
        assert 0 < (ROOT / path).stat().st_size < 500_000


@pytest.mark.parametrize("name", sorted(STACK["configs"].keys() - {"farm"}))
def test_a_changed_file_is_a_config_of_another_name_as_a_swarm_changes_none(name):
    """`docker stack deploy` of a new version fails otherwise: only updates to Labels are allowed."""
    config = STACK["configs"][name]
    digest = hashlib.sha256((ROOT / config["file"]).read_bytes()).hexdigest()
    assert config["name"] == f"pnfarm_{name}_{digest[:8]}", "name it so in compose.swarm.yaml"


def test_the_farm_file_has_the_stacks_names_and_addresses_that_no_container_gets():
    subnet = IPv4Network("10.77.0.0/16")
    for name in ("farm", "plc"):
        assert str(subnet) in SERVICES[name]["entrypoint"]
    pool = IPv4Network("10.77.255.0/24")
    own = [drive.ip.ip for drive in expand(CONFIG)] + [CONFIG.controller.ip.ip]
    assert all(address in subnet and address not in pool for address in own)
    assert CONFIG.state == "postgresql://pnfarm@db/pnfarm"
    assert SERVICES["db"]["environment"]["POSTGRES_USER"] == "pnfarm"
    assert CONFIG.api.token_file == "/run/secrets/token"


@needs_promtool
def test_prometheus_takes_its_file(tmp_path):
    text = (ROOT / "configs" / "swarm" / "prometheus.yml").read_text("utf-8")
    (tmp_path / "token").write_text("x")
    text = text.replace("/run/secrets/token", str(tmp_path / "token"))
    text = text.replace("/etc/prometheus", str(ROOT / "configs" / "prometheus"))
    (tmp_path / "prometheus.yml").write_text(text, "utf-8")
    subprocess.run(["promtool", "check", "config", str(tmp_path / "prometheus.yml")], check=True, capture_output=True)
    jobs = {job["job_name"]: job["dns_sd_configs"][0] for job in yaml.safe_load(text)["scrape_configs"]}
    assert {name: (job["names"], job["port"]) for name, job in jobs.items()} == {
        "pnfarm": (["tasks.farm"], 8702),
        "pnfarm-hub": (["tasks.hub"], 8702),
    }


def test_grafana_asks_for_rates_over_the_interval_at_which_this_prometheus_scrapes():
    (source,) = yaml.safe_load((ROOT / STACK["configs"]["datasource"]["file"]).read_text("utf-8"))["datasources"]
    scraped = yaml.safe_load((ROOT / STACK["configs"]["prometheus"]["file"]).read_text("utf-8"))
    assert source["jsonData"]["timeInterval"] == scraped["global"]["scrape_interval"]
    rigs = ROOT / "dashboards" / "provisioning" / "datasources" / "prometheus.yml"
    (other,) = yaml.safe_load(rigs.read_text("utf-8"))["datasources"]
    assert {**source, "jsonData": None} == {**other, "jsonData": None}


def test_a_pod_runs_the_shard_of_its_ordinal_from_one():
    spec = OBJECTS["StatefulSet", "farm"]["spec"]
    (container,) = spec["template"]["spec"]["containers"]
    environment = {one["name"]: one for one in container["env"]}
    assert spec["ordinals"] == {"start": 1}
    assert environment["PNFARM_UP_SHARD"]["value"] == f"$(POD_INDEX)/{spec['replicas']}"
    index = environment["POD_INDEX"]["valueFrom"]["fieldRef"]["fieldPath"]
    assert index == "metadata.labels['apps.kubernetes.io/pod-index']"
    # what a variable is made of stands before it
    assert list(environment).index("POD_INDEX") < list(environment).index("PNFARM_UP_SHARD")


@pytest.mark.parametrize("name", ["farm", "hub"])
def test_a_service_of_kubernetes_chooses_the_pods_of_its_name(name):
    owner = OBJECTS[("StatefulSet" if name == "farm" else "Deployment"), name]["spec"]
    chosen = OBJECTS["Service", name]["spec"]["selector"]
    assert owner["selector"]["matchLabels"] == chosen
    assert owner["template"]["metadata"]["labels"] == chosen
    assert OBJECTS["Service", "farm"]["spec"]["clusterIP"] == "None"


def test_a_mute_shard_of_kubernetes_stays_alive_and_is_found():
    (container,) = OBJECTS["StatefulSet", "farm"]["spec"]["template"]["spec"]["containers"]
    assert container["livenessProbe"]["httpGet"]["path"] == "/api/v1/healthz"
    assert container["readinessProbe"]["httpGet"]["path"] == "/api/v1/readyz"
    assert OBJECTS["Service", "farm"]["spec"]["publishNotReadyAddresses"] is True
