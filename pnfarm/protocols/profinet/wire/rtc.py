"""Status of a cyclic real-time PDU (IEC 61158-6-10, APDU-Status), for who shows frames.

The engine packs and unpacks them in compiled code (:mod:`pnfarm.engine.channels.rtc`).
"""

from __future__ import annotations

from enum import IntEnum

__all__ = [
    "IOXS_BAD_BY_CONTROLLER",
    "IOXS_BAD_BY_DEVICE",
    "IOXS_BAD_BY_SLOT",
    "IOXS_BAD_BY_SUBSLOT",
    "STATUS_LENGTH",
    "DataStatus",
]

#: Cycle counter, data status and transfer status at the frame's end.
STATUS_LENGTH = 4

# IO provider and consumer status: bit 7 is good, bits 6 and 5 say who found it bad, bit 0 that another follows.
IOXS_BAD_BY_SUBSLOT = 0x00
IOXS_BAD_BY_SLOT = 0x20
IOXS_BAD_BY_DEVICE = 0x40
IOXS_BAD_BY_CONTROLLER = 0x60


class DataStatus(IntEnum):
    """The octet that says how the whole frame's data are meant; bits 3 and 6 are reserved."""

    PRIMARY = 0x01
    REDUNDANCY = 0x02
    VALID = 0x04
    RUN = 0x10
    #: Station problem indicator, 1 is normal operation.
    NO_PROBLEM = 0x20
    IGNORE = 0x80
    GOOD = PRIMARY | VALID | RUN | NO_PROBLEM
