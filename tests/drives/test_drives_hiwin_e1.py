"""The HIWIN E1 against its manual (PROFINET Communication Command Manual V1.2), table by table."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from drives_kit import Drive, new_drive
from manuals import manual_text
from model_copy import copy_model, rewrite
from parameter_requests import change_request, read_request, results

from pnfarm.drives.catalogue import model
from pnfarm.drives.description.as_json import as_json
from pnfarm.drives.description.behaviour import with_behaviour
from pnfarm.drives.description.loader import load_model
from pnfarm.drives.description.parts import Effect
from pnfarm.drives.parameters.effects import effect_of
from pnfarm.drives.parameters.parameter import ParameterError, ParameterErrorNumber, ParameterType
from pnfarm.drives.parameters.store import FaultHistoryCleared, NonVolatileSaved, ParameterStore, ParameterWritten
from pnfarm.drives.profiles.profidrive.base_mode import ParameterAddress, ParameterValues, emit_request, parse_response
from pnfarm.drives.profiles.profidrive.parameter_channel import ParameterChannel
from pnfarm.errors import ConfigError
from pnfarm.firmware.axis import AXIS
from pnfarm.table.axis_codes import CMD_CLEAR_HISTORY, COMMANDS
from pnfarm.table.signals import WORD_NONE

E = ParameterErrorNumber
E1 = model("hiwin-e1")
TELEGRAMS = (3, 9, 111)


@pytest.fixture
def e1() -> Drive:
    return new_drive("hiwin-e1")


@pytest.fixture(scope="module")
def manual() -> str:
    return manual_text("002")


def ask(drive: Drive, text: str) -> bytes:
    channel = ParameterChannel(drive.store)
    channel.write_request(bytes.fromhex(text))
    response = channel.read_response()
    assert response is not None
    return response


def refused(number: int, drive: Drive, text: str) -> None:
    """The negative response of tables 4.3.1.3, 4.3.2.3, 4.3.3.3 and 4.3.4.3: one parameter, one value."""
    request = bytes.fromhex(text)
    assert ask(drive, text) == bytes([request[0], request[1] | 0x80, request[2], 1, 0x44, 1, 0, number])


# identity and limits (2.2, 2.3, 4.1)


def test_2_2_table_2_2_1_cycles_telegrams_and_modes() -> None:
    assert (E1.limits.min_cycle_ns, E1.limits.max_cycle_ns) == (500_000, 4_000_000)
    assert tuple(E1.profidrive.telegrams) == TELEGRAMS
    assert [telegram.opmode for telegram in E1.profidrive.telegrams.values()] == [1, 2, 2]


def test_2_3_two_connectors_and_2_4_2_the_api() -> None:
    ports = [submodule for submodule in E1.dap.submodules if submodule.subslot > 0x8000]
    assert len(ports) == E1.limits.ports == 2
    assert {s.api for telegram in E1.profidrive.telegrams.values() for s in telegram.module.submodules} == {0x3A00}


def test_aliases_and_assumptions_are_shown() -> None:
    assert model("e1").name == E1.name
    for assumed in ("identity.device_id", "communication_loss.fault", "parameter_access.record_indexes"):
        assert E1.facts[assumed].source == "assumed"
    shown = as_json(E1)
    assert [telegram["note"] for telegram in shown["telegrams"]] == [t.note for t in E1.profidrive.telegrams.values()]


@pytest.mark.parametrize(
    ("file", "old", "new", "message"),
    [
        ("parameters.csv", ",power-on,", ",tomorrow,", r"effective: 'tomorrow'"),
        ("parameters.csv", ",note,effective", ",note,effect", r"line 1"),
        ("parameters.csv", "reference/n", "x/n", r"scale: 'x/n'"),
        ("faults.csv", "73,0xFB1", "73,0x10000", r"word: 65536"),
        ("faults.csv", "77,0xFB2", "200,0xFB2", r"word: 4018"),
        ("model.toml", "[sign_of_life]\nfault = { value = 73", "[sign_of_life]\nfault = { value = 1", r"no fault 1"),
        (
            "model.toml",
            "[communication_loss]\nfault = { value = 73",
            "[communication_loss]\nfault = { value = 1",
            r"loss",
        ),
    ],
)
def test_a_mistake_in_what_only_this_model_says_is_named(
    tmp_path: Path, file: str, old: str, new: str, message: str
) -> None:
    folder = copy_model("hiwin-e1", tmp_path / "model")
    rewrite(folder, file, old, new)
    with pytest.raises(ConfigError, match=message):
        load_model(folder)


# signals and telegrams (3.1, 3.2)


def test_3_1_every_signal_of_the_table_with_its_data_type(manual: str) -> None:
    table = manual.split("3.1 IO data signals\n\nTable 3.1.1")[1].split("3.2 Supported telegrams", maxsplit=1)[0]
    rows = re.findall(r"^([A-Z0-9_]+)\t[^\t]+\t(Uint|Int)(\d+)$", table, re.MULTILINE)
    assert len(rows) == 26
    signals = {signal.name: (signal.signed, signal.bits) for signal in E1.profidrive.signals.values()}
    assert signals == {
        ("MDI_MOD" if name == "MDI_MODE" else name): (kind == "Int", int(bits)) for name, kind, bits in rows
    }


@pytest.mark.parametrize(("number", "received", "sent"), [(3, 5, 9), (9, 10, 5), (111, 12, 12)])
def test_3_2_table_3_2_1_words(number: int, received: int, sent: int) -> None:
    telegram = E1.profidrive.telegrams[number]
    assert (len(telegram.output), len(telegram.input)) == (received, sent)
    data = telegram.module.submodules[1]
    assert (data.output_bytes, data.input_bytes) == (2 * received, 2 * sent)


def test_3_2_table_3_2_2_places() -> None:
    """(telegram, PZD, received, sent); a double word's second place shows nothing in the table."""
    rows = [
        (3, 1, "STW1", "ZSW1"), (3, 2, "NSOLL_B", "NIST_B"), (3, 4, "STW2", "ZSW2"), (3, 5, "G1_STW", "G1_ZSW"),
        (3, 6, None, "G1_XIST1"), (3, 8, None, "G1_XIST2"),
        (9, 1, "STW1", "ZSW1"), (9, 2, "SATZANW", "AKTSATZ"), (9, 3, "STW2", "ZSW2"), (9, 4, "MDI_TARPOS", "XIST_A"),
        (9, 6, "MDI_VELOCITY", None), (9, 8, "MDI_ACC", None), (9, 9, "MDI_DEC", None), (9, 10, "MDI_MOD", None),
        (111, 1, "STW1", "ZSW1"), (111, 2, "POS_STW1", "POS_ZSW1"), (111, 3, "POS_STW2", "POS_ZSW2"),
        (111, 4, "STW2", "ZSW2"), (111, 5, "OVERRIDE", "MELDW"), (111, 6, "MDI_TARPOS", "XIST_A"),
        (111, 8, "MDI_VELOCITY", "NIST_B"), (111, 10, "MDI_ACC", "FAULT_CODE"), (111, 11, "MDI_DEC", "WARN_CODE"),
    ]  # fmt: skip
    for number, place, received, sent in rows:
        telegram = E1.profidrive.telegrams[number]
        for signals, name in ((telegram.output, received), (telegram.input, sent)):
            if name is None:
                continue
            signal = signals[place - 1]
            assert signal is not None
            assert signal.name == name
            if signal.bits == 32:
                assert signals[place] is signal
    assert E1.profidrive.telegrams[111].output_words[-1] == E1.profidrive.telegrams[111].input_words[-1] == WORD_NONE


