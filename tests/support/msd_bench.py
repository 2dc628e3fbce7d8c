"""A Moog MSD on the bench: its model, its parameters and its firmware, stepped by hand and without a network."""

from __future__ import annotations

from typing import Any

from stepping import run_steps

from pnfarm.drives.axis_handle import AxisHandle
from pnfarm.drives.catalogue import model
from pnfarm.drives.parameters.store import ParameterStore
from pnfarm.firmware.axis import AXIS
from pnfarm.table.axis_codes import FIRMWARE_PROFIDRIVE
from pnfarm.table.image import IMAGE, LOST_NEVER, LOST_NOT
from pnfarm.table.signals import ACTUAL_SLOTS, SETPOINT_SLOTS

MS = 1_000_000

READY = 0x0476
ON = 0x0477
RUN = 0x047F
#: Position mode: operation enabled, STW1.4 and 5, STW1.6 at rest.
TASKS = 0x043F


class MsdBench:
    """``send`` signals by name, ``run`` milliseconds, ``see`` what comes back; ``store`` has the parameters."""

    def __init__(self, telegram: int = 1, module: int | None = None, **params: int) -> None:
        self.model = model("moog-msd")
        self.axes, self.images = AXIS.allocate(1), IMAGE.allocate(1)
        self.axis: Any = self.axes[0]
        self.image: Any = self.images[0]
        self.store = ParameterStore(self.model, AxisHandle(self.axis, self.image))
        self.model.apply_motor(self.axis)
        self.axis.front = FIRMWARE_PROFIDRIVE
        self.axis.powered = 1
        self.axis.step_ns = MS
        self.image.lost = LOST_NEVER
        self.now = 0
        self.store.power_on()
        self.store.plug_telegram(telegram, module)
        for name, value in params.items():
            self.store.set(name.replace("_", "-"), value)
        self.run(150)

    def run(self, milliseconds: int = 1, *, frames: bool = True) -> None:
        """``frames``: each millisecond a frame of set points comes, the same as the last one."""
        self.now = run_steps(self.axes, self.images, self.now, MS, milliseconds, life=True, frame=frames)

    def send(self, run: int = 1, **signals: int) -> int:
        """Set points by the names of their signals; ZSW1 after ``run`` milliseconds."""
        for name, value in signals.items():
            self.image.received[SETPOINT_SLOTS[name]] = value
        self.image.valid, self.image.lost = 1, LOST_NOT
        self.run(run)
        return self.zsw1

    def see(self, name: str) -> int:
        return int(self.image.sent[ACTUAL_SLOTS[name]])

    @property
    def zsw1(self) -> int:
        return self.see("ZSW1") & 0xFFFF

    @property
    def zsw2(self) -> int:
        """Without the sign of life."""
        return self.see("ZSW2") & 0x0FFF

    @property
    def state(self) -> int:
        return int(self.axis.drive.state)

    @property
    def speed(self) -> float:
        return float(self.axis.motor.velocity)

    @property
    def place(self) -> float:
        """Revolutions from the machine's zero."""
        return float(self.axis.motor.position - self.axis.homing.origin)

    def enable(self, last: int = RUN, **signals: int) -> None:
        for word in (READY, ON, last):
            self.send(3, STW1=word, **signals)
        assert self.state == 4, f"S{self.state}, ZSW1 0x{self.zsw1:04X}"

    def faults(self) -> list[str]:
        return [self.model.faults[int(code) & 0xFFFFFF].label for code in self.axis.faults.code if code]

    def until(self, condition: Any, within: int = 5000) -> int:
        """Milliseconds until ``condition()`` holds."""
        for taken in range(within):
            if condition():
                return taken
            self.run(1)
        raise AssertionError(f"not within {within} ms; ZSW1 0x{self.zsw1:04X}, {self.speed} rpm at {self.place}")
