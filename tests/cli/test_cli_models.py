"""``pnfarm models MODEL``: what is known of a drive, for people, each value with its source."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from pnfarm.cli.commands.models import models as print_models
from pnfarm.drives.catalogue import model, models
from pnfarm.drives.parameters.effects import effect_of
from pnfarm.errors import ConfigError
from pnfarm.terminal.settings import Format


@pytest.mark.parametrize("name", sorted(models()))
def test_a_model_is_printed_for_people_with_each_of_its_facts(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    print_models(name, Format.TABLE)
    printed = capsys.readouterr().out
    for key in model(name).facts:
        section, *parts = key.split(".")
        title = f"MOTORS {parts.pop(0)}" if section == "motors" else section.replace("_", " ").upper()
        assert f"\n{title}" in printed, key
        assert " ".join(parts).replace("_", " ") in printed, key


@pytest.mark.parametrize("name", sorted(models()))
def test_every_open_point_is_printed_with_its_readings_default_and_reason(
    name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    print_models(name, Format.TABLE)
    printed = capsys.readouterr().out
    for point in model(name).behaviour:
        assert f"\n{point.name} " in printed
        assert f"{point.default} (default)" in printed
        for text in (point.about, point.reason, *(reading.does for reading in point.readings.values())):
            assert text in printed


def test_the_table_counts_the_parameters_by_what_they_do(capsys: pytest.CaptureFixture[str]) -> None:
    print_models("akd-profinet", Format.TABLE)
    printed = capsys.readouterr().out
    described = model("akd-profinet")
    for effect in ("acts", "live", "kept", "constant"):
        count = sum(effect_of(described, p).value == effect for p in described.parameters.values())
        assert re.search(rf"^ *{count}  {effect} ", printed, re.MULTILINE)


@pytest.mark.parametrize(
    ("glob", "first", "rows"),
    [("HOME.V_32", 2210, 1), ("2203", 2203, 1), ("home.m*", 1001, 4), ("KEPT", 925, 400), ("*", 1, 802)],
)
def test_parameters_of_a_name_a_number_or_an_effect_are_listed(
    glob: str, first: int, rows: int, capsys: pytest.CaptureFixture[str]
) -> None:
    print_models("akd-profinet", Format.TABLE, parameters=glob)
    head, *lines = capsys.readouterr().out.splitlines()
    assert head.split() == ["PNU", "NAME", "TYPE", "DEFAULT", "UNIT", "SCALE", "ACCESS", "EFFECT", "SOURCE", "NOTE"]
    assert int(lines[0].split()[0]) == first
    assert len(lines) == rows or (rows == 400 and len(lines) > rows)
    print_models("akd-profinet", Format.JSON, parameters=glob)
    assert len(json.loads(capsys.readouterr().out)) == len(lines)


def test_a_glob_without_a_parameter_or_without_a_model_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"has no parameter 'NO\.SUCH'"):
        print_models("akd-profinet", Format.TABLE, parameters="NO.SUCH")
    with pytest.raises(ConfigError, match="--parameters needs a model"):
        print_models(None, Format.TABLE, parameters="*")


# -- a farm file's list of parameters

E1 = Path(__file__).resolve().parents[2] / "configs" / "e1-parameters.pnfarm.yml"


def test_a_model_is_shown_with_the_parameters_of_a_farm_files_list(pnfarm) -> None:
    found = pnfarm("models", "e1", "--farm", E1, "--parameters", "Pt20*", "--format", "json")
    assert found.code == 0, found.err
    rows = {row["name"]: row for row in json.loads(found.out)}
    assert len(rows) == 16
    gear = rows["Pt20E"]
    assert (gear["pnu"], gear["number"], gear["type"], gear["effect"]) == (0x220E, "Pt20E", "dword", "kept")
    assert (gear["source"], rows["Pt20F"]["source"]) == ("e1-parameters.csv:4", "e1-parameters.csv:6")
    plain = pnfarm("models", "e1", "--parameters", "Pt20*")
    assert plain.code == 2
    assert "has no parameter 'Pt20*'" in plain.err


def test_a_model_without_a_list_in_the_farm_file_is_shown_as_it_is(pnfarm) -> None:
    found = pnfarm("models", "moog-msd", "--farm", E1, "--format", "json")
    assert len(json.loads(found.out)["parameters"]) == len(model("moog-msd").parameters)


def test_a_farm_file_needs_a_model_and_a_correct_parameter_list(pnfarm, tmp_path) -> None:
    found = pnfarm("models", "--farm", E1)
    assert found.code == 2
    assert "--farm needs a model" in found.err
    (tmp_path / "e1-parameters.csv").write_text("number\nPt20G\n")
    (tmp_path / "a.yml").write_text(E1.read_text().replace("Pt20E: 8388608, Pt210: 1, ", ""))
    for line in (("models", "e1", "--farm"), ("validate",)):
        found = pnfarm(*line, tmp_path / "a.yml")
        assert found.code == 2
        assert f"{tmp_path / 'e1-parameters.csv'}:2: number: 'Pt20G' is not the number of a parameter" in found.err


def test_parameters_are_found_by_the_number_as_the_maker_writes_it(pnfarm) -> None:
    (row,) = json.loads(pnfarm("models", "moog-msd", "--parameters", "p-0965", "--format", "json").out)
    assert row["pnu"] == 965
