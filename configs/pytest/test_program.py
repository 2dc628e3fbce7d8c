"""Unit tests of a PLC program in Python: in memory and virtual time, on any machine."""

from pathlib import Path

PROGRAM = Path(__file__).with_name("my_plc.py")


def test_the_axis_comes_into_operation(pnfarm_farm):
    line = pnfarm_farm("axis-01", program=PROGRAM)
    line.wait_running(within=5)
    line.run(1)
    assert abs(line["axis-01"].velocity - 60) < 1


def test_one_fault_is_acknowledged_once(pnfarm_farm):
    line = pnfarm_farm("axis-01", "axis-02", program=PROGRAM)
    axis = line["axis-01"]
    line.wait_running()
    with axis.inject("drive-fault", fault=702, count=1):
        line.wait_until(lambda: axis.fault == 702, within=0.1)
        line.wait_until(lambda: not axis.stw1.enable_operation, within=0.1, what="the program stops the axis")
    line.wait_until(lambda: axis.state == "S4", within=2)
    assert line.program("axis-01").acknowledged == 1
    assert line.program("axis-02").acknowledged == 0
