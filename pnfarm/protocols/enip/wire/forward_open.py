"""Services of the Connection Manager: Forward_Open, Large_Forward_Open, Forward_Close, Unconnected_Send
(CIP volume 1, chapter 3-5.5).

What each holds after the path of its request; the path of these requests themselves is the Connection Manager's.
"""

from dataclasses import dataclass
from enum import IntEnum
from typing import Annotated, Final

from pnfarm.wire.layout import Fixed, Length, Structure, UInt8, UInt16, UInt32
from pnfarm.wire.octets import Reader, Writer

__all__ = [
    "CYCLIC",
    "ConnectionType",
    "ForwardClose",
    "ForwardCloseReply",
    "ForwardOpen",
    "ForwardOpenReply",
    "ForwardRefusal",
    "NetworkParameters",
    "Priority",
    "TransportClass",
    "Triad",
    "UnconnectedSend",
    "emit_forward_open",
    "parse_forward_open",
]

#: Production triggers, bits 4 to 6 of transport class and trigger.
CYCLIC: Final = 0
#: Octets after a number of words, and after this number and a reserved octet.
_PATH: Final = Length("B", unit=2)
_Words = Annotated[bytes, Length("Bx", unit=2)]


class ConnectionType(IntEnum):
    """Bits 13 and 14 of the network connection parameters (29 and 30 of the large ones)."""

    NULL = 0
    MULTICAST = 1
    POINT_TO_POINT = 2
    RESERVED = 3


class Priority(IntEnum):
    """Bits 10 and 11 (26 and 27)."""

    LOW = 0
    HIGH = 1
    SCHEDULED = 2
    URGENT = 3


@dataclass(frozen=True, slots=True)
class NetworkParameters:
    """One direction of a connection; ``size`` in octets with sequence count and run/idle header.

    ``reserved`` are the bits without a meaning, so that what came can be sent again.
    """

    size: int
    kind: int = ConnectionType.POINT_TO_POINT
    priority: int = Priority.SCHEDULED
    variable: bool = False
    redundant_owner: bool = False
    reserved: int = 0

    @classmethod
    def from_int(cls, value: int, large: bool) -> "NetworkParameters":
        high = value >> 16 if large else value
        size = value & (0xFFFF if large else 0x1FF)
        reserved = high & (0x11FF if large else 0x1000)
        return cls(size, high >> 13 & 3, high >> 10 & 3, bool(high & 0x200), bool(high & 0x8000), reserved)

    def to_int(self, large: bool) -> int:
        """Raises :class:`ValueError` for a size that does not fit."""
        if not 0 <= self.size <= (0xFFFF if large else 0x1FF):
            raise ValueError(f"a size of {self.size} octets needs a Large_Forward_Open")
        high = self.redundant_owner << 15 | self.kind << 13 | self.priority << 10 | self.variable << 9 | self.reserved
        return high << 16 | self.size if large else high | self.size


@dataclass(frozen=True, slots=True)
class TransportClass:
    """``trigger`` 0 cyclic, 1 change of state, 2 application; ``server`` is bit 7, the direction."""

    transport: int
    trigger: int = CYCLIC
    server: bool = False

    @classmethod
    def from_int(cls, value: int) -> "TransportClass":
        return cls(value & 0x0F, value >> 4 & 7, bool(value & 0x80))

    def __int__(self) -> int:
        return self.server << 7 | self.trigger << 4 | self.transport


class Triad(Structure, little=True):
    """What names a connection for both ends: connection serial number, originator's vendor and serial number."""

    serial: UInt16
    vendor_id: UInt16
    originator_serial: UInt32


@dataclass(frozen=True, slots=True)
class ForwardOpen:
    """RPIs in microseconds; the timeout of data is ``rpi << 2 + timeout_multiplier``.

    ``tick_time`` and ``ticks`` bound the request's own time: ``ticks << tick_time & 15`` ms.
    """

    triad: Triad
    o_to_t_id: int
    t_to_o_id: int
    o_to_t_rpi_us: int
    o_to_t: NetworkParameters
    t_to_o_rpi_us: int
    t_to_o: NetworkParameters
    transport: TransportClass
    path: bytes
    timeout_multiplier: int = 0
    tick_time: int = 0x0A
    ticks: int = 0x0E
    large: bool = False


def parse_forward_open(data: bytes, large: bool = False) -> ForwardOpen:
    """Raises ``short``, ``trailing``."""
    r = Reader(data, little=True)
    tick_time, ticks, o_to_t_id, t_to_o_id = r.u8(), r.u8(), r.u32(), r.u32()
    triad = Triad.read(r)
    multiplier = r.u8()
    r.skip(3)
    o_to_t_rpi, o_to_t = r.u32(), NetworkParameters.from_int(r.u32() if large else r.u16(), large)
    t_to_o_rpi, t_to_o = r.u32(), NetworkParameters.from_int(r.u32() if large else r.u16(), large)
    transport = TransportClass.from_int(r.u8())
    path = _PATH.read(r, {})
    r.expect_end()
    return ForwardOpen(
        triad, o_to_t_id, t_to_o_id, o_to_t_rpi, o_to_t, t_to_o_rpi, t_to_o, transport, path,
        multiplier, tick_time, ticks, large,
    )  # fmt: skip


def emit_forward_open(value: ForwardOpen) -> bytes:
    w = Writer(little=True).u8(value.tick_time).u8(value.ticks).u32(value.o_to_t_id).u32(value.t_to_o_id)
    value.triad.write(w)
    w.u8(value.timeout_multiplier).zeros(3)
    for rpi, parameters in ((value.o_to_t_rpi_us, value.o_to_t), (value.t_to_o_rpi_us, value.t_to_o)):
        number = parameters.to_int(value.large)
        w.u32(rpi)
        _ = w.u32(number) if value.large else w.u16(number)
    _PATH.write(w.u8(int(value.transport)), value.path)
    return w.getvalue()


# Replies


class ForwardOpenReply(Structure, little=True):
    """The ids that are in force, and the packet intervals that the target keeps, in microseconds."""

    o_to_t_id: UInt32
    t_to_o_id: UInt32
    triad: Triad
    o_to_t_api_us: UInt32
    t_to_o_api_us: UInt32
    application: _Words = b""


class ForwardRefusal(Structure, little=True):
    """Data of a negative reply to Forward_Open and Forward_Close; ``remaining_path`` in words."""

    triad: Triad
    remaining_path: Annotated[int, Fixed("Bx")] = 0


# Forward_Close


class ForwardClose(Structure, little=True, wire="tick_time ticks triad path"):
    triad: Triad
    path: _Words
    tick_time: UInt8 = 0x0A
    ticks: UInt8 = 0x0E


class ForwardCloseReply(Structure, little=True):
    triad: Triad
    application: _Words = b""


# Unconnected_Send


class UnconnectedSend(Structure, little=True, wire="tick_time ticks message route"):
    """A message request for the end of a route."""

    message: Annotated[bytes, Length("H", even=2)]
    route: _Words = b""
    tick_time: UInt8 = 0x0A
    ticks: UInt8 = 0x0E
