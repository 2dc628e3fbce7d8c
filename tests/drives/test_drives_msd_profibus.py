"""The MSD on PROFIBUS as data, against its manual; the drive itself is that on PROFINET."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import pytest
from drives_kit import new_drive
from manuals import manual_text
from model_copy import copy_model, rewrite

from pnfarm.drives.catalogue import model, models
from pnfarm.drives.description.as_json import as_json
from pnfarm.drives.description.identity import overrides_of, with_identity
from pnfarm.drives.description.loader import load_model
from pnfarm.drives.description.parts import Effect
from pnfarm.errors import ConfigError
from pnfarm.protocols.profibus.wire.dp import parse_identifiers

if TYPE_CHECKING:
    from pathlib import Path

NAME = "moog-msd-dp"
PROFINET = "moog-msd"
#: Table 8.10: a telegram's number and its identifiers, a hyphen for one that PROFIBUS lacks.
ROW = re.compile(r"(?m)^(\d{1,3})\t(-|0x[0-9A-F]{2}[0-9A-Fx, ]*)\t")


def table_8_10() -> dict[int, bytes]:
    """Identifiers by telegram as printed; empty for a telegram without."""
    text = manual_text("003")
    part = text[text.index("Telegram selection P-0922\tProfibus") : text.index("8.2.4 Parameter channel PKW")]
    rows = {int(number): bytes.fromhex(re.sub("0x|[-, ]", "", octets)) for number, octets in ROW.findall(part)}
    assert len(rows) == 28
    return rows


def test_table_8_10_each_telegram_has_the_identifiers_printed_there_and_no_other_is_there() -> None:
    printed = table_8_10()
    telegrams = model(NAME).profidrive.telegrams
    assert {number: one.identifiers for number, one in telegrams.items()} == {
        number: octets for number, octets in printed.items() if octets
    }
    assert [number for number, octets in printed.items() if not octets] == [2, 3, 5, 121]
    assert set(telegrams) == set(model(PROFINET).profidrive.telegrams) - {2, 3, 5, 121}


@pytest.mark.parametrize("number", model(NAME).profidrive.telegrams)
def test_the_identifiers_have_the_lengths_of_the_telegrams_words_and_their_consistency(number: int) -> None:
    telegram = model(NAME).profidrive.telegrams[number]
    parts = parse_identifiers(telegram.identifiers)
    assert sum(part.outputs for part in parts) == 2 * len(telegram.output)
    assert sum(part.inputs for part in parts) == 2 * len(telegram.input)
    assert all(part.consistent for part in parts), "consistent overall length"
    if telegram.parameter_words:
        assert (parts[0].octets, parts[0].inputs, parts[0].outputs) == (b"\xf3", 8, 8), (
            "the parameter channel comes first"
        )
    assert len(parts) == 1 + bool(telegram.parameter_words)
    if number < 100:
        assert parts[0].specific == bytes((0xFD, 0, number)), "a standard telegram says its number"


def test_words_and_bits_are_those_of_the_same_telegram_on_profinet() -> None:
    ours, theirs = model(NAME).profidrive, model(PROFINET).profidrive
    assert ours.signals == theirs.signals
    for number, telegram in ours.telegrams.items():
        other = theirs.telegrams[number]
        assert (telegram.output, telegram.input, telegram.tasks) == (other.output, other.input, other.tasks)
        for word in ("STW1", "ZSW1", "STW2", "ZSW2"):
            assert ours.bit_names(word, number) == theirs.bit_names(word, number)


def test_10_1_standard_telegram_1_generates_profiles_on_profibus() -> None:
    ours, theirs = model(NAME).profidrive.telegrams, model(PROFINET).profidrive.telegrams
    assert (ours[1].settings[301], theirs[1].settings[301]) == (0, 1)
    assert {**theirs[1].settings, 301: 0} == ours[1].settings
    assert all(ours[number].settings == theirs[number].settings for number in (7, 8, 9))
    drive = new_drive(NAME)
    drive.store.plug_telegram(8)
    assert drive.store.get(301) == 1
    drive.store.plug_telegram(1)
    assert (drive.store.get(300), drive.store.get(301), drive.store.get(1258)) == (2, 0, 0)


def test_axis_faults_and_parameters_are_the_products() -> None:
    ours, theirs = model(NAME), model(PROFINET)
    assert ours.motor == theirs.motor
    assert ours.factor_group == theirs.factor_group
    assert set(theirs.faults) - set(ours.faults) == {3 << 16 | 32}, "8.3: the sign of life is only PROFINET's"
    assert all(fault == theirs.faults[number] for number, fault in ours.faults.items())
    assert ours.communication_loss == theirs.communication_loss
    different = {number for number, row in ours.parameters.items() if row != theirs.parameters[number]}
    assert different == {925, 963, 1296}
    assert set(theirs.parameters) - set(ours.parameters) == {*range(1289, 1296), 1297, 61000}


def test_15_the_parameters_of_profinet_in_table_15_1_are_not_there() -> None:
    text = manual_text("003")
    listed = text[text.index("\nPROFINET parameters") : text.index("* Only PROFIBUS parameters")]
    numbers = {int(number) for number in re.findall(r"P-(\d{4})", listed)}
    assert numbers == {*range(1289, 1296), 1297}
    assert not numbers & set(model(NAME).parameters)


def test_15_the_parameters_that_only_profibus_has_are_those_marked_in_table_15_1() -> None:
    marked = re.findall(r"(?m)^(\w+)\*\tP-(\d{4})\t", manual_text("003"))
    assert marked == [("COM_DP_Address", "0918"), ("COM_DP_Baudrate", "0963")]
    described = model(NAME)
    address, rate = described.parameters[918], described.parameters[963]
    assert (address.minimum, address.maximum, address.default, address.writable) == (0, 126, 126, True)
    assert not rate.writable


def test_what_acts_on_profibus_alone_says_so() -> None:
    ours, theirs = (
        {row["pnu"]: row["effect"] for row in as_json(model(name))["parameters"]} for name in (NAME, PROFINET)
    )
    acts, kept, live, constant = (effect.value for effect in (Effect.ACTS, Effect.KEPT, Effect.LIVE, Effect.CONSTANT))
    assert (ours[918], theirs[918]) == (acts, kept)
    assert (ours[963], theirs[963]) == (live, constant)
    assert ours[1256] == theirs[1256] == acts
    assert (ours[925], theirs[925]) == (kept, acts)
    assert (ours[1296], theirs[1296]) == (constant, live)


def test_8_3_the_sign_of_life_is_not_watched() -> None:
    drive = new_drive(NAME)
    assert int(drive.axis.life.settings.watched) == 0
    assert new_drive(PROFINET).axis.life.settings.watched == 1
    with pytest.raises(ConfigError, match="has no fault '32-3'"):
        model(NAME).fault("32-3")


def test_the_json_has_telegrams_by_their_identifiers_and_no_modules() -> None:
    shown = as_json(model(NAME))
    assert shown["bus"] == "profibus"
    assert shown["dap"] is None
    by_number = {row["number"]: row for row in shown["telegrams"]}
    assert by_number[1]["identifiers"] == "c3 c1 c1 fd 00 01"
    assert by_number[1]["module_source"] == "8.2.3, table 8.10"
    assert all(row["submodules"] == row["other_modules"] == [] for row in shown["telegrams"])
    assert shown["bus_facts"]["baud_rates"]["value"][-1] == 12_000_000
    assert all(fact["source"] and (fact["source"] != "assumed" or fact["note"]) for fact in shown["bus_facts"].values())


def test_only_data_of_the_bus_are_in_its_folder() -> None:
    files = {path.name for path in models()[NAME].folder.iterdir()}
    assert files == {"model.toml", "telegrams.toml", "parameters.csv", "behaviour.toml"}


# identity


def test_a_farm_file_gives_the_ident_number_of_the_makers_gsd_file() -> None:
    described = with_identity(model(NAME), {"device": "0x1234", "station_type": "MSD", "software_version": "V1.2.3"})
    identity = described.profidrive.identity
    assert (identity.device_id, identity.station_type, identity.software_version) == (0x1234, "MSD", (1, 2, 3))
    assert described.profidrive.telegrams == model(NAME).profidrive.telegrams


@pytest.mark.parametrize("key", ["dap", "dap_submodules", "access_point", "supplements"])
def test_an_identity_with_modules_is_refused_with_the_keys_that_there_are(key: str) -> None:
    with pytest.raises(ConfigError, match=rf"identity\.{key}: unknown; there are vendor, device, order_number"):
        with_identity(model(NAME), {key: 1})
    assert key in overrides_of(model(PROFINET))


# mistakes in the data


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        ('identifiers = "F1"\n', 'identifiers = "F3 F1"\n', r"103, identifiers: F3 F1 are those of telegram 101"),
        ('identifiers = "F1"\n', 'identifiers = "F"\n', r"103, identifiers: 'F' are no octets in hexadecimal"),
        (
            'ident_source = "8.2.3, table 8.10"\nidentifiers = "F1"\n',
            'identifiers = "F1"\n',
            r"telegram 103, ident_source: missing",
        ),
    ],
)
def test_a_mistake_in_an_identifier_is_reported_with_its_telegram(
    tmp_path: Path, before: str, after: str, message: str
) -> None:
    folder = copy_model(NAME, tmp_path / "model")
    rewrite(folder, "telegrams.toml", before, after)
    with pytest.raises(ConfigError, match=message):
        load_model(folder)
