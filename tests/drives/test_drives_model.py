"""Models as data: what is loaded, what is refused, what the JSON shows."""

from __future__ import annotations

import csv
import io
import json
import os
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from manuals import manual_text
from model_copy import copy_model, file_of, rewrite

from pnfarm.drives import catalogue
from pnfarm.drives.catalogue import model, models
from pnfarm.drives.description.as_json import as_json
from pnfarm.drives.description.identity import with_identity
from pnfarm.drives.description.loader import load_model
from pnfarm.drives.parameters.parameter import Backing, ParameterError, ParameterType
from pnfarm.drives.telegrams.telegram import MappingError, signal_codes, signal_numbers
from pnfarm.drives.telegrams.word_bits import WordBits, bit_names
from pnfarm.errors import ConfigError
from pnfarm.firmware.axis import AXIS
from pnfarm.table.signals import ACTUAL_SLOTS, SETPOINT_SLOTS, SLOTS, WORD_NONE, word_code

AKD_ROW = re.compile(r"^([A-Z0-9]+\.[A-Z0-9_]+)\t(\d+)\t(.*)$")


def manual_rows() -> list[tuple[str, int, str]]:
    text = manual_text("000").split("**Supported AKD PNUs**")[1].split("## 5.7 Signals")[0]
    return [(m[1], int(m[2]), m[3]) for line in text.splitlines() if (m := AKD_ROW.match(line))]


# the catalogue


@pytest.mark.parametrize("name", sorted(models()))
def test_every_model_loads_and_gives_plain_json(name: str) -> None:
    described = as_json(model(name))
    assert json.loads(json.dumps(described)) == described
    assert {"identity", "dap", "telegrams", "parameters", "faults", "limits"} <= described.keys()
    submodule_keys = {"slot", "subslot", "ident", "api", "input_bytes", "output_bytes"}
    for module in filter(None, [described["dap"], *described["telegrams"]]):
        assert isinstance(module["module_ident"], int)
        assert all(submodule_keys <= submodule.keys() for submodule in module["submodules"])


@pytest.mark.parametrize("name", sorted(models()))
def test_every_value_names_its_source_and_every_assumption_its_reason(name: str) -> None:
    described = model(name)
    for fact in described.facts.values():
        assert fact.source
        assert fact.source != "assumed" or fact.note
    for parameter in described.parameters.values():
        assert parameter.source
        assert parameter.values_source != "assumed" or parameter.note or parameter.backing is not Backing.STORED
    for fault in described.faults.values():
        assert fault.source
        assert fault.source != "assumed" or fault.note


@pytest.fixture
def opened(monkeypatch: pytest.MonkeyPatch) -> list[Path]:
    """The files that were opened since."""
    found: list[Path] = []
    real = io.open

    def note(file: Any, *args: Any, **more: Any) -> Any:
        found.append(Path(file))
        return real(file, *args, **more)

    monkeypatch.setattr(io, "open", note)
    return found


def test_the_list_of_models_is_made_without_a_look_into_their_tables(opened: list[Path]) -> None:
    catalogue._entries.cache_clear()
    assert models()
    assert {path.name for path in opened} == {"bus.toml", "model.toml"}


@pytest.mark.parametrize("name", sorted(models()))
def test_a_model_is_read_when_asked_for_and_each_of_its_files_once(name: str, opened: list[Path]) -> None:
    catalogue._loaded.cache_clear()
    models()
    assert opened == []
    found = model(name)
    assert models()[name].folder / "model.toml" in opened
    assert len(opened) == len(set(opened))
    opened.clear()
    assert all(model(alias) is found for alias in (name, *models()[name].aliases))
    assert opened == []


def test_an_unknown_model_is_refused_with_the_known_ones() -> None:
    with pytest.raises(ConfigError, match=r"akd-profinet.*did you mean"):
        model("akd-profinte")


