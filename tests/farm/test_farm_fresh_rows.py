"""Drives that are alike are worked out once."""

import asyncio

import numpy as np
import pytest

from pnfarm.controller.line import VirtualLine
from pnfarm.drives.parameters.axis_fields import AxisFields
from pnfarm.farm.file.reading import parse_farm
from pnfarm.firmware.axis import AXIS
from pnfarm.table.access.fresh_rows import FreshRows, Same

FILE = """
farm: alike
link: {kind: memory}
api: off
drives:
  - {name: "akd-{n}", count: 3, model: akd-profinet, ip: 10.77.0.1/16}
  - {name: "old-{n}", count: 2, model: akd-profinet-2012, ip: 10.77.1.1/16}
  - {name: "fast-{n}", count: 2, model: akd-profinet, ip: 10.77.2.1/16, telegram: 9, params: {DRV.ACC: 9000}}
  - {name: "e1-{n}", count: 2, model: hiwin-e1, ip: 10.77.3.1/16, load: {inertia: 0.003}}
  - {name: "cip-{n}", count: 3, model: akd-ethernetip, ip: 10.77.5.1/16}
  - {name: "msd-{n}", count: 2, model: moog-msd, ip: 10.77.4.1/16, realism: {seed: 3}}
"""


def farm_axes():
    """The octets of all axes."""
    line = asyncio.run(VirtualLine.create(parse_farm(FILE)))
    return line.farm.columns.axis.view(np.ndarray).view(np.uint8).tobytes()


def test_a_farm_is_the_same_as_with_each_drive_worked_out_by_itself(monkeypatch):
    counted = []
    work_out = AxisFields._write_all
    monkeypatch.setattr(AxisFields, "_write_all", lambda self: counted.append(1) or work_out(self))
    axes = farm_axes()
    once = len(counted)
    monkeypatch.setattr(FreshRows, "write", lambda _self, _record, _key, write: write())
    each = farm_axes()
    assert axes == each
    assert once < len(counted) - once


@pytest.fixture
def rows():
    return FreshRows(most=2)


def test_what_was_written_once_is_copied_and_its_result_told_again(rows):
    axes = AXIS.allocate(2)
    done = []

    def write(row):
        done.append(row)
        axes[row].load.settings.inertia = 0.5
        return "written"

    assert [rows.write(axes[row], "key", lambda row=row: write(row)) for row in (0, 1)] == ["written", "written"]
    assert done == [0]
    assert axes[1].load.settings.inertia == 0.5


def test_another_key_or_another_row_before_is_worked_out_anew(rows):
    axes = AXIS.allocate(3)
    axes[1].motor.position = 7.0
    done = []
    rows.write(axes[0], "key", lambda: done.append("first"))
    rows.write(axes[1], "key", lambda: done.append("moved"))
    rows.write(axes[2], "other", lambda: done.append("other"))
    assert done == ["first", "moved", "other"]


def test_the_row_that_was_not_used_for_longest_is_forgotten(rows):
    axes = AXIS.allocate(1)
    done = []
    for key in "ababcab":
        rows.write(axes[0], key, lambda key=key: done.append(key))
    assert done == ["a", "b", "c", "a", "b"]


def test_equal_objects_are_not_the_same():
    one, other = [1], [1]
    assert Same(one) == Same(one)
    assert Same(one) != Same(other)
    assert len({Same(one), Same(one), Same(other)}) == 2
    assert Same(np.array([1, 2])) != 1
