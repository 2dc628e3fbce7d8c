"""Slots of a process image: one per signal, whatever telegram carries it.

A telegram is a list of 16-bit words; each word names the slot that it fills or shows.  The names are
PROFIdrive's (signal numbers of the profile's table and of the vendors' manuals map to these slots in
each model's data).  ``SETPOINT_*`` travel from the controller to the drive, ``ACTUAL_*`` back.

A word of a telegram is coded ``slot * 4 + part``: the part says which half of the slot's 32 bits it is.
"""

from __future__ import annotations

__all__ = [
    "ACTUAL_SLOTS",
    "ASSEMBLY",
    "ASSEMBLY_WORDS",
    "FIRST_SENT_BACK",
    "FIRST_SHOWN",
    "PART_HIGH",
    "PART_LOW",
    "PART_WORD",
    "SENT_BACK",
    "SETPOINT_SLOTS",
    "SHOWN",
    "SLOTS",
    "WORD_NONE",
    "word_code",
]

#: Slots in each direction of an image; a word's code is one octet.
SLOTS = 64

#: A 16-bit signal.
PART_WORD = 0
#: Bits 31..16 of a 32-bit signal: comes first on the wire (big-endian).
PART_HIGH = 1
#: Bits 15..0 of a 32-bit signal.
PART_LOW = 2
#: A word that no signal uses: ignored when received, sent as zero.
WORD_NONE = SLOTS * 4 - 1

# Controller to drive.
STW1 = 0
NSOLL_A = 1
SATZANW = 2
STW2 = 3
MDI_TARPOS = 4
MDI_VELOCITY = 5
MDI_ACC = 6
MDI_DEC = 7
MDI_MOD = 8
HOME_DIST = 9
MT_FEEDRATE = 10
#: A set point of the current or the torque; the drive's model defines which of them, and its unit.
TORQUE_SETPOINT = 11
HOME_MODE = 12
DRV_ACC = 13
DRV_DEC = 14
NSOLL_B = 15
G1_STW = 16
POS_STW1 = 17
POS_STW2 = 18
OVERRIDE = 19
XSOLL_A = 20
TARPOS_A = 21
VELOCITY_A = 22
XERR = 23
KPC = 24
#: A velocity set point of 32 bits in the drive's own units.
REF_SPEED = 25
TORQUE_LIMIT_POSITIVE = 26
TORQUE_LIMIT_NEGATIVE = 27
#: Velocities of jogging in the drive's own units.
JOG_SPEED_1 = 28
JOG_SPEED_2 = 29
#: By how much the torque limits are reduced.
MOMRED = 30
G2_STW = 31
M_ADD1 = 32
M_LIMIT_POS = 33
M_LIMIT_NEG = 34
#: Digital outputs of a control unit; what a drive sends is in the slot of the same name below.
A_DIGITAL_SET = 35

# Both directions, before all others: the parameter channel (:mod:`pnfarm.drives.profiles.profidrive.pkw`).
#: Identifier, subindex and length.
PKW_HEAD = 60
#: The value.
PKW_VALUE = 61

# Both directions, of a drive whose cyclic data are an assembly: its double words, least significant octet first on the
# wire.  Such a drive has no telegram, and so nothing that is sent back or shown.
ASSEMBLY = 38
#: Number of them: 64 octets.
ASSEMBLY_WORDS = 16

# Drive to controller.
ZSW1 = 0
NIST_A = 1
AKTSATZ = 2
ZSW2 = 3
XIST_A = 4
ITIST_GLATT = 5
XIST_ERROR = 6
DRIVE_MOTION_STATUS = 7
DRIVE_INPUTS = 8
NIST_B = 9
G1_ZSW = 10
G1_XIST1 = 11
G1_XIST2 = 12
POS_ZSW1 = 13
POS_ZSW2 = 14
MELDW = 15
FAULT_CODE = 16
WARN_CODE = 17
#: The actual velocity in 32 bits in the drive's own units.
ACT_SPEED = 18
E_DIGITAL = 19
A_DIGITAL = 20
#: The torque-building current, A, as the bits of a float32.
ACT_CURRENT = 21
#: The torque in the unit of the drive's torque signals.
ACT_TORQUE = 22
# Smoothed values, and the share of the torque that is allowed.
NIST_A_GLATT = 23
IAIST_GLATT = 24
MIST_GLATT = 25
PIST_GLATT = 26
AIST_GLATT = 27
MELD_NAMUR = 28
M_ACT = 29
G2_ZSW = 30
G2_XIST1 = 31
G2_XIST2 = 32
#: Position and velocity as the bits of float32.
XIST_F = 33
VIST_F = 34
#: First slot of the set points that are sent back as received: one slot for each of :data:`SENT_BACK`.
FIRST_SENT_BACK = 38
#: First slot of the stored parameters that a mapping shows.
FIRST_SHOWN = 56
#: Number of those.
SHOWN = 4

