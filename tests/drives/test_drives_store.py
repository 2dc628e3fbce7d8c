"""The parameters of one drive: every row of every model, and what backs the rows."""

from __future__ import annotations

import dataclasses
import tracemalloc
from math import inf, nan
from typing import TYPE_CHECKING

import numpy as np
import pytest
from drives_kit import Drive, new_drive, refused

from pnfarm.drives.axis_handle import AxisHandle, CommandRingFullError
from pnfarm.drives.description.identity import with_identity
from pnfarm.drives.description.parts import CommunicationLoss
from pnfarm.drives.parameters.parameter import Backing, Parameter, ParameterErrorNumber
from pnfarm.drives.parameters.store import (
    DisplayBlinkRequested,
    NonVolatileSaved,
    ParameterStore,
    RebootRequested,
)
from pnfarm.firmware.axis import AXIS
from pnfarm.table.axis_codes import CMD_ACKNOWLEDGE, CMD_POWER_ON, CMD_SET_POSITION, COMMANDS
from pnfarm.table.image import IMAGE
from pnfarm.table.signals import (
    ACTUAL_SLOTS,
    MDI_ACC,
    MDI_TARPOS,
    NIST_A,
    NSOLL_A,
    SETPOINT_SLOTS,
    STW1,
    XIST_A,
)

if TYPE_CHECKING:
    pass

E = ParameterErrorNumber


def plain_writable(drive: Drive) -> list[Parameter]:
    special = {Backing.COMMAND, Backing.COMPUTED}
    rows = drive.model.parameters.values()
    return [p for p in rows if p.writable and drive.model.canonical(p).backing not in special]


# every row


def test_each_parameter_reads_within_its_type(drive: Drive) -> None:
    for parameter in drive.model.parameters.values():
        values = drive.store.read(parameter.pnu, 0, max(parameter.elements, 1))
        assert len(values) == max(parameter.elements, 1)
        assert all(isinstance(value, int) and parameter.lowest <= value <= parameter.highest for value in values)


def test_each_parameter_starts_with_its_default(drive: Drive) -> None:
    for parameter in drive.model.parameters.values():
        if parameter.backing is Backing.STORED:
            count = max(parameter.elements, 1)
            defaults = list(parameter.defaults or [parameter.default])
            if parameter.scale == "position" and drive.model.cip.instances:
                # the model has them in the position unit in which the drive comes
                defaults = [round(value * drive.model.position_units.default) for value in defaults]
            assert drive.store.read(parameter.pnu, 0, count) == defaults


@pytest.mark.parametrize(
    ("pnu", "subindex", "values"), [(1255, 4, [1, 2]), (918, 0, [7]), (922, 0, [104]), (915, 1, [1270, 1270])]
)
def test_a_drive_that_saves_at_once_saves_plain_values_arrays_and_mappings(
    pnu: int, subindex: int, values: list[int]
) -> None:
    msd = new_drive("moog-msd")
    access = dataclasses.replace(msd.model.access, saves_at_once=True)
    store = ParameterStore(dataclasses.replace(msd.model, access=access), msd.store.handle)
    store.commission({922: 105})
    store.power_on()
    store.write(pnu, subindex, values)
    assert NonVolatileSaved() in store.events()
    store.power_on()
    assert store.read(pnu, subindex, len(values)) == values


def test_each_writable_parameter_takes_its_limits_and_refuses_what_lies_beyond(drive: Drive) -> None:
    rows = plain_writable(drive)
    assert rows
    for parameter in rows:
        for value in (parameter.minimum, parameter.maximum):
            drive.store.write(parameter.pnu, 0, [value])
            assert drive.store.read(parameter.pnu) == [value], parameter
        for value in (parameter.minimum - 1, parameter.maximum + 1):
            error = refused(E.LIMIT_EXCEEDED, lambda p=parameter, v=value: drive.store.write(p.pnu, 0, [v]))
            assert error.value == 0
            assert drive.store.read(parameter.pnu) == [parameter.maximum]


def test_each_read_only_parameter_refuses_a_write(drive: Drive) -> None:
    rows = [p for p in drive.model.parameters.values() if not p.writable]
    assert rows
    for parameter in rows:
        refused(E.NOT_CHANGEABLE, lambda p=parameter: drive.store.write(p.pnu, 0, [p.default]))


