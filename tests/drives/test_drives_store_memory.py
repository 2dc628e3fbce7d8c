"""What a drive keeps over a power cycle, and what a farm file and its commands put there."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pytest
from drives_kit import Drive, new_drive, refused

from pnfarm.drives.catalogue import model
from pnfarm.drives.parameters.memory import VolatileMemory
from pnfarm.drives.parameters.parameter import ParameterErrorNumber
from pnfarm.drives.parameters.store import (
    NonVolatileSaved,
    ParameterStore,
    TelegramChanged,
)

if TYPE_CHECKING:
    pass

E = ParameterErrorNumber


def test_values_are_lost_at_power_on_unless_saved(akd: Drive) -> None:
    akd.store.set("DRV.ACC", 5_000_000)
    akd.store.power_on()
    assert akd.store.get("DRV.ACC") == 10_000_170
    akd.store.set("DRV.ACC", 5_000_000)
    akd.store.events()
    akd.store.set("DRV.NVSAVE", 1)
    assert akd.store.events() == [NonVolatileSaved()]
    akd.store.set("DRV.ACC", 6_000_000)
    akd.store.power_on()
    assert akd.store.get("DRV.ACC") == 5_000_000
    assert akd.axis.ramp.settings.acceleration == 5000.0


def test_a_snapshot_survives_json_and_another_drive(akd: Drive) -> None:
    memory = VolatileMemory()
    assert memory.load("axis-01") is None
    akd.store.plug_telegram(400)
    akd.store.write(915, 0, [1, 5] + [0] * 10)
    akd.store.set("DRV.OPMODE", 2)
    assert akd.store.snapshot()["parameters"] == {}
    akd.store.set("DRV.NVSAVE", 1)
    memory.save("axis-01", json.loads(json.dumps(akd.store.snapshot())))
    other = new_drive("akd-profinet")
    assert other.store.restore(memory.load("axis-01")) == []
    other.store.power_on()
    other.store.plug_telegram(400)
    assert other.store.get("DRV.OPMODE") == 2
    assert other.store.output_words()[:2] == (0, 4)
    assert other.store.output_words() == akd.store.output_words()
    assert other.store.snapshot() == akd.store.snapshot()


@pytest.mark.parametrize(
    "entry",
    [
        {"9": 1},
        {"2135": 7},
        {"2135": "x"},
        {"2135": [1, 2]},
        {"2135": True},
        {"2135": None},
        {"944": 1},
        {"915": [1, 2]},
        {"922": 2},
        {"x": 1},
        {"915.2": 1},
    ],
)
def test_kept_values_that_do_not_fit_are_named_and_left_out(akd: Drive, entry: dict[str, object]) -> None:
    refused_values = akd.store.restore({"parameters": {**entry, "2108": 2_000_000}})
    assert len(refused_values) == 1
    assert next(iter(entry)) in refused_values[0]
    akd.store.power_on()
    assert akd.store.get("DRV.ACC") == 2_000_000
    assert akd.store.restore({"parameters": 5}) != []
    assert akd.store.restore(None) == []
    akd.store.power_on()
    assert akd.store.get("DRV.ACC") == 10_000_170


def test_commissioned_values_are_permanent_and_checked(akd: Drive) -> None:
    akd.store.commission({"DRV.OPMODE": 2, 2108: 3_000_000})
    akd.store.power_on()
    assert (akd.axis.drive.settings.opmode, akd.axis.ramp.settings.acceleration) == (2, 3000.0)
    refused(E.LIMIT_EXCEEDED, lambda: akd.store.commission({"DRV.OPMODE": 3}))
    refused(E.NOT_CHANGEABLE, lambda: akd.store.commission({"VL.FB": 3}))


def test_nvload_and_rstvar_replace_values_except_in_operation(akd: Drive) -> None:
    akd.store.commission({"DRV.ACC": 3_000_000})
    akd.store.power_on()
    akd.store.set("DRV.ACC", 4_000_000)
    akd.axis.drive.state = 4
    refused(E.OPERATING_STATE, lambda: akd.store.set("DRV.NVLOAD", 1))
    akd.axis.drive.state = 1
    akd.store.set("DRV.NVLOAD", 1)
    assert akd.store.get("DRV.ACC") == 3_000_000
    akd.store.set("DRV.RSTVAR", 1)
    assert akd.store.get("DRV.ACC") == 10_000_170
    akd.store.power_on()
    assert akd.store.get("DRV.ACC") == 3_000_000


def test_factory_values_report_a_change_of_the_telegram(akd: Drive) -> None:
    akd.store.write(922, 0, [9])
    akd.store.events()
    akd.store.set("DRV.RSTVAR", 1)
    assert akd.store.events() == [TelegramChanged(1)]


# commands


@pytest.mark.parametrize("name", ["Pt317", "Pt316"])
def test_hiwin_a_change_that_cannot_be_saved_is_refused_and_changes_nothing(name: str) -> None:
    """Its parameters are saved as they are written; Pt316 counts from the next power-on."""
    handle = new_drive("hiwin-e1").store.handle
    drive = ParameterStore(model("hiwin-e1"), handle, keep=lambda _: False)
    drive.power_on()
    value, step = drive.get(name), float(handle.axis.profidrive.settings.velocity_step)
    refused(E.OPERATING_STATE, lambda: drive.set(name, 2000))
    assert drive.get(name) == value
    assert float(handle.axis.profidrive.settings.velocity_step) == step
    assert drive.events() == []
