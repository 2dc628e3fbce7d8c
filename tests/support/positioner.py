"""A drive in position mode."""

from bench_axis import BenchAxis

from pnfarm.table.axis_codes import (
    CONFIG_PROFILE_JOG,
    CONFIG_RISING_EDGE,
    HOME_AT_ONCE,
    HOME_MARK,
    TASK_CHAINED,
    TASK_DEFINED,
    TASK_RELATIVE,
    TASKS_MDI,
)
from pnfarm.table.signals import MDI_ACC, MDI_DEC, MDI_MOD, MDI_TARPOS, MDI_VELOCITY, SATZANW, XIST_A

#: Enabled, not rejected, no intermediate stop, control by PLC.
READY = 0x043F
START = READY | 0x0040
HOME = READY | 0x0800

ON_TARGET, HOMED, ACKNOWLEDGED, STOPPED, ACTIVE = 0x0400, 0x0800, 0x1000, 0x2000, 0x4000
COUNTS = 65536
#: rpm and rpm/s of the increments of MDI_VELOCITY and MDI_ACC (AKD PROFINET manual 5.12).
VELOCITY_UNIT = 12000 / 2**32
ACCELERATION_UNIT = 50_000_000 / 65536


class Positioner(BenchAxis):
    """A drive in position mode, enabled; positions in revolutions, velocities in rpm, accelerations in rpm/s."""

    def __init__(self, *, homed=True):
        super().__init__()
        axis = self.axis
        axis.drive.settings.opmode = 2
        axis.profidrive.settings.task_form = TASKS_MDI
        axis.profidrive.settings.target_step = 1 / COUNTS
        axis.travel.settings.position_step = 1 / COUNTS
        axis.profidrive.settings.task_velocity_step = VELOCITY_UNIT
        axis.profidrive.settings.task_velocity_unsigned = 1
        axis.profidrive.settings.task_acceleration_step = axis.profidrive.settings.task_deceleration_step = (
            ACCELERATION_UNIT
        )
        axis.profidrive.settings.task_active = ACTIVE
        axis.asked.settings.control_config = CONFIG_RISING_EDGE | CONFIG_PROFILE_JOG
        axis.jog.settings.real_time = 1
        axis.homing.settings.required = 1
        (
            axis.homing.settings.velocity,
            axis.homing.settings.acceleration,
            axis.homing.settings.deceleration,
            axis.homing.settings.direction,
        ) = 300.0, 3e4, 3e4, 1.0
        axis.homing.settings.method = HOME_MARK
        axis.positioning.settings.gain = 60.0
        axis.positioning.settings.following_window = 0.5
        axis.positioning.settings.target_window = 0.001
        self.data(0.0)
        for word in (0x0430, 0x0436, 0x0437, READY):
            self.stw(word)
        assert axis.drive.state == 4
        if homed:
            axis.homing.settings.method = HOME_AT_ONCE
            self.stw(HOME, 5)
            self.stw(READY)
            axis.homing.settings.method = HOME_MARK
            assert self.zsw1 & HOMED

    def stw(self, word, run=1):
        return self.write(word, run=run)

    def data(self, position, velocity=600.0, up=30_000.0, down=30_000.0, *, relative=False):
        received = self.image.received
        received[SATZANW] = 0x8000
        received[MDI_TARPOS] = round(position * COUNTS)
        received[MDI_VELOCITY] = round(velocity / VELOCITY_UNIT)
        received[MDI_ACC] = round(up / ACCELERATION_UNIT)
        received[MDI_DEC] = round(down / ACCELERATION_UNIT)
        received[MDI_MOD] = 0 if relative else 1

    def move(self, position, **how):
        """The handshake of bits 6 and 12."""
        self.data(position, **how)
        assert self.stw(START) & ACKNOWLEDGED
        assert not self.stw(READY) & ACKNOWLEDGED

    def stand_at(self, position):
        """Disabled, turned there by hand, and enabled again."""
        for word in (0x0430, 0x0436):
            self.stw(word)
        self.axis.motor.position = position
        for word in (0x0437, READY, READY):
            self.stw(word)

    def until(self, bits, most=20_000):
        for milliseconds in range(most):
            if self.zsw1 & bits == bits:
                return milliseconds
            self.run(1)
        raise AssertionError(f"ZSW1 0x{self.zsw1:04X} never had 0x{bits:04X}")

    def settle(self):
        """In the target, and the position controller is done."""
        self.until(ON_TARGET | STOPPED)
        self.run(100)

    @property
    def place(self):
        return int(self.image.sent[XIST_A]) / COUNTS


def task(drive, number, position, *, relative=False, following=None, dwell=0.0):
    """A motion task of the drive's own."""
    axis = drive.axis
    axis.motion_tasks.settings.position[number], axis.motion_tasks.settings.velocity[number] = position, 600.0
    axis.motion_tasks.settings.acceleration[number] = axis.motion_tasks.settings.deceleration[number] = 30_000.0
    axis.motion_tasks.settings.kind[number] = (
        TASK_DEFINED | relative * TASK_RELATIVE | (following is not None) * TASK_CHAINED
    )
    axis.motion_tasks.settings.next[number] = following or 0
    axis.motion_tasks.settings.dwell_ns[number] = round(dwell * 1e9)
