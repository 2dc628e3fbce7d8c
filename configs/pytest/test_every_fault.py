"""One test for each fault and model: the program must bring the axis back after every one of them."""

from pathlib import Path

import pytest

PROGRAM = Path(__file__).with_name("my_plc.py")
FAULTS = [
    ("undervoltage", {"for_": 0.5}),
    ("silence", {"for_": 0.5}),
    ("provider-stop", {"for_": 0.5}),
    ("iops-bad", {"for_": 0.5}),
    ("loss", {"for_": 0.5, "probability": 0.9, "seed": 1}),
    ("link-down", {"for_": 1.0}),
    ("ar-abort", {"count": 1}),
    ("power-cycle", {"count": 1}),
]


@pytest.mark.parametrize("model", ["akd-profinet", "hiwin-e1"])
@pytest.mark.parametrize(("kind", "options"), FAULTS, ids=[kind for kind, _ in FAULTS])
def test_the_program_brings_the_axis_back(pnfarm_farm, model, kind, options):
    line = pnfarm_farm("axis-01", model=model, program=PROGRAM)
    axis = line["axis-01"]
    line.wait_running()
    fault = axis.inject(kind, **options)
    line.wait_until(lambda: fault.state == "ended" and fault.evidence.activations, within=5)
    line.wait_until(lambda: axis.state == "S4" and not axis.fault, within=30, what="operation after the fault")
