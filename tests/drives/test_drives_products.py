"""A product with its buses: what the folders of a model share, what each adds, and how a mistake is reported."""

from __future__ import annotations

import re
import shutil
from typing import TYPE_CHECKING

import pytest
from model_copy import SHIPPED, copy_model, file_of, rewrite

from pnfarm.drives import catalogue
from pnfarm.drives.catalogue import model, models
from pnfarm.drives.description.as_json import as_json
from pnfarm.drives.description.loader import load_model
from pnfarm.errors import ConfigError

if TYPE_CHECKING:
    from pathlib import Path


@pytest.fixture
def akd(tmp_path: Path) -> Path:
    """The folder of edition M in a copy of the AKD."""
    return copy_model("akd-profinet", tmp_path / "akd")


def renamed(folder: Path, name: str, bus: str) -> None:
    rewrite(folder, "model.toml", re.search(r'(?m)^name = ".*"$', file_of(folder, "model.toml").read_text())[0],
            f'name = "{name}"')  # fmt: skip
    path = file_of(folder, "model.toml")
    path.write_text(re.sub(r"(?m)^aliases = .*\n", "", path.read_text()), encoding="utf-8")
    rewrite(folder, "model.toml", 'bus = "profinet"', f'bus = "{bus}"')


# what a second bus finds


