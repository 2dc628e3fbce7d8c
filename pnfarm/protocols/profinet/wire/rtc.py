"""Cyclic real-time PDU (IEC 61158-6-10, RTC-PDU and APDU-Status), for tests and tools.

The engine packs and unpacks its frames in compiled code; this codec is its readable counterpart.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntFlag

from pnfarm.errors import DecodeError
from pnfarm.wire.octets import Reader, Writer

__all__ = [
    "IOXS_BAD_BY_CONTROLLER",
    "IOXS_BAD_BY_DEVICE",
    "IOXS_BAD_BY_SLOT",
    "IOXS_BAD_BY_SUBSLOT",
    "IOXS_EXTENSION",
    "IOXS_GOOD",
    "MAXIMUM_DATA",
    "MINIMUM_DATA",
    "STATUS_LENGTH",
    "DataStatus",
    "RtcPdu",
    "emit_rtc",
    "pad_data",
    "parse_rtc",
]

#: Octets of data (the C_SDU) that a frame carries: fewer are padded.
MINIMUM_DATA = 40
MAXIMUM_DATA = 1440
#: Cycle counter, data status and transfer status at the frame's end.
STATUS_LENGTH = 4

# IO provider and consumer status: bit 7 is good, bits 6 and 5 say who found it bad, bit 0 that another follows.
IOXS_GOOD = 0x80
IOXS_BAD_BY_SUBSLOT = 0x00
IOXS_BAD_BY_SLOT = 0x20
IOXS_BAD_BY_DEVICE = 0x40
IOXS_BAD_BY_CONTROLLER = 0x60
IOXS_EXTENSION = 0x01


class DataStatus(IntFlag):
    """The octet that says how the whole frame's data are meant; bits 3 and 6 are reserved."""

    PRIMARY = 0x01
    REDUNDANCY = 0x02
    VALID = 0x04
    RUN = 0x10
    #: Station problem indicator, 1 is normal operation.
    NO_PROBLEM = 0x20
    IGNORE = 0x80
    GOOD = PRIMARY | VALID | RUN | NO_PROBLEM


@dataclass(frozen=True, slots=True)
class RtcPdu:
    """One cyclic frame behind its EtherType.

    ``data`` are IO data with their provider and consumer status, laid out by the IOCR's frame offsets;
    ``cycle_counter`` counts 31.25 us and wraps at 65536.
    """

    frame_id: int
    data: bytes
    cycle_counter: int
    data_status: DataStatus = DataStatus.GOOD
    transfer_status: int = 0


def pad_data(data: bytes) -> bytes:
    """Data lengthened with zeros to the 40 octets that a frame has at least."""
    return data.ljust(MINIMUM_DATA, b"\0")


def parse_rtc(data: bytes | bytearray | memoryview) -> RtcPdu:
    """PDU from an Ethernet payload; the last four octets are its status. ``short`` below six octets."""
    reader = Reader(data)
    frame_id = reader.u16()
    length = reader.remaining - STATUS_LENGTH
    if length < 0:
        raise DecodeError("short", f"{reader.remaining} octets left for the APDU status")
    return RtcPdu(
        frame_id=frame_id,
        data=reader.bytes(length),
        cycle_counter=reader.u16(),
        data_status=DataStatus(reader.u8()),
        transfer_status=reader.u8(),
    )


def emit_rtc(pdu: RtcPdu) -> bytes:
    """Octets of a PDU exactly as built: below :data:`MINIMUM_DATA` a receiver looks for the status elsewhere."""
    writer = Writer().u16(pdu.frame_id).bytes(pdu.data).u16(pdu.cycle_counter)
    return writer.u8(pdu.data_status).u8(pdu.transfer_status).getvalue()
