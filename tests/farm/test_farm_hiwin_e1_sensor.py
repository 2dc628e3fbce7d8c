"""The encoder of a HIWIN E1 in telegram 3, by G1_STW and G1_ZSW bit by bit (manual 3.7, 3.8)."""

from __future__ import annotations

import pytest
from hand_plc import HandPlc

SEARCH, READ, CANCEL, ON_THE_FLY = 0x10, 0x20, 0x30, 0x80
PARK, ACKNOWLEDGE = 0x4000, 0x8000
ACKNOWLEDGING, PARKED, ERROR = 0x0800, 0x4000, 0x8000
COUNTS = 1 << 23
RUN = 0x040F


@pytest.fixture
def plc() -> HandPlc:
    found = HandPlc("hiwin-e1", 3)
    found.switch_on(operation=RUN)
    return found


def ask(plc: HandPlc, word: int) -> int:
    plc.put(G1_STW=word)
    return plc["G1_ZSW"]


def turn(plc: HandPlc, rpm: float, milliseconds: int) -> None:
    plc.put(NSOLL_B=round(rpm / 3000.0 * 0x40000000), wait=milliseconds)
    plc.put(NSOLL_B=0, wait=100)


@pytest.mark.parametrize("function", [1, 2, 3, 4])
def test_tables_3_7_1_and_3_8_1_a_reference_mark_is_searched_found_read_and_gone(plc, function):
    """Bits 0 to 3 name the function, 4 to 6 the command; G1_XIST2 has the position at the mark."""
    bit = 1 << (function - 1)
    turn(plc, 60.0, 300)
    assert ask(plc, bit | SEARCH) == bit, "active"
    turn(plc, 60.0, 900)
    assert plc["G1_ZSW"] == bit << 4, "found"
    assert plc["G1_XIST2"] == 0
    assert ask(plc, bit | READ) == bit << 4
    assert plc["G1_XIST2"] == COUNTS, "the mark after the first revolution"
    assert plc["G1_XIST1"] > COUNTS * 1.1
    assert ask(plc, 0) == 0
    assert plc["G1_XIST2"] == 0


def test_3_7_a_search_that_is_cancelled_finds_nothing(plc):
    turn(plc, 60.0, 300)
    assert ask(plc, 0x0003 | SEARCH) == 0x0003
    assert ask(plc, 0x0001 | CANCEL) == 0x0002
    assert ask(plc, 0x0002 | CANCEL) == 0
    turn(plc, 60.0, 1000)
    assert plc["G1_ZSW"] == 0


def test_3_7_a_mark_is_found_backwards_too(plc):
    turn(plc, 60.0, 400)
    ask(plc, 0x0001 | SEARCH)
    turn(plc, -60.0, 900)
    ask(plc, 0x0001 | READ)
    assert plc["G1_XIST2"] == 0, "the mark at the beginning"
    assert plc["G1_ZSW"] == 0x0010


@pytest.mark.parametrize(
    ("word", "code"),
    [
        (0x0001 | READ, 0x0005),
        (0x0001 | SEARCH | ON_THE_FLY, 0x0F01),
        (0x0041, 0x0F01),
        (0x0071, 0x0F01),
        (PARK, 0x0003),
    ],
    ids=[
        "nothing to read",
        "bit 7 is reserved",
        "command 4 is reserved",
        "command 7 is reserved",
        "parking in operation",
    ],
)
def test_3_8_what_cannot_be_is_a_sensor_error_with_its_code_until_it_is_acknowledged(plc, word, code):
    """The codes in G1_XIST2 are the profile's: the manual has none."""
    assert ask(plc, word) == ERROR
    assert plc["G1_XIST2"] == code
    assert ask(plc, 0) == ERROR, "it stays"
    assert ask(plc, ACKNOWLEDGE) == ACKNOWLEDGING
    assert ask(plc, 0) == 0
    assert plc["G1_XIST2"] == 0
    assert plc["ZSW1"] & 0x000F == 0x0007, "the drive itself has no fault"


