"""A PLC program by hand: the connected controller's words, written and read signal by signal in virtual time."""

from __future__ import annotations

from typing import TYPE_CHECKING

from virtual_line import VirtualLine

from pnfarm.protocols.profibus.wire.dp import Control
from pnfarm.protocols.profinet.wire.rtc import DataStatus
from pnfarm.table.signals import ACTUAL_SLOTS, SETPOINT_SLOTS

if TYPE_CHECKING:
    from collections.abc import Callable


class HandPlc(VirtualLine):
    """``put`` set points, look at actual values by name (``plc["ZSW1"]``); the sign of life counts in STW2 meanwhile.

    The built-in axis program rests, so that every bit is the test's.  Time goes in milliseconds, one frame each; with a
    cycle of another length in those (``FRAME``, seconds).
    """

    FRAME = 0.001

    def __init__(self, model: str, telegram: int, **options) -> None:
        super().__init__(model=model, telegram=telegram, **{"cycle": "1ms"} | options)
        self.faults = self.farm.injections
        self.connect()
        self.plc.columns.program[0].active = 0
        self.image = self.plc.columns.image[0]
        self.image.sent[:] = 0
        self.image.sent[SETPOINT_SLOTS["STW1"]] = 0x0400
        self.axis = self.farm.columns.axis[0]
        self.store = self.farm.axes[0].store
        self.life = 0
        #: Bits 0 to 11 of STW2.
        self.stw2 = 0
        self.wait_for(lambda: self.axis.drive.state == 1)
        self.wait(30)

    def wait(self, milliseconds: int = 1) -> None:
        self._frames(milliseconds, lambda: False)

    def _frames(self, most: int, condition: Callable[[], bool]) -> bool:
        """Let frames pass, and count the sign of life before each, until the condition holds between two of them."""
        frame = round(self.FRAME * 1e9)
        due = self.world.now
        end = due + most * frame

        def between() -> bool:
            nonlocal due
            if self.world.now < due:
                return False
            if condition():
                return True
            if due < end:
                self.life = 1 + self.life % 15
                self.image.sent[SETPOINT_SLOTS["STW2"]] = self.life << 12 | self.stw2
            due += frame
            return False

        return self.world.run(most * self.FRAME, until=between, look_ns=frame)

    def put(self, *, wait: int = 4, **signals: int) -> int:
        """Set points by name; ZSW1 some milliseconds later, when the drive's answer is there."""
        for name, value in signals.items():
            self.image.sent[SETPOINT_SLOTS[name]] = value
        self.wait(wait)
        return self["ZSW1"]

    def __getitem__(self, name: str) -> int:
        """An actual value as the controller received it; words without a sign."""
        value = int(self.image.received[ACTUAL_SLOTS[name]])
        return value if name in {"NIST_B", "XIST_A", "G1_XIST1", "G1_XIST2"} else value & 0xFFFF

    def inject(self, kind: str, **params):
        """A fault of `pnfarm fault kinds` with its parameters, until it is cleared."""
        return self.faults.inject({"kind": kind, "on": "all", "params": params}, self.world.now)

    def stop_controller(self) -> None:
        """The controller is in STOP: by its data status, on PROFIBUS by Clear_Data; its outputs are zero."""
        if self.is_on_line:
            self.plc.master.control(Control.CLEAR_DATA)
        else:
            self.plc.columns.ppm[0].data_status &= ~DataStatus.RUN & 0xFF

    def clear(self) -> None:
        """End every injected fault."""
        self.faults.clear(None, self.world.now)

    def wait_for(self, condition: Callable[[], bool], most: int = 5000) -> int:
        """Milliseconds until it holds."""
        begun = self.world.now
        if self._frames(most, condition):
            return round((self.world.now - begun) / self.FRAME / 1e9)
        raise AssertionError(f"ZSW1 0x{self['ZSW1']:04X}, S{int(self.axis.drive.state)}")

    def switch_on(self, *, operation: int) -> None:
        """S1 to S4; ``operation`` is STW1 with operation enabled."""
        for word in (0x0406, 0x0407, operation):
            self.put(STW1=word)
        assert self.axis.drive.state == 4
