"""Data of DP-V1: reading, writing, connections of class 2.

Guideline 2.082; Moog MSD manual 9.1, tables 9.2 and 9.3.
"""

from dataclasses import dataclass
from enum import IntEnum
from typing import Annotated, Final

from pnfarm.errors import DecodeError
from pnfarm.protocols.profibus.wire.sized import Sized
from pnfarm.wire.layout import Fixed, Rest, Structure, UInt8, UInt16

__all__ = [
    "ERROR_DECODE_DPV1", "MOST_USER_DATA", "NEGATIVE", "Abort", "AbortReason", "AbortSubnet", "Access",
    "ErrorCode1", "Function", "Initiate", "InitiateAnswer", "Refusal", "ResourceManager", "parse_access",
    "parse_initiate", "parse_refusal",
]  # fmt: skip

#: Bit of the function number in a negative response.
NEGATIVE: Final = 0x80
#: Error_Decode: the codes are those of DPV1.
ERROR_DECODE_DPV1: Final = 128
#: Longest data of one access.
MOST_USER_DATA: Final = 240


class Function(IntEnum):
    """Function_Num: the first octet."""

    IDLE = 0x48
    DATA_TRANSPORT = 0x51
    RESOURCE_MANAGER = 0x56
    INITIATE = 0x57
    ABORT = 0x58
    ALARM_ACK = 0x5C
    READ = 0x5E
    WRITE = 0x5F


class ErrorCode1(IntEnum):
    """Error_Code_1: class in the upper four bits, code below (table 4 of the guideline)."""

    READ_ERROR = 0xA0
    WRITE_ERROR = 0xA1
    MODULE_FAILURE = 0xA2
    VERSION_CONFLICT = 0xA8
    FEATURE_NOT_SUPPORTED = 0xA9
    INVALID_INDEX = 0xB0
    WRITE_LENGTH = 0xB1
    INVALID_SLOT = 0xB2
    TYPE_CONFLICT = 0xB3
    INVALID_AREA = 0xB4
    STATE_CONFLICT = 0xB5
    ACCESS_DENIED = 0xB6
    INVALID_RANGE = 0xB7
    INVALID_PARAMETER = 0xB8
    INVALID_TYPE = 0xB9
    READ_CONSTRAINT = 0xC0
    WRITE_CONSTRAINT = 0xC1
    RESOURCE_BUSY = 0xC2
    RESOURCE_UNAVAILABLE = 0xC3


class AbortSubnet(IntEnum):
    """Subnet of an Abort: where it comes from."""

    NO = 0
    LOCAL = 1
    REMOTE = 2


class AbortReason(IntEnum):
    """Instance (bits 4 and 5: FDL, MSAC2, user) and reason of an Abort."""

    FDL_UE = 0x01
    FDL_RR = 0x02
    FDL_RS = 0x03
    FDL_NR = 0x09
    FDL_NO_ANSWER = 0x0F
    SEQUENCE = 0x11  # a service in a state that does not allow it
    FUNCTION = 0x12  # a function that is not allowed now
    TIMEOUT = 0x13
    RECEIVED = 0x14  # a PDU that cannot be read
    INVALID = 0x15  # an unknown service
    SEND_TIMEOUT = 0x16  # a send time-out that is not supported
    ADDRESS = 0x17  # an additional address that is not supported
    CONFIRMATION = 0x18  # still waiting for a confirmation
    USER = 0x20


# -- Read, Write, Data_Transport --------------------------------------------------------------------------------------


class Access(Structure):
    """Request or positive response; of a Read request ``length`` is what is asked for, and there are no data."""

    function: UInt8
    slot: UInt8
    index: UInt8
    length: UInt8
    data: Rest = b""


