"""Faults of a HIWIN E1: the drive's own alarms, their codes, and a sign of life that fails."""

from __future__ import annotations

from fault_line import FaultLine

from pnfarm.drives.profiles.profidrive.fault_buffer import fault_situations
from pnfarm.metrics.collector import FarmCollector
from pnfarm.table.program import FAULTED, RUNNING
from pnfarm.table.signals import FAULT_CODE, WARN_CODE

FBUS = 73


class E1Line(FaultLine):
    """A running E1 at 1 ms."""

    def __init__(self, **options) -> None:
        super().__init__(model="hiwin-e1", **{"telegram": 3, "cycle": "1ms"} | options)
        self.enable()
        self.run(0.1)

    @property
    def axis(self):
        return self.farm.columns.axis[0]

    @property
    def program(self):
        return self.plc.columns.program[0]

    @property
    def active(self) -> list[int]:
        return [int(code) & 0xFFFFFF for code in self.axis.faults.code if code]

    def seen(self, slot: int) -> int:
        return int(self.plc.columns.image[0].received[slot]) & 0xFFFF

    def running_again(self) -> bool:
        return self.until(lambda: self.program.phase == RUNNING)


def test_a_cause_raises_the_manuals_alarm_and_its_end_lets_the_controller_acknowledge_it():
    line = E1Line()
    line.add("undervoltage", for_="100ms")
    assert line.until(lambda: line.program.phase == FAULTED)
    assert line.active == [18]
    assert line.running_again()
    assert line.active == []
    assert fault_situations(line.axis)[1] == [18]
    assert line.farm.axes[0].store.read(945, 8) == [0x410]
    # raised, and acknowledged
    assert line.farm.axes[0].store.read(944) == [2]
    assert line.farm.axes[0].store.read(952) == [1]


def test_silence_of_the_controller_is_the_fieldbus_alarm_and_a_controlled_stop():
    line = E1Line()
    line.farm.axes[0].store.set("Pt30A", 1000)
    line.program.speed = 600.0
    line.run(0.3)
    line.add("loss", direction="in", for_="200ms")
    assert line.until(lambda: bool(line.active))
    assert line.active == [FBUS]
    line.run(0.03)
    assert (line.axis.drive.state, line.axis.drive.stop) == (5, 3)
    assert 400 < line.axis.motor.velocity < 600
    assert line.running_again()
    assert line.active == []


def test_telegram_111_shows_the_code_of_the_oldest_fault():
    line = E1Line(telegram=111)
    assert line.seen(FAULT_CODE) == 0
    line.add("sto", for_="50ms")
    assert line.until(lambda: line.seen(FAULT_CODE) != 0)
    assert line.seen(FAULT_CODE) == 0xEB0
    assert line.seen(WARN_CODE) == 0
    assert line.until(lambda: line.seen(FAULT_CODE) == 0)


def test_a_lost_frame_is_one_failed_sign_of_life_and_is_in_the_metric():
    line = E1Line(watchdog=100)
    collector = FarmCollector(line.farm)
    try:
        line.add("loss", direction="in", after_cycles=10, count=1)
        line.run(0.2)
        assert line.axis.life.errors == 1
        assert line.active == []
        assert 'pnfarm_sign_of_life_errors_total{drive="axis-01"} 1' in collector.gather().text().decode()
    finally:
        collector.close()


def test_a_sign_of_life_that_fails_is_in_the_log_and_in_the_counts_of_faults():
    line = E1Line()
    line.program.life = 0
    assert line.until(lambda: bool(line.active))
    line.run(0.1)
    assert line.farm.axes[0].fault_counts[FBUS] == 1
