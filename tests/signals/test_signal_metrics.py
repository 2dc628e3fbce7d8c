"""Signals of devices as metrics: those that the farm file asks for, and no other."""

import math
from types import SimpleNamespace

import pytest
from device_cell import HEAD, ONE, Cell, parse

from pnfarm.farm.file.reading import FarmFileError, parse_farm
from pnfarm.metrics import FarmCollector
from pnfarm.testing import Line


def samples(cell):
    collector = FarmCollector(cell.farm)
    try:
        lines = collector.gather().text().decode().splitlines()
    finally:
        collector.close()
    return dict(line.rsplit(" ", 1) for line in lines if line.startswith("pnfarm_signal_value"))


def test_no_signal_is_a_metric_by_itself():
    assert samples(Cell(ONE)) == {}


def test_a_signal_is_a_metric_where_the_farm_file_says_so():
    cell = Cell(ONE.replace("part_present: 1.1.0.3", "part_present: {at: 1.1.0.3, metrics: true}"))
    assert samples(cell) == {'pnfarm_signal_value{station="island",signal="part_present"}': "0.0"}
    cell.signals().set({"part_present": True})
    assert samples(cell) == {'pnfarm_signal_value{station="island",signal="part_present"}': "1.0"}


def test_every_named_signal_of_a_group_is_a_metric_but_those_that_are_left_out():
    more = """    metrics: true
    signals:
      valve: 2.1.0.0
      level: {at: 3.1.4, type: float32}
      code: {at: 3.1.0, type: "octets[2]", metrics: false}
"""
    cell = Cell(ONE.replace("    signals:\n", more))
    cell.connect()
    cell.signals().set({"pressure": -1.25, "level": math.nan})
    cell.sent(b"\1")
    found = {name.partition("signal=")[2].strip('"}'): float(value) for name, value in samples(cell).items()}
    assert math.isnan(found.pop("level"))
    assert found == {"valve": 1, "pressure": -1.25, "part_present": 0}


@pytest.mark.parametrize(
    ("more", "sentence"),
    [
        (
            '{at: 3.1.0, type: "octets[2]", metrics: true}',
            "signals.code: is of type octets[2], and a metric is a number",
        ),
        ('{at: 3.1.0, type: "text[4]"}\n    metrics: true', "`metrics` exports code, which is of type text[4]"),
        ("{at: 3.1.0, metrics: often}", "signals.code.metrics: is 'often'"),
    ],
)
def test_what_cannot_be_a_metric_is_refused(more, sentence):
    with pytest.raises(FarmFileError) as caught:
        parse(HEAD + ONE + f"      code: {more}\n")
    assert sentence in str(caught.value)


PLANT = """farm: t
link: {kind: memory}
drives:
- {name: x, model: akd-profinet, ip: 10.77.0.11/24}
plant:
  models:
"""


def test_ports_of_a_model_are_metrics_where_the_farm_file_names_them():
    models = (
        "  - {name: gripper, kind: cylinder, time: 1ms, metrics: [position, extend]}\n"
        "  - {name: lamp, kind: lamp, metrics: true}\n  - {name: other, kind: lamp}\n"
    )
    with Line.from_text(PLANT + models) as line:
        line.plant.gripper.extend = True
        line.run(0.05)
        found = samples(SimpleNamespace(farm=line.core))
    head = 'pnfarm_signal_value{station="gripper",signal='
    assert {name: found.pop(name) for name in list(found) if name.startswith(head)} == {
        f'{head}"position"}}': "1.0", f'{head}"extend"}}': "1.0",
    }  # fmt: skip
    assert all(name.startswith('pnfarm_signal_value{station="lamp"') for name in found)
    assert len(found) == 3


@pytest.mark.parametrize(
    ("metrics", "sentence"),
    [
        ("[positon]", "gripper has no port 'positon', did you mean position?"),
        ("often", "plant.models[0].metrics"),
        ("[1]", "plant.models[0]: metrics is a list"),
    ],
)
def test_a_port_that_a_model_does_not_have_is_no_metric(metrics, sentence):
    with pytest.raises(FarmFileError) as caught:
        parse_farm(PLANT + f"  - {{name: gripper, kind: cylinder, time: 1s, metrics: {metrics}}}\n")
    assert sentence in str(caught.value)
