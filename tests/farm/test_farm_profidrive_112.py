"""Telegram 112: the positioner of telegram 111 with its position, velocity and ramps as numbers of single precision."""

from __future__ import annotations

import math
import struct

import pytest
from from_python import called
from hand_plc import HandPlc
from hypothesis import given
from hypothesis import strategies as st
from profidrive_plc import ACKNOWLEDGED, FULL, MOVE, REACHED, TASK
from virtual_line import VirtualLine

from pnfarm.drives.catalogue import model
from pnfarm.drives.telegrams.own_words import with_words
from pnfarm.drives.telegrams.signal_view import Outputs, axis_signals, signal_units
from pnfarm.errors import ConfigError
from pnfarm.firmware.profidrive.real_words import bits_of, is_real, real_of
from pnfarm.table.signals import ACTUAL_SLOTS

MDI, ABSOLUTE, SET_UP, FORWARDS = 0x8000, 0x0100, 0x4000, 0x0200
NAN, INFINITE = 0x7FC0_0000, 0x7F80_0000


def bits(value: float) -> int:
    return struct.unpack(">i", struct.pack(">f", value))[0]


def real(plc: HandPlc, name: str) -> float:
    return struct.unpack(">f", struct.pack(">i", int(plc.image.received[ACTUAL_SLOTS[name]])))[0]


def positioner(velocity: float = 180.0, ramps: float = 100.0) -> HandPlc:
    plc = HandPlc("profidrive", 112)
    plc.put(OVERRIDE=FULL, MDI_VELOCITY_F=bits(velocity), MDI_ACC_F=bits(ramps), MDI_DEC_F=bits(ramps))
    plc.switch_on(operation=TASK)
    return plc


def start(plc: HandPlc, **words: int) -> bool:
    """Whether the task of the words begins: the handshake of STW1.6 and ZSW1.12."""
    plc.put(**words)
    acknowledged = bool(plc.put(STW1=MOVE) & ACKNOWLEDGED)
    plc.put(STW1=TASK)
    return acknowledged


def test_an_axis_goes_to_a_position_in_degrees_at_degrees_a_second():
    plc = positioner(velocity=180.0)
    assert start(plc, POS_STW1=MDI | ABSOLUTE, MDI_TARPOS_F=bits(-450.5))
    plc.wait(1000)
    assert real(plc, "VIST_F") == pytest.approx(-180.0, abs=2.0)
    assert plc.axis.motor.velocity == pytest.approx(-30.0, abs=0.5)
    plc.wait_for(lambda: bool(plc["ZSW1"] & REACHED))
    plc.wait(200)
    assert real(plc, "XIST_F") == pytest.approx(-450.5, abs=0.5)


def test_ramps_are_a_percentage_of_those_of_the_axis():
    plc = positioner(velocity=360.0, ramps=100.0)
    whole = plc.axis.asked.acceleration
    plc.put(MDI_ACC_F=bits(25.0), MDI_DEC_F=bits(250.0))
    assert plc.axis.asked.acceleration == pytest.approx(whole / 4)
    assert plc.axis.asked.deceleration == pytest.approx(whole), "not more than 100 percent"


@pytest.mark.parametrize(
    "words",
    [{"MDI_TARPOS_F": NAN}, {"MDI_TARPOS_F": INFINITE}, {"MDI_VELOCITY_F": NAN}, {"MDI_VELOCITY_F": bits(-90.0)}],
)
def test_what_is_no_number_begins_no_task(words):
    plc = positioner()
    plc.put(MDI_TARPOS_F=bits(720.0))
    assert not start(plc, POS_STW1=MDI | ABSOLUTE, **words)
    plc.wait(300)
    assert real(plc, "XIST_F") == pytest.approx(0.0, abs=0.5)


def test_set_up_mode_runs_at_the_velocity_of_the_telegram():
    plc = positioner(velocity=120.0)
    assert start(plc, POS_STW1=MDI | SET_UP | FORWARDS)
    plc.wait(1000)
    assert real(plc, "VIST_F") == pytest.approx(120.0, abs=5.0)


def test_the_built_in_controller_goes_from_target_to_target():
    program = "{kind: positions, targets: [0.5, -1.25], speed_rpm: 300, acceleration: 6000, dwell: 1s}"
    line = VirtualLine(model="profidrive", telegram=112, cycle="1ms", program=program)
    line.connect()
    assert line.world.run(20.0, until=lambda: line.plc.columns.program[0].moves == 2, look_ns=10_000_000)
    axis = line.farm.columns.axis[0]
    assert axis.motor.position - axis.homing.origin == pytest.approx(-1.25, abs=0.01)


def test_a_plc_program_writes_and_reads_them_by_name():
    described = model("profidrive").profidrive
    steps = {"velocity_step": 1.0, "velocity_step_b": 0.0, "target_step": 1.0, "task_velocity_step": 1.0}
    signals = axis_signals(described, 112, signal_units(**steps))
    outputs = Outputs(signals.setpoints)
    outputs.mdi_tarpos_f, outputs.mdi_velocity_f, outputs["mdi_acc_f"] = 1.5, 30.0, 50.0
    assert (outputs["mdi_tarpos_f"], outputs["mdi_velocity_f"], outputs.mdi_acc_f) == (540.0, 180.0, 50.0)
    assert outputs.mdi_tarpos_f == pytest.approx(1.5)
    with pytest.raises(ValueError, match="mdi_acc_f: 'fast' is not a number of single precision"):
        outputs["mdi_acc_f"] = "fast"
    with pytest.raises(ValueError, match="is not a number of single precision"):
        outputs.mdi_acc_f = math.inf


def test_telegram_999_has_no_such_words():
    with pytest.raises(ConfigError, match="no set point 'MDI_TARPOS_F'"):
        with_words(model("profidrive"), {"output": ["STW1", "MDI_TARPOS_F"], "input": ["ZSW1"]})


@given(st.integers(-(1 << 31), (1 << 31) - 1))
def test_whatever_octets_come_the_number_is_finite_and_comes_back(word):
    value = called(real_of)(word)
    assert math.isfinite(value)
    assert called(bits_of)(value) in ({word} if called(is_real)(word) else {0})
