"""The Moog MSD against its manual; sections and tables are the manual's."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import TYPE_CHECKING

import pytest
from drives_kit import Drive, new_drive
from manuals import manual_text
from model_copy import copy_model, rewrite

from pnfarm.drives.catalogue import model
from pnfarm.drives.description.as_json import as_json
from pnfarm.drives.description.identity import with_identity
from pnfarm.drives.description.loader import load_model
from pnfarm.drives.description.parts import fault_label, fault_number
from pnfarm.drives.parameters.parameter import ParameterError
from pnfarm.drives.profiles.profidrive.parameter_channel import LOCAL, ParameterChannel
from pnfarm.errors import ConfigError
from pnfarm.table.axis_codes import VELOCITY_NSOLL_A, VELOCITY_NSOLL_B, VELOCITY_REF_SPEED

if TYPE_CHECKING:
    from pathlib import Path

MSD = model("moog-msd")
WIDTHS = {"U8": 1, "U16": 2, "I16": 2, "U32": 4, "I32": 4}


# parameters


def test_every_parameter_that_the_manual_names_is_there_and_no_other() -> None:
    named = {int(number) for number in re.findall(r"P-(\d{4})", manual_text("003"))}
    assert len(named) == 141
    own = {p.pnu for p in MSD.parameters.values() if p.source != "profile"}
    assert own == named | {39}  # P-39, ERR_ErrorID (10.9)
    assert set(MSD.parameters) - own == {61000}


def test_the_parameters_of_chapter_15_have_its_names_types_and_access() -> None:
    text = manual_text("003")
    start = text.index("15 PROFIBUS/PROFINET parameters and their description\n\nParameter name")
    text = text[start : text.index("* Only PROFIBUS parameters", start)]
    rows = re.findall(
        r"^(COM_\S+(?: \S+)?)\t(?:\*\*)?P-(\d{4})(?:\*\*)?\t[^\t]*\t[^\t]*\t(Yes|YES|Ja|No)\t(\S+)", text, re.MULTILINE
    )
    assert len(rows) >= 70
    for name, number, changed, kind in rows:
        parameter = MSD.parameters[int(number)]
        assert parameter.name == name.rstrip("*")
        assert parameter.writable == (changed != "No"), name
        width, _, length = kind.rstrip("]").partition("[")
        if width == "string":
            assert (parameter.octets, parameter.elements > 0) == (1, True)
            continue
        assert parameter.octets == WIDTHS[width], name
        assert parameter.signed == width.startswith("I"), name
        if length:
            assert parameter.elements == int(length), name


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("P-0918", 126), ("P-0925", 65535), ("P-0924.0", 4), ("P-0924.1", 10), ("P-0950.0", 20), ("P-0950.1", 1),
        ("P-0951.19", 59019), ("P-0974.0", 378), ("P-0974.1", 20), ("P-0974.2", 3), ("P-0975.0", 380),
        ("P-0975.1", 1), ("P-0975.5", 1), ("P-0975.6", 29), ("P-0975.7", 0), ("P-0979.0", 0x5111),
        ("P-0979.1", 0x80000000), ("P-0979.2", 1048576), ("P-0979.5", 4096), ("P-1278", 100), ("P-1279", 100),
        ("P-1283", 5000), ("P-1286", 1000), ("P-1256", 0), ("COM_PN_sign_of_life_limit", 65535), ("P-925", 65535),
    ],
)  # fmt: skip
def test_defaults_are_those_of_the_manual(msd: Drive, text: str, value: int) -> None:
    assert msd.store.get(text) == value


def test_strings_are_read_as_their_characters(msd: Drive) -> None:
    assert bytes(msd.store.read(1289, 0, 5)) == bytes(msd.store.read(1293, 0, 5)) == b"DRIVE"
    msd.store.write(1289, 0, list(b"axis"))
    assert bytes(msd.store.read(1289, 0, 6)) == b"axisE\0"


def test_arrays_are_kept_over_a_power_cycle_and_given_by_a_farm_file(msd: Drive) -> None:
    msd.store.write(1255, 4, [1, 1])
    msd.store.write(971, 0, [1])
    kept = msd.store.snapshot()
    assert msd.store.read(990, 0, 2) == [1255, 0]
    other = new_drive("moog-msd")
    assert other.store.restore(kept) == []
    other.store.power_on()
    assert other.store.read(1255, 0, 12) == [0, 0, 0, 0, 1, 1, 0, 0, 0, 0, 0, 0]
    other.store.commission({"P-1255": [2, 1]})
    other.store.power_on()
    assert other.store.read(1255, 0, 3) == [2, 1, 0]


def test_units_reach_the_axis(msd: Drive) -> None:
    msd.store.set("P-1278", 2)
    msd.store.set("P-1283", 7)
    msd.store.set("P-1268", -40)
    msd.store.set("P-0338", 6000)
    axis = msd.axis
    assert (axis.ramp.settings.acceleration, axis.faults.settings.loss_delay_ns, axis.jog.settings.velocity[0]) == (
        120.0,
        7_000_000,
        -40.0,
    )
    assert axis.profidrive.settings.velocity_step_b * 0x40000000 == pytest.approx(6000.0)
    assert axis.profidrive.settings.velocity_step == 1.0


# telegrams and modules


def test_telegrams_have_the_lengths_and_modules_of_table_8_10() -> None:
    text = manual_text("003")
    start = text.index("Telegram selection P-0922\tProfibus identifier")
    table = text[start : text.index("8.2.4 Parameter channel PKW", start)]
    rows = re.findall(r"^(\d+)\t[^\t]*\t(-|\w+)\t(-|\w+)\t(-|\w+)\t([^\t]*)\t", table, re.MULTILINE)
    assert [int(row[0]) for row in rows] == [1, 2, 3, 5, 7, 8, 9, *range(101, 122)] == list(MSD.profidrive.telegrams)
    for number, *idents, length in rows:
        telegram = MSD.profidrive.telegrams[int(number)]
        wanted = {int(ident, 0) for ident in idents if ident != "-"}
        if number == "121":
            wanted = wanted - {0x176} | {0x179}  # 0x176 is that of telegram 118
        assert {module.ident for module in telegram.modules} == wanted
        assert all(MSD.profidrive.telegram_by_module(ident) is telegram for ident in wanted)
        both = re.findall(r"(\d+) words input/output", length)
        inputs = sum(map(int, both or re.findall(r"(\d+) words input data", length)))
        outputs = sum(map(int, both or re.findall(r"(\d+) words output data", length)))
        for module in telegram.modules:
            point, data = module.submodules
            assert (data.input_bytes, data.output_bytes) == (2 * inputs, 2 * outputs), number
            assert (point.slot, point.subslot, point.api, point.ident) == (1, 1, 0x3A00, 0xFFFF)
            assert (data.slot, data.subslot, data.api, data.ident) == (1, 2, 0x3A00, int(number))


def test_the_profiles_module_is_the_one_to_use_where_there_is_one() -> None:
    first = {number: telegram.module.ident for number, telegram in MSD.profidrive.telegrams.items()}
    assert first[1] == 0x1001
    assert first[104] == 0x1068
    assert first[106] == 0x6A


def test_standard_telegrams_show_their_parameters_and_cannot_be_mapped(msd: Drive) -> None:
    """8.2.3: the numbers are written to the selection parameters by the drive, an entry by hand is not possible."""
    msd.store.plug_telegram(3)
    assert msd.store.read(915, 0, 6) == [967, 1261, 1261, 1280, 1263, 0]
    assert msd.store.read(916, 0, 10) == [968, 1262, 1262, 1281, 1264, 1265, 1265, 1266, 1266, 0]
    assert "operating state" in str(refusal(msd, 915, [967, 0]))
    msd.store.plug_telegram(105)
    assert msd.store.read(915, 0, 2) == [967, 0]
    assert msd.store.read(916, 0, 2) == [968, 0]
    assert "value impermissible" in str(refusal(msd, 915, [967, 4711]))


def refusal(drive: Drive, pnu: int, values: list[int]) -> Exception:
    with pytest.raises(Exception, match="0x") as caught:
        drive.store.write(pnu, 0, values)
    return caught.value


def test_the_signal_lists_are_those_of_table_14_5(msd: Drive) -> None:
    """Table 14.5 and 10.3.3: what may be written may be read, too; the array of figure 8.1 may be read."""
    writable = {967, 1280, 1268, 1269, 1270, 1274, 207, 1275, 1277, 1278, 1279, 1287, 1288, 1259, 1260, 1261, 1263}
    readable = writable | {968, 1281, 1271, 121, 143, 1276, 1262, 1264, 1265, 1266}
    # table 14.2 maps P-0700; the torque is of table 15.1
    further = {202, 700, 1272, 1273}
    assert set(msd.store.read(1284, 0, 32)) == writable | {1272, 0}
    assert set(msd.store.read(1285, 0, 32)) == readable | further | {0}
    assert set(msd.store.read(923, 0, 32)) == readable | further | {0}


def test_the_telegram_in_force_says_which_velocity_set_point_counts(msd: Drive) -> None:
    found = {}
    for number in (1, 2, 3, 5, 101):
        msd.store.plug_telegram(number)
        found[number] = int(msd.axis.profidrive.settings.velocity_signal)
    a, b = VELOCITY_NSOLL_A, VELOCITY_NSOLL_B
    assert found == {1: a, 2: b, 3: b, 5: b, 101: a}
    msd.store.plug_telegram(105)
    msd.store.write(915, 0, [967, 1270, 1270])
    assert msd.axis.profidrive.settings.velocity_signal == VELOCITY_REF_SPEED
    msd.store.write(915, 1, [1261, 1261])
    assert msd.axis.profidrive.settings.velocity_signal == VELOCITY_NSOLL_B
    msd.store.power_on()
    assert msd.axis.profidrive.settings.velocity_signal == VELOCITY_NSOLL_A


def test_the_profiles_mode_is_set_by_telegrams_2_3_and_5(msd: Drive) -> None:
    """10.1; their status words are those of 10.7."""
    for number in MSD.profidrive.telegrams:
        msd.store.set("P-1258", 0)
        msd.store.plug_telegram(number)
        assert msd.store.get("P-1258") == msd.axis.profidrive.settings.profile_mode == (number in {2, 3, 5})


# faults


@pytest.mark.parametrize("wanted", ["32-1", "F32-1", "communication-loss", 32 | 1 << 16])
def test_a_fault_is_found_by_its_two_numbers(wanted: str | int) -> None:
    assert MSD.fault(wanted).label == "32-1"


def test_numbers_in_two_parts_go_into_one_and_back() -> None:
    assert [fault_number(text) for text in ("702", "0x20", "32-1", "11-255")] == [702, 32, 0x10020, 0xFF000B]
    assert [fault_label(number) for number in (702, 0x10020, 0xFF000B)] == ["702", "32-1", "11-255"]
    for text in ("", "32-", "-1", "32-256", "65536-1", "a-b", "32-1-1"):
        with pytest.raises(ValueError):
            fault_number(text)
    with pytest.raises(ConfigError, match="32-1, 32-3"):
        MSD.fault("32-2")


def test_the_label_of_a_fault_is_its_number_as_the_manual_writes_it() -> None:
    assert replace(MSD.fault("32-1"), number=11 | 2 << 16).label == "11-2"


def test_the_error_memory_is_read_as_far_as_its_twenty_places(msd: Drive) -> None:
    numbers = [32 | 1 << 16] + [0] * 18 + [11 | 1 << 16, 9 | 1 << 16]
    for place, number in enumerate(numbers):
        msd.axis.faults.buffer[place] = number
    assert msd.store.read(949, 0, 20) == numbers[:20]
    assert msd.store.read(947, 0, 20) == [9] + [0] * 18 + [16]
    with pytest.raises(ParameterError, match="faulty subindex"):
        msd.store.read(949, 0, 21)


def test_the_json_shows_faults_modules_and_what_moves_nothing() -> None:
    described = as_json(MSD)
    assert {"32-1", "32-3", "11-1"} <= {fault["label"] for fault in described["faults"]}
    telegrams = {telegram["number"]: telegram for telegram in described["telegrams"]}
    assert [module["module_ident"] for module in telegrams[1]["other_modules"]] == [1, 0x101]
    assert described["diagnosis_coding"]["modes"]["value"] == ["none", "channel", "extended", "manufacturer"]


# base mode parameter access: the examples of 9.4


def ask(drive: Drive, text: str) -> str:
    channel = ParameterChannel(drive.store, LOCAL)
    channel.write_request(bytes.fromhex(text))
    response = channel.read_response()
    assert response is not None
    return response.hex(" ").upper()


@pytest.mark.parametrize("elements", ["00", "01"])
class TestExamples:
    """Requests of one value, whose number of elements is given as 0..1."""

    def test_table_9_8_writes_a_word(self, msd: Drive, elements: str) -> None:
        answer = ask(msd, f"00 02 00 01 10 {elements} 03 96 00 00 42 01 00 07")
        assert answer == "00 02 00 01"  # table 9.9
        assert msd.store.get("P-0918") == 7

    def test_table_9_10_writes_a_double_word_and_9_14_reads_it(self, msd: Drive, elements: str) -> None:
        answer = ask(msd, f"00 02 00 01 10 {elements} 04 FA 00 00 43 01 01 02 03 04")
        assert answer == "00 02 00 01"  # table 9.11
        assert msd.store.get("P-1274") == 16909060
        answer = ask(msd, f"00 01 00 01 10 {elements} 04 FA 00 00")
        assert answer == "00 01 00 01 43 01 01 02 03 04"  # table 9.15

    def test_table_9_12_reads_a_word(self, msd: Drive, elements: str) -> None:
        msd.store.plug_telegram(9)
        answer = ask(msd, f"00 01 00 01 10 {elements} 03 9A 00 00")
        assert answer == "00 01 00 01 42 01 00 09"  # table 9.13

    def test_table_9_16_asks_for_a_parameter_that_is_not_there(self, msd: Drive, elements: str) -> None:
        answer = ask(msd, f"00 01 00 01 10 {elements} 00 09 00 00")
        assert answer == "00 81 00 01 44 01 00 00"  # table 9.17


def test_tables_9_18_to_9_20_write_and_read_an_array(msd: Drive) -> None:
    """The fourth value of table 9.18 is P-1270 for the third time, that of table 9.20 is P-1280: either is taken."""
    msd.store.plug_telegram(105)
    answer = ask(msd, "00 02 00 01 10 05 03 93 00 00 42 05 03 C7 04 F6 04 F6 05 00 00 00")
    assert answer == "00 02 00 01"
    answer = ask(msd, "00 01 00 01 10 05 03 93 00 00")
    assert answer == "00 01 00 01 42 05 03 C7 04 F6 04 F6 05 00 00 00"
    answer = ask(msd, "00 02 00 01 10 05 03 93 00 00 42 05 03 C7 04 F6 04 F6 04 F6 00 00")
    assert answer == "00 02 00 01"
    answer = ask(msd, "00 01 00 01 10 05 03 93 00 00")
    assert answer == "00 01 00 01 42 05 03 C7 04 F6 04 F6 04 F6 00 00"
    assert msd.axis.profidrive.settings.velocity_signal == VELOCITY_REF_SPEED


def test_an_array_is_not_written_under_a_standard_telegram(msd: Drive) -> None:
    """9.4: no standard telegram smaller than 10 may be set."""
    msd.store.plug_telegram(9)
    answer = ask(msd, "00 02 00 01 10 01 03 93 00 00 42 01 03 C7")
    assert answer == "00 82 00 01 44 01 00 11"


@pytest.mark.parametrize(
    ("request_", "error"),
    [
        ("02 00 01 10 01 03 B0 00 00 42 01 00 01", "44 02 00 01 00 00"),  # P-0944 cannot be changed
        ("02 00 01 10 01 03 96 00 00 42 01 00 7F", "44 02 00 02 00 00"),  # P-0918 above 126
        ("01 00 01 10 01 03 B6 00 02", "44 02 00 03 00 02"),  # P-0950 has two elements
        ("01 00 01 10 01 03 96 00 01", "44 01 00 04"),  # P-0918 is no array
        ("02 00 01 10 01 03 96 00 00 41 01 07 00", "44 01 00 05"),  # a word as a byte
        ("02 00 01 10 01 03 B8 00 00 42 01 00 05", "44 02 00 06 00 00"),  # P-0952 takes 0 only
        ("02 00 01 20 01 03 96 00 00 42 01 00 05", "44 02 00 07 00 00"),  # a description element
        ("01 00 01 30 01 03 96 00 00", "44 01 00 0F"),  # no text
        ("01 00 01 10 EB 03 B3 00 00", "44 01 00 16"),  # 235 elements
        ("02 00 01 10 01 03 96 00 00 45 01 00 05", "44 01 00 17"),  # format above 0x44
        ("02 00 01 10 01 03 96 00 00 42 02 00 05 00 05", "44 01 00 18"),  # two values for one element
    ],
)
def test_errors_have_the_numbers_of_table_9_7(msd: Drive, request_: str, error: str) -> None:
    assert ask(msd, f"07 {request_}") == f"07 {int(request_[:2]) | 0x80:02X} 00 01 {error}"


ONE = "10 01 03 96 00 00"


def test_a_request_may_hold_as_many_parameters_as_p_0974_says(msd: Drive) -> None:
    """15, table 15.1: 20 of them; the error is the profile's, as table 9.7 has none for it."""
    assert msd.store.read(974, 0, 3)[1] == 20
    assert ask(msd, f"07 01 00 14 {ONE * 20}") == "07 01 00 14" + " 42 01 00 7E" * 20
    assert ask(msd, f"07 01 00 15 {ONE * 21}") == "07 81 00 01 44 01 00 22"
    changes = ONE * 21 + "42 01 00 05" * 21
    assert ask(msd, f"07 02 00 15 {changes}") == "07 82 00 01 44 01 00 22"
    assert msd.store.get("P-0918") == 126
    assert ask(msd, f"07 01 00 28 {ONE * 40}") == "07 81 00 01 44 01 00 16", "table 9.6: 0x01..0x27"


