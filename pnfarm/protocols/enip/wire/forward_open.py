"""Services of the Connection Manager: Forward_Open, Large_Forward_Open, Forward_Close, Unconnected_Send
(CIP volume 1, chapter 3-5.5).

What each holds behind the path of its request; the path of these requests themselves is the Connection Manager's.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import Final

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
    "emit_forward_close",
    "emit_forward_close_reply",
    "emit_forward_open",
    "emit_forward_open_reply",
    "emit_forward_refusal",
    "emit_unconnected_send",
    "parse_forward_close",
    "parse_forward_close_reply",
    "parse_forward_open",
    "parse_forward_open_reply",
    "parse_forward_refusal",
    "parse_unconnected_send",
]

#: Production triggers, bits 4 to 6 of transport class and trigger.
CYCLIC: Final = 0


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
    def from_int(cls, value: int, large: bool) -> NetworkParameters:
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
    def from_int(cls, value: int) -> TransportClass:
        return cls(value & 0x0F, value >> 4 & 7, bool(value & 0x80))

    def __int__(self) -> int:
        return self.server << 7 | self.trigger << 4 | self.transport


@dataclass(frozen=True, slots=True)
class Triad:
    """What names a connection for both ends: connection serial number, originator's vendor and serial number."""

    serial: int
    vendor_id: int
    originator_serial: int


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
    r = Reader(data)
    tick_time, ticks, o_to_t_id, t_to_o_id = r.u8(), r.u8(), r.u32le(), r.u32le()
    triad = _parse_triad(r)
    multiplier = r.u8()
    r.skip(3)
    o_to_t_rpi, o_to_t = r.u32le(), NetworkParameters.from_int(r.u32le() if large else r.u16le(), large)
    t_to_o_rpi, t_to_o = r.u32le(), NetworkParameters.from_int(r.u32le() if large else r.u16le(), large)
    transport = TransportClass.from_int(r.u8())
    path = r.bytes(2 * r.u8())
    r.expect_end()
    return ForwardOpen(
        triad, o_to_t_id, t_to_o_id, o_to_t_rpi, o_to_t, t_to_o_rpi, t_to_o, transport, path,
        multiplier, tick_time, ticks, large,
    )  # fmt: skip


def emit_forward_open(value: ForwardOpen) -> bytes:
    w = Writer().u8(value.tick_time).u8(value.ticks).u32le(value.o_to_t_id).u32le(value.t_to_o_id)
    _emit_triad(w, value.triad).u8(value.timeout_multiplier).zeros(3)
    for rpi, parameters in ((value.o_to_t_rpi_us, value.o_to_t), (value.t_to_o_rpi_us, value.t_to_o)):
        number = parameters.to_int(value.large)
        w.u32le(rpi)
        _ = w.u32le(number) if value.large else w.u16le(number)
    return w.u8(int(value.transport)).u8(_words(value.path)).bytes(value.path).getvalue()


def _parse_triad(r: Reader) -> Triad:
    return Triad(r.u16le(), r.u16le(), r.u32le())


def _emit_triad(w: Writer, triad: Triad) -> Writer:
    return w.u16le(triad.serial).u16le(triad.vendor_id).u32le(triad.originator_serial)


def _words(data: bytes) -> int:
    if len(data) % 2:
        raise ValueError(f"{len(data)} octets are not whole words")
    return len(data) // 2


# Replies


@dataclass(frozen=True, slots=True)
class ForwardOpenReply:
    """The ids that are in force, and the packet intervals that the target keeps, in microseconds."""

    o_to_t_id: int
    t_to_o_id: int
    triad: Triad
    o_to_t_api_us: int
    t_to_o_api_us: int
    application: bytes = b""


