"""The dashboards: what is checked in is what the program makes, Grafana can read it, and every query finds its data.

A farm runs for two minutes of virtual time with a controller and faults; its metrics go into a real Prometheus with
the times at which they were read, and each panel's query is put to it.
"""

import contextlib
import copy
import importlib
import json
import re
import shutil
import socket
import subprocess
import sys
import time
import urllib.parse
import urllib.request

import metric_page
import pytest
import yaml
from prometheus_client.openmetrics.exposition import generate_latest
from rig_dashboards import BOARDS, ROOT, board, panels, queries

from pnfarm.metrics import FarmCollector
from pnfarm.testing import Line

needs_prometheus = pytest.mark.skipif(
    shutil.which("prometheus") is None or shutil.which("promtool") is None,
    reason="prometheus and promtool are not installed (apt-get install prometheus)",
)
STEP_SECONDS = 2
SHOWN_SECONDS = 120
INSTANCE = "farm:8702"


def test_checked_in_dashboards_are_what_the_program_makes():
    run = subprocess.run(
        [sys.executable, "dashboards/build.py", "--check"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert run.returncode == 0, f"{run.stdout}{run.stderr}run `python dashboards/build.py`"


@pytest.mark.parametrize("path", BOARDS, ids=lambda path: path.stem)
def test_panels_have_numbers_and_places_of_their_own(path):
    all_panels = board(path)["panels"]
    assert len({panel["id"] for panel in all_panels}) == len(all_panels)
    taken = set()
    for panel in all_panels:
        place = panel["gridPos"]
        assert place["x"] + place["w"] <= 24
        cells = {
            (x, y)
            for x in range(place["x"], place["x"] + place["w"])
            for y in range(place["y"], place["y"] + place["h"])
        }
        assert not cells & taken, panel["title"]
        taken |= cells


@pytest.mark.parametrize("path", BOARDS, ids=lambda path: path.stem)
def test_every_panel_says_what_it_shows(path):
    for panel in panels(path):
        assert panel["description"].endswith("."), panel["title"]
        assert len({target["refId"] for target in panel["targets"]}) == len(panel["targets"])


def test_links_lead_to_dashboards_that_exist():
    known = {board(path)["uid"] for path in BOARDS}
    text = "".join(path.read_text("utf-8") for path in BOARDS)
    assert set(re.findall(r"/d/([a-z-]+)", text)) == known == {"pnfarm-farm", "pnfarm-drive"}


def test_provisioning_finds_the_dashboards_and_the_datasource_of_the_compose_file():
    services = yaml.safe_load((ROOT / "compose.yaml").read_text("utf-8"))["services"]
    folder = ROOT / "dashboards" / "provisioning"
    (source,) = yaml.safe_load((folder / "datasources" / "prometheus.yml").read_text("utf-8"))["datasources"]
    address = urllib.parse.urlsplit(source["url"])
    assert address.hostname in services
    assert f"127.0.0.1:{address.port}:{address.port}" in services[address.hostname]["ports"]
    prometheus = yaml.safe_load((ROOT / "configs" / "prometheus" / "prometheus.yml").read_text("utf-8"))
    assert source["jsonData"]["timeInterval"] == prometheus["global"]["scrape_interval"]
    (provider,) = yaml.safe_load((folder / "dashboards" / "pnfarm.yml").read_text("utf-8"))["providers"]
    assert f"./dashboards/json:{provider['options']['path']}:ro" in services["grafana"]["volumes"]


#: Of annotations and variables Grafana's published types know less than Grafana's Prometheus plugin reads.
UNTYPED = {"step", "titleFormat", "textFormat", "expr", "refId", "definition"}


def lost(given, kept, where=""):
    """Places of ``given`` that are gone or changed in ``kept``; what is absent and false is the same."""
    if isinstance(given, dict) and isinstance(kept, dict):
        for key, value in given.items():
            if key in kept:
                yield from lost(value, kept[key], f"{where}.{key}")
            elif value is not False and key not in UNTYPED and not where.endswith("tooltip"):
                yield f"{where}.{key}"
    elif isinstance(given, list) and isinstance(kept, list) and len(given) == len(kept):
        for index, (one, other) in enumerate(zip(given, kept, strict=True)):
            yield from lost(one, other, f"{where}[{index}]")
    elif given != kept:
        yield where


@pytest.mark.parametrize("path", BOARDS, ids=lambda path: path.stem)
def test_grafanas_own_types_read_a_dashboard_without_loss(path):
    dashboard = pytest.importorskip(
        "grafana_foundation_sdk.models.dashboard", reason="grafana-foundation-sdk is not installed"
    )
    encoder = importlib.import_module("grafana_foundation_sdk.cog.encoder")
    importlib.import_module("grafana_foundation_sdk.cog.plugins").register_default_plugins()
    given = board(path)
    kept = json.loads(json.dumps(dashboard.Dashboard.from_json(given), cls=encoder.JSONEncoder))
    assert list(lost(given, kept)) == []


# -- queries ---------------------------------------------------------------------------------------------------------


class _Sampled:
    """A farm's metrics at one time, for prometheus_client's OpenMetrics writer."""

    def __init__(self, collector, when):
        self._collector, self._when = collector, when

    def collect(self):
        for family in self._collector.collect():
            family.samples = [
                sample._replace(labels={**sample.labels, "instance": INSTANCE, "job": "pnfarm"}, timestamp=self._when)
                for sample in family.samples
            ]
            yield family


FARM = """
farm: line
link: {kind: memory}
drives:
  - {name: 'axis-{n:02}', count: 3, model: akd-profinet, ip: 10.77.0.11/23}
  - {name: 'eip-{n:02}', count: 2, model: akd-ethernetip, ip: 10.77.0.71/23}
  - {name: 'dp-{n:02}', count: 1, model: moog-msd-dp, address: 11}
controller:
  name: plc
  ip: 10.77.1.250/23
  cycle: 16ms
  watchdog_factor: 3
  reconnect: {after: 300ms}
  program: {kind: constant, speed_rpm: 60, acknowledge_after: 200ms}
  ethernetip: {ip: 10.77.1.251/23, rpi: 10ms}
  profibus: {cycle: 20ms, watchdog: 60ms}
"""
#: A drive on each bus.
BROKEN = ("axis-01", "eip-01", "dp-01")
#: Scrape -> the fault that begins there.
HAPPENS = {
    15: {"kind": "drive-fault", "params": {"fault": 702, "hold": True}, "for": "5s"},
    25: {"kind": "timeout"},
    35: {"kind": "loss", "probability": 0.05, "direction": "in", "for": "40s"},
}


def eventful_history(begin):
    """OpenMetrics text of a farm that connects, runs, trips, loses a drive and recovers, from ``begin`` on."""
    line = Line.from_text(FARM)
    collector = FarmCollector(line.core)
    heads, samples = {}, {}
    for tick in range(SHOWN_SECONDS // STEP_SECONDS + 1):
        if tick in HAPPENS:
            for name in BROKEN:
                fault = copy.deepcopy(HAPPENS[tick])
                if name.startswith("dp") and fault["kind"] == "drive-fault":
                    fault["params"]["fault"] = "9-1"
                line.core.injections.inject({"on": name, **fault}, line.now_ns)
        text = generate_latest(_Sampled(collector, begin + tick * STEP_SECONDS)).decode()
        for block in text.removesuffix("# EOF\n").split("# HELP ")[1:]:
            help_row, type_row, *rows = block.splitlines()
            name = help_row.split()[0]
            heads[name] = f"# HELP {help_row}\n{type_row}"
            samples.setdefault(name, []).extend(rows)
        line.run(STEP_SECONDS)
    line.close()
    # the import wants all samples of a metric together
    return "".join("\n".join([head, *samples[name], ""]) for name, head in heads.items()) + "# EOF\n"


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


@pytest.fixture(scope="module")
def prometheus(tmp_path_factory):
    """A Prometheus with that history; a function that asks it over the shown range."""
    folder = tmp_path_factory.mktemp("prometheus")
    end = int(time.time()) // 10 * 10 - 60
    (folder / "history.txt").write_text(eventful_history(end - SHOWN_SECONDS), "utf-8")
    subprocess.run(
        ["promtool", "tsdb", "create-blocks-from", "openmetrics", "history.txt", "data"],
        cwd=folder, check=True, capture_output=True, timeout=60,
    )  # fmt: skip
    (folder / "prometheus.yml").write_text("global: {}\n", "utf-8")
    base = f"http://127.0.0.1:{free_port()}"
    log = (folder / "log").open("wb")
    server = subprocess.Popen(
        ["prometheus", "--config.file=prometheus.yml", "--storage.tsdb.path=data",
         "--storage.tsdb.retention.time=10y", f"--web.listen-address={base[7:]}"],
        cwd=folder, stdout=log, stderr=log,
    )  # fmt: skip

    def ask(expression):
        form = {"query": expression, "start": end - SHOWN_SECONDS, "end": end, "step": STEP_SECONDS}
        body = urllib.parse.urlencode(form).encode()
        with urllib.request.urlopen(f"{base}/api/v1/query_range", body, timeout=10) as answer:
            return json.load(answer)["data"]["result"]

    try:
        deadline = time.monotonic() + 20
        while True:
            with contextlib.suppress(OSError), urllib.request.urlopen(f"{base}/-/ready", timeout=2):
                break
            assert time.monotonic() < deadline, (folder / "log").read_text()
            time.sleep(0.1)
        yield ask
    finally:
        server.terminate()
        server.wait(10)
        log.close()


@needs_prometheus
@pytest.mark.parametrize("drive", BROKEN)
@pytest.mark.parametrize("path", BOARDS, ids=lambda path: path.stem)
def test_every_query_of_a_dashboard_finds_data_of_a_drive_on_each_bus(prometheus, path, drive):
    asked = queries(path, drive=drive)
    assert len(asked) > 20
    assert [title for title, query in asked.items() if not prometheus(query)] == []


@needs_prometheus
@pytest.mark.parametrize("title", metric_page.QUERIES)
def test_every_query_of_the_documentation_finds_data(prometheus, title):
    assert prometheus(metric_page.QUERIES[title][0])


@needs_prometheus
def test_dashboards_show_the_fault_the_lost_connection_and_the_recovery(prometheus):
    one_drive = queries(ROOT / "dashboards" / "json" / "one-drive.json")
    values = {
        title: [float(value) for _, value in series["values"]]
        for title in ("Fault A", "Connection A", "State A", "Speed A")
        for series in prometheus(one_drive[title])
    }
    assert 702 in values["Fault A"]
    assert values["Fault A"][-1] == 0
    assert {0, 9} <= set(values["Connection A"])
    assert values["State A"][-1] == 4
    assert values["Speed A"][-1] == pytest.approx(60, abs=1)
    codes = {series["metric"]["code"] for series in prometheus(one_drive["Faults A"])}
    assert "702" in codes
    overview = queries(ROOT / "dashboards" / "json" / "farm-overview.json")
    (drives,) = prometheus(overview["Drives A"])
    assert {value for _, value in drives["values"]} == {"6"}
    jitter = prometheus(overview["Jitter, p99: the ten worst drives A"])
    # a polled drive has no agreed cycle to deviate from
    measured = [series for series in jitter if any(value != "NaN" for _, value in series["values"])]
    assert {series["metric"]["model"] for series in measured} == {"akd-profinet", "akd-ethernetip"}
    reactions = prometheus(overview["Reaction to a fault, p99 by fault and injection A"])
    assert {"702"} <= {series["metric"]["code"] for series in reactions}
    lost = {(s["metric"]["reason"], s["metric"]["cause"]) for s in prometheus(one_drive["Connections lost A"])}
    assert ("consumer-dht-expired", "controller") in lost
    injected = {series["metric"]["kind"] for series in prometheus(overview["Activity of injected faults A"])}
    assert {"drive-fault", "loss"} <= injected or {"f702", "loss"} <= injected