def beside(place: Path, name: str, aliases: str = "[]") -> Path:
    """A folder with a copy of the AKD under another name."""
    folder = copy_model("akd-profinet", place / "drive")
    path = folder / "model.toml"
    text = path.read_text(encoding="utf-8").replace('name = "akd-profinet"', f'name = "{name}"', 1)
    path.write_text(re.sub(r"(?m)^aliases = .*$", f"aliases = {aliases}", text), encoding="utf-8")
    return folder


def test_models_of_further_folders_are_known_like_the_others(tmp_path: Path, monkeypatch) -> None:
    beside(tmp_path / "a", "akd-mine", '["mine"]')
    second = beside(tmp_path / "b", "akd-yours")
    monkeypatch.setenv(catalogue.MODELS_VARIABLE, os.pathsep.join(["", str(tmp_path / "a"), str(tmp_path / "b")]))
    assert model("mine") is model("akd-mine")
    assert models()["akd-yours"].folder == second
    assert model("akd-mine").parameters.keys() == model("akd-profinet").parameters.keys()
    monkeypatch.delenv(catalogue.MODELS_VARIABLE)
    with pytest.raises(ConfigError, match="there is no drive model 'akd-mine'"):
        model("akd-mine")


def test_the_folder_of_the_shipped_models_may_be_named_too(monkeypatch) -> None:
    before = models()
    monkeypatch.setenv(catalogue.MODELS_VARIABLE, str(catalogue.SHIPPED_FOLDER))
    assert models() == before


@pytest.mark.parametrize("aliases", ['"own"', "[[1]]", "1"])
def test_aliases_that_are_no_list_of_names_are_refused(tmp_path: Path, monkeypatch, aliases: str) -> None:
    (tmp_path / "own").mkdir()
    (tmp_path / "own" / "model.toml").write_text(f'name = "own-servo"\naliases = {aliases}\n')
    monkeypatch.setenv(catalogue.MODELS_VARIABLE, str(tmp_path))
    with pytest.raises(ConfigError, match=r"aliases: .* is not a list of names"):
        models()


@pytest.mark.parametrize(("name", "aliases"), [("akd-profinet", "[]"), ("akd", "[]"), ("other", '["hiwin-e1"]')])
def test_a_name_that_another_model_has_is_refused(tmp_path: Path, monkeypatch, name: str, aliases: str) -> None:
    folder = beside(tmp_path, name, aliases)
    monkeypatch.setenv(catalogue.MODELS_VARIABLE, str(tmp_path))
    with pytest.raises(ConfigError, match=r"is already a name of .*model\.toml") as caught:
        models()
    assert str(folder) in str(caught.value)


def test_a_further_folder_without_a_model_is_refused(tmp_path: Path, monkeypatch) -> None:
    for place in (tmp_path, tmp_path / "not-there"):
        monkeypatch.setenv(catalogue.MODELS_VARIABLE, str(place))
        with pytest.raises(ConfigError, match=r"PNFARM_MODELS: .* has no folder with a model\.toml"):
            model("akd-profinet")


def test_a_model_without_a_name_is_refused(tmp_path: Path, monkeypatch) -> None:
    path = beside(tmp_path, "other") / "model.toml"
    path.write_text(path.read_text(encoding="utf-8").replace('name = "other"', "", 1), encoding="utf-8")
    monkeypatch.setenv(catalogue.MODELS_VARIABLE, str(tmp_path))
    with pytest.raises(ConfigError, match=r"model\.toml, name: missing"):
        models()


# the AKD against its manual


def test_akd_has_every_row_of_the_manuals_table() -> None:
    rows = manual_rows()
    assert len(rows) == 746
    parameters = model("akd-profinet").parameters
    kinds = {"Byte": ParameterType.BYTE, "Word": ParameterType.WORD, "DWord": ParameterType.DWORD}
    for name, pnu, attributes in rows:
        parameter = parameters[pnu]
        words = [word.strip() for word in attributes.split(",") if word.strip()]
        assert parameter.name == name
        assert parameter.type is kinds.get(words[0], ParameterType.COMMAND)
        assert parameter.signed == ("Signed" in words)
    table = {pnu for _, pnu, _ in rows}
    others = {p.pnu for p in parameters.values() if p.pnu >= 2000 and p.source != "profile"} - table
    assert others == {3022, 3064, 3065}


