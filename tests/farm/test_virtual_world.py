"""Time in a virtual world: who looks at it often sees what one sees who does not."""

from __future__ import annotations

from hand_plc import HandPlc
from virtual_line import VirtualLine

MS = 1_000_000


def octets(line: VirtualLine) -> list[bytes]:
    tables = (line.farm.columns, line.plc.columns)
    return [column.tobytes() for table in tables for column in (table.axis, table.image, table.frames, table.engine)]


def looked_at(look_ns: int | None) -> tuple[list[bytes], int]:
    line = VirtualLine(model="hiwin-e1", telegram=9, cycle="1ms")
    count = 0

    def look() -> bool:
        nonlocal count
        count += 1
        return False

    line.world.run(1.5, until=look, look_ns=look_ns)
    return octets(line), count


def test_a_run_that_is_looked_at_each_millisecond_comes_to_the_same_octets():
    seen, often = looked_at(MS)
    same, seldom = looked_at(None)
    assert seen == same
    assert often > 1500 > seldom


def test_a_run_ends_at_the_first_look_at_which_its_condition_holds():
    line = VirtualLine(model="hiwin-e1", telegram=9, cycle="1ms")
    begun = line.world.now
    assert line.world.run(1.0, until=lambda: line.world.now - begun >= 77 * MS, look_ns=7 * MS)
    assert line.world.now - begun == 77 * MS
    assert not line.world.run(0.5, until=lambda: False, look_ns=7 * MS)
    assert line.world.now - begun == 577 * MS


def test_the_sign_of_life_counts_the_same_frame_by_frame_or_many_at_once():
    one, many = (HandPlc("hiwin-e1", 111) for _ in range(2))
    for _ in range(40):
        one.wait()
    many.wait(40)
    assert one.life == many.life
    assert octets(one) == octets(many)


def test_every_table_of_a_kind_has_the_same_type_so_that_no_call_compares_its_fields():
    line = VirtualLine()
    for of_farm, of_plc in zip(arrays(line.farm.columns), arrays(line.plc.columns), strict=True):
        assert of_farm.dtype is of_plc.dtype


def arrays(columns):
    """The arrays of a table, those of parts as well."""
    return [array for part in columns for array in (part if isinstance(part, tuple) else (part,))]
