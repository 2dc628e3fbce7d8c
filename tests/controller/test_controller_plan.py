"""What the controller's plan makes of the farm file."""

import pytest

from pnfarm.controller.plan import plan_controllers
from pnfarm.farm.file.reading import expand, parse_farm

FILE = """
farm: line
link: {{kind: memory}}
drives:
  - {{name: axis-01, model: akd-profinet, ip: 10.77.0.11/24}}
  - {{name: press, model: hiwin-e1, ip: 10.77.0.12/24}}
controller:
  ip: 10.77.0.1/24
  records: [{{slot: 1, subslot: 1, index: 47, data: '00', on: {on}}}]
"""


@pytest.mark.parametrize(
    ("on", "meant"),
    [
        ("all", ["axis-01", "press"]),
        ("axis-*", ["axis-01"]),
        ("[press]", ["press"]),
        ("'model:hiwin-*'", ["press"]),
        ("'model:other'", []),
    ],
)
def test_a_record_is_written_to_the_drives_that_its_globs_mean(on, meant):
    config = parse_farm(FILE.format(on=on))
    plan = plan_controllers(config, expand(config))[0].plan
    assert [device.name for device in plan.devices if device.records] == meant