def parse_access(data: bytes) -> Access:
    """Raises :class:`DecodeError`; data that are not as many as announced are an error."""
    if len(data) < 4:
        raise DecodeError("short", f"{len(data)} octets")
    access = Access.parse(data)
    if access.data and len(access.data) != access.length:
        raise DecodeError("bad-length", f"{len(access.data)} octets of data, {access.length} announced")
    return access


class Refusal(Structure, wire="function decode code1 code2"):
    """Negative response: ``function`` is that of the request with :data:`NEGATIVE`."""

    function: UInt8
    code1: UInt8
    code2: UInt8 = 0
    decode: UInt8 = ERROR_DECODE_DPV1


def parse_refusal(data: bytes) -> Refusal:
    """Raises :class:`DecodeError`."""
    if len(data) != 4 or not data[0] & NEGATIVE:
        raise DecodeError("bad-length", f"{len(data)} octets are no negative response")
    return Refusal.parse(data)


# -- connections of class 2 -------------------------------------------------------------------------------------------

#: A time in steps of 10 ms.
_Time = Annotated[int, Fixed("H", lambda steps: steps * 10_000_000, lambda time_ns: time_ns // 10_000_000)]


class ResourceManager(
    Sized,
    function=Function.RESOURCE_MANAGER,
    sizes=range(4, 5),
    text="{} octets are no answer of a resource manager",
):
    """What the slave's resource manager answers to an Initiate: the access point of the connection, time in ns."""

    sap: UInt8
    send_timeout_ns: _Time


@dataclass(frozen=True, slots=True)
class Initiate:
    """A connection is asked for; ``send_timeout_ns`` in steps of 10 ms.

    ``s_type`` and ``d_type`` say whether ``source`` and ``destination`` (API, SCL) have more than these two octets.
    """

    send_timeout_ns: int
    features: tuple[int, int] = (1, 0)
    profile_features: tuple[int, int] = (0, 0)
    profile: int = 0
    s_type: int = 0
    d_type: int = 0
    source: bytes = bytes(2)
    destination: bytes = bytes(2)

    def emit(self) -> bytes:
        return (
            bytes((Function.INITIATE, 0, 0, 0))
            + (self.send_timeout_ns // 10_000_000).to_bytes(2, "big")
            + bytes((*self.features, *self.profile_features))
            + self.profile.to_bytes(2, "big")
            + bytes((self.s_type, len(self.source), self.d_type, len(self.destination)))
            + self.source
            + self.destination
        )


def parse_initiate(data: bytes) -> Initiate:
    """Raises :class:`DecodeError`."""
    if len(data) < 16 or data[0] != Function.INITIATE:
        raise DecodeError("short", f"{len(data)} octets are no Initiate")
    s_type, s_length, d_type, d_length = data[12:16]
    addresses = data[16:]
    if s_length + d_length != len(addresses):
        raise DecodeError("bad-length", f"{len(addresses)} octets of addresses, {s_length} and {d_length} announced")
    return Initiate(
        int.from_bytes(data[4:6], "big") * 10_000_000,
        (data[6], data[7]),
        (data[8], data[9]),
        int.from_bytes(data[10:12], "big"),
        s_type,
        d_type,
        addresses[:s_length],
        addresses[s_length:],
    )


class InitiateAnswer(
    Sized,
    function=Function.INITIATE,
    sizes=range(8, 1 << 16),
    text="{} octets are no answer to Initiate",
    reason="short",
):
    """``longest``: octets of user data of one PDU (Max_Len_Data_Unit)."""

    longest: UInt8
    features: tuple[UInt8, UInt8] = (1, 0)
    profile_features: tuple[UInt8, UInt8] = (0, 0)
    profile: UInt16 = 0
    tail: Rest = b"\x00\x02\x00\x02\x00\x00\x00\x00"


class Abort(Sized, function=Function.ABORT, sizes=range(3, 1 << 16), text="{} octets are no Abort", reason="short"):
    """A connection ends; ``reason``: instance and code."""

    subnet: UInt8
    reason: UInt8
    detail: Rest = b""
