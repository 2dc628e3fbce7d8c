"""The cyclic parameter channel (PKW) against the Moog MSD's manual, 8.2.4: words in, words out."""

from __future__ import annotations

import struct

import pytest
from drives_kit import Drive, new_drive
from hypothesis import given
from hypothesis import strategies as st

from pnfarm.drives.parameters.parameter import Backing, Parameter
from pnfarm.drives.parameters.store import NonVolatileSaved, ParameterWritten
from pnfarm.drives.profiles.profidrive.pkw import NO_TASK, Pkw, emit_pkw, parse_pkw
from pnfarm.drives.profiles.profidrive.pkw_channel import OTHER_ERROR, PkwChannel
from pnfarm.errors import DecodeError

ERROR = 7
#: Response identifiers of table 8.18.
RESPONSES = {0, 1, 2, 3, 4, 5, 7, 9, 10, 11, 12}


class Channel:
    """One MSD and its channel; ``ask`` puts task 0 in between, as a master does."""

    def __init__(self) -> None:
        self.drive: Drive = new_drive("moog-msd")
        words = self.drive.model.profidrive.parameter_words
        assert words is not None
        self.store = self.drive.store
        self.machine = PkwChannel(self.store, words)

    def ask(self, identifier: int, pnu: int, subindex: int = 0, length: int = 0, value: int = 0) -> Pkw:
        assert self.machine.answer(bytes(8)) == bytes(8)
        return self.answer(Pkw(identifier, pnu, subindex, length, value))

    def answer(self, task: Pkw) -> Pkw:
        return parse_pkw(self.machine.answer(emit_pkw(task)))

    def error(self, *task: int) -> int:
        """The number of the error; everything else is repeated."""
        given, answer = Pkw(*task), self.ask(*task)
        assert answer == Pkw(ERROR, given.pnu, given.subindex, given.length, answer.value)
        return answer.value


@pytest.fixture
def channel() -> Channel:
    return Channel()


# the eight octets


def test_the_octets_are_those_of_tables_8_11_to_8_13() -> None:
    """PKE in octets 1 and 2 with the identifier in bits 15 to 12, SUB in 3, LEN in 4, data in 5 to 8."""
    octets = bytes.fromhex("1396 02 09 01020304")
    assert parse_pkw(octets) == Pkw(1, 918, 2, 9, 0x01020304)
    assert emit_pkw(Pkw(1, 918, 2, 9, 0x01020304)) == octets
    assert parse_pkw(bytes.fromhex("FFFF FF FF FFFFFFFF")) == Pkw(15, 4095, 255, 255, 0xFFFFFFFF)


@given(st.binary(min_size=8, max_size=8))
def test_any_eight_octets_are_a_task_and_come_back(octets: bytes) -> None:
    assert emit_pkw(parse_pkw(octets)) == octets


@pytest.mark.parametrize("octets", [b"", bytes(7), bytes(9)])
def test_another_number_of_octets_is_a_decode_error(octets: bytes) -> None:
    with pytest.raises(DecodeError, match="octets"):
        parse_pkw(octets)


@pytest.mark.parametrize("wrong", [Pkw(16), Pkw(1, 4096), Pkw(1, 1, 256), Pkw(1, 1, 0, 256), Pkw(1, 1, 0, 0, 1 << 32)])
def test_what_does_not_fit_is_not_emitted(wrong: Pkw) -> None:
    with pytest.raises((ValueError, OverflowError)):
        emit_pkw(wrong)


# tasks and answers: tables 8.14 and 8.18


def test_no_task_is_answered_by_nothing(channel: Channel) -> None:
    assert channel.answer(NO_TASK) == NO_TASK
    assert channel.answer(Pkw(0, 918, 3, 4, 5)) == NO_TASK


