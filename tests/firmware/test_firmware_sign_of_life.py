"""Sign of life: the drive's own count, and how it judges the controller's (Moog MSD manual 8.3.2)."""

from __future__ import annotations

import pytest
from bench_axis import BenchAxis
from from_python import called

from pnfarm.firmware.profidrive.sign_of_life import count_life, following
from pnfarm.table.axis_codes import REACTION_QUICK_STOP
from pnfarm.table.signals import STW2, ZSW2

FAULT = 73


class Living(BenchAxis):
    """``frame`` after ``frame`` from a controller; the drive is stepped after each."""

    def __init__(self, tolerance: int = 5) -> None:
        super().__init__()
        self.axis.life.settings.watched = 1
        self.axis.life.settings.tolerance = tolerance
        self.axis.life.settings.fault = FAULT | REACTION_QUICK_STOP << 24
        self.count = 0

    def frame(self, count: int | None = None, *, frames: int = 1) -> None:
        """One look at ``frames`` new frames; ``count`` replaces the one that the controller is at."""
        self.count = called(following)(self.count, frames) if count is None else count
        self.image.received[STW2] = self.count << 12
        self.image.frames += frames
        called(count_life)(self.axis, self.image)
        self.run(1)

    def good(self, frames: int) -> None:
        for _ in range(frames):
            self.frame()

    def stand(self, frames: int) -> None:
        for _ in range(frames):
            self.frame(self.count)

    @property
    def faults(self) -> list[int]:
        return [int(code) & 0xFFFFFF for code in self.axis.faults.code if code]

    @property
    def own(self) -> int:
        return int(self.image.sent[ZSW2]) >> 12 & 0xF


@pytest.fixture
def drive() -> Living:
    living = Living()
    living.enable()
    return living


def test_a_count_goes_from_1_to_15_and_on_to_1():
    assert called(following)(0, 1) == 1
    assert [called(following)(count, 1) for count in range(1, 16)] == [*range(2, 16), 1]
    assert called(following)(14, 3) == 2
    assert called(following)(7, 0) == 7
    assert called(following)(7, 15) == 7


def test_the_drive_counts_each_frame_that_it_takes(drive):
    counts = []
    for _ in range(31):
        drive.frame()
        counts.append(drive.own)
    assert counts == [1 + n % 15 for n in range(31)]
    before = drive.own
    drive.run(5)
    assert drive.own == before
    drive.frame(frames=3)
    assert drive.own == called(following)(before, 3)


def test_the_count_is_in_zsw2_before_the_drives_next_step(drive):
    drive.frame()
    before = drive.own
    for ahead in (1, 2):
        drive.image.frames += 1
        called(count_life)(drive.axis, drive.image)
        assert drive.own == called(following)(before, ahead)


def test_a_controller_in_sequence_raises_nothing(drive):
    drive.good(100)
    assert (drive.axis.life.run, drive.axis.life.count, drive.axis.life.errors) == (15, 0, 0)
    assert drive.faults == []


def test_a_controller_without_a_sign_of_life_is_not_monitored(drive):
    for count in (0, 5):
        for _ in range(50):
            drive.frame(count)
    assert drive.axis.life.errors == 0
    assert drive.faults == []


def test_watching_begins_after_15_frames_in_sequence(drive):
    drive.good(14)
    drive.stand(20)
    assert drive.axis.life.errors == 0
    drive.good(14)  # the frame that stood last is the first of the new sequence
    drive.stand(1)
    assert drive.axis.life.errors == 1


def test_a_failure_counts_ten_up_and_a_good_frame_one_down():
    """Figure 8.4: three failures, then normal operation again."""
    drive = Living(tolerance=4)
    drive.enable()
    drive.good(20)
    counts = []
    for _ in range(3):
        drive.stand(1)
        counts.append(int(drive.axis.life.count))
    for _ in range(3):
        drive.good(1)
        counts.append(int(drive.axis.life.count))
    assert counts == [10, 20, 30, 29, 28, 27]
    assert drive.faults == []
    drive.good(40)
    assert drive.axis.life.count == 0


def test_as_many_failures_as_the_tolerance_are_a_fault():
    """Figure 8.5: a limit of 4, four failures, error reaction."""
    drive = Living(tolerance=4)
    drive.enable()
    drive.good(20)
    drive.stand(3)
    assert drive.faults == []
    drive.stand(1)
    assert drive.axis.life.count == 40
    assert drive.faults == [FAULT]
    assert drive.zsw1 & 0x0008


