"""Texts for ChannelErrorType and ExtChannelErrorType (IEC 61158-6-10), and for the drive profile's own types.

0x9000 to 0x9FFF belong to the profile of the submodule's API; the PROFIdrive ones as in the
MSD manual, table 9.23.
"""

from __future__ import annotations

__all__ = [
    "CHANNEL_ERROR_TYPES",
    "EXT_CHANNEL_ERROR_TYPES",
    "PROFIDRIVE_API",
    "PROFIDRIVE_ERROR_TYPES",
    "describe_error_type",
]

CHANNEL_ERROR_TYPES = {
    0x0001: "short circuit",
    0x0002: "undervoltage",
    0x0003: "overvoltage",
    0x0004: "overload",
    0x0005: "overtemperature",
    0x0006: "wire break",
    0x0007: "upper limit value exceeded",
    0x0008: "lower limit value exceeded",
    0x0009: "error",
    0x000A: "simulation active",
    0x000F: "parameter missing",
    0x0010: "parametrisation fault",
    0x0011: "power supply fault",
    0x0012: "fuse blown or open",
    0x0013: "manufacturer-specific",
    0x0014: "ground fault",
    0x0015: "reference point lost",
    0x0016: "process event lost or sampling error",
    0x0017: "threshold warning",
    0x0018: "output disabled",
    0x0019: "functional safety event",
    0x001A: "external fault",
    0x001F: "temporary fault",
    0x0040: "mismatch of safety destination address",
    0x0041: "safety destination address not valid",
    0x0042: "safety source address not valid",
    0x0043: "safety watchdog time is 0 ms",
    0x0048: "safety device diagnosis, see its manual",
    0x004D: "safety transmission error: data inconsistent",
    0x004E: "safety transmission error: timeout",
    0x004F: "acknowledgement needed to enable the channels",
    0x8000: "data transmission impossible",
    0x8001: "remote mismatch",
    0x8002: "media redundancy mismatch",
    0x8003: "sync mismatch",
    0x8004: "isochronous mode mismatch",
    0x8005: "multicast CR mismatch",
    0x8007: "fibre optic mismatch",
    0x8008: "network component function mismatch",
    0x8009: "time mismatch",
    0x800A: "dynamic frame packing mismatch",
    0x800B: "media redundancy with planned duplication mismatch",
    0x800C: "system redundancy mismatch",
    0x800D: "multiple interface mismatch",
}

#: By ChannelErrorType.
EXT_CHANNEL_ERROR_TYPES = {
    0x8000: {0x8000: "link down", 0x8001: "MAU type mismatch", 0x8002: "line delay mismatch"},
    0x8001: {
        0x8000: "peer's station name mismatch",
        0x8001: "peer's port name mismatch",
        0x8002: "peer RT_CLASS_3 mismatch",
        0x8003: "peer MAU type mismatch",
        0x8004: "peer MRP domain mismatch",
        0x8005: "no peer detected",
        0x8007: "peer line delay mismatch",
        0x8008: "peer PTCP mismatch",
        0x8009: "peer preamble length mismatch",
        0x800A: "peer fragmentation mismatch",
        0x800B: "peer MRP interconnection domain mismatch",
    },
    0x8002: {0x8000: "manager role fail", 0x8001: "ring open", 0x8003: "multiple manager"},
    0x8003: {0x8000: "no sync message received", 0x8003: "jitter out of boundary"},
    0x8004: {0x8000: "output time failure", 0x8001: "input time failure", 0x8002: "master sign of life failure"},
    0x8005: {0x8000: "multicast consumer CR timed out", 0x8001: "address resolution failed"},
    0x8007: {0x8000: "power budget"},
    0x8008: {0x8000: "frame dropped, no resource"},
}

#: ExtChannelErrorType at any ChannelErrorType below 0x8000: the entry stands for several.
_ACCUMULATIVE_INFO = 0x8000

PROFIDRIVE_API = 0x3A00
PROFIDRIVE_ERROR_TYPES = {
    0x9000: "microcontroller software or hardware",
    0x9001: "mains supply",
    0x9002: "low voltage supply",
    0x9003: "DC link overvoltage",
    0x9004: "power electronics",
    0x9005: "overtemperature of the electronic device",
    0x9006: "earth or ground fault",
    0x9007: "motor overload",
    0x9008: "fieldbus system",
    0x9009: "safety channel",
    0x900A: "feedback",
    0x900B: "internal communication",
    0x900C: "infeed",
    0x900D: "brake resistor",
    0x900E: "line filter",
    0x900F: "external",
    0x9010: "technology",
    0x9011: "engineering",
    0x9012: "other errors",
    0x9013: "auxiliary device",
}


def describe_error_type(error_type: int, ext_error_type: int = 0, api: int = 0) -> str:
    """One line, such as ``remote mismatch: no peer detected``; a code without a text is given as a number."""
    known = CHANNEL_ERROR_TYPES.get(error_type)
    if known is None and api == PROFIDRIVE_API:
        known = PROFIDRIVE_ERROR_TYPES.get(error_type)
    text = known if known is not None else f"error type 0x{error_type:04X}"
    if not ext_error_type:
        return text
    if error_type < 0x8000 and ext_error_type == _ACCUMULATIVE_INFO:
        return f"{text}: accumulative info"
    more = EXT_CHANNEL_ERROR_TYPES.get(error_type, {}).get(ext_error_type)
    return f"{text}: {more if more is not None else f'0x{ext_error_type:04X}'}"