def parse_forward_open_reply(data: bytes) -> ForwardOpenReply:
    """Raises ``short``, ``trailing``."""
    r = Reader(data)
    o_to_t_id, t_to_o_id = r.u32le(), r.u32le()
    triad, o_to_t, t_to_o = _parse_triad(r), r.u32le(), r.u32le()
    size = 2 * r.u8()
    r.skip(1)
    value = ForwardOpenReply(o_to_t_id, t_to_o_id, triad, o_to_t, t_to_o, r.bytes(size))
    r.expect_end()
    return value


def emit_forward_open_reply(value: ForwardOpenReply) -> bytes:
    w = _emit_triad(Writer().u32le(value.o_to_t_id).u32le(value.t_to_o_id), value.triad)
    w.u32le(value.o_to_t_api_us).u32le(value.t_to_o_api_us)
    return w.u8(_words(value.application)).u8(0).bytes(value.application).getvalue()


@dataclass(frozen=True, slots=True)
class ForwardRefusal:
    """Data of a negative reply to Forward_Open and Forward_Close; ``remaining_path`` in words."""

    triad: Triad
    remaining_path: int = 0


def parse_forward_refusal(data: bytes) -> ForwardRefusal:
    """Raises ``short``, ``trailing``."""
    r = Reader(data)
    value = ForwardRefusal(_parse_triad(r), r.u8())
    r.skip(1)
    r.expect_end()
    return value


def emit_forward_refusal(value: ForwardRefusal) -> bytes:
    return _emit_triad(Writer(), value.triad).u8(value.remaining_path).u8(0).getvalue()


# Forward_Close


@dataclass(frozen=True, slots=True)
class ForwardClose:
    triad: Triad
    path: bytes
    tick_time: int = 0x0A
    ticks: int = 0x0E


@dataclass(frozen=True, slots=True)
class ForwardCloseReply:
    triad: Triad
    application: bytes = b""


def parse_forward_close(data: bytes) -> ForwardClose:
    """Raises ``short``, ``trailing``."""
    r = Reader(data)
    tick_time, ticks, triad = r.u8(), r.u8(), _parse_triad(r)
    size = 2 * r.u8()
    r.skip(1)
    value = ForwardClose(triad, r.bytes(size), tick_time, ticks)
    r.expect_end()
    return value


def emit_forward_close(value: ForwardClose) -> bytes:
    w = _emit_triad(Writer().u8(value.tick_time).u8(value.ticks), value.triad)
    return w.u8(_words(value.path)).u8(0).bytes(value.path).getvalue()


def parse_forward_close_reply(data: bytes) -> ForwardCloseReply:
    """Raises ``short``, ``trailing``."""
    r = Reader(data)
    triad, size = _parse_triad(r), 2 * r.u8()
    r.skip(1)
    value = ForwardCloseReply(triad, r.bytes(size))
    r.expect_end()
    return value


def emit_forward_close_reply(value: ForwardCloseReply) -> bytes:
    w = _emit_triad(Writer(), value.triad).u8(_words(value.application)).u8(0)
    return w.bytes(value.application).getvalue()


# Unconnected_Send


@dataclass(frozen=True, slots=True)
class UnconnectedSend:
    """A message request for the end of a route."""

    message: bytes
    route: bytes = b""
    tick_time: int = 0x0A
    ticks: int = 0x0E


def parse_unconnected_send(data: bytes) -> UnconnectedSend:
    """Raises ``short``, ``trailing``."""
    r = Reader(data)
    tick_time, ticks, size = r.u8(), r.u8(), r.u16le()
    message = r.bytes(size)
    r.skip(size % 2)
    words = r.u8()
    r.skip(1)
    value = UnconnectedSend(message, r.bytes(2 * words), tick_time, ticks)
    r.expect_end()
    return value


def emit_unconnected_send(value: UnconnectedSend) -> bytes:
    w = Writer().u8(value.tick_time).u8(value.ticks).u16le(len(value.message)).bytes(value.message)
    return w.zeros(len(value.message) % 2).u8(_words(value.route)).u8(0).bytes(value.route).getvalue()
