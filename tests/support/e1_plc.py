"""A PLC program by hand for the HIWIN E1 in position mode, telegrams 9 and 111, in revolutions and rpm."""

from __future__ import annotations

import pytest
from hand_plc import HandPlc

#: STW1: operation, neither rejected nor stopped, control by PLC; and what starts something.
RUN = 0x043F
START, ACKNOWLEDGE, JOG_FORWARDS, JOG_BACKWARDS, HOME = 0x0040, 0x0080, 0x0100, 0x0200, 0x0800
FOLLOWS, REACHED, HOMED, TAKEN, STOPPED = 0x0100, 0x0400, 0x0800, 0x1000, 0x2000
COUNTS = 1 << 23
#: 100 % of MDI_ACC, MDI_DEC and OVERRIDE.
WHOLE = 0x4000
BOTH_TELEGRAMS = pytest.mark.parametrize("telegram", [9, 111])


class E1Plc(HandPlc):
    """Switched on, MDI selected; ``task`` puts the data of a task, ``go`` starts it by its edge."""

    def __init__(self, telegram: int, **options) -> None:
        super().__init__("hiwin-e1", telegram, **options)
        self.telegram = telegram
        self.task(0.0)
        self.switch_on(operation=RUN)

    def task(self, position: float, rpm: float = 600.0, *, relative: bool = False, mdi: bool = True, **words) -> None:
        """The data of a task; ``words`` are signals as they are."""
        selected = 0x8000 if mdi else 0
        if self.telegram == 9:
            mode = {"SATZANW": selected, "MDI_MOD": 0 if relative else 1}
        else:
            mode = {"POS_STW1": selected | (0 if relative else 0x0100), "OVERRIDE": WHOLE}
        data = {
            "MDI_TARPOS": round(position * COUNTS),
            "MDI_VELOCITY": round(rpm * COUNTS / 1000),
            "MDI_ACC": WHOLE,
            "MDI_DEC": WHOLE,
        }
        self.put(wait=1, **mode | data | words)

    def go(self, stw1: int = RUN) -> bool:
        """The edge of STW1.6; whether the drive took the task.  The bit falls again."""
        taken = bool(self.put(STW1=stw1 | START) & TAKEN)
        self.put(STW1=stw1)
        return taken

    def arrive(self, most: int = 5000) -> int:
        """Milliseconds until ZSW1 says that the target is reached and the motor stopped."""
        return self.wait_for(lambda: self["ZSW1"] & (REACHED | STOPPED) == REACHED | STOPPED, most)

    @property
    def rev(self) -> float:
        """XIST_A."""
        return self["XIST_A"] / COUNTS

    @property
    def rpm(self) -> float:
        return float(self.axis.motor.velocity)

    def bit(self, bits: int) -> bool:
        return self["ZSW1"] & bits == bits
