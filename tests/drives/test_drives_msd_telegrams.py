"""The standard telegrams of the Moog MSD: words and settings by the tables of chapters 8.2.1, 10.1, 10.7 and 10.8."""

from __future__ import annotations

import pytest
from drives_kit import Drive

from pnfarm.drives.catalogue import model
from pnfarm.table.axis_codes import RAMP_GENERATED, RAMP_PASSED_BY

MSD = model("moog-msd")


#: Output and input words; a double word is named twice.
WORDS = {
    1: ("STW1 NSOLL_A", "ZSW1 NIST_A"),  # table 8.2
    2: ("STW1 NSOLL_B NSOLL_B STW2", "ZSW1 NIST_B NIST_B ZSW2"),  # table 8.3
    3: (  # tables 8.4 and 10.15
        "STW1 NSOLL_B NSOLL_B STW2 G1_STW",
        "ZSW1 NIST_B NIST_B ZSW2 G1_ZSW G1_XIST1 G1_XIST1 G1_XIST2 G1_XIST2",
    ),
    5: (  # tables 8.5 and 10.19
        "STW1 NSOLL_B NSOLL_B STW2 G1_STW XERR XERR KPC KPC",
        "ZSW1 NIST_B NIST_B ZSW2 G1_ZSW G1_XIST1 G1_XIST1 G1_XIST2 G1_XIST2",
    ),
    7: ("STW1 SATZANW", "ZSW1 AKTSATZ"),  # table 8.6
    8: ("STW1 XSOLL_A XSOLL_A STW2 NSOLL_A", "ZSW1 XIST_A XIST_A ZSW2 NIST_A"),  # table 8.7
    9: ("STW1 TARPOS_A TARPOS_A STW2 VELOCITY_A VELOCITY_A", "ZSW1 XIST_A XIST_A ZSW2 NIST_A"),  # table 8.8
}


@pytest.mark.parametrize("number", WORDS)
def test_the_words_of_each_standard_telegram_are_those_of_its_table(msd: Drive, number: int) -> None:
    msd.store.plug_telegram(number)
    for setpoint, names in zip((True, False), WORDS[number], strict=True):
        assert [s.name if s else "-" for s in msd.store.mapping(setpoint=setpoint)] == names.split()


#: Words of table 8.1.
LENGTHS = {
    "STW1": 1, "STW2": 1, "ZSW1": 1, "ZSW2": 1, "NSOLL_A": 1, "NIST_A": 1, "SATZANW": 1, "AKTSATZ": 1, "XSOLL_A": 2,
    "XIST_A": 2, "TARPOS_A": 2, "VELOCITY_A": 2, "E_DIGITAL": 1, "A_DIGITAL": 1, "NSOLL_B": 2, "NIST_B": 2, "G1_STW": 1,
    "G1_ZSW": 1, "G1_XIST1": 2, "G1_XIST2": 2, "XERR": 2, "KPC": 2,
}  # fmt: skip


def test_the_signals_of_table_8_1_have_its_lengths() -> None:
    known = {signal.name: signal.bits // 16 for signal in MSD.profidrive.signals.values()}
    assert {name: known[name] for name in LENGTHS} == LENGTHS


#: Control mode P-0300, reference mode P-0301 and P-1258 by 10.1.
MODES = {1: (2, 1, 0), 2: (2, 1, 1), 3: (2, 1, 1), 5: (3, 1, 1), 7: (3, 0, 0), 8: (3, 1, 0), 9: (3, 0, 0)}


@pytest.mark.parametrize("number", MODES)
def test_a_standard_telegram_sets_the_parameters_of_table_8_9(msd: Drive, number: int) -> None:
    """10.1: interpolating with 1 (not RT), 2, 3, 5, 8; speed control with 1, 2, 3; the profile's mode with 2, 3, 5."""
    for name in ("P-0300", "P-0301", "P-1258"):
        msd.store.set(name, 0)
    msd.store.set("P-0159", 1)
    msd.store.set("P-0165", 1)
    msd.store.plug_telegram(number)
    assert tuple(msd.store.get(name) for name in ("P-0300", "P-0301", "P-1258")) == MODES[number]
    assert (msd.store.get("P-0159"), msd.store.get("P-0165")) == (7, 9)
    assert msd.axis.drive.settings.opmode == MODES[number][0] - 1
    assert msd.axis.ramp.settings.generator == (RAMP_PASSED_BY if MODES[number][1] else RAMP_GENERATED)


def test_a_user_specific_telegram_sets_nothing(msd: Drive) -> None:
    """10.1: all of these, P-0915 and P-0916, are for the user to set."""
    wanted = {"P-0300": 3, "P-0301": 1, "P-1258": 2, "P-0159": 4, "P-0165": 5}
    for name, value in wanted.items():
        msd.store.set(name, value)
    for number in range(101, 122):
        msd.store.plug_telegram(number)
        assert {name: msd.store.get(name) for name in wanted} == wanted


#: Table 10.18 and 10.20: the parameter of each word.
SHOWN = {
    "STW1": 967, "NSOLL_B": 1261, "STW2": 1280, "G1_STW": 1263, "XERR": 1259, "KPC": 1260,
    "ZSW1": 968, "NIST_B": 1262, "ZSW2": 1281, "G1_ZSW": 1264, "G1_XIST1": 1265, "G1_XIST2": 1266,
}  # fmt: skip


def test_tables_10_18_and_10_20_name_the_parameter_of_each_word(msd: Drive) -> None:
    for position, (name, pnu) in enumerate(SHOWN.items(), 100):
        signal = MSD.profidrive.signals[pnu]
        assert signal.name == name
        image = msd.image.received if signal.setpoint else msd.image.sent
        image[signal.slot] = position
        assert msd.store.get(pnu) == position


def test_10_7_nsoll_b_is_a_share_of_p_0338_from_minus_200_to_200_percent(msd: Drive) -> None:
    msd.store.set("P-0338", 4500)
    assert 0x40000000 * msd.axis.profidrive.settings.velocity_step_b == pytest.approx(4500)
    assert -0x80000000 * msd.axis.profidrive.settings.velocity_step_b == pytest.approx(-9000)


@pytest.mark.parametrize(
    ("word", "telegram", "bits"),
    [
        ("STW1", 1, {*range(11)}),
        ("STW1", 5, {*range(11)}),
        ("STW1", 8, {*range(12)}),
        ("STW1", 9, {*range(15)}),
        ("STW1", 105, {*range(15)}),
        ("STW2", 2, {12, 13, 14, 15}),
        ("ZSW1", 1, {*range(11), 13, 14}),
        ("ZSW1", 2, {*range(11)}),
        ("ZSW1", 5, {*range(11)}),
        ("ZSW1", 7, {*range(15)}),
        ("ZSW1", 121, {*range(15)}),
        ("ZSW2", 3, {0, 1, 10, 12, 13, 14, 15}),
        ("ZSW2", 9, {*range(8), 12, 13, 14, 15}),
        ("G1_STW", 3, {*range(8), *range(11, 16)}),
        ("G1_ZSW", 3, {*range(10), *range(11, 16)}),
    ],
)
def test_tables_10_4_to_10_17_bits_with_a_meaning_have_names(
    msd: Drive, word: str, telegram: int, bits: set[int]
) -> None:
    names = msd.model.profidrive.bit_names(word, telegram)
    assert {bit for bit, name in enumerate(names) if name} == bits
    assert len({name for name in names if name}) == len(bits)
