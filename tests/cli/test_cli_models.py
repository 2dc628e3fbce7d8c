"""``pnfarm models MODEL``: what is known of a drive, for people, each value with its source."""

from __future__ import annotations

import json
import re

import pytest

from pnfarm.cli.models import models as print_models
from pnfarm.cli.settings import Format
from pnfarm.drives.catalogue import model, models
from pnfarm.drives.effects import effect_of
from pnfarm.errors import ConfigError


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
    with pytest.raises(ConfigError, match="--parameters wants a model"):
        print_models(None, Format.TABLE, parameters="*")