@pytest.mark.parametrize(
    ("identifier", "pnu", "subindex", "answer", "value"),
    [
        (1, 918, 0, 1, 126),  # U16
        (1, 1283, 0, 2, 5000),  # U32
        (1, 1268, 0, 2, 0),  # I32
        (1, 1289, 1, 1, ord("D")),  # one octet in a word
        (6, 951, 0, 4, 59000),  # subindex 0 and 1: element 0
        (6, 951, 1, 4, 59000),
        (6, 951, 2, 4, 59001),  # 2: element 1
        (6, 951, 20, 4, 59019),
        (6, 979, 3, 5, 1048576),
        (1, 951, 2, 1, 59001),
    ],
)
def test_a_value_is_read(channel: Channel, identifier: int, pnu: int, subindex: int, answer: int, value: int) -> None:
    """Tasks 1 and 6, answers 1, 2, 4 and 5; the subindex rule of 8.2.4."""
    assert channel.ask(identifier, pnu, subindex) == Pkw(answer, pnu, subindex, 0, value)


@pytest.mark.parametrize(
    ("identifier", "pnu", "subindex", "value", "answer", "place"),
    [
        (2, 918, 0, 7, 1, 0),
        (2, 1270, 0, 0xFFFE, 1, 0),  # I16: -2
        (3, 1283, 0, 0xFFFFFFFF, 2, 0),
        (3, 1268, 1, 0x80000000, 2, 0),
        (7, 1255, 0, 2, 4, 0),
        (7, 1255, 5, 1, 4, 4),
        (8, 202, 2, 0x12345678, 5, 1),
        (2, 1289, 2, 0x78, 1, 1),
    ],
)
def test_a_value_is_changed(
    channel: Channel, identifier: int, pnu: int, subindex: int, value: int, answer: int, place: int
) -> None:
    """Tasks 2, 3, 7 and 8; the answer shows the value."""
    assert channel.ask(identifier, pnu, subindex, 0, value) == Pkw(answer, pnu, subindex, 0, value)
    parameter = channel.drive.model.parameters[pnu]
    assert channel.store.read(pnu, place) == [parameter.wrap(value)]


def test_the_upper_word_does_not_matter_to_a_task_of_one_word(channel: Channel) -> None:
    assert channel.ask(2, 918, 0, 0, 0xABCD0007) == Pkw(1, 918, 0, 0, 7)


@pytest.mark.parametrize("identifier", [5, 13, 14, 15])
def test_identifiers_without_a_task_cannot_be_carried_out(channel: Channel, identifier: int) -> None:
    """Table 8.14: 5 is a dash, 12 is the last."""
    assert channel.error(identifier, 918) == OTHER_ERROR


# errors: table 8.19


@pytest.mark.parametrize(
    ("task", "number"),
    [
        ((1, 9), 0),
        ((1, 0), 0),
        ((1, 4095), 0),
        ((4, 9, 1), 0),
        ((11, 9, 1, 255), 0),
        ((2, 944, 0, 0, 1), 1),
        ((2, 918, 0, 0, 127), 2),
        ((2, 1286, 0, 0, 2001), 2),
        ((7, 1255, 1, 0, 3), 2),
        ((2, 1289, 1, 0, 0x100), 2),  # more than its octet holds
        ((6, 951, 21), 3),
        ((7, 1255, 13, 0, 1), 3),
        ((4, 918, 0), 3),
        ((4, 918, 13), 3),
        ((6, 918), 4),
        ((1, 918, 2), 4),
        ((2, 918, 2, 0, 7), 4),
        ((7, 918, 1, 0, 7), 4),
        ((3, 918, 0, 0, 7), 5),
        ((2, 1283, 0, 0, 7), 5),
        ((8, 1255, 1, 0, 1), 5),
        ((11, 918, 1, 255), 5),
        ((2, 952, 0, 0, 5), 6),
        ((7, 915, 1, 0, 967), 17),  # under a standard telegram
        ((2, 922, 0, 0, 4711), 18),
    ],
)
def test_a_task_that_cannot_be_carried_out_says_why(channel: Channel, task: tuple[int, ...], number: int) -> None:
    """Answer 7 with the number in the value; between 5 and 17 the profile's numbers."""
    assert channel.error(*task) == number


def test_no_priority_for_a_set_point_that_the_telegram_brings(channel: Channel) -> None:
    channel.store.plug_telegram(101)
    channel.drive.image.valid = 1
    assert channel.error(2, 967, 0, 0, 0x47F) == 11