def test_a_second_bus_is_a_folder_that_shares_the_drive(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    first = copy_model("moog-msd", tmp_path / "places" / "msd")
    second = first.parent / "otherbus"
    shutil.copytree(first, second)
    for folder, name, bus in ((first, "msd-a", "profinet"), (second, "msd-b", "otherbus")):
        renamed(folder, name, bus)
    (second / "parameters.csv").unlink()
    rewrite(second, "model.toml", "station_name = {", "# station_name = {")
    rewrite(second, "telegrams.toml", "module_ident = 0x1001", "module_ident = 0x2001")
    monkeypatch.setenv(catalogue.MODELS_VARIABLE, str(tmp_path / "places"))
    a, b = model("msd-a"), model("msd-b")
    assert (a.bus, b.bus) == ("profinet", "otherbus")
    assert [entry.bus for entry in models().values()].count("otherbus") == 1
    assert set(a.parameters) - set(b.parameters) == {61000, *range(1289, 1298)}
    assert {b.parameters[pnu] == a.parameters[pnu] for pnu in b.parameters} == {True}
    assert (a.faults, a.motor, a.firmware, a.factor_group) == (b.faults, b.motor, b.firmware, b.factor_group)
    assert a.profidrive.telegrams[1].output_words == b.profidrive.telegrams[1].output_words
    assert (a.profidrive.telegrams[1].module.ident, b.profidrive.telegrams[1].module.ident) == (0x1001, 0x2001)


def test_a_bus_gives_the_parameters_its_own_numbers_and_changes_what_differs_there(akd: Path) -> None:
    usual = load_model(akd)
    numbers = akd / "numbers.csv"
    rows = [line.split(",") for line in numbers.read_text(encoding="utf-8").splitlines()[1:]]
    other = [[str(int(number) + 20000), name, scale, ""] for number, name, scale in rows]
    next(row for row in other if row[1] == "DRV.ACC")[3] = "rpm/min"
    numbers.write_text("\n".join(map(",".join, [["pnu", "id", "scale", "unit"], *other])) + "\n", encoding="utf-8")
    for old, new in (("2606", '"IP.MODE"'), ("2158", '"FBUS.PARAM02"'), ("2393", '"UNIT.PROTARY"')):
        rewrite(akd, "model.toml", f"value = {old}", f"value = {new}")
    for old, new in (("2390", '"UNIT.PIN"'), ("2392", '"UNIT.POUT"')):
        rewrite(akd, "model.toml", f"value = {old}", f"value = {new}")
    for number, name in (("2127", "DRV.EN"), ("2485", "DRV.FAULT9"), ("2486", "DRV.FAULT10")):
        rewrite(akd, "model.toml", f"{number} = {{", f'"{name}" = {{')
    found = load_model(akd)
    assert found.parameters.keys() & usual.parameters.keys() == {
        pnu for pnu in usual.parameters if not 2000 <= pnu < 61000 or usual.parameters[pnu].name.startswith("PN.")
    } | {2157}  # fmt: skip
    assert found.resolve("DRV.OPMODE")[0].pnu == 22135
    assert found.canonical(found.parameters[930]).pnu == 22135
    assert found.parameters[22108].unit == "rpm/min"
    assert usual.parameters[2108].unit == "rpm/s"
    assert found.motion_tasks is not None
    assert found.motion_tasks.position == 22275
    assert found.access.disabled_only == (22117,)
    assert found.faults[702].action == 22605
    assert as_json(found)["motion_tasks"]["number"]["value"] == 22274
    assert {effect for effect in found.effects if effect > 20000} == {22127, 22485, 22486}
    chosen = next(point for point in found.behaviour if point.name == "mode-change").readings["disabled-only"]
    assert list(chosen.model.values()) == [(22117, 22135)]


@pytest.mark.parametrize("name", SHIPPED)
def test_a_products_files_name_parameters_and_leave_their_numbers_to_its_buses(name: str) -> None:
    product = next(path for path in models()[name].folder.parents if path.parent == catalogue.SHIPPED_FOLDER)
    assert (product / "parameters.csv").read_text(encoding="utf-8").startswith("id,")
    assert (product / "axis.toml").exists()
    assert not list(product.glob("model.toml"))


def test_an_edition_says_what_it_has_not_and_what_it_says_otherwise() -> None:
    older, newer = model("akd-profinet-2012"), model("akd-profinet")
    assert set(newer.faults) - set(older.faults) == {130, 131, 132, 134, 139, 451, 524, 570}
    assert (older.motion_tasks, older.following_error) == (None, None)
    assert older.motor.keys() == newer.motor.keys() - {"foldback.delay", "foldback.time"}
    assert older.facts["motor.load.inertia"] == newer.facts["motor.load.inertia"]
    assert older.facts["motor.motor.thermal_time"] != newer.facts["motor.motor.thermal_time"]


# a mistake in what they share


@pytest.mark.parametrize(
    ("file", "old", "new", "message"),
    [
        ("numbers.csv", "2108,DRV.ACC,", "2108,DRV.AC,", r"numbers\.csv, line \d+, id: no .* has 'DRV\.AC'"),
        ("numbers.csv", "2108,DRV.ACC,", "two,DRV.ACC,", r"numbers\.csv, line \d+, pnu: 'two' is not a number"),
        ("numbers.csv", "2108,DRV.ACC,", "2110,DRV.ACC,", r"pnu: 2110 is given twice"),
        ("numbers.csv", "2108,DRV.ACC,", "916,DRV.ACC,", r"pnu: 916 is given twice"),
        ("numbers.csv", "2108,DRV.ACC,", "2108,DRV.ACC", r"numbers\.csv, line \d+: must have 3 columns"),
        ("numbers.csv", "pnu,id,scale", "pnu,id,colour", r"numbers\.csv, line \d+, colour: not a column of"),
        ("numbers.csv", "2108,DRV.ACC,", "2108,DRV.ACC,x", r"changed by .*numbers\.csv, line \d+, scale: 'x'"),
        ("parameters.csv", "\nDRV.DEC,", "\nDRV.ACC,", r"parameters\.csv, line \d+, id: DRV\.ACC is given twice"),
        ("model.toml", '"MT.NUM"', '"MT.NUMBER"', r"axis\.toml, line \d+, motion_tasks\.number: there is no parameter"),
        ("faults.csv", ",FAULT702.ACTION", ",FAULT703.ACTION", r"action: there is no parameter 'FAULT703\.ACTION'"),
        ("model.toml", '\nname = "', '\nwithout = ["lamps"]\nname = "', r"model\.toml, line 4, without: .* no lamps"),
        ("model.toml", '\nname = "', '\nwithout = ["motor.mass"]\nname = "', r"without: .* have no motor\.mass"),
        ("model.toml", '\nname = "', '\nwithout = ["faults.9"]\nname = "', r"without: there is no fault 9"),
    ],
)  # fmt: skip
def test_a_mistake_in_what_a_bus_makes_of_a_product_is_named_by_file_line_and_field(
    akd: Path, file: str, old: str, new: str, message: str
) -> None:
    rewrite(akd, file, old, new)
    with pytest.raises(ConfigError, match=message) as caught:
        load_model(akd)
    assert str(akd.parents[1]) in str(caught.value)


def test_a_number_that_the_makers_rule_does_not_write_is_named(tmp_path: Path) -> None:
    folder = copy_model("hiwin-e1", tmp_path / "e1")
    rewrite(folder, "parameters.csv", "\nPt001,", "\nP001,")
    with pytest.raises(ConfigError, match=r"parameters\.csv, line 2, id: 'P001' is not written as the section"):
        load_model(folder)


def test_a_file_that_no_folder_of_the_model_has_is_named(akd: Path) -> None:
    file_of(akd, "faults.csv").unlink()
    with pytest.raises(ConfigError, match=r"2017/faults\.csv: no such file, nor one above it"):
        load_model(akd)


def test_a_telegram_of_a_product_that_no_bus_gives_a_module_is_named(tmp_path: Path) -> None:
    folder = copy_model("moog-msd", tmp_path / "msd")
    rewrite(folder, "telegrams.toml", "number = 2\nmodule_ident = 0x1002\n", "number = 2\n")
    with pytest.raises(ConfigError, match=r"telegram 2, module_ident: missing"):
        load_model(folder)
