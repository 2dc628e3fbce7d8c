"""The AKD on EtherNet/IP as data, against what is legible of its manual; the drive itself is the PROFINET AKD's."""

from __future__ import annotations

import csv
import re
from functools import cache

import pytest
from akd_appendix_b import LEGIBLE
from drives_kit import new_drive
from manuals import manual_text
from model_copy import copy_model, rewrite

from pnfarm.drives.catalogue import model, models
from pnfarm.drives.description.loader import load_model
from pnfarm.drives.parameters.parameter import Backing, ParameterError, ParameterErrorNumber
from pnfarm.drives.profiles.cip.part import Scaling
from pnfarm.errors import ConfigError
from pnfarm.firmware.ethernetip.maps import COMMAND_SIZES, RESPONSE_SIZES
from pnfarm.firmware.ethernetip.message_types import COMMAND_TYPES, RESPONSE_TYPES

NAME = "akd-ethernetip"
PROFINET = "akd-profinet"
#: Instances that the PROFINET AKD has no number for, and numbers without an instance.
OWN = {158, 397, 579, 580, 581, 582, 8192, 8193, 8195}
WITHOUT_INSTANCE = {65001, 65002, 65003, 65004, 65005}


@cache
def text() -> str:
    return " ".join(manual_text("004").split())


@pytest.mark.parametrize(("quote", "rows"), LEGIBLE, ids=[str(rows[0][0]) for _, rows in LEGIBLE])
def test_each_row_is_as_the_legible_text_has_it(quote: str, rows: list[tuple[int, str | None, int | None]]) -> None:
    assert quote in text()
    instances = model(NAME).cip.instances
    for number, name, size in rows:
        found = instances[number]
        assert name in {None, found.name}
        assert size in {None, found.size}
        assert found.source == "12"


def test_a_row_that_is_not_legible_says_so_with_the_reason() -> None:
    legible = {number for _, rows in LEGIBLE for number, _, _ in rows} | {8192}
    for found in model(NAME).cip.instances.values():
        assert (found.source == "assumed") == (found.number not in legible), found
        assert found.note or found.source != "assumed"


def test_an_instance_is_the_number_on_profinet_less_1999_for_the_same_parameter() -> None:
    ours, theirs = model(NAME), model(PROFINET)
    numbers = set(ours.parameters) - OWN - WITHOUT_INSTANCE
    assert len(numbers) == 657
    for number in numbers:
        mine, other = ours.parameters[number], theirs.parameters[number + 1999]
        assert mine.name == other.name
        kept = (
            "readable", "writable", "unit", "backing", "argument", "elements", "form", "nonvolatile", "choices",
            "source",
        )  # fmt: skip
        assert [getattr(mine, key) for key in kept] == [getattr(other, key) for key in kept], mine
        if mine.scale != "position":
            assert (mine.minimum, mine.maximum, mine.default) == (other.minimum, other.maximum, other.default)
        assert mine.default == other.default
    every = {number - 1999 for number, row in theirs.parameters.items() if 2000 <= number <= 2868}
    assert every - numbers == {158}, "FBUS.PARAM01 is PROFINET's own"
    assert numbers <= every


def test_a_parameter_that_takes_two_instances_has_eight_octets() -> None:
    instances = model(NAME).cip.instances
    for number in (5, 54, 109, 116, 193, 199, 264, 276, 286, 288, 384, 386):
        assert instances[number].size == 8
        assert number + 1 not in instances


def test_values_are_scaled_as_the_appendix_says() -> None:
    instances = model(NAME).cip.instances
    kinds = {number: instances[number].scaling for number in (109, 58, 286, 437, 113, 136)}
    assert kinds == {
        109: Scaling.ACCELERATION, 58: Scaling.VELOCITY, 286: Scaling.POSITION, 437: Scaling.FLOAT,
        113: Scaling.COMMAND, 136: Scaling.INTEGER,
    }  # fmt: skip