# bits (3.3 to 3.16)


@pytest.mark.parametrize(
    ("word", "telegram", "bits"),
    [
        ("STW1", 3, {0, 1, 2, 3, 7, 10}),
        ("STW1", 9, {*range(12)}),
        ("STW1", 111, {*range(12)}),
        ("STW2", 3, {12, 13, 14, 15}),
        ("ZSW1", 3, {*range(11)}),
        ("ZSW1", 9, {*range(14)}),
        ("ZSW1", 111, {*range(14)}),
        ("ZSW2", 3, {12, 13, 14, 15}),
        ("ZSW2", 9, {11, 12, 13, 14, 15}),
        ("G1_STW", 3, {*range(8), 14, 15}),
        ("G1_ZSW", 3, {*range(8), 11, 14, 15}),
        ("SATZANW", 9, {15}),
        ("AKTSATZ", 9, {15}),
        ("MDI_MOD", 9, {0}),
        ("POS_STW1", 111, {8, 15}),
        ("POS_STW2", 111, {1}),
        ("POS_ZSW1", 111, {8, 9, 10, 11, 15}),
        ("POS_ZSW2", 111, {2, 4, 5, 15}),
        ("MELDW", 111, {1, 6, 7, 8, 11, 12, 13}),
    ],
)
def test_3_3_to_3_16_bits_that_are_not_reserved_have_names(word: str, telegram: int, bits: set[int]) -> None:
    names = E1.profidrive.bit_names(word, telegram)
    assert {bit for bit, name in enumerate(names) if name} == bits
    assert len({name for name in names if name}) == len(bits)


