"""One drive on the bench: an axis with an image, stepped by hand."""

from __future__ import annotations

from typing import Any

from stepping import run_steps

from pnfarm.firmware.axis import AXIS
from pnfarm.firmware.faults import take_commands  # noqa: F401 - re-exported for tests that drive it alone
from pnfarm.table.axis_codes import CMD_POWER_ON, COMMANDS, FIRMWARE_PROFIDRIVE, REACTION_QUICK_STOP
from pnfarm.table.image import IMAGE, LOST_NEVER, LOST_NOT
from pnfarm.table.signals import NIST_A, NSOLL_A, STW1, ZSW1

MS = 1_000_000
VELOCITY_STEP = 1638 * 60 * 16000 / 2**32


def configure(axis: Any) -> None:
    """Values of a small servo; the ramps are round numbers."""
    axis.front = FIRMWARE_PROFIDRIVE
    axis.powered = 1
    axis.step_ns = MS
    axis.boot_time_ns = 100 * MS
    axis.load.settings.inertia = 2e-4
    axis.load.settings.friction = 0.05
    axis.load.settings.damping = 0.0
    axis.motor.settings.torque_constant = 0.5
    axis.motor.settings.peak_current = 9.0
    axis.motor.settings.velocity_time_constant = 0.002
    axis.motor.settings.max_velocity = 12000.0
    axis.drive.settings.opmode = 1
    axis.profidrive.settings.velocity_step = VELOCITY_STEP
    axis.profidrive.settings.message_bits = 0x38C2
    axis.profidrive.settings.message_set = 0x0100
    axis.travel.settings.position_step = 1 / 65536
    axis.ramp.settings.acceleration = 10_000.0
    axis.ramp.settings.deceleration = 5_000.0
    axis.ramp.settings.quick_stop_deceleration = 50_000.0
    axis.ramp.settings.velocity_window = 1.0
    axis.ramp.settings.standstill = 0.5
    axis.jog.settings.velocity[0] = 100.0
    axis.jog.settings.velocity[1] = -50.0
    axis.jog.settings.acceleration = 1_000.0
    axis.jog.settings.deceleration = 1_000.0
    axis.faults.settings.loss_fault = 702 | REACTION_QUICK_STOP << 24


class BenchAxis:
    """``write`` as a controller does, ``run`` time, look at ``axis``."""

    def __init__(self) -> None:
        self.axes = AXIS.allocate(1)
        self.images = IMAGE.allocate(1)
        self.axis = self.axes[0]
        self.image = self.images[0]
        configure(self.axis)
        self.image.lost = LOST_NEVER
        self.now = 0
        self.run(150)

    def run(self, steps: int, step_ns: int = MS, *, frame: bool = False) -> None:
        """So many steps of ``step_ns`` each; with ``frame`` set points came in each."""
        self.now = run_steps(self.axes, self.images, self.now, step_ns, steps, frame=frame)

    def write(self, stw1: int, rpm: float = 0.0, *, run: int = 1) -> int:
        """STW1 and a speed; ZSW1 after ``run`` milliseconds."""
        self.image.received[STW1] = stw1
        self.image.received[NSOLL_A] = round(rpm / VELOCITY_STEP) & 0xFFFF
        self.image.valid = 1
        self.image.lost = LOST_NOT
        self.run(run)
        return self.zsw1

    def lose(self, why: int) -> None:
        """The engine finds that set points are no longer valid."""
        self.image.valid = 0
        self.image.lost = why
        self.run(1)

    def command(self, code: int, argument: int = 0) -> None:
        head = int(self.axis.commands.settings.head)
        self.axis.commands.settings.ring[head % COMMANDS] = code | argument << 8
        self.axis.commands.settings.head = head + 1

    def off_and_on(self, milliseconds: int = 50) -> None:
        """The supply goes, and with it the connection; it returns after so long, and the drive takes its first step."""
        self.axis.powered = 0
        self.image.valid = 0
        self.run(milliseconds)
        self.image.received[:] = 0
        self.image.lost = LOST_NEVER
        self.axis.powered = 1
        self.command(CMD_POWER_ON)
        self.run(1)

    def enable(self, rpm: float = 0.0) -> None:
        for word in (0x0470, 0x0476, 0x0477, 0x047F):
            self.write(word)
        self.write(0x047F, rpm)
        assert self.axis.drive.state == 4

    @property
    def zsw1(self) -> int:
        return int(self.image.sent[ZSW1])

    @property
    def nist_a(self) -> int:
        value = int(self.image.sent[NIST_A])
        return value - 0x10000 if value & 0x8000 else value