@pytest.mark.parametrize(
    ("number", "code"), [(136, 0xC6), (228, 0xC7), (227, 0xC8), (206, 0xC5), (109, 0xC9), (62, 0xC7), (4, 0xC3)]
)
def test_a_parameter_tells_its_type_by_the_code_of_7_3_1(number: int, code: int) -> None:
    assert model(NAME).cip.instances[number].type_code == code


def test_faults_and_axis_are_those_of_the_product() -> None:
    ours, theirs = model(NAME), model(PROFINET)
    assert ours.motor == theirs.motor
    left_out = {570}
    assert {number for number in theirs.faults if number not in left_out} == set(ours.faults)
    for number, fault in ours.faults.items():
        assert (fault.code, fault.cause, fault.name) == (
            theirs.faults[number].code, theirs.faults[number].cause, theirs.faults[number].name,
        )  # fmt: skip
    assert (ours.limits.motion_tasks, ours.communication_loss.fault) == (129, 702)


def test_only_data_of_the_bus_are_in_its_folder() -> None:
    folder = models()[NAME].folder
    assert {path.name for path in folder.iterdir()} == {
        "model.toml", "numbers.csv", "parameters.csv", "instances.csv", "attributes.csv", "behaviour.toml",
    }  # fmt: skip
    with (folder / "parameters.csv").open(encoding="utf-8", newline="") as file:
        assert {int(row["pnu"]) for row in csv.DictReader(file)} == OWN | WITHOUT_INSTANCE


def test_6_2_1_assemblies_and_the_packet_interval() -> None:
    described = model(NAME)
    facts = {key: fact.value for key, fact in described.bus_facts.items()}
    assert facts["vendor_id"] == 452
    assert (facts["configuration_assembly"], facts["configuration_size"]) == (100, 0)
    assert (facts["output_assembly"], facts["output_size"], facts["output_run_idle"]) == (101, 64, True)
    assert (facts["input_assembly"], facts["input_size"], facts["input_run_idle"]) == (102, 64, False)
    assert facts["min_rpi_ns"] == described.limits.min_cycle_ns == 10_000_000
    for key in ("Input Assembly", "Instance 102 Size 64 bytes Run Idle Header No", "Instance 101 Size 64 bytes"):
        assert key in text()


def test_11_1_every_attribute_of_the_position_controller_is_there() -> None:
    attributes = model(NAME).cip.attributes
    numbers = [number for class_id, number in attributes if class_id == 0x25]
    assert numbers == [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 17, 25, 58, 100, 101]
    assert [number for class_id, number in attributes if class_id == 0x24] == [5]
    assert [number for class_id, number in attributes if class_id == 0x0F] == [1, 5, 6]
    assert not attributes[0x25, 58].writable
    assert not attributes[0x25, 101].readable


def test_a_position_is_kept_in_counts_and_the_unit_changes_none() -> None:
    drive = new_drive(NAME)
    store = drive.store
    store.set("HOME.P", 3 << 32)
    assert drive.axis.homing.settings.position == 3.0
    store.set("EIP.POSUNIT", 1)
    assert store.get("HOME.P") == 3 << 32
    assert drive.axis.travel.settings.position_step * 2**32 == 1.0
    assert drive.axis.positioning.settings.target_window == pytest.approx(655 / 65536)


def test_the_profile_unit_is_a_part_of_a_revolution_in_a_second() -> None:
    drive = new_drive(NAME)
    assert float(drive.axis.ethernetip.settings.profile_step) == pytest.approx(60.0 / 65536)
    drive.store.set("EIP.PROFUNIT", 1 << 20)
    assert float(drive.axis.ethernetip.settings.profile_step) == pytest.approx(60.0 / 4096)