def test_each_parameter_refuses_a_wrong_subindex(drive: Drive) -> None:
    for parameter in drive.model.parameters.values():
        if parameter.elements:
            refused(E.FAULTY_SUBINDEX, lambda p=parameter: drive.store.read(p.pnu, p.elements))
            refused(E.FAULTY_SUBINDEX, lambda p=parameter: drive.store.read(p.pnu, p.elements - 1, 2))
            refused(E.FAULTY_SUBINDEX, lambda p=parameter: drive.store.read(p.pnu, -1))
        else:
            refused(E.NO_ARRAY, lambda p=parameter: drive.store.read(p.pnu, 1))
            refused(E.NO_ARRAY, lambda p=parameter: drive.store.read(p.pnu, 0, 2))
        refused(E.ADDRESS_IMPERMISSIBLE, lambda p=parameter: drive.store.read(p.pnu, 0, 0))


def test_each_command_acts_or_says_why_not(drive: Drive) -> None:
    for parameter in drive.model.parameters.values():
        if parameter.backing is not Backing.COMMAND:
            continue
        assert drive.store.read(parameter.pnu) == [0]
        head = int(drive.axis.commands.settings.head)
        drive.store.events()
        # nothing is kept that could be loaded, and the axis is in S1
        if parameter.argument in {"refuse", "home", "enable", "service", "task-continue", "task-move"}:
            refused(E.OPERATING_STATE, lambda p=parameter: drive.store.write(p.pnu, 0, [1]))
            assert drive.store.events() == []
            continue
        if parameter.argument == "task-load":
            refused(E.VALUE_IMPERMISSIBLE, lambda p=parameter: drive.store.write(p.pnu, 0, [1]))
            continue
        drive.store.write(parameter.pnu, 0, [1])
        acted = int(drive.axis.commands.settings.head) != head or drive.store.events()
        assert acted or parameter.argument in {"load", "factory-values", "task-clear", "task-set", "disable", "stop"}


def test_unknown_numbers_are_impermissible(drive: Drive) -> None:
    for pnu in (number for number in (0, 3, 9, 65535, 70000) if number not in drive.model.parameters):
        refused(E.IMPERMISSIBLE_PNU, lambda n=pnu: drive.store.read(n))
        refused(E.IMPERMISSIBLE_PNU, lambda n=pnu: drive.store.write(n, 0, [1]))


def test_a_write_without_values_is_refused(akd: Drive) -> None:
    refused(E.NUMBER_OF_VALUES, lambda: akd.store.write(2135, 0, []))
    refused(E.NO_ARRAY, lambda: akd.store.write(2135, 0, [1, 1]))


# fields of the axis


def test_power_on_fills_every_field_that_parameters_write(drive: Drive) -> None:
    axis = AXIS.allocate(1)[0]
    image = IMAGE.allocate(1)[0]
    for key, field in AXIS.fields.items():
        if field.writer == "parameter":
            AXIS.write(axis, key, 77)
    ParameterStore(drive.model, AxisHandle(axis, image)).power_on()
    for key, field in AXIS.fields.items():
        if field.writer == "parameter":
            assert np.all(AXIS.read(axis, key) != 77), key


def test_an_akd_starts_with_the_defaults_of_its_manual(akd: Drive) -> None:
    axis = akd.axis
    assert axis.drive.settings.opmode == 1
    assert axis.profidrive.settings.velocity_step == pytest.approx(1638 * 60 * 16000 / 2**32)
    assert axis.ramp.settings.acceleration == pytest.approx(10000.17)
    assert axis.travel.settings.position_step == 2.0**-16
    assert axis.ramp.settings.standstill == 5.0
    assert axis.faults.settings.loss_fault == 702 | 1 << 24
    assert axis.faults.settings.stop_fault == 702 | 1 << 24


def test_opmode_is_one_parameter_under_two_numbers(akd: Drive) -> None:
    akd.store.write(930, 0, [2])
    assert akd.axis.drive.settings.opmode == 2
    assert akd.store.get("DRV.OPMODE") == 2
    akd.store.set("DRV.OPMODE", 0)
    assert akd.store.read(930) == [0]
    refused(E.LIMIT_EXCEEDED, lambda: akd.store.write(930, 0, [3]))


@pytest.mark.parametrize(("raw", "step"), [(1, 0.0002), (100, 0.022), (1000, 0.224), (1638, 0.366), (2000, 0.447)])
def test_velocity_scaling_is_that_of_the_manuals_table(akd: Drive, raw: int, step: float) -> None:
    akd.store.write(1009, 0, [raw])
    assert akd.store.get("PN.VELSCALING") == raw
    assert akd.axis.profidrive.settings.velocity_step == pytest.approx(step, abs=6e-4)


