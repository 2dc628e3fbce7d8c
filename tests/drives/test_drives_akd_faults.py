"""FAULTx.ACTION of the AKD of manual edition M (5.6): faults that the drive raises, or ignores."""

from __future__ import annotations

import pytest
from drives_kit import Running, new_drive

from pnfarm.drives.catalogue import model
from pnfarm.drives.description.as_json import as_json
from pnfarm.drives.description.parts import Effect
from pnfarm.drives.parameters.effects import effect_of
from pnfarm.drives.parameters.parameter import ParameterError, ParameterErrorNumber
from pnfarm.table.axis_codes import CMD_ACKNOWLEDGE, CMD_HOLD_FAULT, CMD_POWER_ON, CMD_RAISE_FAULT, CMD_RELEASE_FAULT
from pnfarm.table.image import LOST_EXPIRED
from pnfarm.table.signals import ZSW1

NAME = "akd-profinet"
NUMBERS = (130, 131, 132, 134, 139, 451, 570, 702)
RAISE, IGNORE = 0, 1
FAULT = 0x0008


def tell(drive: Running, command: int, number: int, run: int = 2) -> int:
    """The fault that the drive shows then, 0 for none."""
    fault = drive.drive.model.fault(number)
    drive.drive.store.handle.push_command(command, fault.number if command == CMD_RELEASE_FAULT else fault.code)
    drive.run(run)
    shown = drive.drive.store.get("DRV.FAULT1")
    assert bool(drive.image.sent[ZSW1] & FAULT) == bool(shown)
    return shown


@pytest.mark.parametrize("number", NUMBERS)
def test_each_fault_with_an_action_is_raised_at_0_the_default_and_ignored_at_1(number: int) -> None:
    drive = Running(NAME)
    store = drive.drive.store
    name = f"FAULT{number}.ACTION"
    assert store.get(name) == RAISE
    with pytest.raises(ParameterError) as caught:
        store.set(name, 2)
    assert caught.value.number == ParameterErrorNumber.LIMIT_EXCEEDED
    store.set(name, IGNORE)
    assert tell(drive, CMD_RAISE_FAULT, number) == 0
    assert (store.read(944), store.read(947)) == ([0], [0]), "no situation, no entry"
    store.set(name, RAISE)
    assert tell(drive, CMD_RAISE_FAULT, number) == number


def test_an_action_leaves_other_faults_alone() -> None:
    drive = Running(NAME)
    for number in NUMBERS:
        drive.drive.store.set(f"FAULT{number}.ACTION", IGNORE)
    assert tell(drive, CMD_RAISE_FAULT, 301) == 301


def test_a_cause_that_is_ignored_hinders_no_acknowledgement_and_is_a_fault_once_the_action_says_so() -> None:
    drive = Running(NAME)
    store = drive.drive.store
    store.set("FAULT139.ACTION", IGNORE)
    assert tell(drive, CMD_HOLD_FAULT, 139) == 0
    assert tell(drive, CMD_RAISE_FAULT, 301) == 301
    store.handle.push_command(CMD_ACKNOWLEDGE)
    drive.run(2)
    assert store.get("DRV.FAULT1") == 0
    store.handle.push_command(CMD_POWER_ON)
    drive.run(200)
    assert store.get("DRV.FAULT1") == 0, "nor does it come with the supply"
    store.set("FAULT139.ACTION", RAISE)
    drive.run(2)
    assert store.get("DRV.FAULT1") == 139
    store.handle.push_command(CMD_ACKNOWLEDGE)
    drive.run(2)
    assert store.get("DRV.FAULT1") == 139, "its cause is still there"
    store.set("FAULT139.ACTION", IGNORE)
    drive.run(2)
    assert store.get("DRV.FAULT1") == 139, "what is there stays until it is acknowledged"
    store.handle.push_command(CMD_ACKNOWLEDGE)
    drive.run(2)
    assert store.get("DRV.FAULT1") == 0


@pytest.mark.parametrize("action", [RAISE, IGNORE])
def test_fault702_action_decides_whether_lost_data_are_a_fault(action: int) -> None:
    drive = Running(NAME)
    for word in (0x0470, 0x0476, 0x0477, 0x047F):
        drive.send(word, 0x00A3)
    drive.drive.store.set("FAULT702.ACTION", action)
    drive.image.valid, drive.image.lost = 0, LOST_EXPIRED
    drive.run(5)
    assert drive.drive.store.get("DRV.FAULT1") == (0 if action == IGNORE else 702)
    if action == IGNORE:
        assert drive.axis.drive.state == 1, "no control word: the axis coasts"


def test_an_action_is_permanent_once_it_is_saved() -> None:
    drive = new_drive(NAME)
    drive.store.set("FAULT570.ACTION", IGNORE)
    drive.store.set("FAULT451.ACTION", IGNORE)
    drive.store.set("DRV.NVSAVE", 1)
    drive.store.set("FAULT451.ACTION", RAISE)
    drive.store.power_on()
    assert (drive.store.get("FAULT570.ACTION"), drive.store.get("FAULT451.ACTION")) == (IGNORE, IGNORE)
    assert {570, 451} <= set(drive.axis.faults.settings.ignored)


def test_the_model_says_which_parameter_a_fault_depends_on() -> None:
    told = {fault["number"]: fault["action"] for fault in as_json(model(NAME))["faults"]}
    described = model(NAME)
    assert {number for number, pnu in told.items() if pnu} == set(NUMBERS)
    for number in NUMBERS:
        parameter = described.parameters[told[number]]
        assert (parameter.name, effect_of(described, parameter)) == (f"FAULT{number}.ACTION", Effect.ACTS)