@pytest.mark.parametrize(
    ("name", "allowed", "refused"),
    [
        ("EIP.CMDMAP", (0, 383, 384, 386), (1, 286, 385, 387, 8192)),
        ("EIP.RSPMAP", (0, 286, 288, 478, 8192, 8193, 8195), (1, 287, 383, 479, 8194, 65535)),
    ],
)
def test_9_1_9_5_a_map_takes_the_parameters_of_its_table_and_no_other(
    name: str, allowed: tuple[int, ...], refused: tuple[int, ...]
) -> None:
    store = new_drive(NAME).store
    parameter, _ = store.model.resolve(name)
    store.write(parameter.pnu, 0, allowed)
    assert tuple(store.read(parameter.pnu, 0, len(allowed))) == allowed
    for number in refused:
        with pytest.raises(ParameterError) as caught:
            store.write(parameter.pnu, 3, [0, number])
        assert caught.value.number == ParameterErrorNumber.LIMIT_EXCEEDED
    assert tuple(store.read(parameter.pnu, 0, len(allowed))) == allowed
    sizes = COMMAND_SIZES if name == "EIP.CMDMAP" else RESPONSE_SIZES
    assert set(allowed) - {0} == sizes.keys(), "what the front has a size for"


@pytest.mark.parametrize("name", ["EIP.POSUNIT", "EIP.PROFUNIT"])
def test_a_unit_of_zero_is_refused(name: str) -> None:
    store = new_drive(NAME).store
    with pytest.raises(ParameterError) as caught:
        store.set(name, 0)
    assert caught.value.number == ParameterErrorNumber.LIMIT_EXCEEDED


def test_every_command_that_refuses_says_why() -> None:
    for parameter in model(NAME).parameters.values():
        if parameter.backing is Backing.COMMAND and parameter.argument == "refuse":
            assert "refused: " in parameter.note, parameter


@pytest.mark.parametrize(
    ("file", "before", "after", "message"),
    [
        ("instances.csv", "1,AIN.CUTOFF,4,", "1,AIN.CUTOFF,2,", "size: 2 octets, but AIN.CUTOFF has 4"),
        ("instances.csv", "1,AIN.CUTOFF,4,0,", "1,AIN.CUTOFF,4,1,", "signed: '1' is not as of AIN.CUTOFF"),
        ("instances.csv", "1,AIN.CUTOFF,4,0,float", "1,AIN.CUTOFF,4,0,speed", "scaling: 'speed' is not one of"),
        ("instances.csv", "1,AIN.CUTOFF,4,0,float", "1,AIN.CUTOFF,4,0,position", "does not go with the scale"),
        ("instances.csv", "1,AIN.CUTOFF,4,0,float", "1,AIN.CUTOFF,4,0,command", "does not go with the type"),
        ("instances.csv", "2,AIN.DEADBAND,", "6,AIN.DEADBAND,", "instance: there is no parameter 6"),
        ("attributes.csv", "0x24,5,General Fault,get,", "0x24,5,General Fault,see,", "access: 'see' is not"),
        ("attributes.csv", "get,BOOL,0,1,7.2", "get,BIT,0,1,7.2", "type: 'BIT' is not one of"),
        ("attributes.csv", "0x25,2,Attribute", "0x25,1,Attribute", "attribute: 1 is given twice"),
        (
            "model.toml",
            "revolution = { value = [4294967296.0]",
            "revolution = { value = []",
            "position_units.revolution",
        ),
    ],
)
def test_a_mistake_in_a_table_is_named_with_its_place(
    tmp_path, file: str, before: str, after: str, message: str
) -> None:
    folder = copy_model(NAME, tmp_path / "drive")
    rewrite(folder, file, before, after)
    with pytest.raises(ConfigError, match=message):
        load_model(folder)


# 6.2: types of commands and responses


def test_6_2_every_type_with_a_number_in_the_manual_is_listed_with_its_section_and_every_other_one_is_assumed() -> None:
    found = re.findall(r"\b(Command|Response) Type (?:[0O]x)?([0-9A-F]{1,2})\b", text())
    printed = {(direction, int(number, 16)) for direction, number in found}
    listed = {("Command", one) for one in COMMAND_TYPES} | {("Response", one) for one in RESPONSE_TYPES}
    assert printed == {(direction, one.number) for direction, one in listed if one.source != "assumed"}
    assert {one.number for _, one in listed if one.source == "assumed"} == {0x02, 0x03, 0x04}
