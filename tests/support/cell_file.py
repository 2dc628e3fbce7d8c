"""A farm file with a drive and an island by its GSDML file, and a controller that runs both."""

from farm_file import CONFIGS

GSDML = CONFIGS / "gsdml" / "GSDML-V2.35-Example-Island-20261127.xml"
DEVICES = f"""
devices:
  - name: island-1
    gsdml: {GSDML}
    access_point: DAP 1
    ip: 10.77.0.41/23
    slots: {{1: DI16, 2: DO8, 3: AI4}}
    signals:
      part_present: 1.1.0.3
      valve: 2.1.0.0
      pressure: {{at: 3.1.0, type: int16, unit: bar, scale: 0.01}}
"""
CELL = (
    """
farm: cell
link: {kind: memory}
drives:
  - {name: axis-01, model: akd-profinet, ip: 10.77.0.11/23}
controller:
  ip: 10.77.0.1/23
  program: {kind: constant, speed_rpm: 60, acknowledge_after: 200ms}
"""
    + DEVICES
)