def test_3_6_the_bit_of_zsw2_that_says_pulses_are_enabled(e1: Drive) -> None:
    found = []
    for number in TELEGRAMS:
        e1.store.plug_telegram(number)
        found.append(int(e1.axis.profidrive.settings.pulses_enabled))
        names = E1.profidrive.bit_names("ZSW2", number)
        assert ["pulses_enabled"] * (found[-1] > 0) == [name for name in names[:12] if name]
    assert found == [0, 1 << 11, 1 << 11]


def test_words_without_bits_have_no_names() -> None:
    assert E1.profidrive.bit_names("NSOLL_B", 3) == ()
    assert model("akd").profidrive.bit_names("STW1", 9)[:2] == ("on", "no_coast_stop")


# parameters (4.1, 4.2, 6)


def test_4_1_every_parameter_of_the_table(manual: str) -> None:
    table = manual.split("Table 4.1.1 describes")[1].split("4.2 Drive parameters", maxsplit=1)[0]
    rows = re.findall(
        r"^(\d{3})\t(Read(?: / Write)?)\tUint(16|32)(?: Array\[(\d+)\])?\t(.+?)\t(\S+)", table, re.MULTILINE
    )
    assert [int(row[0]) for row in rows] == [
        p.pnu for p in E1.parameters.values() if p.pnu < 0x2000 and p.source != "profile"
    ]
    for pnu, access, bits, elements, name, _ in rows:
        parameter = E1.parameters[int(pnu)]
        assert parameter.type is (ParameterType.WORD if bits == "16" else ParameterType.DWORD)
        assert (parameter.readable, parameter.writable) == (True, "Write" in access)
        assert parameter.elements == int(elements or 0)
        assert parameter.name == name
    assert E1.parameters[925].default == 5


def test_4_1_profile_parameters_that_the_table_does_not_have_are_not_there() -> None:
    for pnu in (915, 916, 923, 972, 975, 980, 61001):
        with pytest.raises(ParameterError):
            E1.resolve(pnu)


def test_a_parameter_that_is_not_there_is_refused_with_the_name_that_is_near() -> None:
    with pytest.raises(ParameterError, match="has no parameter 'Fault numbre', did you mean FAULT NUMBER"):
        E1.resolve("Fault numbre")
    with pytest.raises(ParameterError, match="has no parameter '60000'; give a number or a name"):
        E1.resolve("60000")


def test_4_1_what_the_table_does_not_list_is_the_profiles_and_can_be_left_out(e1: Drive) -> None:
    """Tools ask for the profile's number and the station's name."""
    assert [p.pnu for p in E1.parameters.values() if p.source == "profile"] == [965, 61000]
    assert e1.store.read(965) == [0x032A]
    assert e1.store.read(61000, 0, 240) == [0] * 240, "a drive that no station holds"
    listed = with_behaviour(E1, {"profile-parameters": "listed-only"})
    assert {965, 61000} & listed.parameters.keys() == set()


#: Every Pt parameter that the manual names, by section.
PT_PARAMETERS = {
    "4.2": ("Pt100",),
    "6.1": ("Pt317", "Pt386"),
    "6.2": ("Pt316", "Pt385"),
    "6.3": ("Pt402", "Pt403", "Pt483", "Pt484"),
    "6.4": ("Pt30A", "Pt538"),
    "6.5": ("Pt001",),
    "6.6.1": ("Pt534", "Pt537"),
    "6.8": ("Pt533", "Pt585"),
}