def test_acceleration_scaling_reaches_the_jog_ramps(akd: Drive) -> None:
    akd.store.write(1006, 0, [100])
    akd.store.write(1007, 0, [7])
    assert akd.axis.jog.settings.acceleration == 100 * 763
    akd.store.set("PN.ACCSCALING", 100)
    assert akd.axis.jog.settings.acceleration == 10_000
    assert akd.axis.jog.settings.deceleration == 700
    assert akd.store.read(1008) == [100]
    assert akd.store.read(1006) == [100]


def test_a_kept_acceleration_scaling_is_in_force_at_the_jog_ramps_from_power_on(akd: Drive) -> None:
    akd.store.commission({"PN.ACCSCALING": 100, 1006: 50})
    akd.store.power_on()
    assert (
        akd.axis.profidrive.settings.acceleration_step,
        akd.axis.jog.settings.acceleration,
        akd.axis.jog.settings.deceleration,
    ) == (100, 5000, 1300)


def test_jog_set_points_are_signed(akd: Drive) -> None:
    akd.store.write(1004, 0, [163])
    akd.store.write(1005, 0, [-163])
    assert akd.axis.jog.settings.velocity[0] == pytest.approx(59.7, abs=0.1)
    assert akd.axis.jog.settings.velocity[1] == pytest.approx(-59.7, abs=0.1)
    assert akd.store.read(1005) == [-163]


def test_ramps_are_thousandths_of_an_rpm_per_second(akd: Drive) -> None:
    for name, field in (
        ("DRV.ACC", "ramp.acceleration"),
        ("DRV.DEC", "ramp.deceleration"),
        ("CS.DEC", "ramp.quick_stop_deceleration"),
    ):
        akd.store.set(name, 1_234_567)
        assert AXIS.read(akd.axis, field) == pytest.approx(1234.567)


def test_actual_values_come_from_the_axis(akd: Drive) -> None:
    akd.axis.motor.velocity = -59.7
    akd.axis.ramp.command = 60.0
    akd.axis.ramp.setpoint = 61.0
    akd.axis.motor.current = 1.5
    akd.axis.drive.state = 4
    akd.axis.profidrive.motion_status = 0x80000001
    assert akd.store.get("VL.FB") == -59700
    assert akd.store.get("VL.CMD") == 60000
    assert akd.store.get("VL.CMDU") == 61000
    assert akd.store.get("VL.ERR") == 119700
    assert akd.store.get("IL.FB") == 1500
    assert akd.store.get("DRV.ACTIVE") == 1
    assert akd.store.get("DRV.IPEAK") == 9000
    assert akd.store.get("DRV.MOTIONSTAT") == 0x80000001
    akd.axis.motor.velocity = 1e12
    assert akd.store.get("VL.FB") == 0x7FFFFFFF
    for odd in (nan, inf, -inf):
        akd.axis.motor.velocity = odd
        assert akd.store.get("VL.FB") == 0


def test_positions_follow_posscale_and_unit_and_wrap(akd: Drive) -> None:
    akd.axis.motor.position = 2.0
    assert akd.store.get("PL.FB") == 2 * 65536
    akd.store.set("PN.POSSCALE", 1_000_000)
    assert akd.store.get("PL.FB") == round(2 * 65.536)
    akd.store.set("PN.POSSCALE", 1000)
    akd.store.set("UNIT.PROTARY", 0)
    akd.axis.motor.position = 0.75
    assert akd.store.get("PL.FB") == -(2**30)
    for unit, counts in ((2, 360), (4, 65536), (3, 5), (1, 6)):
        akd.store.set("UNIT.PROTARY", unit)
        akd.axis.motor.position = 1.0
        assert akd.store.get("PL.FB") == counts
    akd.axis.positioning.following_error = -1.0
    akd.store.set("UNIT.PROTARY", 2)
    assert akd.store.get("PL.ERR") == 2**32 - 360


def test_singleturn_bits_set_the_position_step(akd: Drive) -> None:
    akd.store.write(1002, 0, [20])
    assert akd.axis.travel.settings.position_step == 2.0**-20


def test_controlled_stop_shows_quick_and_fault_stops(akd: Drive) -> None:
    akd.axis.drive.state = 5
    for stop, shown in ((1, 0), (2, 1), (3, 1)):
        akd.axis.drive.stop = stop
        assert akd.store.get("CS.STATE") == shown