def test_with_lax_limits_a_request_holds_what_table_9_6_has(msd: Drive) -> None:
    channel = ParameterChannel(msd.store, LOCAL, strict=False)
    channel.write_request(bytes.fromhex(f"07 01 00 27 {ONE * 39}"))
    assert channel.read_response() == bytes.fromhex("07 01 00 27" + " 42 01 00 7E" * 39)


def test_a_response_longer_than_p_0974_says_is_refused(msd: Drive) -> None:
    assert ask(msd, "07 01 00 03" + "10 20 03 D3 00 00" * 3) == (
        ask(msd, "07 01 00 02" + "10 20 03 D3 00 00" * 2).replace("07 01 00 02", "07 81 00 03") + " 44 01 00 15"
    )


# a broken folder


@pytest.mark.parametrize(
    ("file", "old", "new", "message"),
    [
        ("parameters.csv", "1|0|1|2", "1|0|1", r"scale: '1\|0\|1' must have a value for each of 0\.\.3"),
        ("parameters.csv", "1|0|1|2", "1|0|x|2", r"scale: .* must have numbers between its bars"),
        ("parameters.csv", ",4 10,", ",4 10 5,", r"default: '4 10 5' does not fit"),
        ("parameters.csv", ",4 10,", ",4 70000,", r"default: '4 70000' does not fit"),
        ("telegrams.toml", "ident = 0x0101,", "ident = 0x1002,", r"0x1002 is the module ident of telegram 1"),
        ("telegrams.toml", "P-0301 = 1", "0x12E = 1", r"telegram 1, settings: no parameter 302"),
        ("telegrams.toml", "P-0301 = 1", "P-0301 = 2", r"telegram 1, settings\.301: 2 is not within 0\.\.1"),
        ("telegrams.toml", 'name = "Standard telegram 1, IRT", ', "", r"other_modules 2, name: missing"),
        ("telegrams.toml", "tasks =", "pulses_enabled = 12\ntasks =", r"telegram 7, pulses_enabled: 12"),
        ("telegrams.toml", '"driving-set"', '"driving-sets"', r"tasks: 'driving-sets' is not one of"),
        (
            "model.toml",
            'denominator = { value = "P-0272"',
            "denominator = { value = 284",
            r"factor_group\.denominator: 284 is not",
        ),
        ("model.toml", "other_subindex = 0", "other_subindex = 2", r"consequence 1: 1 does not fit element 2"),
        ("model.toml", 'other = "P-1402"', "other = 1403", r"consequence 1: names a parameter"),
        ("faults.csv", "32-3,", "32-300,", r"number: '32-300' is not a number or a pair such as 32-1"),
        ("model.toml", 'value = "32-1"', 'value = "32-2"', r"communication_loss: names a fault"),
        (
            "model.toml",
            'action_parameter = { value = "P-1283"',
            "action_parameter = { value = 1282",
            r"communication_loss",
        ),
        ("model.toml", "32-3 = {", "32-4 = {", r"diagnosis\.32-4: there is no fault"),
        ("model.toml", '"extended", ', '"verbose", ', r"diagnosis_coding\.modes"),
        ("model.toml", "[1, 1, 1, 2]", "[1, 1, 1]", r"diagnosis_coding\.modes"),
        ("model.toml", "mode_parameter = { value = 1256", "mode_parameter = { value = 1257", r"no parameter 1257"),
        ("model.toml", 'ready = { value = ["on", "on"]', "ready = { value = 1", r"lamps: each state"),
        ("model.toml", "error = { value = 7", 'error = { value = "7"', r"parameter_words\.error: '7'"),
        ("model.toml", "station_name = { value = 1289", "station_name = { value = 1290", r"station_name: 1290 is not"),
        ("model.toml", '"P-1254"]', "1256]", r"mapping_elements: \[1253, 1256\]"),
        ("telegrams.toml", "shown_as = 1270", "shown_as = 4711", r"signal 5, shown_as: no parameter 4711"),
        (
            "telegrams.toml",
            "number = 202\n",
            "number = 918\n",
            r"signal 918, stored: no stored parameter 918 of its length",
        ),
        ("model.toml", 'ready = { value = ["on", "on"]', 'ready = { value = ["on"]', r"lamps: each state"),
        ("model.toml", '"cache-read"]', '"cash-read"]', r"parameter_words\.tasks"),
        ("model.toml", "array_word = { value = 4", "array_word = { value = 16", r"parameter_words\.array_word: 16"),
        ("model.toml", "[parameter_words]", "[description]", r"parameter_words: missing, and a telegram"),
        ("telegrams.toml", "parameter_words = 4", "parameter_words = 3", r"telegram 101, parameter_words: 3"),
        (
            "telegrams.toml",
            'output = ["-", "-", "-", "-", "STW1", "-"]',
            'output = ["STW1", "-"]',
            r"telegram 101, output",
        ),
        (
            "telegrams.toml",
            'direction = "setpoint"\n',
            'direction = "setpoint"\nreadable = true\n',
            r"signal 5, readable",
        ),
        ("telegrams.toml", "stored = true\n", "", r"stored: only for a signal SHOWN_0"),
        (
            "parameters.csv",
            "284,MPRO_FG_PosUnit,String,0,16",
            "284,MPRO_FG_PosUnit,String,0,",
            r"type: String has no sign",
        ),
        ("parameters.csv", "320,CON_SCON_Kp,Float,0", "320,CON_SCON_Kp,Float,1", r"type: Float has no sign"),
        ("model.toml", "user_structure = { value = 1,", "user_structure = { value = 0,", r"user_structure: 0"),
    ],
)
def test_a_mistake_in_the_data_is_named(tmp_path: Path, file: str, old: str, new: str, message: str) -> None:
    folder = copy_model("moog-msd", tmp_path / "model")
    rewrite(folder, file, old, new)
    with pytest.raises(ConfigError, match=message):
        load_model(folder)


def test_a_farm_file_changes_idents_of_the_first_module_and_may_not_give_one_twice() -> None:
    changed = with_identity(MSD, {"telegrams": {104: 0x100}, "access_point": 0xFFFE})
    assert [module.ident for module in changed.profidrive.telegrams[104].modules] == [0x100, 0x68, 0x168]
    assert {module.submodules[0].ident for t in changed.profidrive.telegrams.values() for module in t.modules} == {
        0xFFFE
    }
    ident = MSD.profidrive.telegrams[101].module.data.ident
    with pytest.raises(ConfigError, match="two modules have the same module ident and submodule ident"):
        with_identity(MSD, {"telegrams": {104: {"module": 0x0065, "submodule": ident}}})