def test_4_2_every_pt_parameter_of_the_manual_is_accessible_by_its_number_plus_2000h(e1: Drive) -> None:
    for section, names in PT_PARAMETERS.items():
        for name in names:
            parameter = E1.resolve(name)[0]
            assert parameter.pnu == 0x2000 + int(name.removeprefix("Pt"), 16)
            assert section in parameter.source
            (value,) = e1.store.read(parameter.pnu)
            e1.store.write(parameter.pnu, 0, [parameter.maximum])
            assert e1.store.read(parameter.pnu) == [parameter.maximum]
            assert parameter.allows(value)


def test_4_2_no_other_pt_parameter_is_named(manual: str) -> None:
    named = {name for names in PT_PARAMETERS.values() for name in names}
    assert set(re.findall(r"Pt[0-9A-F]{3}\b", manual)) == named
    assert {p.name for p in E1.parameters.values() if 0x2000 <= p.pnu <= 0x2FFF} == named
    tables = re.findall(r"^Pt No\.\tPt(\w+)\tPNU Number\t0x(\w+)", manual, re.MULTILINE)
    assert len(tables) == 16
    assert all(E1.resolve(f"0x{pnu}") == E1.resolve(f"Pt{name}") for name, pnu in tables), "as the tables print it"


def test_4_2_pt100_whose_meaning_is_in_another_manual_is_kept(e1: Drive) -> None:
    assert effect_of(E1, E1.parameters[0x2100]) is Effect.KEPT
    e1.store.set("Pt100", 400)
    e1.store.power_on()
    assert e1.store.get(0x2100) == 400


def test_6_ranges_defaults_units_and_effect_of_the_pt_parameters(manual: str) -> None:
    pattern = (
        r"^Pt No\.\tPt(\w+).*\nSize\t(\d)\tSetting Range\t(\d+)~(\d+)\tDefault\t(\d+).*\n"
        r"Name\t(.+?)\tUnit\t(?:1(?!0) ?)?(.+?)\t.*\nEffective\t(Immediately|After power on)"
    )
    tables = re.findall(pattern, manual, re.MULTILINE)
    assert len(tables) == 16
    for number, size, low, high, default, name, unit, effective in tables:
        parameter = model("hiwin-e1").resolve(f"Pt{number}")[0]
        assert parameter.octets == int(size)
        assert (parameter.minimum, parameter.maximum, parameter.default) == (int(low), int(high), int(default))
        assert parameter.unit == unit
        assert parameter.after_power_on == (effective == "After power on")
        assert parameter.note.startswith(name)
        assert parameter.writable


def test_964_identification(e1: Drive) -> None:
    assert e1.store.read(964, 0, 7) == [0xAAA, 5, 201, 2023, 101, 1, 0]


def test_944_to_952_the_fault_buffer(e1: Drive) -> None:
    e1.axis.faults.buffer[0], e1.axis.faults.buffer[1], e1.axis.faults.buffer[8] = 73, 18, 62
    e1.axis.faults.counter, e1.axis.faults.changes = 2, 5
    assert e1.store.read(944) == [5]
    assert e1.store.read(945, 0, 9) == [0xFB1, 0x410, 0, 0, 0, 0, 0, 0, 0xD00]
    assert e1.store.read(947, 0, 9) == [73, 18, 0, 0, 0, 0, 0, 0, 62]
    assert len(e1.store.read(945, 0, 64)) == len(e1.store.read(947, 0, 64)) == 64
    scaling = e1.store.read(950, 0, 2)
    assert scaling[0] * scaling[1] == 64
    assert e1.store.read(952) == [2]
    with pytest.raises(ParameterError) as caught:
        e1.store.write(952, 0, [1])
    assert caught.value.number == E.ONLY_RESET
    e1.store.write(952, 0, [0])
    assert int(e1.axis.commands.settings.ring[0]) == CMD_CLEAR_HISTORY
    assert e1.store.events() == [FaultHistoryCleared(), ParameterWritten(952, 0, (0,))]


def test_930_follows_the_telegram(e1: Drive) -> None:
    found = []
    for number in TELEGRAMS:
        e1.store.plug_telegram(number)
        found.append((e1.store.read(922), e1.store.read(930), int(e1.axis.drive.settings.opmode)))
    assert found == [([3], [3], 1), ([9], [2], 2), ([111], [2], 2)]


