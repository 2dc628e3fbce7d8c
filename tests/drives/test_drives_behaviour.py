"""Open points as data: what a model's ``behaviour.toml`` may say, what it makes of a model, and who shows it."""

from __future__ import annotations

from pathlib import Path

import pytest
from model_copy import copy_model, file_of, files_of, rewrite

from pnfarm.drives.catalogue import model, models
from pnfarm.drives.description.as_json import as_json
from pnfarm.drives.description.behaviour import with_behaviour
from pnfarm.drives.description.loader import load_model
from pnfarm.errors import ConfigError
from pnfarm.firmware.axis import AXIS

POINT = """
[[behaviour]]
name = "first"
about = "something is left open"
default = "as-always"
reason = "nothing says otherwise"
source = "1.2"

[behaviour.readings.as-always]
does = "as always"
firmware = { homing.by_edge = 0 }
defaults = { 2135 = 1 }
model = { "parameter_access.disabled_only" = [2117] }

[behaviour.readings.otherwise]
does = "otherwise"
firmware = { homing.by_edge = 1 }
defaults = { 2135 = 2 }
model = { "parameter_access.disabled_only" = [2117, 2135] }
"""
SECOND = POINT.replace('name = "first"', 'name = "second"')


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    folder = copy_model("akd-profinet", tmp_path / "model")
    for shared in files_of(folder, "behaviour.toml")[1:]:
        shared.unlink()
    return folder


def test_a_reading_sets_fields_defaults_and_values_of_sections(folder: Path) -> None:
    file_of(folder, "behaviour.toml").write_text(POINT)
    usual = load_model(folder)
    assert (usual.firmware["homing.by_edge"], usual.parameters[2135].default) == (0, 1)
    assert usual.access.disabled_only == (2117,)
    other = with_behaviour(usual, {"first": "otherwise"})
    assert (other.firmware["homing.by_edge"], other.parameters[2135].default) == (1, 2)
    assert other.access.disabled_only == (2117, 2135)
    assert [p.default for p in other.axis_parameters if p.pnu == 2135] == [2]
    assert other.readings == {"first": "otherwise"}
    assert with_behaviour(other, {}) == usual, "and back"


OF_THE_BUS = """
[[behaviour]]
name = "freezing"
about = "whether the slave knows Freeze and Sync"
default = "both"
reason = "nothing says otherwise"
source = "1.2"

[behaviour.readings.both]
does = "it knows both"
model = { "profibus.freeze" = true, "profibus.sync" = true }

[behaviour.readings.none]
does = "it knows neither"
model = { "profibus.freeze" = false, "profibus.sync" = false }
"""


@pytest.fixture
def line_folder(tmp_path: Path) -> Path:
    folder = copy_model("moog-msd-dp", tmp_path / "model")
    file_of(folder, "behaviour.toml").write_text(OF_THE_BUS)
    return folder


def test_a_reading_sets_values_of_the_section_named_after_the_bus(line_folder: Path) -> None:
    for key in ("freeze", "sync"):
        rewrite(line_folder, "model.toml", f"{key} = {{", f"not_{key} = {{")
    usual = load_model(line_folder)
    assert (usual.bus_facts["freeze"].value, usual.bus_facts["sync"].value) == (True, True)
    other = with_behaviour(usual, {"freezing": "none"})
    assert (other.bus_facts["freeze"].value, other.bus_facts["sync"].value) == (False, False)
    assert other.bus_facts["connections"] == usual.bus_facts["connections"]
    assert with_behaviour(other, {}) == usual, "and back"


def test_what_the_section_of_the_bus_says_itself_is_no_open_point(line_folder: Path) -> None:
    with pytest.raises(ConfigError, match=r"behaviour freezing: (freeze|sync) is set by other data of the model"):
        load_model(line_folder)


def test_a_model_without_the_file_leaves_nothing_open(folder: Path) -> None:
    file_of(folder, "behaviour.toml").unlink()
    assert load_model(folder).behaviour == ()


