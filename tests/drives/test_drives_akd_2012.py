"""The AKD of manual edition B (firmware 1.06) against that manual, section by section, and beside the later edition."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import pytest
from drives_kit import Drive, Running, new_drive
from manuals import manual_text
from parameter_requests import read_request, response_error

from pnfarm.drives.catalogue import model, models
from pnfarm.drives.description.behaviour import with_behaviour
from pnfarm.drives.parameters.parameter import Backing, ParameterError, ParameterErrorNumber
from pnfarm.drives.profiles.profidrive.base_mode import (
    ATTRIBUTE_DESCRIPTION,
    ParameterAddress,
    emit_request,
    parse_response,
)
from pnfarm.drives.profiles.profidrive.parameter_channel import ParameterChannel
from pnfarm.table.image import LOST_STOP
from pnfarm.table.signals import (
    ITIST_GLATT,
    MDI_ACC,
    MDI_DEC,
    MDI_MOD,
    MDI_TARPOS,
    MDI_VELOCITY,
    NIST_A,
    SATZANW,
    ZSW1,
)

if TYPE_CHECKING:
    from collections.abc import Iterator

NAME = "akd-profinet-2012"
MS = 1_000_000
E = ParameterErrorNumber
#: Sections of the manual, and what besides them a source may be.
SECTIONS = re.compile(r"(?:\d\.\d+(?:\.\d+)?|PI manufacturer table|profile|hardware revision table|assumed|AKD )")


@pytest.fixture
def akd_2012() -> Drive:
    return new_drive(NAME)


@pytest.fixture(scope="module")
def manual() -> str:
    return manual_text("001")


@pytest.fixture
def running() -> Running:
    return Running(NAME)


def ask(drive: Drive, data: bytes) -> bytes:
    channel = ParameterChannel(drive.store)
    channel.write_request(data)
    response = channel.read_response()
    assert response is not None
    return response


# the model


def test_both_editions_are_models_of_their_own() -> None:
    older, newer = model(NAME), model("akd-profinet")
    assert (older.edition, older.firmware_version) == ("B, March 2012", "1.06")
    assert model("akd-2012") is older
    assert model("akd") is newer
    assert not set(models()[NAME].aliases) & set(models()["akd-profinet"].aliases)


def test_each_source_is_a_section_of_the_manual_or_says_where_else_it_comes_from(manual: str) -> None:
    described = model(NAME)
    sources: Iterator[str] = iter(
        [fact.source for fact in described.facts.values()]
        + [parameter.source for parameter in described.parameters.values()]
        + [parameter.values_source for parameter in described.parameters.values()]
        + [signal.source for signal in described.profidrive.signals.values()]
        + [telegram.source for telegram in described.profidrive.telegrams.values()]
    )
    for source in sources:
        assert SECTIONS.match(source), source
        for section in re.findall(r"\b\d\.\d+(?:\.\d+)?", source):
            assert re.search(rf"^#+ \**{re.escape(section)} ", manual, re.MULTILINE), section


def test_cover_identification_shows_firmware_1_06(akd_2012: Drive) -> None:
    assert akd_2012.store.read(964, 0, 5) == [0x0105, 1, 106, 2012, 103]
    assert akd_2012.store.read(975, 0, 8) == [0x0105, 1, 106, 2012, 103, 1, 5, 1]
    assert akd_2012.store.read(965) == [0x0329]


def test_3_6_2_the_request_of_the_example_with_the_tables_attribute_switches_the_operation_mode(
    akd_2012: Drive,
) -> None:
    request = bytes.fromhex("05 02 00 01 10 01 03 A2 00 00 42 01 00 02")
    assert ask(akd_2012, request) == bytes.fromhex("05 02 00 01 00 00")
    assert akd_2012.axis.drive.settings.opmode == 2


def test_3_6_2_the_attribute_of_the_example_is_not_one_of_3_6(akd_2012: Drive) -> None:
    response = parse_response(ask(akd_2012, bytes.fromhex("05 02 00 01 0A 01 03 A2 00 00 42 01 00 02")))
    assert response.response_id == 0x82
    error = response_error(response.entries[0])
    assert error is not None
    assert error.number == E.ADDRESS_IMPERMISSIBLE
    assert akd_2012.axis.drive.settings.opmode == 1


def test_4_2_2_the_fastest_cycle_is_8_ms() -> None:
    assert model(NAME).limits.min_cycle_ns == 8 * MS
    assert model(NAME).facts["limits.min_cycle_ns"].source == "4.2.2"
    assert model("akd-profinet").limits.min_cycle_ns == 16 * MS


# 5.4, 5.5: words


def test_5_4_and_5_5_say_which_bits_this_edition_does_not_have() -> None:
    signals = model(NAME).profidrive.signals
    assert "bits 12 to 15" in signals[1].note
    assert "bits 14 and 15" in signals[2].note
    later = model("akd-profinet").profidrive.signals
    assert "bits 12 and 13 are real time jogging" in later[1].note
    assert "bit 14 by its bit 0" in later[2].note


def test_5_4_bits_11_to_15_do_nothing_in_velocity_mode_and_5_5_bits_11_to_15_are_never_set(running: Running) -> None:
    plain = Running(NAME)
    for word in (0x0470, 0x0476, 0x0477, 0x047F, 0x047F, 0x0474):
        for _ in range(30):
            assert running.send(word | 0xF800, 0x00A3) == plain.send(word, 0x00A3)
            assert plain.image.sent[ZSW1] & 0xF800 == 0
    assert running.axis.motor.position == plain.axis.motor.position != 0


# 5.6, 5.8: parameters and signals


def test_5_6_has_every_pnu_of_its_tables(manual: str) -> None:
    described = model(NAME)
    text = manual.split("# 5.6 Supported PNU's")[1].split("**Supported Formats:**", maxsplit=1)[0]
    rows = re.findall(r"^(\d+)\t([^\t]*)\t((?:Array of )?[US]16)?\t", text, re.MULTILINE)
    assert [int(pnu) for pnu, *_ in rows] == [
        915, 916, 922, 923, 930, 944, 947, 964, 965, 975, 1004, 1005, 1006, 1007, 1, 2, 5, 6, 32, 33, 52,
    ]  # fmt: skip
    for number, name, kind in rows:
        parameter = described.parameters[int(number)]
        assert parameter.name == name
        assert parameter.octets == 2
        assert bool(parameter.elements) == kind.startswith("Array") or not kind
        # the current is U16 here, but the example of 5.12.4 gives it a sign
        assert parameter.signed == kind.endswith("S16") or parameter.pnu == 52


def test_5_6_5_8_and_the_text_give_all_pnus_and_none_is_above_1007() -> None:
    assert [p.pnu for p in model(NAME).parameters.values() if p.source != "profile"] == [
        1, 2, 5, 6, 32, 33, 34, 35, 36, 37, 38, 52, 915, 916, 922, 923, 930, 944, 947, 964, 965, 975, *range(980, 990),
        1001, 1002, 1004, 1005, 1006, 1007,
    ]  # fmt: skip


@pytest.mark.parametrize("name", [NAME, "akd-profinet"])
def test_what_5_6_does_not_list_is_the_profiles_and_can_be_left_out(name: str) -> None:
    """5.6: all supported PNUs; technology objects and engineering tools ask for these."""
    described = model(name)
    assert [p.pnu for p in described.parameters.values() if p.source == "profile"] == [925, 979, 61000]
    listed = with_behaviour(described, {"profile-parameters": "listed-only"})
    assert [pnu for pnu in described.parameters if pnu not in listed.parameters] == [925, 979, 61000]
    assert with_behaviour(listed, {}) == described
    drive = new_drive(name)
    assert drive.store.read(925) == [65535]
    assert drive.store.read(979, 0, 7) == [0x5111, 0x80000000, 1 << 20, 0, 0, 4096, 0]
    drive.store.write(925, 0, [5])
    assert drive.store.read(925) == [5], "masters write it, and nothing is watched"


@pytest.mark.parametrize("pnu", [3, 4, 28, 100, 108, 1003, 1008, 1009, 2000, 2135, 2158, 2605, 3014, 3022, 3064, 3065])
def test_parameters_of_the_later_edition_are_impermissible(akd_2012: Drive, pnu: int) -> None:
    with pytest.raises(ParameterError) as caught:
        akd_2012.store.read(pnu)
    assert caught.value.number == E.IMPERMISSIBLE_PNU


def test_what_both_editions_have_has_the_same_name_type_and_sign() -> None:
    older, newer = model(NAME), model("akd-profinet")
    for pnu, parameter in older.parameters.items():
        other = newer.parameters[pnu]
        assert (parameter.type, parameter.signed, parameter.readable, parameter.writable) == (
            other.type,
            other.signed,
            other.readable,
            other.writable,
        )
    for number, signal in older.profidrive.signals.items():
        other_signal = newer.profidrive.signals[number]
        assert (signal.name, signal.bits, signal.setpoint) == (
            other_signal.name,
            other_signal.bits,
            other_signal.setpoint,
        )


def test_5_8_the_signals_are_those_of_the_table_and_the_three_of_telegram_9(manual: str, akd_2012: Drive) -> None:
    text = manual.split("# 5.8 Telegram configuration")[1].split("# 5.9 ", maxsplit=1)[0]
    rows = re.findall(r"^(\d+)\t[^\t]*\t(\w+)\t([^\t\n]+)$", text, re.MULTILINE)
    signals = akd_2012.model.profidrive.signals
    assert {int(number): name for number, name, _ in rows} == {
        number: signal.name for number, signal in signals.items() if number not in {3, 4, 28}
    }
    for number, _, drive_signal in rows:
        assert signals[int(number)].drive_signal == drive_signal.rstrip("*")
    listed = {number: pnu for number, pnu in enumerate(akd_2012.store.read(923, 0, 53)) if pnu}
    assert listed == {int(number): int(number) for number, *_ in rows}


def test_5_6_the_one_list_of_980_names_all_parameters_and_the_other_nine_are_empty(akd_2012: Drive) -> None:
    listed = akd_2012.store.read(980, 0, 117)
    assert [pnu for pnu in listed if pnu] == [pnu for pnu in akd_2012.model.parameters if pnu not in range(980, 990)]
    assert all(not any(akd_2012.store.read(pnu, 0, 117)) for pnu in range(981, 990))


def test_5_6_each_parameter_is_read_and_described_by_the_channel(akd_2012: Drive) -> None:
    for parameter in akd_2012.model.parameters.values():
        wanted: list[Any] = [
            ParameterAddress(parameter.pnu, 0, min(max(parameter.elements, 1), 234)),
            ParameterAddress(parameter.pnu, 0, 1, ATTRIBUTE_DESCRIPTION),
        ]
        for address in wanted:
            assert not parse_response(ask(akd_2012, emit_request(read_request(1, [address])))).negative


def test_nothing_saves_by_a_pnu_and_what_was_written_is_gone_at_power_on(akd_2012: Drive) -> None:
    assert not [p for p in akd_2012.model.parameters.values() if p.backing is Backing.COMMAND]
    akd_2012.store.write(1006, 0, [100])
    akd_2012.store.power_on()
    assert akd_2012.store.read(1006) == [13]
    akd_2012.store.commission({1006: 50, "DRV.OPMODE": 2})
    akd_2012.store.power_on()
    assert (akd_2012.store.read(1006), akd_2012.axis.drive.settings.opmode) == ([50], 2)


# 5.9 and 6.1.4: the walk to operation


def test_5_9_the_control_words_of_the_example_lead_to_60_rpm(running: Running) -> None:
    assert running.send(0b0000_0100_0111_0000) & 0x47 == 0x40
    assert running.send(0b0000_0100_0111_0110) & 0x47 == 0x01
    assert running.send(0b0000_0100_0111_0111) & 0x47 == 0x03
    assert running.send(0b0000_0100_0111_1111, 0x00A3, 200) & 0x4F == 0x07
    assert running.axis.motor.velocity == pytest.approx(60, abs=0.5)
    assert running.image.sent[NIST_A] == 0x00A3


def test_6_1_4_the_sequence_of_the_sample_project_enables_and_bits_4_to_6_start_the_motion(running: Running) -> None:
    for word in (0b0000_0100_0000_0000, 0b0000_0100_0000_0110, 0b0000_0100_0000_1110, 0b0000_0100_0000_1111):
        zsw1 = running.send(word, 0x00A3, 5)
    assert zsw1 & 0x4F == 0x07
    assert running.axis.motor.velocity == 0
    running.send(0x047F, 0x00A3, 200)
    assert running.image.sent[NIST_A] == 0x00A3


def test_6_1_3_the_drive_starts_in_velocity_mode_and_knows_position_mode_but_no_third(akd_2012: Drive) -> None:
    assert akd_2012.store.get("DRV.OPMODE") == 1
    akd_2012.store.write(930, 0, [2])
    for wrong in (0, 3):
        with pytest.raises(ParameterError) as caught:
            akd_2012.store.write(930, 0, [wrong])
        assert caught.value.number == E.LIMIT_EXCEEDED


# 5.11: telegrams


def test_5_11_the_telegrams_are_those_of_its_tables(manual: str) -> None:
    described = model(NAME)
    assert list(described.profidrive.telegrams) == [0, 1, 7, 9, 350]
    for number in (1, 7, 9, 350):
        telegram = described.profidrive.telegrams[number]
        text = manual.split(f"## {telegram.source} ")[1].split("\n## ", maxsplit=1)[0]
        rows = re.findall(r"^(\d+)\t(\w*)(?:\t(\w*))?$", text, re.MULTILINE)
        assert [int(row[0]) for row in rows] == list(range(1, max(len(telegram.output), len(telegram.input)) + 1))
        for column, words in ((1, telegram.output), (2, telegram.input)):
            in_table = [row[column] for row in rows][: len(words)]
            # the second word of a double word may have no name
            assert [signal.name for signal in words if signal] == [
                name or in_table[place - 1] for place, name in enumerate(in_table)
            ]
            assert not any(row[column] for row in rows[len(words) :])


def test_5_11_1_telegram_0_maps_signals_freely_within_the_frames_in_slot_1(akd_2012: Drive) -> None:
    akd_2012.store.plug_telegram(0)
    akd_2012.store.write(915, 0, [1, 5, 34, 34])
    akd_2012.store.write(916, 0, [2, 6, 52, 28, 28])
    assert len(akd_2012.store.output_words()) == len(akd_2012.store.input_words()) == 10
    assert akd_2012.store.read(916, 0, 10) == [2, 6, 52, 28, 28, 0, 0, 0, 0, 0]
    for wrong in (104, 105, 106):
        with pytest.raises(ParameterError) as caught:
            akd_2012.store.write(916, 0, [2, wrong])
        assert caught.value.number == E.VALUE_IMPERMISSIBLE


@pytest.mark.parametrize("number", [351, 352, 353, 354, 400])
def test_telegrams_of_the_later_edition_are_not_there(akd_2012: Drive, number: int) -> None:
    with pytest.raises(ParameterError) as caught:
        akd_2012.store.write(922, 0, [number])
    assert caught.value.number == E.VALUE_IMPERMISSIBLE


# 5.12: units


def test_5_12_1_60_rpm_are_163_steps(running: Running) -> None:
    assert int(60 / 12000 * 2**15) == 163
    assert running.axis.profidrive.settings.velocity_step * 2**15 == 12000


def test_5_12_2_positions_have_65536_counts_a_turn_until_pnu_1002_says_otherwise(akd_2012: Drive) -> None:
    assert akd_2012.axis.travel.settings.position_step == 1 / 65536
    akd_2012.store.write(1002, 0, [20])
    assert akd_2012.axis.travel.settings.position_step == 2.0**-20


def test_5_12_3_65536_steps_of_acceleration_are_50_million_rpm_per_second(akd_2012: Drive) -> None:
    assert akd_2012.axis.profidrive.settings.acceleration_step * 65536 == 50_000_000
    akd_2012.store.write(1006, 0, [65535])
    assert akd_2012.axis.jog.settings.acceleration == pytest.approx(50_000_000, rel=2e-5)


def test_5_12_4_minus_182_are_minus_0_1_a(running: Running) -> None:
    running.send(0x0470)
    assert running.axis.motor.settings.peak_current == 9
    running.image.sent[ITIST_GLATT] = 0x10000 - 182
    assert running.drive.store.read(52) == [-182]
    assert 9 / 2**14 * running.drive.store.read(52)[0] == pytest.approx(-0.1, abs=0.001)


def test_5_4_jogging_runs_at_pnu_1004_and_1005_with_the_ramp_of_1006_and_1007(running: Running) -> None:
    store = running.drive.store
    store.write(1004, 0, [163])
    store.write(1005, 0, [-163])
    for word in (0x0400, 0x0406, 0x0407, 0x040F):
        running.send(word)
    running.send(0x050F, 0, 100)
    assert running.axis.motor.velocity == pytest.approx(59.7, abs=0.5)
    running.send(0x060F, 0, 100)
    assert running.axis.motor.velocity == pytest.approx(-59.7, abs=0.5)
    running.send(0x040F, 0, 100)
    assert running.axis.motor.velocity == 0


# 5.10: position mode of this edition


class Positioning(Running):
    """In position mode, operation enabled, homed at its position; telegram 9."""

    def __init__(self) -> None:
        super().__init__(NAME)
        self.drive.store.plug_telegram(9)
        self.drive.store.write(930, 0, [2])
        for word in (0x0430, 0x0436, 0x0437, 0x043F, 0x0C3F, 0x043F):
            self.send(word, milliseconds=5)
        received = self.image.received
        received[SATZANW], received[MDI_MOD] = 0x8000, 1
        received[MDI_VELOCITY], received[MDI_ACC], received[MDI_DEC] = 2**32 // 20, 40, 40

    def move(self, revolutions: float, milliseconds: int = 20) -> int:
        self.image.received[MDI_TARPOS] = round(revolutions * 65536)
        return self.send(0x047F, milliseconds=milliseconds)


def test_5_4_this_edition_has_no_real_time_jogging() -> None:
    drive = Positioning()
    drive.send(0x343F, milliseconds=300)
    assert drive.axis.motor.velocity == 0.0
    assert drive.image.sent[ZSW1] & 0x2000


def test_5_5_this_edition_has_no_bit_14_and_bits_10_and_13_go_by_the_task() -> None:
    drive = Positioning()
    assert drive.send(0x043F) & 0xFC00 == 0x2C00
    assert drive.move(5.0) & 0xFC00 == 0x1800, "acknowledged, homed, moving"
    assert drive.send(0x041F, milliseconds=400) & 0xFC00 == 0x0800, "an interrupted task is active still"
    assert drive.axis.motor.velocity == pytest.approx(0.0, abs=0.1)
    assert drive.send(0x040F, milliseconds=400) & 0xFC00 == 0x2C00, "rejected: no task is active"
    drive.send(0x043F)
    drive.move(0.0, 3000)
    assert drive.send(0x043F) & 0xFC00 == 0x2C00


def test_5_10_3_pnu_1001_is_the_homing_mode_of_this_edition() -> None:
    drive = Positioning()
    drive.drive.store.write(1001, 0, [7])
    for word in (0x0430, 0x0436):
        drive.send(word)
    drive.axis.motor.position = 0.3
    for word in (0x0437, 0x043F, 0x0C3F):
        drive.send(word, milliseconds=20)
    assert not drive.image.sent[ZSW1] & 0x2C00
    drive.send(0x0C3F, milliseconds=3000)
    assert drive.image.sent[ZSW1] & 0x2C00 == 0x2C00
    assert drive.axis.motor.position == pytest.approx(1.0, abs=0.01)


# 5.14 and lost data


def test_5_14_faults_fill_situations_of_eight_and_acknowledging_moves_them_down_by_eight(running: Running) -> None:
    for word in (0x0470, 0x0476, 0x0477, 0x047F):
        running.send(word)
    store = running.drive.store
    running.image.valid, running.image.lost = 0, LOST_STOP
    running.run(200)
    assert store.read(944) == [1]
    assert store.read(947, 0, 9) == [702, 0, 0, 0, 0, 0, 0, 0, 0]
    assert running.send(0x0470) & 0x0008
    assert running.send(0x04F0) & 0x0048 == 0x0040  # acknowledged: no fault, S1
    assert store.read(947, 0, 9) == [0, 0, 0, 0, 0, 0, 0, 0, 702]


def test_the_later_editions_numbered_fault_actions_and_the_drives_foldback_are_not_there() -> None:
    older, newer = model(NAME).faults, model("akd-profinet").faults
    assert newer.keys() - older.keys() == {130, 131, 132, 134, 139, 451, 524, 570}
    assert not older.keys() - newer.keys()
    assert model(NAME).facts["communication_loss.fault"].source == "assumed"
