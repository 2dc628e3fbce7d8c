"""Torque mode of the Kollmorgen AKD (DRV.OPMODE 0); sections are those of its PROFINET manual, edition M."""

from __future__ import annotations

from math import pi

import pytest
from drives_kit import new_drive

from pnfarm.drives.parameters.parameter import ParameterError, ParameterErrorNumber
from pnfarm.table.axis_codes import CMD_POWER_ON
from pnfarm.table.image import LOST_NOT
from pnfarm.table.signals import ITIST_GLATT, NSOLL_A, STW1, TORQUE_SETPOINT

INERTIA, FRICTION = 2e-4, 0.05
#: 5.12.4: 2^14 is DRV.IPEAK, 9 A.
PER_AMPERE = 2**14 / 9.0


class Torque:
    """An AKD in torque mode and operation; the current comes by signal 102 in a free mapping."""

    def __init__(self, *, telegram: int = 0, mapped: bool = True) -> None:
        self.drive = new_drive("akd-profinet")
        self.axis, self.image, self.store = self.drive.axis, self.drive.image, self.drive.store
        self.axis.powered = 1
        self.store.handle.push_command(CMD_POWER_ON)
        self.store.set("DRV.OPMODE", 0)
        self.store.plug_telegram(telegram)
        if mapped:
            self.store.write(915, 0, [1, 102])
        self.run(200)
        self.enable()

    def enable(self) -> None:
        for word in (0x0476, 0x0477, 0x047F):
            self.send(word)
        assert self.axis.drive.state == 4

    def run(self, milliseconds: int) -> None:
        self.drive.pass_time(int(self.axis.last_ns), milliseconds, frames=False)

    def send(self, word: int, amperes: float | None = None, milliseconds: int = 5) -> None:
        self.image.valid, self.image.lost = 1, LOST_NOT
        self.image.received[STW1] = word
        if amperes is not None:
            self.image.received[TORQUE_SETPOINT] = round(amperes * PER_AMPERE) & 0xFFFF
        self.run(milliseconds)


def test_5_8_signal_102_is_the_current_in_torque_mode_in_the_unit_of_5_12_4() -> None:
    running = Torque()
    running.send(0x047F, 1.0, 20)
    omega = (1.0 * 0.5 - FRICTION) / INERTIA * 0.020
    assert float(running.axis.motor.velocity) * 2 * pi / 60 == pytest.approx(omega, rel=0.05)
    assert running.store.get("IL.CMD") == pytest.approx(1000, abs=2)
    assert int(running.image.sent[ITIST_GLATT]) == pytest.approx(PER_AMPERE, abs=2)
    running.send(0x047F, -2.0, 20)
    assert running.store.get("IL.FB") == pytest.approx(-2000, abs=4)


def test_5_8_the_current_is_a_pnu_where_no_telegram_brings_it() -> None:
    running = Torque(telegram=1, mapped=False)
    running.store.write(102, 0, [round(0.5 * PER_AMPERE)])
    running.run(10)
    assert running.store.get("IL.FB") == pytest.approx(500, abs=2)


def test_5_6_il_cmdu_is_the_current_with_drv_cmdsource_0() -> None:
    running = Torque()
    running.store.set("IL.CMDU", 800)
    running.send(0x047F, 0.3, 10)
    assert running.store.get("IL.FB") == pytest.approx(300, abs=2), "the fieldbus leads"
    running.store.set("DRV.CMDSOURCE", 0)
    running.run(10)
    assert running.store.get("IL.FB") == pytest.approx(800, abs=2)
    assert running.store.get("IL.CMDU") == 800
    running.store.set("DRV.CMDSOURCE", 3)
    running.run(10)
    assert running.store.get("IL.FB") == pytest.approx(0, abs=2), "there is no other source"


def test_5_6_il_cmdu_takes_no_more_than_the_peak_current_and_il_limitp_holds() -> None:
    running = Torque()
    for value in (9001, -9001):
        with pytest.raises(ParameterError) as caught:
            running.store.set("IL.CMDU", value)
        assert caught.value.number == ParameterErrorNumber.LIMIT_EXCEEDED
    running.store.set("IL.LIMITP", 400)
    running.send(0x047F, 1.0, 10)
    assert running.store.get("IL.FB") == pytest.approx(400, abs=2)


def test_5_9_a_stop_in_torque_mode_brakes_along_the_stop_ramp_and_switches_off() -> None:
    running = Torque()
    running.send(0x047F, 1.0, 50)
    top = float(running.axis.motor.velocity)
    assert top > 500
    running.send(0x047B, 1.0, 10)
    assert running.axis.drive.state == 5
    assert 0 < running.axis.motor.velocity < top
    running.run(2000)
    assert (float(running.axis.motor.velocity), int(running.axis.drive.state)) == (0.0, 1)


def test_5_6_velocity_mode_ignores_current_and_torque_mode_velocity() -> None:
    running = Torque(telegram=1, mapped=False)
    running.image.received[NSOLL_A] = 0x00A3
    running.run(100)
    assert running.axis.motor.velocity == 0.0
    running.store.set("DRV.OPMODE", 1)
    running.store.write(102, 0, [1000])
    running.run(300)
    assert running.axis.motor.velocity == pytest.approx(0x00A3 * 60 * 16000 * 1638 / 2**32, abs=1.0)
