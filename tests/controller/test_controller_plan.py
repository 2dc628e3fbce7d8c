"""What the controller's plan makes of the farm file."""

import pytest

from pnfarm.controller.plan import plan_controllers
from pnfarm.farm.file.reading import expand, parse_farm
from pnfarm.testing import Line

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


def test_a_reference_speed_of_the_farm_file_scales_the_set_point_of_the_speed():
    text = """farm: line
link: {kind: memory}
drives: [{name: axis, model: profidrive, ip: 10.77.0.11/24, telegram: 1, params: {p2000: 1500.0}}]
controller: {ip: 10.77.0.1/24, program: {kind: constant, speed_rpm: 300}}
"""
    with Line.from_text(text) as line:
        line.wait_running()
        line.run(1.0)
        assert line["axis"].velocity == pytest.approx(300, rel=1e-3)


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