def test_979_describes_one_encoder(e1: Drive) -> None:
    values = e1.store.read(979, 0, 31)
    assert values[2] == 1 << 23
    assert values[6:] == [0] * 25


def test_6_1_the_reference_velocity_is_100_percent_at_once(e1: Drive) -> None:
    assert e1.axis.profidrive.settings.velocity_step * 0x4000 == 3000.0
    e1.store.set("Pt317", 1500)
    assert e1.axis.profidrive.settings.velocity_step * 0x4000 == 1500.0


def test_6_2_and_6_5_take_effect_after_power_on(e1: Drive) -> None:
    e1.store.set("Pt316", 2000)
    e1.store.set("Pt001", 2)
    assert (e1.axis.travel.settings.velocity_limit, e1.axis.motor.settings.coast_method) == (10_000, 0)
    assert (e1.store.get("Pt316"), e1.store.get("Pt001")) == (2000, 2)
    e1.store.power_on()
    assert (e1.axis.travel.settings.velocity_limit, e1.axis.motor.settings.coast_method) == (2000, 2)


def test_what_is_written_is_permanent_at_once(e1: Drive) -> None:
    e1.store.set("Pt534", 250)
    assert NonVolatileSaved() in e1.store.events()
    again = new_drive("hiwin-e1")
    assert again.store.restore(e1.store.snapshot()) == []
    again.store.power_on()
    assert again.store.get("Pt534") == 250


@pytest.mark.parametrize(("milliseconds", "deceleration"), [(0, 1e12), (10, 300_000.0), (1000, 3000.0)])
def test_6_4_the_stop_time_is_a_ramp(e1: Drive, milliseconds: int, deceleration: float) -> None:
    e1.store.set("Pt30A", milliseconds)
    assert e1.axis.ramp.settings.quick_stop_deceleration == deceleration


def test_another_model_clears_what_this_one_sets(e1: Drive) -> None:
    store = ParameterStore(model("akd"), e1.store.handle)
    store.power_on()
    assert [
        AXIS.read(e1.axis, name) for name in ("ramp.generator", "life.watched", "travel.velocity_limit", "sensor.step")
    ] == [0, 0, 0, 0]


# parameter access (4.3)


def test_4_3_1_read_a_value(e1: Drive) -> None:
    """Tables 4.3.1.1 and 4.3.1.2: 0 elements, the subindex irrelevant; the format of the data type."""
    assert ask(e1, "01 01 00 01 10 00 039D 0000") == bytes.fromhex("01 01 00 01 06 01 0005")
    assert ask(e1, "FF 01 00 01 10 00 039D 1234") == bytes.fromhex("FF 01 00 01 06 01 0005")
    refused(0x00, e1, "01 01 00 01 10 00 03C6 0000")


def test_4_3_2_write_a_value(e1: Drive) -> None:
    """Tables 4.3.2.1 and 4.3.2.2: the positive response is the header alone."""
    assert ask(e1, "02 02 00 01 10 00 2317 0000 06 01 05DC") == bytes.fromhex("02 02 00 01")
    assert e1.store.get("Pt317") == 1500
    assert ask(e1, "02 02 00 01 10 00 2317 0000 42 01 0BB8") == bytes.fromhex("02 02 00 01")
    refused(0x02, e1, "02 02 00 01 10 00 2317 0000 06 01 0000")
    refused(0x01, e1, "02 02 00 01 10 00 03C4 0000 06 01 0000")
    refused(0x06, e1, "02 02 00 01 10 00 03B8 0000 06 01 0001")


def test_4_3_3_read_array_elements(e1: Drive) -> None:
    assert ask(e1, "03 01 00 01 10 07 03C4 0000") == bytes.fromhex(
        "03 01 00 01 06 07 0AAA 0005 00C9 07E7 0065 0001 0000"
    )
    whole = ask(e1, "03 01 00 01 10 1F 03D3 0000")
    assert whole[:6] == bytes.fromhex("03 01 00 01 07 1F")
    assert len(whole) == 6 + 4 * 31
    refused(0x03, e1, "03 01 00 01 10 08 03C4 0000")
    refused(0x03, e1, "03 01 00 01 10 01 03C4 0007")
    refused(0x04, e1, "03 01 00 01 10 02 039D 0000")
    refused(0x04, e1, "03 01 00 01 10 01 039D 0001")


