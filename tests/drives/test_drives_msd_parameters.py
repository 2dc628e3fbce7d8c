"""The Moog MSD's parameters against chapter 15 of its manual, row by row: range, default, and what of them lives."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import pytest
from drives_kit import Drive
from manuals import manual_text

from pnfarm.drives.catalogue import model
from pnfarm.drives.parameters.parameter import Backing
from pnfarm.table.axis_codes import RAMP_GENERATED

if TYPE_CHECKING:
    pass

MSD = model("moog-msd")
#: PNU -> the first element where the table's default is not a plain number, or another than the text's.
DEFAULTS = {
    924: 4,  # "410": [0] = 4, [1] = 10
    925: 65535,  # 8.3.2: the factory setting
    950: 20,  # "201": 20 situations of one fault (10.9)
    951: 59000,  # 10.9, table 10.22
    965: 810,  # 17.2: profile 3, version 42
    974: 378,
    979: 0x5111,  # 11.3.1, table 11.4
    1255: 0,
    963: 0,
}
#: PNU -> range, where the table's does not fit its own type, or is no pair of numbers.
RANGES = {949: (0, 0xFFFFFFFF), 963: (0, 65535), 1289: (0, 255), 1290: (0, 0xFFFFFFFF), 1291: (0, 0xFFFFFFFF)}
RANGES |= {1292: (0, 255), 1293: (0, 255), 1294: (0, 0xFFFF), 1295: (0, 0xFFFFFFFF)}


def table_15_1() -> list[tuple[int, str, str]]:
    """Number, range and default of each row."""
    text = manual_text("003")
    start = text.index("15 PROFIBUS/PROFINET parameters and their description\n\nParameter name")
    text = text[start : text.index("* Only PROFIBUS parameters", start)]
    rows = re.findall(
        r"^COM_\S+(?: \S+)?\t\**P-(\d{4})\**\t([^\t]*)\t([^\t]*)\t(?:Yes|YES|Ja|No)\t", text, re.MULTILINE
    )
    return [(int(number), limits, default) for number, limits, default in rows]


def test_table_15_1_has_eighty_parameters_with_their_ranges() -> None:
    rows = table_15_1()
    assert len({number for number, *_ in rows}) == 80
    for number, limits, _ in rows:
        parameter = MSD.parameters[number]
        found = re.fullmatch(r"(-?\w+) ?[-\u2013] ?(-?\w+)", limits.strip())
        if number in RANGES:
            wanted = RANGES[number]
        else:
            assert found is not None, parameter
            wanted = (int(found[1], 0), int(found[2], 0))
        assert (parameter.minimum, parameter.maximum) == wanted, parameter


def test_table_15_1_gives_each_stored_parameter_its_default() -> None:
    looked_at = 0
    for number, _, default in table_15_1():
        parameter = MSD.parameters[number]
        if parameter.backing in {Backing.STORED, Backing.FIELD} and not parameter.text:
            wanted = DEFAULTS[number] if number in DEFAULTS else int(default, 0)
            assert parameter.default == wanted, parameter
            looked_at += 1
    assert looked_at >= 20


def test_what_chapter_15_says_of_the_drive_itself_is_read_from_the_drive() -> None:
    """15: words, positions, faults, telegram and station are not stored, so that they cannot be stale."""
    live = {Backing.SIGNAL, Backing.COMPUTED, Backing.FIELD}
    numbers = (
        *range(915, 917), 922, 923, 925, 930, 944, 945, 947, 949, 952, 953, 964, 967, 968, 975, *range(980, 991),
        *range(1255, 1256), *range(1259, 1272), *range(1274, 1282), 1283, 1284, 1285, *range(1289, 1293), 1295, 1296,
    )  # fmt: skip
    assert [n for n in numbers if MSD.parameters[n].backing not in live] == []


@pytest.mark.parametrize(
    ("mode", "ramp", "shown"), [(3, 0, 2), (3, 1, 2), (2, 0, 1), (2, 1, 3), (0, 0, 1), (1, 0, 0)], ids=str
)
def test_p_0930_follows_the_control_mode(msd: Drive, mode: int, ramp: int, shown: int) -> None:
    """15, P-0930, in the profile's numbers; 10.1, table 10.1."""
    msd.store.set("P-0300", mode)
    msd.store.set("P-0301", ramp)
    assert msd.store.get("P-0930") == shown
    assert (msd.axis.ramp.settings.generator == RAMP_GENERATED) == (not ramp)


def test_p_0971_makes_what_was_written_permanent_and_nothing_else_does(msd: Drive) -> None:
    """15, P-0971: any value of 0 to 255."""
    for value in (0, 1, 255):
        msd.store.set("P-0918", 10 + value % 100)
        msd.store.set("P-0971", value)
        kept = msd.store.snapshot()
        msd.store.set("P-0918", 1)
        assert msd.store.snapshot() == kept
        msd.store.power_on()
        assert msd.store.get("P-0918") == 10 + value % 100


def test_p_0990_lists_what_is_not_the_factorys_and_no_more(msd: Drive) -> None:
    """15, P-0990."""
    assert not any(msd.store.read(990, 0, 117))
    msd.store.set("P-0918", 3)
    msd.store.set("P-1279", 5)
    msd.store.write(1254, 3, [1])
    assert msd.store.read(990, 0, 4) == [918, 1254, 1279, 0]
    msd.store.set("P-0918", 126)
    msd.store.write(1254, 3, [0])
    assert msd.store.read(990, 0, 2) == [1279, 0]


def test_p_0980_to_p_0989_lead_through_all_parameters(msd: Drive) -> None:
    """15, P-0980 to P-0989; a list that is not the last ends with the number of the next."""
    found: list[int] = []
    number = 980
    while True:
        part = msd.store.read(number, 0, 117)
        if part[-1] != number + 1:
            found += [pnu for pnu in part if pnu]
            break
        found += part[:-1]
        number += 1
    assert found == [pnu for pnu in MSD.parameters if not 980 <= pnu <= 989]


def test_identification_has_the_entries_of_the_table(msd: Drive) -> None:
    """15, P-0964, P-0965, P-0974 and P-0975."""
    assert msd.store.read(975, 0, 10) == [380, 1, 12425, 2018, 3005, 1, 29, 0, 0, 0]
    assert msd.store.read(964, 0, 5) == [380, 1, 12425, 2018, 3005]
    assert msd.store.read(974, 0, 3) == [378, 20, 3]
    assert msd.store.get("P-0965") == 0x032A