def test_the_telegram_is_not_changed_in_operation(channel: Channel) -> None:
    channel.drive.axis.drive.state = 4
    assert channel.error(2, 922, 0, 0, 101) == 17


# description: tables 8.15 to 8.17

CHANGED, READ_ONLY, ARRAY, NO_FACTOR, RESET, TEXTS = 1 << 12, 1 << 9, 1 << 14, 1 << 8, 1 << 13, 1 << 10


@pytest.mark.parametrize(
    ("pnu", "identifier"),
    [
        (918, 6),
        (944, READ_ONLY | 6),
        (951, READ_ONLY | ARRAY | TEXTS | 6),
        (952, RESET | 6),
        (1283, 7),
        (1268, 4),
        (1270, 3),
        (1292, READ_ONLY | ARRAY | 5),
        (320, 8),
        (1261, 4),
        (1289, NO_FACTOR | 9),
    ],
)
def test_the_identifier_has_the_bits_of_table_8_16_and_the_types_of_8_17(
    channel: Channel, pnu: int, identifier: int
) -> None:
    """The type is in the eighth octet, always as a number."""
    assert channel.ask(4, pnu, 1) == Pkw(3, pnu, 1, 0, identifier)


def test_the_identifier_says_that_a_value_is_not_the_factorys(channel: Channel) -> None:
    """Table 8.16, bit 12."""
    channel.store.set("P-0918", 7)
    assert channel.ask(4, 918, 1).value & CHANGED
    channel.store.set("P-0918", 126)
    assert not channel.ask(4, 918, 1).value & CHANGED


def reached(channel: Channel) -> list[Parameter]:
    """The parameters whose number fits in 12 bits (table 8.12)."""
    return [parameter for parameter in channel.drive.model.parameters.values() if parameter.pnu <= 4095]


def bits(number: float) -> int:
    return int.from_bytes(struct.pack(">f", number), "big")


@pytest.mark.parametrize(
    ("pnu", "values"),
    [
        (918, [6, 0, bits(1.0), 0, 0, int.from_bytes(b"COM_", "big"), 0, 126, 0, 0, 0, 0]),
        (1283, [7, 0, bits(1.0), 0, 0, int.from_bytes(b"COM_", "big"), 0, 0xFFFFFFFF, 0, 0, 0, 0]),
        (1268, [4, 0, bits(1.0), 0, 0, 0x434F4D5F, 0x80000000, 0x7FFFFFFF, 0, 0, 0, 0]),
        (1255, [ARRAY | 6, 12, bits(1.0), 0, 0, 0x434F4D5F, 0, 2, 0, 0, 0, 0]),
        (1293, [READ_ONLY | NO_FACTOR | 9, 25, bits(1.0), 0, 0, 0x434F4D5F, 0, 255, 0, 0, 0, 0]),
        (325, [8, 0, bits(1.0), 0, 0, int.from_bytes(b"CON_", "big"), 0xFF7FFFFF, 0x7F7FFFFF, 0, 0, 0, 0]),
        (320, [8, 0, bits(1.0), 0, 0, int.from_bytes(b"CON_", "big"), 0, 0x7F7FFFFF, 0, 0, 0, 0]),
    ],
)
def test_a_description_has_the_twelve_elements_of_table_8_15(channel: Channel, pnu: int, values: list[int]) -> None:
    """Of the name the first four octets; elements of two octets are in the last word."""
    assert [channel.ask(4, pnu, place).value for place in range(1, 13)] == values


@pytest.mark.parametrize(
    ("pnu", "factor"),
    [
        (1283, 1.0),  # ms in table 8.22
        (338, 1.0),  # rpm, whatever NSOLL_B counts in
        (1286, 1.0),  # 1000 of table 15.1
        (1261, 100 / 0x40000000),  # 10.7: percent of a number that the profile normalises
        (1262, 100 / 0x40000000),
    ],
)
def test_the_standardisation_factor_gives_the_value_of_the_manual(channel: Channel, pnu: int, factor: float) -> None:
    """Table 8.15, sub index 3: what the drive makes of the number inside is not in it."""
    assert channel.ask(4, pnu, 3).value == bits(factor)