def test_fault_702_follows_its_two_parameters(akd: Drive) -> None:
    akd.store.set("FBUS.PARAM02", 0)
    assert (akd.axis.faults.settings.loss_fault & 0xFFFFFF, akd.axis.faults.settings.stop_fault) == (702, 0)
    akd.store.set("FBUS.PARAM02", 3)
    assert akd.axis.faults.settings.stop_fault & 0xFFFFFF == 702
    assert 702 not in akd.axis.faults.settings.ignored
    akd.store.set("FAULT702.ACTION", 1)
    assert 702 in akd.axis.faults.settings.ignored


def test_without_its_parameters_the_fault_on_lost_data_is_the_models(akd: Drive) -> None:
    for on_stop in (True, False):
        fixed = dataclasses.replace(akd.model, communication_loss=CommunicationLoss(fault=702, on_stop=on_stop))
        ParameterStore(fixed, akd.store.handle).power_on()
        assert akd.axis.faults.settings.loss_fault & 0xFFFFFF == 702
        assert akd.axis.faults.settings.stop_fault & 0xFFFFFF == (702 if on_stop else 0)


def test_the_assigned_timeout_is_shown_in_milliseconds(akd: Drive) -> None:
    akd.store.watchdog_ns = 48_000_000
    assert akd.store.get("PN.TIMEOUTFTHRESH") == 48


# signals


def test_signals_are_parameters_of_their_number(akd: Drive) -> None:
    akd.image.received[NSOLL_A] = 0xFF5D
    akd.image.received[STW1] = 0x047F
    akd.image.sent[NIST_A] = 0x009E
    akd.image.sent[XIST_A] = -1
    assert akd.store.read(5) == [-163]
    assert akd.store.get("PN.STW1") == 0x047F
    assert akd.store.read(6) == [0x9E]
    assert akd.store.read(28) == [0xFFFFFFFF]


def test_every_signal_with_a_pnu_shows_its_slot(drive: Drive) -> None:
    for slot in range(48):
        drive.image.received[slot] = slot + 100
        drive.image.sent[slot] = slot + 200
    for number, signal in drive.model.profidrive.signals.items():
        parameter = drive.model.parameters.get(number)
        if parameter is None:
            continue
        if parameter.backing is Backing.SIGNAL and 8 * parameter.octets == signal.bits:
            slots, base = (SETPOINT_SLOTS, 100) if signal.setpoint else (ACTUAL_SLOTS, 200)
            assert drive.store.read(number) == [slots[signal.name] + base]
        # the profile has a number's place in the list, others list the numbers one behind the other
        listed = drive.store.read(923, 0, drive.model.parameters[923].elements)
        assert number in listed


def test_a_set_point_that_the_cyclic_channel_brings_is_not_for_parameters(akd: Drive) -> None:
    akd.store.plug_telegram(352)
    akd.image.valid = 1
    for pnu in (1, 37):
        refused(E.NO_OPERATION_PRIORITY, lambda pnu=pnu: akd.store.write(pnu, 0, [0x47F]))
    akd.image.valid = 0
    akd.store.write(1, 0, [0x470])
    assert akd.image.received[STW1] == 0x470
    akd.store.write(34, 0, [-2])
    assert akd.image.received[MDI_TARPOS] == -2


def test_akd_5_11_7_pnu_36_counts_where_word_8_of_telegram_352_is_0(akd: Drive) -> None:
    akd.store.plug_telegram(352)
    akd.image.valid = 1
    akd.store.write(36, 0, [5])
    assert (akd.store.read(36), akd.axis.profidrive.settings.spare_acceleration) == ([5], 5)
    assert akd.image.received[MDI_ACC] == 0, "the word is the telegram's"
    akd.image.received[MDI_ACC] = 9
    assert akd.store.read(36) == [9]
    akd.store.plug_telegram(9)
    assert akd.axis.profidrive.settings.spare_acceleration == 0, (
        "where the word has a signal in the table it counts, be it 0"
    )
    refused(E.NO_OPERATION_PRIORITY, lambda: akd.store.write(36, 0, [7]))


# faults


def test_fault_parameters_show_numbers_without_reactions(akd: Drive) -> None:
    akd.axis.faults.code[0] = 702 | 1 << 24
    akd.axis.faults.code[1] = 502
    akd.axis.faults.buffer[0] = 702
    akd.axis.faults.buffer[1] = 502
    akd.axis.faults.buffer[8] = 602
    akd.axis.faults.counter = 0x10003
    akd.axis.warnings.active[0] = 107
    assert [akd.store.get(f"DRV.FAULT{n}") for n in range(1, 11)] == [702, 502, 0, 0, 0, 0, 0, 0, 0, 0]
    assert akd.store.read(947, 0, 64)[:9] == [702, 502, 0, 0, 0, 0, 0, 0, 602]
    assert akd.store.read(944) == [3]
    assert [akd.store.get(f"DRV.WARNING{n}") for n in (1, 2, 3)] == [107, 0, 0]