def test_3_7_reserved_bits_do_nothing(plc):
    turn(plc, 60.0, 300)
    for bit in range(8, 14):
        assert ask(plc, 1 << bit) == 0
        assert plc["G1_XIST2"] == 0


def test_3_7_bit_14_parks_the_encoder_at_standstill(plc):
    turn(plc, 60.0, 300)
    place = plc["G1_XIST1"]
    plc.put(STW1=0x0406)
    assert ask(plc, PARK) == PARKED
    assert (plc["G1_XIST1"], plc["G1_XIST2"]) == (0, 0)
    fault = plc.inject("encoder-error")
    plc.wait(5)
    assert plc["G1_ZSW"] == PARKED, "a parked encoder has no error"
    plc.faults.clear(fault.id, plc.world.now)
    assert ask(plc, 0) == 0
    assert plc["G1_XIST1"] == pytest.approx(place, abs=COUNTS // 100)


def test_3_8_bit_15_shows_an_encoder_error_and_bit_11_its_acknowledgement(plc):
    plc.inject("encoder-error")
    plc.wait(4)
    assert plc["G1_ZSW"] == ERROR
    assert plc["G1_XIST2"] == 0x0001
    assert plc.store.read(945, 0, 1) == [0x820]
    plc.put(STW1=0x0406)
    assert ask(plc, ACKNOWLEDGE) & ERROR
    plc.clear()
    plc.wait(5)
    assert plc["G1_ZSW"] == ACKNOWLEDGING, "the cause is gone while the acknowledgement still stands"
    assert ask(plc, 0) == 0
    assert plc["ZSW1"] & 0x0008, "the drive's fault has an acknowledgement of its own"
    assert plc.put(STW1=0x0486) & 0x0008 == 0


def test_without_control_by_the_plc_the_encoder_is_asked_for_nothing(plc):
    turn(plc, 60.0, 300)
    plc.put(STW1=RUN & ~0x0400)
    assert ask(plc, 0x0001 | SEARCH) == 0


# -- without power (PNU 979) -------------------------------------------------------------------------------------------


def power_cycle(plc: HandPlc) -> None:
    plc.inject("power-cycle", off="200ms")
    plc.run(0.5)
    plc.connect()
    plc.wait_for(lambda: plc.axis.drive.state == 1)
    plc.put(STW1=0x0400)


def test_an_encoder_of_one_revolution_forgets_those_that_it_counted_without_power(plc):
    """PNU 979 subindex 5: one determinable revolution (profile 4.1, 6.3.4)."""
    turn(plc, 300.0, 730)
    counted = plc["G1_XIST1"]
    assert counted > 3 * COUNTS
    assert plc.store.read(979, 5) == [1]
    power_cycle(plc)
    assert plc["G1_XIST1"] == pytest.approx(counted % COUNTS, abs=COUNTS / 1000)
    assert plc["G1_XIST1"] < COUNTS
    # a mark is where the count comes round, as before
    plc.switch_on(operation=RUN)
    ask(plc, 0x0001 | SEARCH)
    turn(plc, 60.0, 1200)
    assert plc["G1_ZSW"] == 0x0010
    ask(plc, 0x0001 | READ)
    assert plc["G1_XIST2"] == COUNTS


def test_an_incremental_scale_counts_from_0_when_it_is_switched_on():
    plc = HandPlc("hiwin-e1", 3, motor="{kind: linear}")
    plc.switch_on(operation=RUN)
    plc.put(NSOLL_B=round(0.2 * 0x40000000), wait=300)
    plc.put(NSOLL_B=0, wait=200)
    assert plc["G1_XIST1"] > 1_000_000, "of 0.1 um"
    assert plc.store.read(979, 5) == [0]
    power_cycle(plc)
    assert abs(plc["G1_XIST1"]) <= 1
