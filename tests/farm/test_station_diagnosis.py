"""Which diagnosis a drive's fault becomes, by the data of its model."""

from __future__ import annotations

from dataclasses import replace

import pytest
from virtual_line import VirtualLine

from pnfarm.buses.profinet.device.fault_diagnosis import FaultDiagnosis, fault_entry
from pnfarm.buses.profinet.device.modules import plug_module, pull_module
from pnfarm.drives.axis_handle import AxisHandle
from pnfarm.drives.catalogue import model
from pnfarm.drives.parameters.store import ParameterStore
from pnfarm.firmware.axis import AXIS
from pnfarm.protocols.profinet.diagnosis import DiagnosisStore
from pnfarm.protocols.profinet.wire.any_block import parse_blocks
from pnfarm.table.axis_codes import CMD_RAISE_FAULT
from pnfarm.table.image import IMAGE

MSD = model("moog-msd")
WATCHDOG, EXTERNAL, UNKNOWN = 32 | 1 << 16, 11 | 1 << 16, 99


def store_of(drive) -> ParameterStore:
    store = ParameterStore(drive, AxisHandle(AXIS.allocate(1)[0], IMAGE.allocate(1)[0]))
    store.power_on()
    return store


def test_a_model_without_forms_of_its_own_uses_the_plain_one() -> None:
    entry = fault_entry(store_of(replace(MSD, diagnosis_coding=None)), WATCHDOG)
    assert entry is not None
    assert (entry.place, entry.usi, entry.error_type) == ((0x3A00, 1, 1), 0x8000, 0x9008)


@pytest.mark.parametrize(
    "drive",
    [replace(MSD, limits=replace(MSD.limits, alarms=False)), model("akd-profinet")],
    ids=["alarms denied", "akd"],
)
def test_a_drive_without_alarms_reports_nothing(drive) -> None:
    assert fault_entry(store_of(replace(drive, diagnosis_coding=None)), WATCHDOG) is None


def test_a_fault_that_the_data_do_not_name_is_not_reported() -> None:
    assert fault_entry(store_of(replace(MSD, diagnosis_coding=None)), UNKNOWN) is None


def test_the_makers_form_carries_fault_and_warning() -> None:
    store = store_of(MSD)
    store.set("P-1256", 3)
    store.handle.axis.warnings.code = 20 | 2 << 16
    entry = fault_entry(store, EXTERNAL)
    assert entry is not None
    assert (entry.subslot, entry.usi, entry.data.hex()) == (2, 1, "0001000b00020014")


def test_a_diagnosis_disappears_as_it_appeared_even_if_the_form_changes_meanwhile() -> None:
    store, diagnosis = store_of(MSD), DiagnosisStore()
    told = FaultDiagnosis(store, diagnosis, 0, lambda _: True)
    store.set("P-1256", 1)
    told.raised(EXTERNAL)
    told.raised(EXTERNAL)
    store.set("P-1256", 2)
    assert len(diagnosis) == 1
    told.cleared()
    told.cleared()
    assert len(diagnosis) == 0
    assert len(diagnosis.events()) == 2


@pytest.mark.parametrize("fault_comes", ["before the pull", "while it is away"])
def test_a_fault_that_is_still_there_is_reported_again_by_a_module_that_is_plugged_again(fault_comes: str) -> None:
    line = VirtualLine(model="moog-msd", cycle="1ms", program="{kind: constant, speed_rpm: 60}", params="{P-1256: 1}")
    line.connect()
    (axis,) = line.farm.axes
    for step in ("before the pull", "while it is away"):
        if step == fault_comes:
            axis.handle.push_command(CMD_RAISE_FAULT, EXTERNAL)
            line.run(0.1)
        if step == "before the pull":
            pull_module(axis.device, 1, None, line.world.now)
            line.farm.settle(axis.station, line.world.now)
    plug_module(axis.device, 1, line.world.now)
    line.farm.settle(axis.station, line.world.now)
    line.run(0.5)
    job = line.plc.read_record("axis-01", (0, 0, 0, 0xF80C), line.world.now)
    line.run(0.1)
    (block,) = parse_blocks(job.data or b"")
    assert (block.slot, block.subslot, block.items[0].error_type) == (1, 1, MSD.diagnoses[EXTERNAL])
    assert line.plc.snapshot()[0]["last_alarm"].startswith("diagnosis appears on slot 1 subslot 0x0001")