def test_4_3_4_write_array_elements(e1: Drive) -> None:
    """Every array of table 4.1.1 is for reading only."""
    refused(0x01, e1, "04 02 00 01 10 02 03B1 0000 06 02 0000 0000")


@pytest.mark.parametrize("code", [0x01, 0x02, 0x03, 0x04, 0x05, 0x06, 0x07, 0x08, 0x41, 0x42, 0x43])
def test_4_3_5_formats_of_the_table_are_judged_by_their_width(e1: Drive, code: int) -> None:
    octets = {0x01: 1, 0x02: 1, 0x05: 1, 0x41: 1, 0x03: 2, 0x06: 2, 0x42: 2}.get(code, 4)
    value = (100).to_bytes(octets, "big").hex() + ("00" if octets == 1 else "")
    request = f"05 02 00 01 10 00 2534 0000 {code:02X} 01 {value}"
    if octets == 2:
        assert ask(e1, request) == bytes.fromhex("05 02 00 01")
    else:
        refused(0x05, e1, request)


@pytest.mark.parametrize("code", [0x00, 0x09, 0x0A, 0x3F, 0x40, 0x44, 0x45, 0x71, 0x7B, 0xFF])
def test_4_3_5_reserved_formats_are_illegal(e1: Drive, code: int) -> None:
    refused(0x17, e1, f"05 02 00 01 10 00 2534 0000 {code:02X} 01 0064")


def test_4_3_6_number_of_values_attribute_and_drive_object(e1: Drive) -> None:
    refused(0x18, e1, "06 02 00 01 10 00 2534 0000 06 02 0064 0064")
    refused(0x09, e1, "06 01 00 01 20 00 2534 0000")
    refused(0x0F, e1, "06 01 00 01 30 00 2534 0000")
    refused(0x07, e1, "06 02 00 01 20 00 2534 0000 06 01 0064")
    refused(0x16, e1, "06 01 00 01 50 00 2534 0000")
    refused(0x19, e1, "06 01 01 01 10 00 2534 0000")


#: Table 4.3.6.1: a request that meets each error; None for those that have no cause in this drive.
ERRORS: dict[int, str | None] = {
    0x00: "01 01 00 01 10 00 03C6 0000",
    0x01: "01 02 00 01 10 00 03B0 0000 06 01 0000",
    0x02: "01 02 00 01 10 00 2402 0000 06 01 0321",
    0x03: "01 01 00 01 10 01 03C4 0007",
    0x04: "01 01 00 01 10 01 2402 0001",
    0x05: "01 02 00 01 10 00 2402 0000 07 01 00000001",
    0x06: "01 02 00 01 10 00 03B8 0000 06 01 0005",
    0x07: "01 02 00 01 20 00 2402 0000 06 01 0001",
    0x09: "01 01 00 01 20 00 2402 0000",
    0x0B: None,  # every parameter may be written by everybody
    0x0F: "01 01 00 01 30 00 2402 0000",
    0x11: "01 02 00 01 10 00 03B8 0000 06 01 0000",  # with a drive that takes no commands
    0x14: None,  # no parameter of single values can be written
    0x15: "01 01 00 01 10 1F 03D3 0000",  # with a reader that takes 16 octets
    0x16: "01 01 00 01 11 00 2402 0000",
    0x17: "01 02 00 01 10 00 2402 0000 0A 01 0001",
    0x18: "01 02 00 01 10 00 2402 0000 06 02 0001 0001",
    0x19: "01 01 02 01 10 00 2402 0000",
    0x20: "01 02 00 01 30 00 2402 0000 06 01 0001",
    0x21: "01 03 00 01 10 00 2402 0000",
    0x22: None,  # 0x23 comes first
    0x23: "01 01 00 02 10 00 2402 0000 10 00 2403 0000",
}


