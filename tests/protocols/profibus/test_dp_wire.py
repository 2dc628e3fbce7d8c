"""Telegrams and DP's data: what was built is read back, and any octets are read or refused."""

import random
import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pnfarm.errors import DecodeError
from pnfarm.protocols.profibus.splitter import Splitter
from pnfarm.protocols.profibus.wire import dp, dpv1, timing
from pnfarm.protocols.profibus.wire.telegram import (
    ShortAck,
    Telegram,
    Token,
    checksum,
    emit_data,
    emit_telegram,
    parse_telegram,
)

SAPS = st.none() | st.integers(0, 127)
TELEGRAMS = st.builds(
    Telegram, st.integers(0, 127), st.integers(0, 127), st.integers(0, 255), SAPS, SAPS, st.binary(max_size=244)
)
LINES = TELEGRAMS | st.builds(Token, st.integers(0, 126), st.integers(0, 126)) | st.just(ShortAck())


@given(LINES, st.booleans())
def test_what_was_built_is_read_back(telegram, fixed):
    assert parse_telegram(emit_telegram(telegram, fixed=fixed)) == telegram


@given(st.integers(0, 127), st.integers(0, 127), st.integers(0, 255), st.binary(min_size=1, max_size=20), st.booleans())
def test_the_short_form_for_data_without_access_points_has_the_same_octets(destination, source, function, data, fixed):
    telegram = Telegram(destination, source, function, data=data)
    assert emit_data(destination, source, function, data, fixed=fixed) == emit_telegram(telegram, fixed=fixed)


@given(st.binary(max_size=300))
def test_any_octets_are_a_telegram_or_refused(octets):
    for parse in (
        parse_telegram, dp.Diagnosis.parse, dp.Parameters.parse, dp.parse_identifiers, dp.GlobalControl.parse,
        dp.SetAddress.parse, dpv1.parse_access, dpv1.parse_refusal, dpv1.parse_initiate, dpv1.InitiateAnswer.parse,
        dpv1.ResourceManager.parse, dpv1.Abort.parse,
    ):  # fmt: skip
        try:
            parse(octets)
        except DecodeError:
            continue


def test_telegrams_have_the_standards_octets():
    assert emit_telegram(Telegram(3, 2, 0x49)) == bytes.fromhex("10 03 02 49 4e 16")
    diagnosis = Telegram(3, 2, 0x6D, 60, 62)
    assert emit_telegram(diagnosis) == bytes.fromhex("68 05 05 68 83 82 6d 3c 3e ec 16")
    assert emit_telegram(Token(1, 2)) == bytes.fromhex("dc 01 02")
    assert emit_telegram(ShortAck()) == b"\xe5"
    assert emit_telegram(Telegram(3, 2, 8, data=bytes(8))) == bytes.fromhex("a2 03 02 08 0000000000000000 0d 16")
    # a diagnosis as an SPC3 sends it: six octets, and the access points
    diagnosis = Telegram(2, 8, 8, 62, 60, bytes.fromhex("02 05 00 ff 0a 35"))
    assert emit_telegram(diagnosis, fixed=False) == bytes.fromhex("680b0b68 8288083e3c 020500ff0a35 d1 16")
    assert emit_telegram(diagnosis) == bytes.fromhex("a2 8288083e3c 020500ff0a35 d1 16")
    with pytest.raises(ValueError, match="at most 246"):
        emit_telegram(Telegram(3, 2, 8, data=bytes(247)))


@pytest.mark.parametrize(
    ("octets", "reason"),
    [("10 03 02 49 4f 16", "bad-fcs"), ("10 03 02 49 4e 17", "no-end"), ("68 05 06 68", "bad-length"),
     ("99", "no-delimiter"), ("10 03", "short"), ("e5 e5", "long"), ("68 04 04 68 83 02 6d f2 16", "short")],
)  # fmt: skip
def test_a_broken_telegram_says_what_is_wrong(octets, reason):
    with pytest.raises(DecodeError) as error:
        parse_telegram(bytes.fromhex(octets))
    assert error.value.reason == reason


@given(st.lists(LINES, max_size=8), st.randoms())
def test_telegrams_in_any_pieces_are_found_in_order(telegrams, rng):
    octets = b"".join(emit_telegram(one) for one in telegrams)
    splitter, found, place = Splitter(1_500_000), [], 0
    while place < len(octets):
        step = rng.randint(1, 40)
        found += [parse_telegram(one) for one in splitter.split(octets[place : place + step], 0)]
        place += step
    assert found == telegrams
    assert not splitter.dropped