def test_akd_has_the_profidrive_parameters_and_the_signals_of_the_manual() -> None:
    parameters = model("akd-profinet").parameters
    profidrive = {915, 916, 922, 923, 930, 944, 947, 964, 965, 975, *range(980, 990), 1002, *range(1004, 1010)}
    assert profidrive | {1, 2, 5, 6, 28, 32, 33, 52, 1001} <= parameters.keys()
    assert [pnu for pnu in parameters if pnu < 915] == [
        1, 2, 5, 6, 28, 32, 33, 34, 35, 36, 37, 38, 52, 100, 101, 102, 103, 104, 105, 106, 108, 109,
    ]  # fmt: skip


def test_akd_parameters_keep_rising_numbers() -> None:
    parameters = model("akd-profinet").parameters
    assert list(parameters) == sorted(parameters)
    assert len([number for number, parameter in parameters.items() if parameter.source != "profile"]) == 799
    numbers = file_of(catalogue.models()["akd-profinet"].folder, "numbers.csv")
    with numbers.open(encoding="utf-8", newline="") as file:
        listed = [int(row["pnu"]) for row in csv.DictReader(file)]
    assert listed == sorted(set(listed))


@pytest.mark.parametrize(
    ("text", "pnu", "subindex"),
    [
        ("922", 922, 0),
        (922, 922, 0),
        ("0x39A", 922, 0),
        ("0x3b3.3", 947, 3),
        ("947.3", 947, 3),
        ("DRV.OPMODE", 2135, 0),
        ("drv.opmode", 2135, 0),
        ("DRV.CLRFAULTS", 2111, 0),
        ("TEMP.POWER", 2875, 0),
        ("VL.FB", 2428, 0),
        ("VL.FB_32", 2428, 0),
        ("AIN.VSCALE", 2007, 0),
        ("AOUT.VSCALE", 2858, 0),
        ("PN.STW1", 1, 0),
        ("PN.POSSCALE", 3014, 0),
        ("Fault number.9", 947, 9),
    ],
)
def test_parameters_are_found_by_number_and_by_the_manuals_name(text: str | int, pnu: int, subindex: int) -> None:
    parameter, index = model("akd-profinet").resolve(text)
    assert (parameter.pnu, index) == (pnu, subindex)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "0",
        "9",
        "65536",
        "0x",
        "0x0",
        "0x1039A",
        "0x 39A",
        "39A",
        "DRV",
        "DRV.NOTHING",
        ".3",
        "-1",
        "9\u00b2",
        "922.x",
    ],
)
def test_an_unknown_parameter_is_refused(text: str) -> None:
    with pytest.raises(ParameterError) as caught:
        model("akd-profinet").resolve(text)
    assert caught.value.number == 0


@pytest.mark.parametrize("wanted", [702, "702", "F702", "Fieldbus communication lost", "communication-loss"])
def test_faults_are_found_by_number_name_and_cause(wanted: str | int) -> None:
    fault = model("akd-profinet").fault(wanted)
    assert fault.number == 702
    assert fault.code == 702 | 1 << 24
    with pytest.raises(ConfigError, match="702"):
        model("akd-profinet").fault("flat tyre")


@pytest.mark.parametrize("name", sorted(models()))
@pytest.mark.parametrize(
    "cause", ["undervoltage", "overvoltage", "sto", "following-error", "encoder-error", "motor-overtemperature"]
)
def test_fault_kinds_find_a_fault_for_their_cause(cause: str, name: str) -> None:
    assert model(name).fault(cause).cause == cause


# telegrams


