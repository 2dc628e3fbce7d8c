"""Views of single fields of a row, in place of the slow attributes of its record."""

from pnfarm.firmware.axis import AXIS
from pnfarm.table.access.record_fields import field_views


def test_views_show_and_write_fields_of_a_row_also_those_of_its_parts():
    axes = AXIS.allocate(3)
    powered, codes, warning = field_views(axes[1], "powered", "faults.code", "warnings.code")
    axes[1].powered, axes[1].faults.code[2], axes[1].warnings.code = 1, 702, 9
    assert (powered[0], codes[2], warning[0]) == (1, 702, 9)
    codes[0] = 21
    assert axes[1].faults.code[0] == 21
    assert not axes[0].faults.code.any()
    assert not axes[2].faults.code.any()