def test_a_telegram_behind_noise_is_found_and_a_pause_ends_a_broken_one():
    splitter = Splitter(1_500_000)
    pause = splitter.pause_ns
    good = emit_telegram(Telegram(3, 2, 0x49))
    assert splitter.split(b"\x00\x55\x16" + good, 0) == [good]
    assert splitter.dropped["garbage"] == 3
    broken = emit_telegram(Telegram(3, 2, 0x6D, 60, 62, bytes(20)))[:12]
    assert splitter.split(broken, 10) == []
    assert splitter.next_deadline() == 10 + pause
    assert splitter.split(good, 5 * pause)[-1] == good
    assert splitter.dropped["cut-off"] >= 1
    splitter.split(broken, 6 * pause)
    assert splitter.handle_timeout(7 * pause - 1) == []
    splitter.handle_timeout(7 * pause)
    assert splitter.is_whole


def test_a_million_octets_of_noise_are_counted_and_hold_nothing():
    splitter = Splitter(1_500_000)
    rng = random.Random(1)
    begin = time.process_time()
    for _ in range(500):
        splitter.split(rng.randbytes(2000), 0)
    # each octet is looked at a bounded number of times
    assert time.process_time() - begin < 60
    assert splitter.dropped["garbage"] > 100_000
    assert len(splitter._waiting) < 256


@given(st.integers(1, 255 * 255 * 10_000_000))
def test_the_watchdogs_factors_reach_the_time_and_little_more(time_ns):
    try:
        first, second = dp.watchdog_factors(time_ns)
    except ValueError:
        assert time_ns > 250 * 250 * 10_000_000
        return
    assert 1 <= first <= second <= 255
    assert time_ns <= first * second * 10_000_000


def test_identifiers_say_their_lengths():
    simple = dp.parse_identifiers(bytes.fromhex("f3 f1"))
    assert [(one.inputs, one.outputs, one.consistent) for one in simple] == [(8, 8, True), (4, 4, True)]
    (special,) = dp.parse_identifiers(bytes.fromhex("c3 c5 c4 fd 00 09"))
    assert (special.inputs, special.outputs, special.specific) == (10, 12, bytes.fromhex("fd0009"))
    with pytest.raises(DecodeError):
        dp.parse_identifiers(bytes.fromhex("c3 c5"))


def test_a_diagnosis_is_read_in_blocks():
    octets = bytes.fromhex("08 0c 00 02 0b ad 0c 81 00 00 00 01 00 20 00 00 00 00")
    found = dp.Diagnosis.parse(octets)
    assert found.status & dp.StationStatus.EXT_DIAG
    assert (found.master, found.ident) == (2, 0x0BAD)
    assert [block.octets for block in found.blocks()] == [octets[6:]]
    assert found.emit() == octets


def test_dp_v1_pdus_have_the_manuals_octets():
    # Moog MSD manual 9.1: Req.id, slot, index 2F, length, data
    write = dpv1.Access(dpv1.Function.WRITE, 0, 0x2F, 2, b"\x01\x02")
    assert write.emit() == bytes.fromhex("5f 00 2f 02 01 02")
    assert dpv1.parse_access(bytes.fromhex("5f 00 2f 02 01 02")) == write
    assert dpv1.Refusal(0xDE, 0xB5).emit() == bytes.fromhex("de 80 b5 00")
    initiate = dpv1.Initiate(1_000_000_000)
    assert dpv1.parse_initiate(initiate.emit()) == initiate
    manager = dpv1.ResourceManager(7, 500_000_000)
    assert dpv1.ResourceManager.parse(manager.emit()) == manager
    abort = dpv1.Abort(0, 0x13, b"\x01")
    assert dpv1.Abort.parse(abort.emit()) == abort
    answer = dpv1.InitiateAnswer(240)
    assert dpv1.InitiateAnswer.parse(answer.emit()) == answer


def test_times_of_the_line_follow_its_rate():
    assert timing.line_ns(1, 1_500_000) == 7333
    assert timing.longest_tsdr_bits(1_500_000) == 150
    assert timing.longest_tsdr_bits(45_450) == 250
    assert timing.answered_within_ns(20, 12_000_000) == timing.line_ns(275, 12_000_000) + timing.bits_ns(
        1000, 12_000_000
    )
    assert checksum(b"\xff\x02") == 1


@pytest.mark.parametrize(
    ("several", "most", "joined"),
    [
        ([], 238, ""),
        (["42 01 80 43 26"], 238, "42 01 80 43 26"),
        (["42 01 80 43 26", "42 02 81 40 31", "42 01 80 43 26"], 238, "42 03 80 43 26 81 40 31"),
        (["43 00 01", "42 04"], 238, "43 04 01"),
        (["42 04", "43 00 01"], 238, "43 04 01"),
        (["03 00 02", "42 01 80 43 26", "02 08"], 238, "02 08 42 01 80 43 26"),
        (["42 01 80 43 26", "42 02 81 40 31"], 7, "42 03 80 43 26"),
    ],
)
def test_diagnoses_of_one_slave_are_joined_block_by_block_as_far_as_there_is_room(several, most, joined):
    assert dp.join_diagnoses(map(bytes.fromhex, several), most).hex(" ") == joined
