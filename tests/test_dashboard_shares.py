"""The dashboards' shares of a farm with axes, drives and devices, by the Prometheus that evaluates alert rules."""

from __future__ import annotations

import json
import shutil
import subprocess

import pytest
from rig_dashboards import ROOT, queries

from pnfarm.metrics import FarmCollector
from pnfarm.testing import Line

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


@pytest.mark.skipif(shutil.which("promtool") is None, reason="promtool is not installed (apt-get install prometheus)")
def test_all_of_a_farm_that_exchanges_data_is_a_hundred_percent(tmp_path):
    query = queries(ROOT / "dashboards" / "json" / "farm-overview.json")["Exchanging data A"]
    with Line.from_text(FARM) as line:
        collector = FarmCollector(line.core)
        line.wait_connected()
        rows = [row for row in collector.gather().text().decode().splitlines() if row.startswith("pnfarm_a")]
    series = [dict(zip(("series", "values"), row.rsplit(" ", 1), strict=True)) for row in rows]
    expected = {"expr": query, "eval_time": "0", "exp_samples": [{"labels": "{}", "value": 1}]}
    rules = {"tests": [{"interval": "1s", "input_series": series, "promql_expr_test": [expected]}]}
    (tmp_path / "test.json").write_text(json.dumps(rules), "utf-8")
    run = subprocess.run(
        ["promtool", "test", "rules", "test.json"], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert run.returncode == 0, run.stdout + run.stderr