@pytest.mark.parametrize("name", sorted(models()))
def test_every_telegram_packs_and_unpacks_every_signal_once(name: str) -> None:
    for telegram in model(name).profidrive.telegrams.values():
        for signals, words, slots in (
            (telegram.output, telegram.output_words, SETPOINT_SLOTS),
            (telegram.input, telegram.input_words, ACTUAL_SLOTS),
        ):
            assert len(signals) == len(words)
            image = dict.fromkeys(range(SLOTS), 0)
            frame = [0x1000 + index for index in range(len(words))]
            for word, code in zip(frame, words, strict=True):
                if code != WORD_NONE:
                    shift = 16 if code % 4 == 1 else 0
                    image[code // 4] |= word << shift
            back = [
                image[code // 4] >> (16 if code % 4 == 1 else 0) & 0xFFFF if code != WORD_NONE else None
                for code in words
            ]
            assert back == [word if signal else None for word, signal in zip(frame, signals, strict=True)]
            used = {signal.name for signal in signals if signal}
            assert {slots[n] for n in used} == {code // 4 for code in words if code != WORD_NONE}


@pytest.mark.parametrize(
    ("number", "output_bytes", "input_bytes"),
    [
        (0, 24, 24),
        (1, 4, 4),
        (7, 4, 4),
        (9, 20, 10),
        (350, 4, 6),
        (351, 4, 10),
        (352, 24, 10),
        (353, 26, 10),
        (354, 8, 4),
        (400, 24, 24),
    ],
)
def test_akd_telegrams_have_the_lengths_of_the_manual(number: int, output_bytes: int, input_bytes: int) -> None:
    telegram = model("akd-profinet").profidrive.telegrams[number]
    point, data = telegram.module.submodules
    assert (data.output_bytes, data.input_bytes) == (output_bytes, input_bytes)
    assert (point.output_bytes, point.input_bytes) == (0, 0)
    assert {point.api, data.api} == {0x3A00}
    assert model("akd-profinet").profidrive.telegram_by_module(telegram.module.ident) is telegram


def test_akd_telegram_352_has_mdi_acc_where_telegrams_9_and_353_have_it() -> None:
    telegrams = model("akd-profinet").profidrive.telegrams
    assert telegrams[352].output_words[7] == telegrams[9].output_words[7] == word_code(SETPOINT_SLOTS["MDI_ACC"])
    assert telegrams[352].output_words == telegrams[353].output_words[:12]
    assert "assumed" in telegrams[352].note


def test_the_module_in_slot_1_is_shaped_as_a_captured_profidrive_device(shared: Path) -> None:
    path = shared / "captures" / "drive_connect_api3a00.pcap"
    if not path.exists():
        pytest.skip("the capture is not here")
    point, data = model("akd-profinet").profidrive.telegrams[1].module.submodules
    # expected submodule block: API, slot, module ident, properties, two submodules; the first with subslot and ident
    expected = bytes.fromhex("00003a00 0001 00000100 0000 0002 0001 0000ffff".replace(" ", ""))
    assert expected in path.read_bytes()
    assert (point.api, point.slot, point.subslot, point.ident) == (0x3A00, 1, 1, 0xFFFF)
    assert (data.slot, data.subslot) == (1, 2)


def test_a_mapping_that_cannot_be_is_refused_at_its_word() -> None:
    signals = model("akd-profinet").profidrive.signals
    stw1, zsw1, target = signals[1], signals[2], signals[34]
    assert signal_numbers([stw1, None, target, target]) == (1, 0, 34, 34)
    for wrong, index in (([stw1, zsw1], 1), ([stw1, target, stw1], 1), ([target], 0), ([stw1, None, stw1], 2)):
        with pytest.raises(MappingError) as caught:
            signal_codes(wrong, setpoint=True)
        assert caught.value.index == index


def test_bits_of_a_telegram_come_before_those_of_all_others() -> None:
    usual = WordBits("STW1", (), ("on",), "x")
    own = WordBits("STW1", (9, 111), ("off",), "x")
    for known in ((usual, own), (own, usual)):
        assert bit_names(known, "STW1", 9) == ("off",)
        assert bit_names(known, "STW1", 1) == ("on",)
    assert bit_names((own,), "STW1", 1) == ()


# identity


def test_a_farm_file_overrides_the_identity() -> None:
    plain = model("akd-profinet")
    changed = with_identity(
        plain,
        {
            "vendor": "0x0105",
            "device": 0x0203,
            "order_number": "AKD-P00607-NBPN-0000",
            "software_version": "V1.18.2",
            "dap": 0x22,
            "dap_submodules": {"0x8001": 0x33},
            "access_point": 0xFFFE,
            "telegrams": {1: {"module": 0x101, "submodule": 0x55}, "7": 0x107},
        },
    )
    assert changed.profidrive.identity.device_id == 0x0203
    assert changed.profidrive.identity.software_version == (1, 18, 2)
    assert changed.dap.ident == 0x22
    assert [s.ident for s in changed.dap.submodules] == [1, 2, 0x33]
    assert changed.profidrive.telegrams[1].module.ident == 0x101
    assert [s.ident for s in changed.profidrive.telegrams[1].module.submodules] == [0xFFFE, 0x55]
    assert changed.profidrive.telegrams[7].module.ident == 0x107
    assert changed.profidrive.telegrams[7].output_words == plain.profidrive.telegrams[7].output_words
    shown = as_json(changed)
    assert shown["identity"]["sources"]["device_id"]["source"] == "farm file"
    assert shown["identity"]["sources"]["vendor_id"]["source"] != "farm file"
    assert shown["dap"]["module_source"] == "farm file"
    assert plain.profidrive.identity.device_id != 0x0203
    assert with_identity(plain, {}) is plain


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        ({"colour": 1}, r"identity\.colour"),
        ({"vendor": 0x10000}, r"identity\.vendor"),
        ({"vendor": "abc"}, r"identity\.vendor"),
        ({"device": True}, r"identity\.device"),
        ({"order_number": "x" * 21}, r"identity\.order_number"),
        ({"station_type": ""}, r"identity\.station_type"),
        ({"software_version": "1.2"}, r"identity\.software_version"),
        ({"dap_submodules": {5: 1}}, r"identity\.dap_submodules\.5"),
        ({"dap_submodules": 5}, r"identity\.dap_submodules"),
        ({"telegrams": {2: 1}}, r"identity\.telegrams\.2"),
        ({"telegrams": {1: {"modul": 1}}}, r"identity\.telegrams\.1"),
        ({"telegrams": {1: -1}}, r"identity\.telegrams\.1\.module"),
        ({"telegrams": {1: {"takes": {2: 5}}}}, r"identity\.telegrams\.1\.takes\.2: 5 is not a list of idents"),
        ({"telegrams": {1: {"module": 5, "submodule": 6}, 7: {"module": 5, "submodule": 6}}}, r"same module ident"),
    ],
)
def test_a_wrong_identity_is_refused_by_its_field(overrides: dict[str, object], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        with_identity(model("akd-profinet"), overrides)


# a broken folder


@pytest.mark.parametrize(
    ("file", "old", "new", "message"),
    [
        ("parameters.csv", "\n1,STW1,Word", "\n1,STW1,Real", r"parameters\.csv, line 2, type"),
        ("parameters.csv", "\n2,ZSW1,Word,0,,r,", "\n2,ZSW1,Word,0,,x,", r"line 2, access"),
        ("parameters.csv", "\n5,NSOLL_A", "\n2,NSOLL_A", r"line 3, pnu: 2 is given twice"),
        ("parameters.csv", "\n2,ZSW1", "\n0,ZSW1", r"line 2, pnu"),
        ("parameters.csv", "\n2,ZSW1", "\ntwo,ZSW1", r"line 2, pnu: 'two' is not a number"),
        ("parameters.csv", "signal:received.STW1", "signal:received.STW9", r"line 2, backed_by"),
        ("parameters.csv", "signal:received.STW1", "magic", r"line 2, backed_by"),
        ("parameters.csv", "field:jog.velocity[0]", "field:jog.velocity[2]", r"backed_by"),
        ("parameters.csv", "field:jog.velocity[0]", "field:speed", r"no field 'speed'"),
        ("parameters.csv", "field:drive.opmode", "field:drive.state", r"written by firmware"),
        ("parameters.csv", "alias:DRV.OPMODE", "alias:17", r"line \d+, backed_by: alias of 17"),
        ("parameters.csv", "computed:telegram", "computed:teleprompter", r"backed_by"),
        ("parameters.csv", "command:save", "command:shave", r"backed_by"),
        ("parameters.csv", "1875/8388608", "1875/0", r"scale"),
        ("parameters.csv", "1,2000,1638", "1,2000,2001", r"min, default, max"),
        ("parameters.csv", "\n2,ZSW1,Word,0", "\n2,ZSW1,Word,yes", r"line 2, signed"),
        ("parameters.csv", "\n2,ZSW1,Word,0", "\n2,ZSW1,Word", r"line 2: must have 16 columns"),
        ("parameters.csv", "pnu,name,", "pnu,title,", r"line 1"),
        (
            "parameters.csv",
            '"no manual gives access, limits or default"\nBODE.PRB',
            "\nBODE.PRB",
            r"line 22, note: an assumed",
        ),
        ("telegrams.toml", 'output = ["STW1", "NSOLL_A"]', 'output = ["STW1", "NSOLL_X"]', r"NSOLL_X"),
        (
            "telegrams.toml",
            'output = ["STW1", "NSOLL_A"]',
            'output = ["STW1", "ZSW1"]',
            r"telegram 351, output: word 2",
        ),
        ("telegrams.toml", "number = 7\n", "number = 1\n", r"is given twice"),
        ("telegrams.toml", "bits = 16", "bits = 8", r"signal 101, bits"),
        ("telegrams.toml", 'direction = "setpoint"', 'direction = "up"', r"signal 100, direction"),
        ("telegrams.toml", "[[signal]]", "[[signal", r"telegrams\.toml"),
        ("telegrams.toml", '[[bits]]\nword = "STW1"', '[[bits]]\nword = "STW8"', r"bits 1, word: there is no signal"),
        ("telegrams.toml", '[[bits]]\nword = "STW1"', "[[bits]]", r"bits 1, word: missing"),
        ("telegrams.toml", 'names = ["on",', "names = [7,", r"bits 1, names"),
        ("telegrams.toml", 'word = "STW1"\nnames', 'word = "STW1"\ntelegrams = [2]\nnames', r"bits 1, telegrams: .*2"),
        ("telegrams.toml", 'number = 1\nname = "Standard', 'number = 1\nopmode = 3\nname = "Standard', r"opmode: 3"),
        ("faults.csv", "702,", "x,", r"faults\.csv, line \d+, number"),
        ("faults.csv", "fault,quick-stop", "fault,prayer", r"reaction"),
        ("faults.csv", "702,Fieldbus communication lost,fault", "702,Fieldbus communication lost,mood", r"kind"),
        ("faults.csv", "702,Fieldbus", "703,Fieldbus", r"communication_loss"),
        (
            "faults.csv",
            "assumed: controlled stop,FAULT702.ACTION",
            "assumed: controlled stop,9",
            r"action: 9 is not a plain",
        ),
        ("faults.csv", 'as 154",', 'as 154",2605', r"action: only a fault can have one"),
        (
            "model.toml",
            "stop_parameter = { value = 2158",
            "stop_parameter = { value = 9",
            r"parameter that does not exist",
        ),
        ("model.toml", "parameter = { value = 2606", "parameter = { value = 1", r"address_mode\.parameter: 1 is not"),
        ("model.toml", "dcp = { value = 1", "dcp = { value = -1", r"address_mode\.dcp: -1 is not a value of IP\.MODE"),
        ("model.toml", "default = { value = 65536.0", "default = { value = 0.0", r"units\.default: 0\.0 is not"),
        (
            "telegrams.toml",
            'falls_back = ["MDI_ACC"]',
            'falls_back = ["MDI_DEC"]',
            r"falls_back: 'MDI_DEC' is not one of",
        ),
        (
            "model.toml",
            "[communication_loss]",
            '[communication_loss]\non_stop = { value = true, source = "x" }',
            r"communication_loss\.on_stop",
        ),
        (
            "model.toml",
            'disabled_only = { value = ["DRV.DIR"',
            "disabled_only = { value = [17",
            r"disabled_only: .* 17",
        ),
        ("model.toml", "vendor_id = {", "vendor = {", r"identity"),
        (
            "model.toml",
            'source = "assumed", note = "only in the maker\'s GSDML file" }\nhardware',
            'source = "assumed" }\nhardware',
            r"device_id, note",
        ),
        ("model.toml", "motor.peak_current = {", "motor.beak_current = {", r"beak_current"),
        ("model.toml", "default_telegram = 1", "default_telegram = 2", r"default_telegram"),
        ("model.toml", 'name = "akd-profinet"', "", r"name: missing"),
        ("model.toml", "pnu = 1,", "pnu = 9,", r"PN\.STW1"),
        ("model.toml", "[limits]\nmin_cycle_ns", "[borders]\nmin_cycle_ns", r"limits: .* missing .* 'min_cycle_ns'"),
        ("model.toml", "motion_tasks = { value = 129", "motion_tasks = { value = 130", r"130 is not within 0\.\.129"),
        ("model.toml", "[position_units]", "[units]", r"position_units: missing, but PNU 2004 has the scale position"),
        (
            "model.toml",
            "unit = { value = 2393",
            "unit = { value = 9",
            r"position_units\.unit: 9 is not a plain parameter",
        ),
        ("model.toml", "0.0, 65536.0]", "0.0]", r"position_units\.revolution: PNU 2393 goes to 4"),
        ("model.toml", "scaling = { value = 3014", "scaling = { value = 2391", r"PNU 2391 may be 0"),
    ],
)
def test_a_mistake_in_a_models_file_is_named_by_file_row_and_field(
    folder: Path, file: str, old: str, new: str, message: str
) -> None:
    rewrite(folder, file, old, new)
    with pytest.raises(ConfigError, match=message) as caught:
        load_model(folder)
    assert str(folder.parents[1]) in str(caught.value)


@pytest.mark.parametrize(
    ("file", "change", "message"),
    [
        (
            "faults.csv",
            lambda text: text.replace(b",", b";"),
            r"faults\.csv, line 2, number: missing; the file's columns",
        ),
        ("faults.csv", lambda text: text.replace(b"kind", b"sort", 1), r"faults\.csv, line 2, kind: missing"),
        ("faults.csv", lambda text: text.replace(b"lost", b"l\xf6st", 1), r"faults\.csv: 'utf-8' codec can't decode"),
        (
            "model.toml",
            lambda text: text.replace(b"pnu = 1,", b"pnu = [1],"),
            r"a value in its files has a wrong form",
        ),
        (
            "model.toml",
            lambda text: re.sub(rb"min_cycle_ns = .*", b"min_cycle_ns = 1000000", text),
            r"limits\.min_cycle_ns: 1000000 stands alone; a value has its source",
        ),
    ],
)
def test_a_models_file_as_a_spreadsheet_or_a_beginner_writes_it_is_refused_and_named(folder, file, change, message):
    path = file_of(folder, file)
    path.write_bytes(change(path.read_bytes()))
    with pytest.raises(ConfigError, match=message):
        load_model(folder)


def test_a_byte_order_mark_before_a_table_changes_nothing(folder: Path) -> None:
    for path in (file_of(folder, "faults.csv"), file_of(folder, "parameters.csv")):
        path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes())
    assert load_model(folder).faults == model("akd-profinet").faults


def test_a_missing_file_is_named(folder: Path) -> None:
    file_of(folder, "faults.csv").unlink()
    with pytest.raises(ConfigError, match=r"faults\.csv"):
        load_model(folder)


@pytest.mark.parametrize("name", sorted(models()))
def test_motor_data_name_fields_of_the_axis(name: str) -> None:
    described = model(name)
    axis = AXIS.allocate(1)[0]
    described.apply_motor(axis)
    for field, value in described.motor.items():
        assert np.array_equal(AXIS.read(axis, field), value)
        assert value == described.facts[f"motor.{field}"].value
    assert (
        min(
            axis.motor.settings.peak_current,
            axis.motor.settings.max_velocity,
            axis.load.settings.inertia,
            axis.motor.settings.torque_constant,
        )
        > 0
    )