# identification and lists


def test_identification_is_that_of_the_model(akd: Drive) -> None:
    assert akd.store.read(964, 0, 5) == [0x0105, 1, 117, 2017, 110]
    assert akd.store.read(975, 0, 8) == [0x0105, 1, 117, 2017, 110, 1, 5, 1]
    assert akd.store.read(965) == [0x0329]
    other = with_identity(akd.model, {"vendor": 0x1234, "software_version": "V2.5.0"})
    assert ParameterStore(other, akd.store.handle).read(964, 0, 3) == [0x1234, 1, 205]


def test_the_number_lists_lead_through_all_parameters_where_the_manual_has_them(drive: Drive) -> None:
    if 980 not in drive.model.parameters:
        refused(E.IMPERMISSIBLE_PNU, lambda: drive.store.read(980))
        return
    found: list[int] = []
    pnu = 980
    while True:
        values = drive.store.read(pnu, 0, 117)
        if values[-1] == pnu + 1:
            found += values[:-1]
            pnu += 1
            continue
        found += [value for value in values if value]
        break
    assert found == [pnu for pnu in drive.model.parameters if pnu not in range(980, 990)]


# telegrams


def test_clearing_faults_and_setting_the_position_go_through_the_command_ring(akd: Drive) -> None:
    akd.store.write(2111, 0, [1])
    akd.store.write(2112, 0, [1])
    akd.store.set("HOME.SET", 1)
    assert [int(c) for c in akd.axis.commands.settings.ring[:3]] == [
        CMD_ACKNOWLEDGE,
        CMD_ACKNOWLEDGE,
        CMD_SET_POSITION,
    ]
    assert akd.axis.commands.settings.head == 3


def test_a_full_command_ring_refuses_instead_of_losing(akd: Drive) -> None:
    akd.axis.commands.settings.head = akd.axis.commands.tail = 0xFFFFFFFA
    for n in range(COMMANDS - 1):
        akd.store.handle.push_command(1, n)
    assert akd.axis.commands.settings.head == (0xFFFFFFFA + COMMANDS - 1) & 0xFFFFFFFF
    with pytest.raises(CommandRingFullError):
        akd.store.handle.push_command(1)
    refused(E.OPERATING_STATE, lambda: akd.store.set("DRV.CLRFAULTS", 1))
    with pytest.raises(ValueError, match="octet"):
        akd.store.handle.push_command(256)


def test_a_full_command_ring_has_room_for_the_command_that_boots_the_drive(akd: Drive) -> None:
    for n in range(COMMANDS - 1):
        akd.store.handle.push_command(1, n)
    for _ in range(3):
        akd.store.handle.push_command(CMD_POWER_ON)
    assert akd.axis.commands.settings.head == COMMANDS
    assert akd.axis.commands.settings.ring[COMMANDS - 1] == CMD_POWER_ON


def test_reboot_and_blink_are_events(akd: Drive) -> None:
    akd.store.set("DRV.REBOOT", 0)
    akd.store.set("DRV.REBOOT", 1)
    akd.store.set("DRV.BLINKDISPLAY", 1)
    assert akd.store.events() == [RebootRequested(), DisplayBlinkRequested()]
    assert akd.store.events() == []


# cost


def test_a_drive_costs_less_than_50_kilobytes(akd: Drive) -> None:
    axes, images = AXIS.allocate(64), IMAGE.allocate(64)
    tracemalloc.start()
    stores = [ParameterStore(akd.model, AxisHandle(axes[n], images[n])) for n in range(64)]
    for store in stores:
        store.power_on()
        for pnu in range(2497, 2521):
            store.write(pnu, 0, [pnu])
        store.set("DRV.NVSAVE", 1)
        store.events()
    used, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert used / len(stores) < 50_000


def test_a_switch_that_saves_or_loads_does_nothing_at_0() -> None:
    """An idle 0 of a PLC neither saves nor loses values."""
    drive = new_drive("profidrive")
    saved = drive.store.snapshot()
    drive.store.set("p0925", 9)
    drive.store.set("p0977", 0)
    assert drive.store.snapshot() == saved
    drive.store.set("p0976", 0)
    assert drive.store.get("p0925") == 9
    drive.store.set("p0977", 1)
    drive.store.set("p0976", 1)
    assert drive.store.get("p0925") == 5
    drive.store.power_on()
    assert drive.store.get("p0925") == 9
