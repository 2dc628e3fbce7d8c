"""The AKD of manual edition M without its hardware enable, its supply, or with a stop input on (5.8.1, 5.6)."""

from __future__ import annotations

import pytest
from drives_kit import Running

from pnfarm.table.axis_codes import CMD_HOLD_FAULT, CMD_POWER_ON, CMD_RELEASE_FAULT, LACKS_ENABLE, LACKS_SUPPLY
from pnfarm.table.signals import DRIVE_INPUTS

NAME = "akd-profinet"
#: Bits of DRIVE_INPUTS and DRV.DISSOURCES.
HARDWARE_DISABLED, STOPPED_BY_INPUT, TORQUE_ALLOWED = 0x10, 0x20, 0x40
SOFTWARE, FAULT, HARDWARE, NO_POWER, STOP_INPUT = 0x01, 0x02, 0x04, 0x08, 0x20
#: DINx.MODE of an input for a controlled stop.
CONTROLLED_STOP = 13


def operating(nsoll_a: int = 0) -> Running:
    drive = Running(NAME)
    for word in (0x0470, 0x0476, 0x0477, 0x047F):
        drive.send(word, nsoll_a)
    drive.send(0x047F, nsoll_a, 200)
    assert drive.axis.drive.state == 4
    return drive


def inputs(drive: Running) -> int:
    return int(drive.image.sent[DRIVE_INPUTS])


def sources(drive: Running) -> int:
    return drive.drive.store.get("DRV.DISSOURCES")


def test_5_8_1_bit_4_is_the_hardware_disable_that_dissources_and_hwenable_show() -> None:
    drive = operating(0x00A3)
    assert (inputs(drive), sources(drive), drive.drive.store.get("DRV.HWENABLE")) == (TORQUE_ALLOWED, 0, 1)
    drive.axis.drive.settings.interlocks = LACKS_ENABLE
    drive.run(1)
    assert drive.axis.drive.state == 1, "the power stage is off at once"
    assert inputs(drive) == TORQUE_ALLOWED | HARDWARE_DISABLED
    assert sources(drive) == SOFTWARE | HARDWARE
    assert drive.drive.store.get("DRV.HWENABLE") == 0
    drive.axis.drive.settings.interlocks = 0
    drive.run(1)
    assert (inputs(drive), sources(drive), drive.drive.store.get("DRV.HWENABLE")) == (TORQUE_ALLOWED, SOFTWARE, 1)


def test_5_8_1_bit_5_is_an_input_for_a_controlled_stop_which_brakes_along_cs_dec_and_keeps_the_drive_off() -> None:
    drive = operating(0x00A3)
    store = drive.drive.store
    store.set("DIN2.MODE", CONTROLLED_STOP)
    store.set("CS.DEC", 1_000_000)
    drive.run(1)
    assert (drive.axis.drive.state, inputs(drive)) == (4, TORQUE_ALLOWED), "the input is off"
    drive.axis.machine.settings.fault_inputs = 0b10
    drive.run(1)
    assert (drive.axis.drive.state, store.get("CS.STATE")) == (5, 1)
    assert inputs(drive) == TORQUE_ALLOWED | STOPPED_BY_INPUT
    assert sources(drive) == STOP_INPUT
    drive.run(30)
    assert drive.axis.motor.velocity == pytest.approx(59.7 - 31.0, abs=3.0), "1,000 rpm/s"
    drive.run(100)
    assert drive.axis.drive.state == 1
    drive.send(0x0476, milliseconds=20)
    assert drive.axis.drive.state == 1, "while the input is on nothing switches the drive on"
    drive.axis.machine.settings.fault_inputs = 0
    drive.send(0x0476, milliseconds=2)
    assert (drive.axis.drive.state, inputs(drive)) == (2, TORQUE_ALLOWED)


def test_5_6_an_inverted_input_for_a_controlled_stop_stops_while_it_is_low() -> None:
    drive = Running(NAME)
    drive.drive.store.set("DIN7.MODE", CONTROLLED_STOP)
    drive.drive.store.set("DIN7.INV", 1)
    drive.send(0x0476, milliseconds=5)
    assert drive.axis.drive.state == 1
    assert inputs(drive) & STOPPED_BY_INPUT
    drive.axis.machine.settings.fault_inputs = 1 << 6
    drive.send(0x0476, milliseconds=5)
    assert drive.axis.drive.state == 2


def test_5_6_without_supply_the_dc_link_discharges_and_dissources_shows_it() -> None:
    drive = operating()
    store = drive.drive.store
    drive.axis.drive.settings.interlocks = LACKS_SUPPLY
    drive.run(1)
    assert drive.axis.drive.state == 1
    assert sources(drive) == SOFTWARE | NO_POWER
    assert (inputs(drive), store.get("DRV.HWENABLE")) == (TORQUE_ALLOWED, 1)
    before = store.get("VBUS.VALUE")
    assert 500_000 < before <= 560_000, "its capacitors are full"
    drive.run(1000)
    assert 0 < store.get("VBUS.VALUE") < before - 50_000
    drive.run(4000)
    assert store.get("VBUS.VALUE") == 0
    drive.axis.drive.settings.interlocks = 0
    drive.run(1)
    assert store.get("VBUS.VALUE") == 560_000


def test_5_6_a_control_supply_that_cycles_does_not_charge_the_dc_link() -> None:
    drive = Running(NAME)
    drive.axis.drive.settings.interlocks = LACKS_SUPPLY
    drive.run(5000)
    drive.drive.store.handle.push_command(CMD_POWER_ON)
    drive.run(200)
    assert drive.drive.store.get("VBUS.VALUE") == 0


@pytest.mark.parametrize("mode", [0, 1])
def test_5_6_vbus_uvmode_decides_whether_a_lost_supply_is_a_fault_of_a_drive_that_is_off(mode: int) -> None:
    drive = operating()
    store = drive.drive.store
    store.set("VBUS.UVMODE", mode)
    drive.axis.drive.settings.interlocks = LACKS_SUPPLY
    drive.run(5000)
    assert store.get("DRV.FAULT1") == (0 if mode else 502)
    drive.send(0x04F6)
    drive.run(2)
    assert store.get("DRV.FAULT1") == (0 if mode else 502), "nothing is acknowledged at 0 V"
    drive.axis.drive.settings.interlocks = 0
    drive.send(0x0476)
    drive.send(0x04F6)
    assert (store.get("DRV.FAULT1"), sources(drive)) == (0, SOFTWARE)


def test_5_6_the_cause_of_an_undervoltage_shows_in_vbus_value_while_it_is_there() -> None:
    drive = operating()
    store = drive.drive.store
    fault = drive.drive.model.fault("undervoltage").code
    store.handle.push_command(CMD_HOLD_FAULT, fault)
    drive.run(5000)
    assert store.get("VBUS.VALUE") < 1000 * store.get("VBUS.UVFTHRESH")
    assert sources(drive) & FAULT
    store.handle.push_command(CMD_RELEASE_FAULT, fault & 0xFFFF)
    drive.run(1)
    assert store.get("VBUS.VALUE") == 560_000


def test_5_6_an_undervoltage_warning_stays_down_to_an_empty_dc_link() -> None:
    drive = operating()
    drive.drive.store.set("VBUS.UVWTHRESH", 300)
    drive.axis.drive.settings.interlocks = LACKS_SUPPLY
    drive.run(5000)
    assert drive.drive.store.get("DRV.WARNING1") == 502