SETPOINT_SLOTS: dict[str, int] = {
    "STW1": STW1,
    "NSOLL_A": NSOLL_A,
    "SATZANW": SATZANW,
    "STW2": STW2,
    "MDI_TARPOS": MDI_TARPOS,
    "MDI_VELOCITY": MDI_VELOCITY,
    "MDI_ACC": MDI_ACC,
    "MDI_DEC": MDI_DEC,
    "MDI_MOD": MDI_MOD,
    "HOME_DIST": HOME_DIST,
    "MT_FEEDRATE": MT_FEEDRATE,
    "IL_CMD_FIELDBUS": TORQUE_SETPOINT,
    "REF_TORQUE": TORQUE_SETPOINT,
    "HOME_MODE": HOME_MODE,
    "DRV_ACC": DRV_ACC,
    "DRV_DEC": DRV_DEC,
    "NSOLL_B": NSOLL_B,
    "G1_STW": G1_STW,
    "POS_STW1": POS_STW1,
    "POS_STW2": POS_STW2,
    "OVERRIDE": OVERRIDE,
    "XSOLL_A": XSOLL_A,
    "TARPOS_A": TARPOS_A,
    "VELOCITY_A": VELOCITY_A,
    "XERR": XERR,
    "KPC": KPC,
    "REF_SPEED": REF_SPEED,
    "TORQUE_LIMIT_POSITIVE": TORQUE_LIMIT_POSITIVE,
    "TORQUE_LIMIT_NEGATIVE": TORQUE_LIMIT_NEGATIVE,
    "JOG_SPEED_1": JOG_SPEED_1,
    "JOG_SPEED_2": JOG_SPEED_2,
    "MOMRED": MOMRED,
    "G2_STW": G2_STW,
    "M_ADD1": M_ADD1,
    "M_LIMIT_POS": M_LIMIT_POS,
    "M_LIMIT_NEG": M_LIMIT_NEG,
    # of encoders, control units and infeeds, and of another telegram of the positioner
    "STW2_ENC": STW2,
    "CU_STW1": STW2,
    "E_STW1": STW1,
    "A_DIGITAL": A_DIGITAL_SET,
    "POS_STW": POS_STW2,
    # float32 in place of the whole numbers
    "MDI_TARPOS_F": MDI_TARPOS,
    "MDI_VELOCITY_F": MDI_VELOCITY,
    "MDI_ACC_F": MDI_ACC,
    "MDI_DEC_F": MDI_DEC,
    "PKW_HEAD": PKW_HEAD,
    "PKW_VALUE": PKW_VALUE,
}
#: Set points that a drive can send back, in the order of their slots.
SENT_BACK = (
    STW1, STW2, REF_SPEED, XSOLL_A, SATZANW, TARPOS_A, VELOCITY_A, DRV_ACC, DRV_DEC, TORQUE_LIMIT_POSITIVE,
    TORQUE_LIMIT_NEGATIVE, XERR, KPC, NSOLL_B, G1_STW, TORQUE_SETPOINT, JOG_SPEED_1, JOG_SPEED_2,
)  # fmt: skip
ACTUAL_SLOTS: dict[str, int] = {
    "ZSW1": ZSW1,
    "NIST_A": NIST_A,
    "AKTSATZ": AKTSATZ,
    "ZSW2": ZSW2,
    "XIST_A": XIST_A,
    "ITIST_GLATT": ITIST_GLATT,
    "XIST_ERROR": XIST_ERROR,
    "DRIVE_MOTION_STATUS": DRIVE_MOTION_STATUS,
    "DRIVE_INPUTS": DRIVE_INPUTS,
    "NIST_B": NIST_B,
    "G1_ZSW": G1_ZSW,
    "G1_XIST1": G1_XIST1,
    "G1_XIST2": G1_XIST2,
    "POS_ZSW1": POS_ZSW1,
    "POS_ZSW2": POS_ZSW2,
    "MELDW": MELDW,
    "FAULT_CODE": FAULT_CODE,
    "WARN_CODE": WARN_CODE,
    "ACT_SPEED": ACT_SPEED,
    "E_DIGITAL": E_DIGITAL,
    "A_DIGITAL": A_DIGITAL,
    "ACT_CURRENT": ACT_CURRENT,
    "ACT_TORQUE": ACT_TORQUE,
    "NIST_A_GLATT": NIST_A_GLATT,
    "IAIST_GLATT": IAIST_GLATT,
    "MIST_GLATT": MIST_GLATT,
    "PIST_GLATT": PIST_GLATT,
    "AIST_GLATT": AIST_GLATT,
    "MELD_NAMUR": MELD_NAMUR,
    "M_ACT": M_ACT,
    "G2_ZSW": G2_ZSW,
    "G2_XIST1": G2_XIST1,
    "G2_XIST2": G2_XIST2,
    "XIST_F": XIST_F,
    "VIST_F": VIST_F,
    "ZSW2_ENC": ZSW2,
    "CU_ZSW1": ZSW2,
    "E_ZSW1": ZSW1,
    "POS_ZSW": POS_ZSW2,
    "PKW_HEAD": PKW_HEAD,
    "PKW_VALUE": PKW_VALUE,
    **{
        f"{name}_BACK": FIRST_SENT_BACK + SENT_BACK.index(slot)
        for name, slot in SETPOINT_SLOTS.items()
        if slot in SENT_BACK
    },
    **{f"SHOWN_{place}": FIRST_SHOWN + place for place in range(SHOWN)},
}


def word_code(slot: int, part: int = PART_WORD) -> int:
    """The code of one telegram word; see the module's docstring."""
    if not 0 <= slot < SLOTS or part not in {PART_WORD, PART_HIGH, PART_LOW}:
        raise ValueError(f"no such word: slot {slot}, part {part}")
    return slot * 4 + part
