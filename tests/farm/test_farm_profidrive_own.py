"""What a farm file adds to a profidrive: words of telegram 999, faults; and parameters that PLC blocks read."""

from __future__ import annotations

import pytest
from hand_plc import HandPlc
from hypothesis import given
from hypothesis import strategies as st
from profidrive_plc import FULL, RUN, running

from pnfarm.drives.catalogue import model
from pnfarm.drives.telegrams.own_words import with_words
from pnfarm.errors import ConfigError
from pnfarm.table.channel import MAX_WORDS
from pnfarm.table.signals import PART_HIGH, PART_LOW, word_code

OWN = "{output: [STW1, NSOLL_B, '-', M_ADD1, M_LIMIT_POS, M_LIMIT_NEG], input: [ZSW1, NIST_B, M_ACT, FAULT_CODE]}"
MODEL = model("profidrive")
SET_POINTS = {signal.name for signal in MODEL.profidrive.signals.values() if signal.setpoint and not signal.real}
NAMES = sorted({signal.name for signal in MODEL.profidrive.signals.values()})


def free(**options) -> HandPlc:
    plc = HandPlc("profidrive", 999, words=OWN, **options)
    plc.put(M_LIMIT_POS=FULL, M_LIMIT_NEG=-FULL)
    plc.switch_on(operation=RUN)
    return plc


def test_telegram_999_has_the_words_of_the_farm_file_and_a_double_word_takes_two():
    plc = free()
    telegram = plc.store.telegram_number
    module = plc.farm.axes[0].store.model.profidrive.telegrams[telegram].module
    assert telegram == 999
    assert [(s.output_bytes, s.input_bytes) for s in module.submodules if s.subslot == 2] == [(14, 10)]
    plc.put(NSOLL_B=FULL << 15, wait=300)
    assert plc["NIST_B"] == pytest.approx(FULL << 15, rel=0.01)
    plc.inject("drive-fault", fault=16)
    plc.wait(20)
    assert plc["FAULT_CODE"] == 16


def test_the_torque_words_limit_and_add_torque_in_shares_of_pnu_2003():
    plc = free()
    plc.put(M_LIMIT_POS=FULL // 10, NSOLL_B=FULL << 15, wait=20)
    assert float(plc.axis.motor.torque) == pytest.approx(0.45, abs=0.01)
    assert plc["M_ACT"] == pytest.approx(FULL // 10, abs=40)
    plc.put(M_LIMIT_POS=FULL, wait=400)
    assert plc.axis.motor.velocity == pytest.approx(1500.0, abs=2.0)
    before = float(plc.axis.motor.speed_integral)
    plc.put(M_ADD1=FULL // 10, wait=600)
    assert float(plc.axis.motor.speed_integral) == pytest.approx(before - 0.45, abs=0.05), "the controller gives less"
    assert plc.axis.motor.velocity == pytest.approx(1500.0, abs=2.0)


@given(st.lists(st.sampled_from([*NAMES, "-", "NSOLL_C", ""]), max_size=40).map(lambda names: ["STW1", *names]))
def test_any_list_of_words_makes_a_telegram_of_whole_words_or_is_refused_with_a_sentence(names: list[str]):
    given_once = all(name == "-" or names.count(name) == 1 for name in names)
    known = all(name == "-" or name in SET_POINTS for name in names)
    if not (given_once and known):
        with pytest.raises(ConfigError, match=r"^words\.output: word [0-9]+: "):
            with_words(MODEL, {"output": names, "input": ["ZSW1"]})
        return
    telegram = with_words(MODEL, {"output": names, "input": ["ZSW1"]}).profidrive.telegrams[999]
    assert len(telegram.output) == len(telegram.output_words) < MAX_WORDS
    for signal in filter(None, telegram.output):
        assert telegram.output.count(signal) == signal.bits // 16
        if signal.bits == 32:
            place = telegram.output.index(signal)
            halves = (word_code(signal.slot, PART_HIGH), word_code(signal.slot, PART_LOW))
            assert telegram.output_words[place : place + 2] == halves


def test_free_telegrams_of_other_lengths_have_other_idents():
    idents = set()
    for more in range(4):
        words = {"output": ["STW1", *["-"] * more], "input": ["ZSW1"]}
        idents.add(with_words(MODEL, words).profidrive.telegrams[999].module.ident)
    assert len(idents) == 4


def test_a_fault_of_the_farm_file_stops_the_axis_as_the_file_says():
    plc = HandPlc(
        "profidrive", 111,
        faults="[{number: 7900, name: Motor blocked, reaction: quick-stop}, {number: 7012, name: Warm, kind: warning},"
        " {number: 28, name: Winding too hot, reaction: coast}]",
    )  # fmt: skip
    plc.switch_on(operation=0x043F)
    plc.inject("drive-warning", warning=7012)
    plc.wait(20)
    assert (plc["WARN_CODE"], plc.axis.drive.state) == (7012, 4)
    assert plc.store.read(2122)[0] == 7012
    plc.inject("drive-fault", fault="Winding too hot")
    plc.wait(20)
    assert (plc["FAULT_CODE"], plc.axis.drive.state) == (28, 1)
    plc.clear()
    plc.put(STW1=0x04F6, wait=20)
    plc.switch_on(operation=0x043F)
    plc.inject("drive-fault", fault=7900)
    plc.wait(20)
    assert plc["FAULT_CODE"] == 7900
    assert plc.store.read(947)[0] == 7900


def test_r0002_says_what_operation_waits_for():
    plc = HandPlc("profidrive", 1)
    shown = {word: (plc.put(STW1=word), plc.store.read(2)[0])[1] for word in (0x0472, 0x0474, 0x0476, 0x0477, RUN)}
    assert shown == {0x0472: 43, 0x0474: 42, 0x0476: 31, 0x0477: 21, RUN: 0}
    assert (plc.put(STW1=0x043F), plc.store.read(2)[0])[1] == 10
    plc.put(STW1=0x0477, wait=50)
    plc.inject("drive-fault", fault=4)
    plc.wait(20)
    assert plc.store.read(2)[0] == 45


def test_plc_blocks_find_the_telegram_where_siemens_drives_have_it():
    plc = running(105)
    assert [plc.store.read(pnu)[0] for pnu in (922, 2079)] == [105, 105]