@pytest.mark.parametrize("tolerance", [0, 1, 5, 6])
def test_every_tolerance_trips_at_its_own_number(tolerance):
    drive = Living(tolerance)
    drive.enable()
    drive.good(20)
    assert drive.faults == []
    drive.stand(max(0, tolerance - 1))
    assert drive.faults == []
    drive.stand(1)
    assert drive.faults == [FAULT]


def test_the_largest_tolerance_watches_nothing_but_counts_errors():
    drive = Living(tolerance=0xFFFF)
    drive.enable()
    drive.good(20)
    drive.stand(100)
    assert drive.axis.life.errors == 100
    assert drive.axis.life.count == 0
    assert drive.faults == []


@pytest.mark.parametrize("ahead", [0, 2, 3, 14])
def test_a_jump_of_any_width_is_one_failure(drive, ahead):
    drive.good(20)
    drive.frame(called(following)(drive.count, ahead))
    assert drive.axis.life.errors == 1
    drive.good(1)
    assert drive.axis.life.errors == 1


def test_zero_is_a_failure_and_so_is_coming_back_from_it(drive):
    drive.good(20)
    drive.frame(0)
    drive.frame(0)
    drive.frame(1)
    assert drive.axis.life.errors == 3
    drive.good(1)
    assert drive.axis.life.errors == 3


def test_a_lost_frame_is_one_failure(drive):
    drive.good(20)
    drive.count = called(following)(drive.count, 1)
    drive.good(1)
    assert (drive.axis.life.errors, drive.axis.life.count) == (1, 10)
    drive.good(10)
    assert drive.axis.life.count == 0


def test_frames_that_came_together_are_in_sequence(drive):
    drive.good(20)
    drive.frame(frames=2)
    assert drive.axis.life.errors == 0


def test_a_new_connection_begins_with_a_clean_count(drive):
    drive.good(20)
    drive.stand(3)
    drive.image.valid = 0
    called(count_life)(drive.axis, drive.image)
    assert (drive.axis.life.count, drive.axis.life.run) == (0, 0)
    drive.image.valid = 1
    drive.count = 9
    drive.good(20)
    assert (drive.axis.life.errors, drive.axis.life.count) == (3, 0)


def test_a_fault_comes_back_while_the_sign_of_life_stays_and_not_when_it_counts(drive):
    drive.good(20)
    drive.stand(10)
    assert drive.faults == [FAULT]
    drive.write(0x0476 | 0x0080)
    drive.write(0x0476)
    assert drive.faults == []
    drive.stand(1)
    assert drive.faults == [FAULT]
    drive.good(100)
    drive.write(0x0476 | 0x0080)
    drive.write(0x0476)
    drive.good(20)
    assert drive.faults == []


def test_moog_8_3_2_ten_times_the_tolerance_is_the_counters_maximum_so_that_a_long_failure_is_soon_forgotten(drive):
    """Moog MSD manual, figure 8.5: the counter reaches its maximum value when the error reaction starts."""
    drive.good(20)
    drive.stand(5000)
    assert drive.axis.life.count == 10 * drive.axis.life.settings.tolerance
    drive.good(10 * int(drive.axis.life.settings.tolerance))
    assert drive.axis.life.count == 0
    drive.write(0x0476 | 0x0080)
    drive.write(0x0476)
    drive.good(20)
    drive.stand(int(drive.axis.life.settings.tolerance) - 1)
    assert drive.faults == []


def test_after_an_acknowledgement_further_failures_raise_the_fault_again(drive):
    drive.good(20)
    drive.stand(6)
    drive.write(0x0476 | 0x0080)
    assert drive.faults == []
    drive.good(1)
    assert drive.faults == []
    drive.stand(1)
    assert drive.faults == [FAULT]


def test_it_is_watched_without_control_by_the_plc(drive):
    drive.image.received[0] = 0
    drive.good(20)
    drive.stand(5)
    assert drive.faults == [FAULT]


@pytest.mark.parametrize("bit", [0x0400, 0x0800])
def test_pulses_are_shown_by_the_bit_of_the_telegram_if_it_has_one(drive, bit):
    for opmode in (1, 2):
        drive.axis.drive.settings.opmode = opmode
        drive.frame()
        assert not int(drive.image.sent[ZSW2]) & 0x0FFF
    drive.axis.profidrive.settings.pulses_enabled = bit
    drive.frame()
    assert int(drive.image.sent[ZSW2]) & 0x0FFF == bit
    drive.write(0x0476)
    drive.run(2000)
    assert not int(drive.image.sent[ZSW2]) & 0x0FFF


def test_a_drive_without_sign_of_life_leaves_zsw2_alone():
    drive = BenchAxis()
    drive.enable()
    drive.run(10)
    assert drive.image.sent[ZSW2] == 0
