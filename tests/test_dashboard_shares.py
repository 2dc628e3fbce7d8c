"""The dashboards' shares of a farm with axes, drives and devices, by the Prometheus that evaluates alert rules."""

import json
import subprocess

import pytest
from rig_dashboards import ROOT, needs_promtool, queries

from pnfarm.metrics import FarmCollector
from pnfarm.metrics.collector import connection_numbers
from pnfarm.testing import Line

OVERVIEW, ONE_DRIVE = (ROOT / "dashboards" / "json" / f"{name}.json" for name in ("farm-overview", "one-drive"))
DATA = connection_numbers("profinet")["DATA"]
FARM = f"""
farm: line
link: {{kind: memory}}
drives:
  - {{name: drive, model: akd-profinet, ip: 10.77.0.11/23}}
  - {{name: system, model: profidrive, ip: 10.77.0.12/23, axes: [{{name: x}}, {{name: y}}, {{name: z}}]}}
devices:
  - name: island
    gsdml: {ROOT}/configs/gsdml/GSDML-V2.35-Example-Island-20261127.xml
    access_point: DAP 1
    ip: 10.77.0.41/23
    slots: {{1: 16DI}}
controller: {{name: plc, ip: 10.77.1.250/23, cycle: 16ms, watchdog_factor: 3}}
"""


@pytest.fixture(scope="module")
def ask(tmp_path_factory):
    """Whether queries have these values of the farm while all of it exchanges data."""
    folder = tmp_path_factory.mktemp("prometheus")
    with Line.from_text(FARM) as line:
        collector = FarmCollector(line.core)
        line.wait_connected()
        rows = [row for row in collector.gather().text().decode().splitlines() if not row.startswith("#")]
    series = [dict(zip(("series", "values"), row.rsplit(" ", 1), strict=True)) for row in rows]

    def ask(expected):
        tests = [
            {"expr": query, "eval_time": "0", "exp_samples": [{"labels": labels, "value": value}]}
            for query, labels, value in expected
        ]
        rules = {"tests": [{"interval": "1s", "input_series": series, "promql_expr_test": tests}]}
        (folder / "test.json").write_text(json.dumps(rules), "utf-8")
        run = subprocess.run(
            ["promtool", "test", "rules", "test.json"], cwd=folder, capture_output=True, text=True, check=False
        )
        assert run.returncode == 0, run.stdout + run.stderr

    return ask


@needs_promtool
def test_all_of_a_farm_that_exchanges_data_is_a_hundred_percent(ask):
    ask([(queries(OVERVIEW)["Exchanging data A"], "{}", 1)])


@needs_promtool
@pytest.mark.parametrize(("drive", "station"), [("drive", "drive"), ("system.y", "system")])
def test_an_axis_with_a_name_of_its_own_is_shown_with_the_connection_of_its_station(ask, drive, station):
    found = queries(ONE_DRIVE, drive=drive, station=station)
    ask(
        [
            (f"sum by (node) ({found['variable station']})", f'{{node="{station}"}}', 1),
            (f"sum({found['Connection A']})", "{}", DATA),
            (f"sum({found['Cycle A']})", "{}", 0.016),
            (f"sum({found['Watchdog A']})", "{}", 0),
        ]
    )
