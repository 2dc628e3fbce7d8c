"""The two frames of the toy bus, behind an Ethernet header (IEEE 802 local experimental EtherType 1)."""

from __future__ import annotations

import struct
from dataclasses import dataclass

from pnfarm.errors import DecodeError
from pnfarm.wire.ethernet import EthernetFrame, emit_ethernet

ETHERTYPE = 0x88B5
ORDER, REPORT = 1, 2
_ORDER = struct.Struct(">BBh")
_REPORT = struct.Struct(">BHh")


@dataclass(frozen=True, slots=True)
class Order:
    """Controller to drive: whether to run, and how fast in rpm."""

    enable: bool
    speed: int


@dataclass(frozen=True, slots=True)
class Report:
    """Drive to controller: the drive's status word, and how fast it is in rpm."""

    status: int
    speed: int


def emit_order(order: Order) -> bytes:
    return _ORDER.pack(ORDER, order.enable, order.speed)


def parse_order(data: bytes) -> Order:
    """Raises :class:`DecodeError`; what stands behind it is padding."""
    if len(data) < _ORDER.size or data[0] != ORDER or data[1] > 1:
        raise DecodeError("no order")
    _, enable, speed = _ORDER.unpack_from(data)
    return Order(bool(enable), speed)


def emit_report(report: Report) -> bytes:
    return _REPORT.pack(REPORT, report.status, report.speed)


def parse_report(data: bytes) -> Report:
    """Raises :class:`DecodeError`; what stands behind it is padding."""
    if len(data) < _REPORT.size or data[0] != REPORT:
        raise DecodeError("no report")
    return Report(*_REPORT.unpack_from(data)[1:])


def frame(destination: bytes, source: bytes, data: bytes) -> bytes:
    return emit_ethernet(EthernetFrame(destination, source, ETHERTYPE, data))
