"""SINA_POS: the basic positioner by telegram 111, with the inputs and outputs that PLC programmers know from the block.

Written from public documentation: SinaPos (GitHub simatic-ax/sinamics-drive-functions, docs/SinaPos), BasicPosControl
2.1 (TIA Portal information system: inputs, ConfigEPos bit by bit, Status), and a published table of the bits that the
block sets in each mode.  Not said there, and so assumed:

- the order of errors that hold at a time: connection, fault, inhibit, mode, overrides, block, flying homing;
- AxisSpFixed is ZSW1.13, which drives of other makers have as "motor stopped";
- ModePos 0, its preset value, is no error: nothing of a mode is sent; with a wrong mode or block nothing starts;
- overrides beyond their limits are sent as the limit;
- ActMode: the last ModePos that fits POS_ZSW1 (bits 14 and 15 say MDI and set-up mode; the others show only in motion);
- 0x8403: FlyRef was set for a second in operation, and POS_ZSW1.12 has not come;
- DiagId 0x80A0 without a connection, what DPRD_DAT returns; 0x8601 never comes: what cannot be written cannot be read.

The block has no output Done: that a motion is over is AxisPosOk, that homing is AxisRef.  A program of your own derives
from it: it sets inputs, and calls `super().cycle(inputs, outputs, now)`.
"""

from functools import lru_cache

from pnfarm import AxisProgram

RELATIVE, ABSOLUTE, SET_UP, HOMING, SET_REFERENCE, BLOCK, JOG, JOG_INCREMENTAL = range(1, 9)
MDI = (RELATIVE, ABSOLUTE, SET_UP)
#: Bits of ConfigEPos that go to a word: (bit of ConfigEPos, bit of the word).
CONFIG = {
    "STW1": ((0, 1), (1, 2), (7, 13), (15, 12), (16, 14), (17, 15)),
    "STW2": ((9, 0), (10, 1), (11, 2), (12, 3), (13, 4), (14, 7), (28, 5), (29, 6), (30, 8), (31, 9)),
    "POS_STW1": ((8, 12), (18, 6), (19, 7), (20, 11), (21, 13)),
    "POS_STW2": ((2, 14), (3, 15), (4, 11), (5, 10), (6, 2), (22, 3), (23, 4), (24, 6), (25, 7), (26, 12), (27, 13)),
}
LIMITS = {"OverV": 199, "OverAcc": 100, "OverDec": 100}
FULL = 0x4000  # 100 %
LAST_BLOCK = 63
NO_FAULT, READ_ERROR, DRIVE_FAULT, INHIBITED = 0x7002, 0x8600, 0x8401, 0x8402
WRONG_MODE, WRONG_OVERRIDE, WRONG_BLOCK, NO_FLYING_HOMING = 0x8202, 0x8203, 0x8204, 0x8403
SECOND = 1_000_000_000


@lru_cache(64)
def configured_words(config):
    """The bits of each word that ConfigEPos sets."""
    return {word: sum((config >> place & 1) << bit for place, bit in places) for word, places in CONFIG.items()}