def test_bit_8_follows_the_data_type_alone(channel: Channel) -> None:
    """Table 8.16: no physical value is calculated of a string."""
    for parameter in reached(channel):
        identifier = channel.ask(4, parameter.pnu, 1).value
        assert bool(identifier & NO_FACTOR) == (identifier & 0xFF in {9, 10}), parameter


def test_every_parameter_describes_itself(channel: Channel) -> None:
    for parameter in reached(channel):
        for place in range(1, 13):
            assert channel.ask(4, parameter.pnu, place).identifier == 3, parameter


# strings: tables 8.20 and 8.21, figure 8.2


def test_a_string_is_read_through_the_cache(channel: Channel) -> None:
    """Read a character string: task 11, then task 12 for four octets each."""
    assert channel.ask(11, 1293, 1, 255) == Pkw(11, 1293, 1, 5, 0)
    assert emit_pkw(channel.ask(12, 1293, 0, 255)) == b"\xc0\x00\x00\x05DRIV"
    assert emit_pkw(channel.ask(12, 1293, 1, 255)) == b"\xc0\x00\x01\x05DRIV"
    # 2 is element 2 here, not element 1
    assert emit_pkw(channel.ask(12, 1293, 2, 255)) == b"\xc0\x00\x02\x03IVE\0"
    assert emit_pkw(channel.ask(12, 1293, 4, 255)) == b"\xc0\x00\x04\x01E\0\0\0"
    assert emit_pkw(channel.ask(12, 1293, 8, 255)) == b"\xc0\x00\x08\x00\0\0\0\0"


def test_no_more_characters_are_read_than_asked_for(channel: Channel) -> None:
    assert channel.ask(11, 1293, 1, 3) == Pkw(11, 1293, 1, 3, 0)
    assert emit_pkw(channel.ask(12, 1293, 1, 3)) == b"\xc0\x00\x01\x03DRI\0"


def write_text(channel: Channel, pnu: int, text: bytes) -> Pkw:
    """Write a character string: the length is larger than the text by one, its last octet is 0."""
    for place in range(0, len(text) + 1, 4):
        part = int.from_bytes((text + b"\0")[place : place + 4].ljust(4, b"\xee"), "big")
        assert channel.ask(9, pnu, place, len(text) + 1, part) == Pkw(9, 0, place, len(text) + 1, part)
    return channel.ask(10, pnu, 1, len(text) + 1)


@pytest.mark.parametrize("text", [b"", b"mm", b"inch", b"nine of 9", b"rad/s", b"abcdefghijklmnop"])
def test_a_string_is_written_through_the_cache(channel: Channel, text: bytes) -> None:
    """Tasks 9 and 10: the answer to 9 is 0x9000 and the subindex, that to 10 repeats the first four octets."""
    channel.store.write(284, 0, list(b"abcdefgh"))
    assert write_text(channel, 284, text) == Pkw(10, 284, 1, len(text) + 1, 0)
    assert bytes(channel.store.read(284, 0, 16)) == text.ljust(16, b"\0")
    assert channel.ask(11, 284, 1, 255).length == len(text)


@pytest.mark.parametrize(
    ("pnu", "text", "number"),
    [
        (284, b"seventeen letters", 2),  # of 16
        (918, b"x", 5),
        (1293, b"x", 1),
        (9, b"x", 0),
    ],
)
def test_a_string_that_cannot_be_written_changes_nothing(channel: Channel, pnu: int, text: bytes, number: int) -> None:
    """8.2.4, "Task identifier 10": 7 if there is an error."""
    assert write_text(channel, pnu, text) == Pkw(ERROR, pnu, 1, len(text) + 1, number)


def test_a_string_without_its_0_is_not_written(channel: Channel) -> None:
    channel.ask(9, 284, 1, 4, 0x61626364)
    assert channel.error(10, 284, 1, 4) == OTHER_ERROR
    assert channel.error(10, 284, 1, 0) == OTHER_ERROR
    assert bytes(channel.store.read(284, 0, 6)) == b"Degree"


