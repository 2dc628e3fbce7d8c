"""Free mappings of the Moog MSD: P-0915 and P-0916 with their lists of elements, P-0922; sections are its manual's."""

from __future__ import annotations

import pytest
from drives_kit import Drive, new_drive

from pnfarm.drives.parameters.parameter import ParameterError, ParameterErrorNumber
from pnfarm.drives.parameters.store import TelegramChanged
from pnfarm.firmware.step import step
from pnfarm.table.signals import PART_HIGH, SETPOINT_SLOTS, WORD_NONE

E = ParameterErrorNumber
#: Figure 8.1: what the figure's list maps, an array among it.
FIGURE = [968, 1271, 1271, 1280, 1276, 1276, 1264, 202, 202]


@pytest.fixture
def msd() -> Drive:
    drive = new_drive("moog-msd")
    drive.store.plug_telegram(105)
    return drive


def refused(drive: Drive, pnu: int, place: int, values: list[int]) -> ParameterError:
    before = drive.store.read(pnu, 0, 32)
    drive.store.events()
    with pytest.raises(ParameterError) as caught:
        drive.store.write(pnu, place, values)
    assert drive.store.read(pnu, 0, 32) == before
    assert drive.store.events() == []
    return caught.value


def sent_words(drive: Drive) -> list[int]:
    """The words behind the parameter channel, as the engine packs them after a step."""
    step(drive.axis, drive.image, int(drive.axis.last_ns) + 1_000_000)
    words = []
    for code in drive.store.input_words()[4:]:
        value = 0 if code == WORD_NONE else int(drive.image.sent[code >> 2])
        words.append((value >> 16 if code & 3 == PART_HIGH else value) & 0xFFFF)
    return words


def test_figure_8_1_maps_an_element_of_an_array_as_a_double_word(msd: Drive) -> None:
    """8.2.3: P-1254 has the element; that of the double word's second entry is ignored."""
    msd.axis.powered = 1
    msd.store.write(202, 0, [0x11112222, 0x33334444])
    msd.store.write(1254, 7, [1, 99])
    msd.store.write(916, 0, FIGURE)
    assert msd.store.read(916, 0, 10) == [*FIGURE, 0]
    msd.image.received[3] = 0x5678  # STW2, P-1280, which is sent back as it came
    words = sent_words(msd)
    assert words[3] == 0x5678
    assert words[7:] == [0x3333, 0x4444, 0]
    # what is shown follows its parameter at once
    msd.store.write(202, 1, [-0x7FFFFFFF])
    assert sent_words(msd)[7:9] == [0x8000, 0x0001]
    msd.store.write(1254, 7, [0])
    assert sent_words(msd)[7:9] == [0x1111, 0x2222]


def test_both_elements_of_an_array_are_mapped_beside_each_other(msd: Drive) -> None:
    msd.axis.powered = 1
    msd.store.write(202, 0, [0x11112222, 0x33334444])
    msd.store.write(916, 0, [202, 202, 202, 202])
    assert sent_words(msd)[:4] == [0x1111, 0x2222, 0x1111, 0x2222]
    msd.store.write(1254, 0, [1, 0, 0, 0])
    assert sent_words(msd)[:4] == [0x3333, 0x4444, 0x1111, 0x2222]


