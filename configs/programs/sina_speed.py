"""SINA_SPEED: a speed by telegram 1, with the inputs and outputs that PLC programmers know from Siemens' block.

Written from the public documentation of SinaSpeed (GitHub simatic-ax/sinamics-drive-functions, docs/SinaSpeed); names
are those of the S7 library.  Not said there, and so assumed: ConfigAxis has its bits in the order of the documented
structure, and a preset value that lets the axis run (0x003F); which of two errors at a time Status has (a lost
connection before a fault before the inhibit); DiagId 0x80A0 without a connection, what DPRD_DAT returns; a reference
speed of 0 sends a set point of 0.  0x8601 never comes: what cannot be written cannot be read here, either.

A program of your own derives from the block: it sets inputs, and calls `super().cycle(inputs, outputs, now)`.
"""

from pnfarm import AxisProgram

#: Bits of ConfigAxis -> bits of STW1: OFF2, OFF3, enable operation, ramp generator (two), set point, inversion, holding
#: brake, motorized potentiometer up and down.
CONFIG = (1, 2, 3, 4, 5, 6, 11, 12, 13, 14)
FULL = 0x4000  # 100 % of the reference speed
NO_FAULT, DRIVE_FAULT, INHIBITED, READ_ERROR = 0x7002, 0x8401, 0x8402, 0x8600
SECOND = 1_000_000_000


class SinaSpeed(AxisProgram):
    # inputs
    EnableAxis: bool = False
    AckError: bool = False
    SpeedSp: float = 0.0  # rpm
    RefSpeed: float = 3000.0  # rpm: p2000
    ConfigAxis: int = 0x003F
    # outputs
    AxisEnabled: bool = False
    Lockout: bool = False
    ActVelocity: float = 0.0  # rpm
    Error: bool = False
    Status: int = NO_FAULT
    DiagId: int = 0

    def cycle(self, inputs, outputs, now):
        config = sum((self.ConfigAxis >> place & 1) << bit for place, bit in enumerate(CONFIG))
        outputs["STW1"] = self.EnableAxis | config | self.AckError << 7 | 1 << 10
        share = self.SpeedSp / self.RefSpeed if self.RefSpeed else 0.0
        outputs["NSOLL_A"] = max(-0x8000, min(0x7FFF, round(share * FULL)))
        zsw1 = inputs["ZSW1"] if inputs.valid else 0
        self.AxisEnabled, self.Lockout = bool(zsw1 & 0x0004), bool(zsw1 & 0x0040)
        self.ActVelocity = inputs["NIST_A"] * self.RefSpeed / FULL if inputs.valid else 0.0
        found = ((not inputs.valid, READ_ERROR), (zsw1 & 0x0008, DRIVE_FAULT), (self.Lockout, INHIBITED))
        self.Status = next((status for holds, status in found if holds), NO_FAULT)
        self.DiagId = 0 if inputs.valid else 0x80A0
        self.Error = self.Status != NO_FAULT


class BackAndForth(SinaSpeed):
    """The block in use: 600 rpm, two seconds each way; a fault is acknowledged, once a second."""

    fault_ns = 0

    def cycle(self, inputs, outputs, now):
        self.fault_ns = (self.fault_ns or now) if self.Status == DRIVE_FAULT else 0
        self.AckError = bool(self.fault_ns) and (now - self.fault_ns) % SECOND > SECOND // 2
        self.EnableAxis = not self.Error
        self.SpeedSp = 600.0 if self.seconds % 4 < 2 else -600.0
        super().cycle(inputs, outputs, now)
