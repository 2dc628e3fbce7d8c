"""A scenario runs with drives on EtherNet/IP and their scanner as with any others."""

import asyncio

from pnfarm.cli.commands.run import bound
from pnfarm.scenario.definition.file import parse_scenario
from pnfarm.scenario.virtual import run_virtual

FARM = """
farm: cip
link: {kind: memory}
drives:
  - {name: 'axis-{n}', count: 2, model: akd-ethernetip, ip: 10.77.0.11/23}
controller:
  name: plc
  ip: 10.77.1.250/23
  program: {kind: constant, speed_rpm: 100, acknowledge_after: 500ms}
  reconnect: {after: 500ms}
"""
SCENARIO = """
scenario: recovery
farm: {farm}
steps:
  - wait: {{until: all-connected, within: 20s}}
  - wait: {{until: state == S4, within: 10s}}
  - wait: {{until: velocity > 90, within: 5s}}
  - fault: {{kind: drive-fault, on: axis-1, params: {{fault: encoder-error}}, as: trip}}
  - expect: {{drive: axis-1, that: fault != 0, within: 100ms, name: the drive reports the fault}}
  - parallel:
      - expect: {{drive: axis-2, that: state == S4, for: 3s, name: the other axis runs on}}
      - - clear: trip
        - expect: {{drive: axis-1, that: fault == 0, within: 2s, name: the controller acknowledges}}
        - expect: {{drive: axis-1, that: state == S4, within: 2s, for: 1s, name: the axis is back}}
  - fault: {{kind: link-down, on: axis-2, for: 1s}}
  - expect: {{drive: axis-2, that: fault == 702, within: 200ms, name: the lost connection is a fault}}
  - expect: {{drive: axis-2, that: state == S4, within: 5s, for: 1s, name: the axis is back behind the cable}}
"""


def test_faults_and_recovery_have_their_verdict(tmp_path):
    farm = tmp_path / "line.pnfarm.yml"
    farm.write_text(FARM, encoding="utf-8")
    record, _ = asyncio.run(run_virtual(*bound(parse_scenario(SCENARIO.format(farm=farm)))))
    verdicts = {case["name"]: case["verdict"] for case in record["cases"]}
    assert len(verdicts) == 6
    assert set(verdicts.values()) == {"passed"}, verdicts