def test_every_set_point_of_table_14_5_can_be_sent_back(msd: Drive) -> None:
    """14.3: what may be written may be read, too."""
    msd.axis.powered = 1
    telegram = msd.model.profidrive.telegrams[121]
    msd.store.plug_telegram(telegram.number)
    signals = [signal for signal in msd.model.profidrive.signals.values() if signal.readable]
    assert len(signals) == 18, "P-1272 of table 15.1, P-1268 and P-1269 of 10.3.3 beside them"
    for signal in signals:
        msd.store.write(916, 0, [signal.number] * (signal.bits // 16))
        msd.image.received[signal.slot] = 0x12345678
        step(msd.axis, msd.image, int(msd.axis.last_ns) + 1_000_000)
        (code, *_) = msd.store.input_words()
        assert int(msd.image.sent[code >> 2]) == 0x12345678, signal.name
        msd.store.write(916, 0, [0, 0])


def test_a_mapping_without_set_points_and_arrays_costs_the_step_nothing(msd: Drive) -> None:
    assert not msd.axis.profidrive.settings.shows
    msd.store.write(916, 0, [968, 967])
    assert msd.axis.profidrive.settings.shows == 1
    msd.store.write(916, 1, [0])
    assert not msd.axis.profidrive.settings.shows


def test_thirty_two_words_are_mapped_each_way(msd: Drive) -> None:
    """8.2.3: a maximum of 32 items; telegram 121 has as many words (17.2: 64 bytes)."""
    msd.store.plug_telegram(121)
    mapped = [n for n, signal in msd.model.profidrive.signals.items() if signal.setpoint and not signal.shown_as]
    every = [n for n in mapped for _ in range(msd.model.profidrive.signals[n].bits // 16)][:32]
    assert signal_is_whole(msd, every)
    msd.store.write(915, 0, every)
    assert msd.store.read(915, 0, len(every)) == every
    assert refused(msd, 915, 32, [967]).number == E.FAULTY_SUBINDEX


def signal_is_whole(drive: Drive, numbers: list[int]) -> bool:
    return drive.model.profidrive.signals[numbers[-1]].bits == 16 or numbers[-1] == numbers[-2]


@pytest.mark.parametrize(
    ("pnu", "place", "values", "number", "value"),
    [
        (915, 0, [4711], E.VALUE_IMPERMISSIBLE, 0),  # no signal
        (915, 1, [968], E.VALUE_IMPERMISSIBLE, 1),  # an actual value
        (915, 1, [202, 202], E.VALUE_IMPERMISSIBLE, 1),  # not in P-1284
        (915, 1, [5], E.VALUE_IMPERMISSIBLE, 1),  # the profile's number of NSOLL_A, no parameter of this drive
        (915, 10, [1278], E.VALUE_IMPERMISSIBLE, 10),  # the telegram has 10 words
        (916, 9, [1276, 1276], E.VALUE_IMPERMISSIBLE, 10),  # a double word over the end
        (1254, 31, [1, 1], E.FAULTY_SUBINDEX, 32),
    ],
)
def test_a_wrong_entry_is_refused_and_changes_nothing(
    msd: Drive, pnu: int, place: int, values: list[int], number: int, value: int
) -> None:
    """8.2.3 and 14.1.1, notes to tables 14.1 and 14.2."""
    error = refused(msd, pnu, place, values)
    assert (error.number, error.value) == (number, value)


@pytest.mark.parametrize(
    ("pnu", "name", "value"),
    [
        (1268, "JOG_SPEED_1", -70), (1270, "REF_SPEED", -300), (1275, "TARPOS_A", -5), (1278, "DRV_ACC", 65535),
        (1288, "TORQUE_LIMIT_NEGATIVE", 500),
    ],
)  # fmt: skip
def test_a_set_point_of_the_telegram_is_its_parameters_value_and_the_channel_cannot_change_it(
    msd: Drive, pnu: int, name: str, value: int
) -> None:
    """P-0915 links the process data to the parameter; without a controller it has its own value again."""
    msd.store.write(pnu, 0, [7])
    words = [pnu] * (2 if pnu < 1278 else 1)
    msd.store.write(915, 1, words)
    msd.image.received[SETPOINT_SLOTS[name]] = value
    msd.image.valid = 1
    assert msd.store.read(pnu) == [value]
    with pytest.raises(ParameterError) as caught:
        msd.store.write(pnu, 0, [8])
    assert caught.value.number == E.NO_OPERATION_PRIORITY
    msd.image.valid = msd.image.received[SETPOINT_SLOTS[name]] = 0  # the connection ends (16)
    msd.store.write(pnu, 0, [9])
    assert msd.store.read(pnu) == [9]


def test_more_speed_than_a_word_holds_reads_as_the_most(msd: Drive) -> None:
    """P-1270 is a word in table 15.1 and two in table 14.5."""
    msd.store.write(915, 1, [1270, 1270])
    msd.image.received[SETPOINT_SLOTS["REF_SPEED"]] = -40_000
    msd.image.valid = 1
    assert msd.store.read(1270) == [-32768]


def test_the_list_is_written_entry_by_entry(msd: Drive) -> None:
    """As the parameter channel does (8.2.4); a double word counts once both of its entries are there (14.1.1)."""
    whole = [967, 1275, 1275, 1278]
    for place, number in enumerate(whole):
        msd.store.write(915, place, [number])
    assert msd.store.read(915, 0, 5) == [*whole, 0]
    assert [signal.name for signal in msd.store.mapping(setpoint=True)[4:8] if signal] == [
        "STW1", "TARPOS_A", "TARPOS_A", "DRV_ACC",
    ]  # fmt: skip
    # the way to another list leads over torn ones
    msd.store.write(915, 1, [1278])
    assert msd.store.read(915, 0, 4) == [967, 1278, 1275, 1278]
    assert [signal and signal.name for signal in msd.store.mapping(setpoint=True)[4:8]] == [
        "STW1", "DRV_ACC", None, None,
    ]  # fmt: skip


def test_a_list_that_is_not_complete_is_kept_over_a_power_cycle(msd: Drive) -> None:
    msd.store.write(916, 0, [968, 1276])
    msd.store.set("P-0971", 1)
    msd.store.power_on()
    msd.store.plug_telegram(105)
    assert msd.store.read(916, 0, 3) == [968, 1276, 0]
    msd.store.write(916, 2, [1276])
    assert [signal.name for signal in msd.store.mapping(setpoint=False)[4:7] if signal] == ["ZSW1", "XIST_A", "XIST_A"]


@pytest.mark.parametrize(
    ("telegram", "output", "actual"),
    [
        (1, [967, 1270], [968, 1271]),
        (7, [967, 207], [968, 207]),
        (8, [967, 1274, 1274, 1280, 1270], [968, 1276, 1276, 1281, 1271]),
        (9, [967, 1275, 1275, 1280, 1277, 1277], [968, 1276, 1276, 1281, 1271]),
    ],
)
def test_a_standard_telegram_writes_the_numbers_of_its_parameters_into_the_lists(
    msd: Drive, telegram: int, output: list[int], actual: list[int]
) -> None:
    """8.2.3 and 14.3, table 14.5."""
    msd.store.plug_telegram(telegram)
    assert msd.store.read(915, 0, 7) == (output + [0] * 7)[:7]
    assert msd.store.read(916, 0, 7) == (actual + [0] * 7)[:7]


@pytest.mark.parametrize("number", [121, 968, 1262, 1265, 1276, 1271, 202, 700])
def test_what_is_for_reading_only_is_no_set_point_of_a_single_entry_either(msd: Drive, number: int) -> None:
    """8.2.3 and table 14.5: P-0915 takes what P-1284 lists, each entry as the whole list does."""
    width = msd.model.profidrive.signals[number].bits // 16
    whole = refused(msd, 915, 1, [number] * width)
    assert (whole.number, whole.value) == (E.VALUE_IMPERMISSIBLE, 1)
    entry = refused(msd, 915, 1, [number])
    assert (entry.number, entry.value) == (whole.number, whole.value)


@pytest.mark.parametrize(("number", "name"), [(968, "ZSW1"), (1276, "XIST_A"), (1275, "TARPOS_A")])
def test_a_signal_that_is_mapped_twice_is_sent_twice(msd: Drive, number: int, name: str) -> None:
    """8.2.3: each entry links its word to the parameter."""
    msd.axis.powered = 1
    width = msd.model.profidrive.signals[number].bits // 16
    msd.store.write(916, 0, [number] * width + [1281] + [number] * width)
    msd.axis.motor.position = 12_345_678.5
    msd.image.received[SETPOINT_SLOTS["TARPOS_A"]] = 0x12345678
    words = sent_words(msd)
    assert words[:width] == words[width + 1 : 2 * width + 1] != [0] * width, name
    assert msd.store.read(916, 0, 2 * width + 1) == [number] * width + [1281] + [number] * width


def test_of_a_set_point_that_is_mapped_twice_the_first_words_count(msd: Drive) -> None:
    """The manual does not say which (assumed)."""
    msd.store.write(915, 0, [967, 1278, 1278])
    assert [signal and signal.name for signal in msd.store.mapping(setpoint=True)[4:7]] == ["STW1", "DRV_ACC", None]
    assert msd.store.read(915, 0, 3) == [967, 1278, 1278]


def test_four_array_elements_are_mapped_each_any_number_of_times(msd: Drive) -> None:
    """The drive shows four stored parameters at once (assumed)."""
    msd.axis.powered = 1
    msd.store.write(202, 0, [10, 11, 12, 13, 14])
    msd.store.write(916, 0, [202] * 10)
    assert sent_words(msd)[:10] == [0, 10] * 5
    msd.store.write(1254, 0, [0, 0, 1, 0, 2, 0, 3, 0, 1, 0])
    assert sent_words(msd)[:10] == [0, 10, 0, 11, 0, 12, 0, 13, 0, 11]
    error = refused(msd, 1254, 8, [4])
    assert (error.number, error.value) == (E.VALUE_IMPERMISSIBLE, 8)


def test_an_element_that_the_mapped_array_has_not_is_refused(msd: Drive) -> None:
    msd.store.write(916, 0, [968, 202, 202])
    error = refused(msd, 1254, 1, [16])
    assert (error.number, error.value) == (E.VALUE_IMPERMISSIBLE, 1)
    # of what is no array it counts for nothing, whatever it is
    msd.store.write(1254, 0, [65535])
    msd.store.write(1254, 1, [1])
    msd.store.write(916, 1, [0, 0])
    msd.store.write(1254, 1, [16])
    assert refused(msd, 916, 1, [202, 202]).number == E.VALUE_IMPERMISSIBLE


def test_an_element_beyond_a_mapping_that_grew_is_element_0(msd: Drive) -> None:
    """What was written while the words were fewer cannot stop the drive."""
    msd.axis.powered = 1
    msd.store.write(202, 0, [7, 8])
    msd.store.write(916, 8, [202, 202])
    msd.store.plug_telegram(101)
    msd.store.write(1254, 8, [40])
    msd.store.plug_telegram(105)
    assert sent_words(msd)[8:10] == [0, 7]


@pytest.mark.parametrize(
    ("numbers", "left"),
    [
        ([202, 202, 202, 202], [202, 202]),  # the first element whole, the second one gone
        ([968, 202, 202], [968, 202]),  # of a double word that is torn nothing is sent
        ([968, 1281, 121], [968, 1281]),
    ],
)
def test_a_mapping_that_is_too_long_for_another_module_is_cut(msd: Drive, numbers: list[int], left: list[int]) -> None:
    msd.store.write(916, 0, numbers)
    msd.store.plug_telegram(101)
    assert msd.store.read(916, 0, 3) == [*left, 0]
    assert len(msd.store.input_words()) == 6


def test_selections_are_not_changed_in_operation(msd: Drive) -> None:
    msd.axis.drive.state = 4
    for pnu, value in ((915, 967), (916, 968), (922, 105), (1253, 0), (1254, 0)):
        with pytest.raises(ParameterError) as caught:
            msd.store.write(pnu, 0, [value])
        assert caught.value.number == E.OPERATING_STATE


def test_the_telegram_selection_takes_the_numbers_of_table_8_10_and_the_module_rules() -> None:
    """8.2.3, table 8.10, P-0922; 14.2: the selection is shown once the bus has booted."""
    msd = new_drive("moog-msd")
    for number in (*range(1, 4), 5, *range(7, 10), *range(101, 122)):
        msd.store.write(922, 0, [number])
        assert msd.store.get("P-0922") == number
        assert TelegramChanged(number) in msd.store.events()
    for number in (0, 4, 6, 10, 100, 122, 65535):
        with pytest.raises(ParameterError) as caught:
            msd.store.write(922, 0, [number])
        assert (caught.value.number, caught.value.value) == (E.VALUE_IMPERMISSIBLE, 0)
    msd.store.plug_telegram(102)
    assert msd.store.get("P-0922") == 102
    with pytest.raises(ParameterError) as caught:
        msd.store.write(922, 0, [103])
    assert caught.value.number == E.OPERATING_STATE


def test_mappings_and_elements_are_kept_over_a_power_cycle(msd: Drive) -> None:
    msd.store.write(202, 0, [7, 8])
    msd.store.write(1254, 1, [1])
    msd.store.write(916, 0, [968, 202, 202])
    msd.store.write(971, 0, [1])
    other = new_drive("moog-msd")
    assert other.store.restore(msd.store.snapshot()) == []
    other.store.power_on()
    other.store.plug_telegram(105)
    other.axis.powered = 1
    assert other.store.read(1254, 0, 3) == [0, 1, 0]
    assert sent_words(other)[1:3] == [0, 8]