class SinaPos(AxisProgram):
    # inputs
    ModePos: int = 0
    EnableAxis: bool = False
    CancelTraversing: bool = True  # 0 = reject
    IntermediateStop: bool = True  # 0 = stop
    Positive: bool = False
    Negative: bool = False
    Jog1: bool = False
    Jog2: bool = False
    FlyRef: bool = False
    AckError: bool = False
    ExecuteMode: bool = False
    Position: int = 0  # LU, or the number of a traversing block
    Velocity: int = 0  # 1000 LU/min
    OverV: int = 100  # %
    OverAcc: int = 100
    OverDec: int = 100
    ConfigEPos: int = 0x00000003
    # outputs
    AxisEnabled: bool = False
    AxisPosOk: bool = False
    AxisSpFixed: bool = False
    AxisRef: bool = False
    AxisWarn: bool = False
    AxisError: bool = False
    Lockout: bool = False
    ActVelocity: int = 0  # 0x40000000 = p2000
    ActPosition: int = 0  # LU
    ActMode: int = 0
    EPosZSW1: int = 0
    EPosZSW2: int = 0
    ActWarn: int = 0
    ActFault: int = 0
    Error: bool = False
    Status: int = NO_FAULT
    DiagId: int = 0

    fly_ns = 0
    flew = False

    def cycle(self, inputs, outputs, now):
        self._read(inputs)
        self._check(inputs, now)
        self._write(outputs)

    def _read(self, inputs):
        words = ("ZSW1", "POS_ZSW1", "POS_ZSW2", "NIST_B", "XIST_A", "FAULT_CODE", "WARN_CODE")
        zsw1, *others = [inputs[word] for word in words] if inputs.valid else [0] * len(words)
        self.EPosZSW1, self.EPosZSW2, self.ActVelocity, self.ActPosition, self.ActFault, self.ActWarn = others
        self.AxisEnabled, self.AxisError = bool(zsw1 & 1 << 2), bool(zsw1 & 1 << 3)
        self.Lockout, self.AxisWarn = bool(zsw1 & 1 << 6), bool(zsw1 & 1 << 7)
        self.AxisPosOk, self.AxisRef = bool(zsw1 & 1 << 10), bool(zsw1 & 1 << 11)
        self.AxisSpFixed = bool(zsw1 & 1 << 13)
        shown = (bool(self.EPosZSW1 & 0x8000), bool(self.EPosZSW1 & 0x4000))
        if not inputs.valid:
            self.ActMode = 0
        elif shown == (self.ModePos in MDI, self.ModePos == SET_UP):
            self.ActMode = self.ModePos

    def _check(self, inputs, now):
        self.fly_ns = (self.fly_ns or now) if self.FlyRef and self.AxisEnabled else 0
        self.flew = bool(self.fly_ns) and (self.flew or bool(self.EPosZSW1 & 0x1000))
        found = (
            (not inputs.valid, READ_ERROR),
            (self.AxisError, DRIVE_FAULT),
            (self.Lockout, INHIBITED),
            (self.ModePos not in range(9), WRONG_MODE),
            (any(not 0 <= getattr(self, name) <= most for name, most in LIMITS.items()), WRONG_OVERRIDE),
            (self.ModePos == BLOCK and self.Position not in range(LAST_BLOCK + 1), WRONG_BLOCK),
            (self.fly_ns and not self.flew and now - self.fly_ns > SECOND, NO_FLYING_HOMING),
        )
        self.Status = next((status for holds, status in found if holds), NO_FAULT)
        self.DiagId = 0 if inputs.valid else 0x80A0
        self.Error = self.Status != NO_FAULT

    def _write(self, outputs):
        mode = 0 if self.Status in (WRONG_MODE, WRONG_BLOCK) else self.ModePos
        start, jogs, one_jog = self.ExecuteMode, mode in (JOG, JOG_INCREMENTAL), self.Jog1 != self.Jog2
        one_way = self.Positive != self.Negative
        fly = self.FlyRef and mode != HOMING
        bits = {
            "STW1": self.EnableAxis | 1 << 3 | self.CancelTraversing << 4 | self.IntermediateStop << 5
            | (start and mode in (*MDI, BLOCK)) << 6 | self.AckError << 7
            | (jogs and one_jog and self.Jog1) << 8 | (jogs and one_jog and self.Jog2) << 9 | 1 << 10
            | (fly or (start and mode == HOMING)) << 11,
            "POS_STW1": (self.Position if mode == BLOCK else 0) | (mode in (ABSOLUTE, SET_UP)) << 8
            | (one_way and self.Positive) << 9 | (one_way and self.Negative) << 10
            | (mode == SET_UP) << 14 | (mode in MDI) << 15,
            "POS_STW2": (start and mode == SET_REFERENCE) << 1 | (mode == JOG_INCREMENTAL) << 5 | fly << 8
            | (mode == HOMING and one_way and self.Negative) << 9,
            "STW2": 0,
        }  # fmt: skip
        for word, configured in configured_words(self.ConfigEPos).items():
            outputs[word] = bits[word] | configured
        shares = (max(0, min(most, getattr(self, name))) * FULL // 100 for name, most in LIMITS.items())
        outputs["OVERRIDE"], outputs["MDI_ACC"], outputs["MDI_DEC"] = shares
        outputs["MDI_TARPOS"] = self.Position if mode in MDI else 0
        outputs["MDI_VELOCITY"] = self.Velocity


class Shuttle(SinaPos):
    """The block in use: it takes the place for 0, and moves between there and ten revolutions of 10000 LU."""

    step_ns = fault_ns = 0
    out = False

    def cycle(self, inputs, outputs, now):
        self.fault_ns = (self.fault_ns or now) if self.Status == DRIVE_FAULT else 0
        self.AckError = bool(self.fault_ns) and (now - self.fault_ns) % SECOND > SECOND // 2
        self.EnableAxis = not self.Error
        self.Velocity, self.Position = 6000, 100_000 if self.out else 0
        self.ModePos = ABSOLUTE if self.AxisRef and self.AxisEnabled else SET_REFERENCE
        if self.ExecuteMode or not self.AxisEnabled:
            self.ExecuteMode = self.AxisEnabled and now - self.step_ns < SECOND // 10
        elif self.ModePos == self.ActMode and now - self.step_ns > SECOND and (self.AxisSpFixed or not self.AxisRef):
            self.step_ns, self.ExecuteMode = now, True
            self.out = not self.out and self.AxisRef
        super().cycle(inputs, outputs, now)
