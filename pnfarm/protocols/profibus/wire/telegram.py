"""Telegrams of the line (FDL; EN 50170 part 2, 4.7; Moog MSD manual table 9.1).

=====  =======================================================  ==============================
start  octets                                                   what it is
=====  =======================================================  ==============================
0x10   SD1 DA SA FC FCS ED                                      without data
0x68   SD2 LE LEr SD2 DA SA FC DATA(0..246) FCS ED              data of any length
0xA2   SD3 DA SA FC DATA(8) FCS ED                              eight octets of data
0xDC   SD4 DA SA                                                the token
0xE5   SC                                                       short acknowledgement
=====  =======================================================  ==============================

LE counts from DA to the last octet of data; FCS is their sum modulo 256.  The highest bit of an address says that an
access point (SAP) follows as an octet of the data, that of the destination first.

Eight octets of data may go as SD3 or as SD2: both are read; who emits says which (``fixed``).
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from functools import lru_cache
from typing import Final, NamedTuple

from pnfarm.errors import DecodeError

__all__ = [
    "BODY", "BROADCAST", "ED", "EXTENDED", "FCB", "FCV", "LONGEST_DATA", "LONGEST_TELEGRAM", "REQUEST", "SC", "SD1",
    "SD2", "SD3", "SD4", "Answer", "Line", "Request", "Sap", "ShortAck", "Telegram", "Token", "body_of_data",
    "checksum", "emit_data", "emit_telegram", "parse_telegram", "telegram_length",
]  # fmt: skip

SD1: Final = 0x10
SD2: Final = 0x68
SD3: Final = 0xA2
SD4: Final = 0xDC
SC: Final = 0xE5
#: Start delimiter of a request or an answer -> place of DA.
BODY: Final = {SD1: 1, SD2: 4, SD3: 1}
ED: Final = 0x16
#: All stations; no answer follows.
BROADCAST: Final = 127
#: Data with access points: LE has room for 249 octets, three of which are DA, SA and FC.
LONGEST_DATA: Final = 246
#: SD2, LE, LEr, SD2, 249 octets, FCS, ED.
LONGEST_TELEGRAM: Final = 255
#: Bit of an address: an access point follows in the data.
EXTENDED: Final = 0x80
_FIXED: Final = 8
#: Of an SD2 with DA, SA and FC and nothing else; of an SD3.
_SHORTEST_SD2: Final = 9
_WHOLE_SD3: Final = 14
_SD1: Final = bytes((SD1,))
_SD3: Final = bytes((SD3,))
_SHORT: Final = bytes((SC,))

# Bits of FC of a request.
REQUEST: Final = 0x40
FCB: Final = 0x20
FCV: Final = 0x10


class Request(IntEnum):
    """Function of a request: the lower four bits of FC (4.7.1.2, table 3a)."""

    SDA_LOW = 0x3
    SDN_LOW = 0x4
    SDA_HIGH = 0x5
    SDN_HIGH = 0x6
    DIAGNOSIS = 0x7
    FDL_STATUS = 0x9
    SRD_LOW = 0xC
    SRD_HIGH = 0xD
    IDENT = 0xE
    LSAP_STATUS = 0xF


class Answer(IntEnum):
    """Function of an answer: the lower four bits of FC (table 3b)."""

    OK = 0x0
    UE = 0x1  # user error
    RR = 0x2  # no resource
    RS = 0x3  # no service activated
    DL = 0x8  # data, low priority
    NR = 0x9  # no data
    DH = 0xA  # data, high priority
    RDL = 0xC  # data low, no resource
    RDH = 0xD  # data high, no resource


class Sap(IntEnum):
    """Access points of DP (8.3) and of its extensions (guideline 2.082); Data_Exchange has none."""

    SET_SLAVE_ADDRESS = 55
    READ_INPUTS = 56
    READ_OUTPUTS = 57
    GLOBAL_CONTROL = 58
    GET_CONFIGURATION = 59
    SLAVE_DIAGNOSIS = 60
    SET_PARAMETERS = 61
    CHECK_CONFIGURATION = 62
    #: That of the master in all requests above.
    MASTER = 62
    #: Reading and writing within the cyclic connection, on both sides; alarms would have 50.
    MSAC1 = 51
    MSAC1_ALARM = 50
    #: The slave's resource manager, and the master of class 2.
    RESOURCE_MANAGER = 49
    MASTER_2 = 50


class Telegram(NamedTuple):
    """SD1, SD2 or SD3; ``function`` is FC, ``data`` is without access points.

    A tuple, as one is made for each answer.
    """

    destination: int
    source: int
    function: int
    dsap: int | None = None
    ssap: int | None = None
    data: bytes = b""

    @property
    def is_request(self) -> bool:
        return bool(self.function & REQUEST)

    @property
    def code(self) -> int:
        """The function itself, without the bits above it."""
        return self.function & 0x0F


@dataclass(frozen=True, slots=True)
class Token:
    """The right to send."""

    destination: int
    source: int


@dataclass(frozen=True, slots=True)
class ShortAck:
    """Done, without data."""


#: Whatever is one telegram of the line.
Line = Telegram | Token | ShortAck


def checksum(octets: bytes | memoryview) -> int:
    """FCS of DA to the last octet of data."""
    return sum(octets) & 0xFF


def telegram_length(begin: bytes | bytearray | memoryview) -> int | None:
    """Octets of the telegram that begins here, None where they are too few to say.

    Raises :class:`DecodeError` where none begins.
    """
    if not begin:
        return None
    match begin[0]:
        case 0x10:
            return 6
        case 0xA2:
            return 14
        case 0xDC:
            return 3
        case 0xE5:
            return 1
        case 0x68:
            if len(begin) < 4:
                if len(begin) > 1 and not 4 <= begin[1] <= 249:
                    raise DecodeError("bad-length", f"LE is {begin[1]}")
                return None
            if begin[1] != begin[2] or begin[3] != SD2 or not 4 <= begin[1] <= 249:
                raise DecodeError("bad-length", f"LE {begin[1]}, LEr {begin[2]}")
            return begin[1] + 6
        case other:
            raise DecodeError("no-delimiter", f"0x{other:02x} begins no telegram")


def body_of_data(octets: bytes) -> int:
    """Place of DA in a telegram with data (SD2, SD3) that is whole and right, 0 for any other octets."""
    length = len(octets)
    if length > _SHORTEST_SD2 and octets[0] == SD2:
        if octets[1] != length - 6 or octets[2] != length - 6 or octets[3] != SD2:
            return 0
        begin = 4
    elif length == _WHOLE_SD3 and octets[0] == SD3:
        begin = 1
    else:
        return 0
    return begin if octets[-1] == ED and sum(octets[begin:-2]) & 0xFF == octets[-2] else 0


def emit_data(destination: int, source: int, function: int, data: bytes, *, fixed: bool = True) -> bytes:
    """:func:`emit_telegram` of a telegram with data and without access points, the fastest path."""
    body = bytes((destination, source, function)) + data
    end = bytes((sum(body) & 0xFF, ED))
    if fixed and len(data) == _FIXED:
        return _SD3 + body + end
    return bytes((SD2, len(body), len(body), SD2)) + body + end


@lru_cache(maxsize=1024)
def parse_telegram(octets: bytes) -> Line:
    """One whole telegram.  Raises :class:`DecodeError`.

    A telegram is parsed where octets are split, and again by whom it is for; polls are mostly like the ones before.
    """
    length = telegram_length(octets)
    if length is None or len(octets) < length:
        raise DecodeError("short", f"{len(octets)} octets")
    if len(octets) > length:
        raise DecodeError("long", f"{len(octets)} octets for a telegram of {length}")
    start = octets[0]
    if start == SC:
        return ShortAck()
    if start == SD4:
        return Token(octets[1] & 0x7F, octets[2] & 0x7F)
    if octets[-1] != ED:
        raise DecodeError("no-end", f"0x{octets[-1]:02x} instead of 0x16")
    body = octets[BODY[start] : -2]
    if checksum(body) != octets[-2]:
        raise DecodeError("bad-fcs", f"0x{octets[-2]:02x} instead of 0x{checksum(body):02x}")
    destination, source, function, data = body[0], body[1], body[2], body[3:]
    dsap = ssap = None
    if destination & EXTENDED:
        dsap, data = _access_point(data)
    if source & EXTENDED:
        ssap, data = _access_point(data)
    return Telegram(destination & 0x7F, source & 0x7F, function, dsap, ssap, data)


def _access_point(data: bytes) -> tuple[int, bytes]:
    if not data:
        raise DecodeError("short", "an access point is announced and missing")
    return data[0], data[1:]


def emit_telegram(telegram: Line, *, fixed: bool = True) -> bytes:
    """As SD1 without data, as SD3 with eight octets of it where ``fixed`` says so, else as SD2.

    Raises :class:`ValueError` for too much data.
    """
    if isinstance(telegram, ShortAck):
        return _SHORT
    if isinstance(telegram, Token):
        return bytes((SD4, telegram.destination, telegram.source))
    destination, source, function, dsap, ssap, data = telegram
    if dsap is not None:
        destination |= EXTENDED
    if ssap is not None:
        source |= EXTENDED
    if dsap is not None or ssap is not None:
        data = bytes(sap for sap in (dsap, ssap) if sap is not None) + data
    if len(data) > LONGEST_DATA:
        raise ValueError(f"{len(data)} octets of data; a telegram has at most {LONGEST_DATA}")
    if data:
        return emit_data(destination, source, function, data, fixed=fixed)
    body = bytes((destination, source, function))
    return _SD1 + body + bytes((checksum(body), ED))
