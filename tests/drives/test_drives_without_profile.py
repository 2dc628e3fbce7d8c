"""A drive that does not speak PROFIdrive: its model needs none of the profile's data, and its parameters work alone."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from pnfarm.drives.axis_handle import AxisHandle
from pnfarm.drives.description.as_json import as_json
from pnfarm.drives.description.loader import load_model
from pnfarm.drives.parameters.store import ParameterStore
from pnfarm.errors import ConfigError
from pnfarm.firmware.axis import AXIS
from pnfarm.table.image import IMAGE

if TYPE_CHECKING:
    from pathlib import Path

    from pnfarm.drives.description.model import Model

MODEL = """
name = "plain-servo"
title = "Plain servo"
maker = "Example"
bus = "twobus"
manual = "Plain servo, data sheet"
edition = "1"
firmware_version = "1.0"

[limits]
min_cycle_ns = { value = 1_000_000, source = "data sheet 2" }

[communication_loss]
fault = { value = 7, source = "data sheet 4" }

[motor]
load.inertia = { value = 1.0e-4, unit = "kg m^2", source = "data sheet 3" }

[firmware]
ramp.acceleration = { value = 3000.0, unit = "rpm/s", source = "data sheet 3" }

[twobus]
command = { value = 0x21, source = "data sheet 5" }
"""
PARAMETERS = """pnu,name,type,signed,elements,access,min,max,default,unit,scale,backed_by,nv,source,values_source,note
1,SPEED LIMIT,Word,0,,rw,0,6000,3000,rpm,1,stored,1,data sheet 6,data sheet 6,
2,RAMP,DWord,0,,rw,1,60000,5000,rpm/s,1,field:ramp.deceleration,1,data sheet 6,data sheet 6,
"""
FAULTS = """number,word,name,kind,reaction,cause,source,note
7,0x0007,connection lost,fault,coast,communication,data sheet 4,
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name, text in (("model.toml", MODEL), ("parameters.csv", PARAMETERS), ("faults.csv", FAULTS)):
        (tmp_path / name).write_text(text, encoding="utf-8")
    return tmp_path


@pytest.fixture
def servo(folder: Path) -> Model:
    return load_model(folder)


def test_it_needs_no_telegram_no_module_and_no_identity_of_the_profile(servo: Model) -> None:
    assert (servo.bus, servo.profile) == ("twobus", "")
    assert not servo.profidrive.telegrams
    assert not servo.profidrive.signals
    assert not servo.dap.submodules
    assert servo.bus_facts["command"].value == 0x21
    assert servo.bus_facts["command"].source == "data sheet 5"


def test_it_is_printed_as_any_other(servo: Model) -> None:
    found = as_json(servo)
    assert (found["telegrams"], found["signals"], found["dap"]) == ([], [], None)
    assert found["identity"] is None
    assert found["bus_facts"]["command"]["value"] == 0x21


def test_its_parameters_are_read_and_written(servo: Model) -> None:
    axis, image = AXIS.allocate(1)[0], IMAGE.allocate(1)[0]
    servo.apply_motor(axis)
    store = ParameterStore(servo, AxisHandle(axis, image))
    store.power_on()
    assert (store.get("SPEED LIMIT"), store.get("RAMP"), axis.ramp.settings.deceleration) == (3000, 5000, 5000.0)
    store.write(2, 0, [2500])
    assert (store.get("RAMP"), axis.ramp.settings.deceleration) == (2500, 2500.0)
    assert (store.output_words(), store.input_words()) == ((), ())


@pytest.mark.parametrize(
    ("profile", "bus", "missing"),
    [
        ("profidrive", "twobus", r"identity: missing"),
        ("", "profinet", r"limits\.io_controllers: missing"),
    ],
)
def test_what_a_profile_or_a_bus_needs_is_asked_for(folder: Path, profile: str, bus: str, missing: str) -> None:
    text = MODEL.replace('bus = "twobus"', f'bus = "{bus}"\nprofile = "{profile}"')
    (folder / "model.toml").write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError, match=missing):
        load_model(folder)