def test_the_cache_holds_what_a_length_can_say_and_is_empty_at_first(channel: Channel) -> None:
    assert channel.ask(12, 284, 1, 255) == Pkw(12, 0, 1, 0, 0)
    channel.ask(9, 284, 254, 255, 0x61626364)
    assert channel.ask(12, 284, 254, 255).value == 0x61000000
    channel.machine.reset()
    assert channel.ask(12, 284, 254, 255) == Pkw(12, 0, 254, 0, 0)


# how long a task lasts


def test_a_task_is_carried_out_once_however_long_it_is_sent(channel: Channel) -> None:
    task = Pkw(2, 971, value=1)
    for _ in range(100):
        assert channel.answer(task) == Pkw(1, 971, value=1)
    assert channel.store.events() == [NonVolatileSaved()]
    channel.answer(NO_TASK)
    channel.answer(task)
    assert channel.store.events() == [NonVolatileSaved()]


def test_other_octets_are_another_task(channel: Channel) -> None:
    for value in (1, 2, 2, 3):
        channel.answer(Pkw(2, 918, value=value))
    written = [event.values for event in channel.store.events() if isinstance(event, ParameterWritten)]
    assert written == [(1,), (2,), (3,)]


def test_a_value_that_is_asked_for_follows_the_parameter_and_a_refusal_goes_with_its_reason(channel: Channel) -> None:
    task = Pkw(1, 918)
    assert channel.answer(task).value == 126
    assert channel.machine.repeats
    channel.store.set("P-0918", 3)
    assert channel.answer(task).value == 3
    channel.answer(Pkw(2, 918, value=4))
    assert not channel.machine.repeats
    channel.store.set("P-0918", 5)
    assert channel.answer(Pkw(2, 918, value=4)).value == 4


# every parameter, any octets


def plain(parameter: Parameter) -> bool:
    return parameter.backing in {Backing.STORED, Backing.FIELD}


def test_every_parameter_is_read_and_every_writable_one_takes_both_limits(channel: Channel) -> None:
    for parameter in reached(channel):
        array, double = bool(parameter.elements), parameter.octets > 2
        answer = {(0, 0): 1, (0, 1): 2, (1, 0): 4, (1, 1): 5}[array, double]
        read = channel.ask(6 if array else 1, parameter.pnu)
        width = (1 << (32 if double else 16)) - 1
        assert read == Pkw(answer, parameter.pnu, 0, 0, channel.store.read(parameter.pnu)[0] & width), parameter
        if not (plain(parameter) and parameter.writable):
            continue
        write = {(0, 0): 2, (0, 1): 3, (1, 0): 7, (1, 1): 8}[array, double]
        for value in (parameter.minimum, parameter.maximum):
            assert channel.ask(write, parameter.pnu, 0, 0, value & width).identifier == answer, parameter
            assert channel.store.read(parameter.pnu) == [value], parameter
        if parameter.maximum < (width >> parameter.signed):
            assert channel.error(write, parameter.pnu, 0, 0, parameter.maximum + 1) == 2, parameter


SHARED = Channel()


@given(st.one_of(st.binary(min_size=8, max_size=8), st.builds(
    Pkw, st.integers(0, 15), st.sampled_from([0, 9, 202, 284, 915, 918, 922, 951, 952, 971, 1255, 1283, 1289, 1293]),
    st.integers(0, 255), st.integers(0, 255), st.integers(0, 0xFFFFFFFF)).map(emit_pkw)))  # fmt: skip
def test_any_octets_get_an_answer_of_table_8_18(octets: bytes) -> None:
    """Whatever was asked before."""
    answer = parse_pkw(SHARED.machine.answer(octets))
    assert answer.identifier in RESPONSES
    if answer.identifier == ERROR:
        assert answer.value in {0, 1, 2, 3, 4, 5, 6, 7, 9, 11, 15, 17, 18}
        assert (answer.pnu, answer.subindex) == (parse_pkw(octets).pnu, parse_pkw(octets).subindex)