@pytest.mark.parametrize("chosen", [{"second": "otherwise"}, {"first": "any"}])
def test_a_reading_that_a_model_does_not_have_is_refused(chosen: dict[str, str], folder: Path) -> None:
    file_of(folder, "behaviour.toml").write_text(POINT)
    with pytest.raises(ConfigError, match=r"has no behaviour (second: otherwise; there are first|first: any; there)"):
        with_behaviour(load_model(folder), chosen)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("[[behaviour]]", "[[behavior]]", r"behaviour\.toml, behavior: unknown; only behaviour"),
        ("[[behaviour]]", "[[behaviour", r"behaviour\.toml"),
        ('name = "first"\n', "", r"behaviour 1, name: missing"),
        ('name = "first"', 'name = "First"', r"behaviour First: not a name"),
        ('name = "first"', 'name = "off"', r"behaviour off: not a name"),
        ('reason = "nothing says otherwise"\n', "", r"behaviour first, reason: missing"),
        ('default = "as-always"', 'default = "never"', r"behaviour first: must have at least two readings, and one"),
        ("[behaviour.readings.otherwise]", "[behaviour.readings.Other]", r"first\.Other: not a name"),
        ('does = "otherwise"\n', "", r"first\.otherwise, does: missing"),
        (
            'does = "otherwise"\n',
            'does = "otherwise"\ntext = "x"\n',
            r"first\.otherwise, text: unknown; allowed are does, firmware",
        ),
        (
            "{ homing.by_edge = 1 }",
            "{ homing.edge = 1 }",
            r"firmware\.homing\.edge: not a field of the axis",
        ),
        (
            "{ homing.by_edge = 1 }",
            "{ homing.homed = 1 }",
            r"firmware\.homing.homed: not a field of the axis that a reading may set",
        ),
        (
            "{ homing.by_edge = 1 }",
            "{ ramp.velocity_window = 1 }",
            r"velocity_window: not a field of the axis",
        ),
        ("{ homing.by_edge = 1 }", "{ jog.real_time = 1 }", r"first\.otherwise: must set the same keys as as-always"),
        ("{ 2135 = 2 }", "{ 2135 = 3 }", r"defaults\.2135: not a plain parameter, or it does not allow 3"),
        ("{ 2135 = 2 }", "{ 17 = 2 }", r"defaults\.17: not a plain parameter"),
        ("{ 2135 = 2 }", "{ 915 = 2 }", r"defaults\.915: not a plain parameter"),
        ('access.disabled_only" = [2117, 2135]', 'access.no_such" = 1', r"no_such"),
        ('access.disabled_only" = [2117, 2135]', 'access.disabled_only" = [17]', r"there is no parameter 17"),
        ('parameter_access.disabled_only" = [2117, 2135]', 'limits.ports" = 2', r"the section must be one of"),
    ],
)
def test_a_mistake_in_the_file_is_reported_with_its_place(old: str, new: str, message: str, folder: Path) -> None:
    assert old in POINT
    head, found, tail = POINT.rpartition(old)
    file_of(folder, "behaviour.toml").write_text(head + new + tail if found else POINT)
    with pytest.raises(ConfigError, match=message):
        load_model(folder)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (POINT + POINT, r"behaviour first, name: is given twice"),
        (POINT + SECOND, r"behaviour second: .* is set by first"),
        (POINT.replace("homing.by_edge", "homing.required"), r"homing.required is set by other data of the model"),
        (POINT.replace("homing.by_edge", "drive.opmode"), r"opmode is set by other data of the model"),
        (
            POINT.replace("homing.by_edge = 1", "homing.by_edge = 0").replace("= 2 }", "= 1 }").replace(", 2135]", "]"),
            r"as-always: sets the same as otherwise",
        ),
    ],
)
def test_what_readings_set_is_set_once_and_differs(text: str, message: str, folder: Path) -> None:
    file_of(folder, "behaviour.toml").write_text(text)
    with pytest.raises(ConfigError, match=message):
        load_model(folder)


@pytest.mark.parametrize("name", sorted(models()))
def test_json_lists_each_point_with_its_readings_default_reason_and_source(name: str) -> None:
    shown = as_json(model(name))["behaviour"]
    assert [point["name"] for point in shown] == [point.name for point in model(name).behaviour]
    for point in shown:
        assert {"name", "readings", "default", "reason", "source"} <= point.keys()
        assert point["default"] in point["readings"]
        assert list(point["descriptions"]) == point["readings"]
        assert all(point["descriptions"].values())


@pytest.mark.parametrize("name", sorted(models()))
def test_every_field_that_readings_set_is_one_of_the_axis(name: str) -> None:
    for point in model(name).behaviour:
        for reading in point.readings.values():
            assert all(AXIS.fields[key].writer == "parameter" for key in reading.firmware)