def test_4_3_6_every_error_number_that_this_drive_can_give(e1: Drive, manual: str) -> None:
    table = manual.split("Table 4.3.6.1\n", maxsplit=1)[1].split("5. Diagnostics", maxsplit=1)[0]
    rows = re.findall(r"^0x([0-9A-F]{2})\t(?!Reserved)", table, re.MULTILINE)
    assert {int(number, 16) for number in rows} - {0x0D, 0x0E, 0x13} == set(ERRORS)
    for _ in range(COMMANDS - 1):
        e1.store.handle.push_command(CMD_CLEAR_HISTORY)
    for number, request in ERRORS.items():
        if request is None:
            continue
        channel = ParameterChannel(e1.store)
        channel.write_request(bytes.fromhex(request))
        response = channel.read_response(16)
        assert response is not None
        assert response[1] & 0x80
        assert response[3:] == bytes([1, 0x44, 1, 0, number]), f"0x{number:02X}"
    assert e1.store.get("Pt402") == 800


@pytest.mark.parametrize("service", ["00", "03", "7F", "81"])
def test_4_3_6_an_unknown_request_id_is_answered_with_80h(e1: Drive, service: str) -> None:
    assert ask(e1, f"07 {service} 00 01 10 00 2534 0000") == bytes.fromhex("07 80 00 01 44 01 0021")


@pytest.mark.parametrize("count", [2, 3, 39, 40, 255])
def test_4_3_only_one_parameter_a_request(e1: Drive, count: int) -> None:
    addresses = " ".join(["10 00 2534 0000"] * min(count, 39))
    refused(0x23, e1, f"08 01 00 {count:02X} {addresses}")
    refused(0x23, e1, f"08 02 00 {count:02X} {addresses} " + "06 01 0001 " * min(count, 39))
    assert e1.store.get("Pt534") == 100


def test_4_3_a_request_without_parameters_is_not_a_multi_parameter_request(e1: Drive) -> None:
    refused(0x16, e1, "08 01 00 00")


def test_the_requester_understands_the_refusal_and_the_short_answer(e1: Drive) -> None:
    request = read_request(9, [ParameterAddress(922), ParameterAddress(925)])
    answers = results(request, parse_response(ask(e1, emit_request(request).hex())))
    assert [answer.number for answer in answers if isinstance(answer, ParameterError)] == [E.MULTI_PARAMETER] * 2
    single = change_request(9, [(ParameterAddress(925), ParameterValues(0x06, (7,)))])
    assert results(single, parse_response(ask(e1, emit_request(single).hex()))) == [ParameterValues(0)]
    assert e1.axis.life.settings.tolerance == 7


def test_the_akd_still_takes_many_parameters_a_request() -> None:
    akd = new_drive("akd-profinet")
    response = ask(akd, "08 01 00 02 10 01 039A 0000 10 01 03A2 0000")
    assert response == bytes.fromhex("08 01 00 02 42 01 0001 42 01 0001")


# faults (5.1)


def test_5_1_every_fault_with_number_code_and_name(manual: str) -> None:
    rows = re.findall(r"^(\d+)\t([0-9A-Za-z]{3})\t(.+)\t(AL\.\w+)$", manual, re.MULTILINE)
    assert len(rows) == 56
    assert [int(row[0]) for row in rows] == [fault.number for fault in E1.faults.values() if not fault.warning]
    for number, code, name, alarm in rows:
        fault = E1.faults[int(number)]
        assert fault.word == int(code, 16)
        assert fault.name == f"{alarm} {name}"


def test_5_1_the_axis_has_the_codes_for_the_signal(e1: Drive) -> None:
    assert {n: int(word) for n, word in enumerate(e1.axis.profidrive.settings.fault_words) if word} == {
        fault.number: fault.word for fault in E1.faults.values() if not fault.warning
    }


@pytest.mark.parametrize(
    ("cause", "number"),
    [("communication-loss", 73), ("undervoltage", 18), ("overvoltage", 17), ("encoder-error", 35), ("sto", 66)],
)
def test_fault_kinds_find_the_drives_own_alarm(cause: str, number: int) -> None:
    assert E1.fault(cause).number == number
    assert (E1.communication_loss.fault, E1.profidrive.sign_of_life and E1.profidrive.sign_of_life.fault) == (73, 73)


@pytest.mark.parametrize("word", ["AL.FB1", "al.fb1", "AL.FB1 Fieldbus communication error", "73", "F73"])
def test_5_1_an_alarm_is_found_by_its_code_name_or_number(word):
    assert model("hiwin-e1").fault(word).number == 73


def test_no_other_word_of_a_name_finds_a_fault():
    with pytest.raises(ConfigError, match="has no fault"):
        model("hiwin-e1").fault("Fieldbus")
