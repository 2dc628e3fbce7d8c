"""Types of commands and responses in the assemblies, with their data (AKD EtherNet/IP manual 6.2.2, 6.2.3).

The type of a command is in octet 2 of the command assembly, that of the response asked for in octet 3; octet 3 of the
response assembly has the one that it is.  The firmware has the numbers from here, the decoder the names, and the page
of the drive the whole list; a test compares the list with what the drive takes and refuses.

The manual numbers most of them.  Numbers that it does not give are those of the position controller device profile.
"""

from __future__ import annotations

from dataclasses import dataclass

__all__ = [
    "ACCELERATION", "ACTUAL_TORQUE", "AXIS", "COMMAND_OCTETS", "COMMAND_TYPES", "DECELERATION", "ERRORS", "ERROR_TYPE",
    "JOG_MOVE", "NOT_READY", "NO_ATTRIBUTE", "NO_AXIS", "NO_COMMAND_TYPE", "NO_RESPONSE_AXIS", "NO_RESPONSE_TYPE",
    "OUT_OF_RANGE", "PARAMETER", "POSITION_MOVE", "RESPONSE_NUMBERS", "RESPONSE_OCTETS", "RESPONSE_TYPES",
    "SET_ATTRIBUTE", "TARGET_POSITION", "TARGET_VELOCITY", "TORQUE", "WRONG_MODE", "MessageType", "Octets",
]  # fmt: skip

#: The only axis: bits 5 to 7 beside each type.
AXIS = 1
# Commands.
TARGET_POSITION = 0x01
TARGET_VELOCITY = 0x02
ACCELERATION = 0x03
DECELERATION = 0x04
TORQUE = 0x05
POSITION_MOVE = 0x06
JOG_MOVE = 0x07
SET_ATTRIBUTE = 0x1B
PARAMETER = 0x1F
# Responses.
NO_DATA = 0x00
ACTUAL_TORQUE = 0x05
ERROR_TYPE = 0x14

# Errors: general status, additional code in bits 8 to 15.
NO_AXIS = 0x0105
NO_RESPONSE_AXIS = 0x0205
NO_COMMAND_TYPE = 0x0108
NO_RESPONSE_TYPE = 0x0208
OUT_OF_RANGE = 0xFF09
WRONG_MODE = 0xFF0C  # OBJ_STATE_CONFLICT
NOT_READY = 0xFF10  # DEVICE_STATE_CONFLICT
NO_ATTRIBUTE = 0xFF14


@dataclass(frozen=True, slots=True)
class Octets:
    """A datum: its first and last octet in the assembly, its type as CIP names it."""

    first: int
    last: int
    kind: str
    unit: str
    meaning: str


@dataclass(frozen=True, slots=True)
class MessageType:
    """A command or a response.

    ``modes``: those in which a command is taken; ``begins``: those in which it begins a motion or a torque.
    ``source`` is of the number.
    """

    number: int
    name: str
    data: tuple[Octets, ...]
    does: str
    source: str
    note: str = ""
    modes: tuple[str, ...] = ()
    begins: tuple[str, ...] = ()


POSITIONS, PROFILES, CURRENT = "position units (EIP.POSUNIT)", "profile units (EIP.PROFUNIT)", "mA"
_EVERY = ("torque", "velocity", "position")
_PROFILE = "the manual gives no number: that of the position controller device profile"


def _one(unit: str, meaning: str) -> tuple[Octets]:
    """The datum of a type that has one."""
    return (Octets(4, 7, "DINT", unit, meaning),)


_RAMPS = (
    Octets(16, 19, "DINT", PROFILES, "acceleration, above 0"),
    Octets(20, 23, "DINT", PROFILES, "deceleration, above 0"),
)
_VALUE = Octets(24, 31, "as the attribute's or parameter's", "as the attribute's or parameter's", "the value to write")

#: Taken with the rising edge of Load/Start.
COMMAND_TYPES = (
    MessageType(
        TARGET_POSITION,
        "Target Position",
        _one(POSITIONS, "target, or distance with the bit Relative"),
        "sets attribute 6; in position mode begins a move at the target velocity (attribute 7), along the ramps loaded "
        "by 0x03 and 0x04, else HOME.ACC and HOME.DEC",
        "6.2.4",
        modes=_EVERY,
        begins=("position",),
    ),
    MessageType(
        TARGET_VELOCITY,
        "Target Velocity",
        _one(PROFILES, "velocity, not negative"),
        "sets attribute 7; in velocity mode begins a jog in the direction of the bit Direction, along the ramps loaded "
        "by 0x03 and 0x04, else DRV.ACC and DRV.DEC",
        "assumed",
        f"named in 6.2.2.2; {_PROFILE}",
        modes=_EVERY,
        begins=("velocity",),
    ),
    MessageType(
        ACCELERATION,
        "Acceleration",
        _one(PROFILES, "acceleration, above 0"),
        "is the ramp of 0x01 and 0x02 until the mode changes",
        "assumed",
        _PROFILE,
        modes=_EVERY,
    ),
    MessageType(
        DECELERATION,
        "Deceleration",
        _one(PROFILES, "deceleration, above 0"),
        "is the ramp of 0x01, 0x02 and Smooth Stop until the mode changes",
        "assumed",
        _PROFILE,
        modes=_EVERY,
    ),
    MessageType(
        TORQUE,
        "Torque",
        _one(CURRENT, "current, up to the motor's peak in either direction"),
        "is the set point of the torque",
        "6.2.2.3",
        modes=("torque",),
        begins=("torque",),
    ),
    MessageType(
        POSITION_MOVE,
        "Position Move",
        (
            Octets(8, 11, "DINT", POSITIONS, "target, or distance with the bit Relative"),
            Octets(12, 15, "DINT", PROFILES, "velocity, above 0"),
            *_RAMPS,
        ),
        "begins a move, which is motion task 0",
        "6.2.2.4",
        modes=("position",),
        begins=("position",),
    ),
    MessageType(
        JOG_MOVE,
        "Jog Move",
        (Octets(12, 15, "DINT", PROFILES, "velocity, not negative"), *_RAMPS),
        "turns at this velocity in the direction of the bit Direction, until another command or a stop",
        "6.2.2.5",
        modes=("velocity", "position"),
        begins=("velocity", "position"),
    ),
    MessageType(
        SET_ATTRIBUTE,
        "Set Attribute",
        (Octets(4, 5, "UINT", "", "attribute of the position controller (class 0x25)"), _VALUE),
        "sets the attribute",
        "6.2.2.6",
        modes=_EVERY,
    ),
    MessageType(
        PARAMETER,
        "Parameter",
        (
            Octets(4, 5, "UINT", "", "instance of the parameter"),
            Octets(6, 6, "USINT", "", "1 writes, any other value reads"),
            _VALUE,
        ),
        "writes the parameter, or reads it: the value is in octets 24 to 31 of the responses that follow, if Attribute "
        "to Get is 0",
        "6.2.2.7",
        modes=_EVERY,
    ),
)

#: In each response while they are asked for.
RESPONSE_TYPES = (
    MessageType(NO_DATA, "none", (), "nothing is asked for: octets 4 to 7 are 0", "6.2.4"),
    MessageType(
        ACTUAL_TORQUE, "Actual Torque", _one(CURRENT, "actual current of the motor"), "the actual torque", "6.2.3.4"
    ),
    MessageType(
        ERROR_TYPE,
        "Command/Response Error",
        (
            Octets(4, 4, "USINT", "", "error code: the general status of CIP"),
            Octets(5, 5, "USINT", "", "additional code"),
            Octets(6, 6, "USINT", "", "octet 2 of the command"),
            Octets(7, 7, "USINT", "", "octet 3 of the command"),
        ),
        "comes in place of the response that was asked for; asked for itself, it has zeros while there is no error",
        "6.2.3.5",
    ),
)
RESPONSE_NUMBERS = tuple(one.number for one in RESPONSE_TYPES)

_TYPE = "bits 0 to 4: type; bits 5 to 7: axis, 1"
_MAP = Octets(33, 33, "USINT", "", "map type: 0 static, 2 with the dynamic map")
_GET = "Attribute to Get: attribute of the position controller whose value is in octets 24 to 31 of each response"
#: Of every command, whatever its type.
COMMAND_OCTETS = (
    Octets(0, 0, "USINT", "", "control word"),
    Octets(1, 1, "USINT", "", "motion task that the bit Start Block begins"),
    Octets(2, 2, "USINT", "", f"command ({_TYPE})"),
    Octets(3, 3, "USINT", "", f"response asked for ({_TYPE})"),
    Octets(32, 32, "USINT", "", f"{_GET}; 0: none"),
    _MAP,
    Octets(36, 63, "as mapped", "as mapped", "set points of EIP.CMDMAP, with map type 2"),
)
#: Of every response.
RESPONSE_OCTETS = (
    Octets(0, 0, "USINT", "", "status word 1"),
    Octets(1, 1, "USINT", "", "motion task that is executed"),
    Octets(2, 2, "USINT", "", "status word 2"),
    Octets(3, 3, "USINT", "", f"response ({_TYPE})"),
    Octets(8, 11, "DINT", POSITIONS, "actual position"),
    Octets(12, 15, "DINT", PROFILES, "actual velocity"),
    Octets(16, 19, "UDINT", "", "motion status (DRV.MOTIONSTAT)"),
    Octets(24, 31, "as the attribute's or parameter's", "as the attribute's or parameter's",
           "value of the attribute asked for, or of the parameter that was read"),
    Octets(32, 32, "USINT", "", "Attribute to Get, as in the command"),
    _MAP,
    Octets(36, 63, "as mapped", "as mapped", "actual values of EIP.RSPMAP, with map type 2"),
)  # fmt: skip

#: Error -> what it is, and when it comes.
ERRORS = {
    NO_AXIS: ("the command's axis is not 1", "when a command is loaded"),
    NO_RESPONSE_AXIS: ("the response's axis is not 1", "when a command is loaded"),
    NO_COMMAND_TYPE: ("another command type", "when a command is loaded"),
    NO_RESPONSE_TYPE: ("another response type", "in each response while it is asked for"),
    OUT_OF_RANGE: ("a value out of its range", "when a command is loaded"),
    WRONG_MODE: ("the mode is another one, or a stop or Start Block is set", "when a command is loaded"),
    NOT_READY: ("the drive is not enabled, has a fault, is homing or stops, or a limit switch bars the way",
                "when a command is loaded"),
    NO_ATTRIBUTE: ("Attribute to Get is none that can be read", "in each response while it is asked for"),
}  # fmt: skip
