"""Bodies of connectionless RPC's control PDUs: fack, cl_cancel and cancel_ack (C706 12.5.3).

Integers follow the header's data representation, as everywhere in connectionless RPC.
"""

from __future__ import annotations

from dataclasses import dataclass

from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.wire.rpc.pdu import read_u16, read_u32, write_u16, write_u32
from pnfarm.wire.octets import Reader, Writer

__all__ = [
    "CancelAckBody",
    "CancelBody",
    "FackBody",
    "emit_cancel",
    "emit_cancel_ack",
    "emit_fack",
    "parse_cancel",
    "parse_cancel_ack",
    "parse_fack",
]

# --- body of fack, and of a nocall that reports what has arrived (C706 12.5.3.4) --------------------------------


@dataclass(frozen=True, slots=True)
class FackBody:
    """What a receiver of fragments says about itself; versions 0 and 1 share this layout.

    ``window_size`` is in units of 1024 octets, ``max_tsdu`` and ``max_fragment_size`` in octets; ``serial`` is the
    serial number of the PDU that asked.
    """

    window_size: int
    max_tsdu: int
    max_fragment_size: int
    serial: int
    selective: tuple[int, ...] = ()
    version: int = 1


def parse_fack(body: bytes, *, little_endian: bool) -> FackBody | None:
    """Read the body; ``None`` when it is empty, as several peers send it.

    Raises :class:`DecodeError` (``short``, ``bad-version``, ``trailing``).
    """
    if not body:
        return None
    reader = Reader(body)
    version = reader.u8()
    if version > 1:
        raise DecodeError("bad-version", f"fack body version {version}, 0 and 1 are known")
    reader.skip(1)
    window = read_u16(reader, little=little_endian)
    max_tsdu, max_fragment = read_u32(reader, little=little_endian), read_u32(reader, little=little_endian)
    serial, count = read_u16(reader, little=little_endian), read_u16(reader, little=little_endian)
    if count * 4 > reader.remaining:
        raise DecodeError("short", f"{count} selective acknowledgement words, {reader.remaining} octets left")
    selective = tuple(read_u32(reader, little=little_endian) for _ in range(count))
    # one stack always sends a single word of selective acknowledgement, with a count of 0
    if reader.remaining not in {0, 4}:
        reader.expect_end()
    return FackBody(window, max_tsdu, max_fragment, serial, selective, version)


def emit_fack(fack: FackBody, *, little_endian: bool) -> bytes:
    writer = Writer()
    writer.u8(fack.version).u8(0)
    write_u16(writer, fack.window_size, little=little_endian)
    write_u32(writer, fack.max_tsdu, little=little_endian)
    write_u32(writer, fack.max_fragment_size, little=little_endian)
    write_u16(writer, fack.serial, little=little_endian)
    write_u16(writer, len(fack.selective), little=little_endian)
    for word in fack.selective:
        write_u32(writer, word, little=little_endian)
    return writer.getvalue()


# --- cl_cancel and cancel_ack (C706 12.5.3.2, 12.5.3.3) ----------------------------------------------------------


@dataclass(frozen=True, slots=True)
class CancelBody:
    """What makes a cl_cancel a cancel; without a body it orphans the call."""

    cancel_id: int
    version: int = 0


@dataclass(frozen=True, slots=True)
class CancelAckBody:
    """The answer to a cancel: which one, and whether the call can still be cancelled."""

    cancel_id: int
    accepting: bool
    version: int = 0


def _read_version(reader: Reader, *, little: bool) -> int:
    version = read_u32(reader, little=little)
    if version:
        raise DecodeError("bad-version", f"cancel body version {version}, 0 is known")
    return version


def parse_cancel(body: bytes, *, little_endian: bool) -> CancelBody | None:
    """Read the body; ``None`` when it is empty, which orphans the call.

    Raises :class:`DecodeError` (``short``, ``bad-version``, ``trailing``).
    """
    if not body:
        return None
    reader = Reader(body)
    version, cancel_id = _read_version(reader, little=little_endian), read_u32(reader, little=little_endian)
    reader.expect_end()
    return CancelBody(cancel_id, version)


def emit_cancel(cancel: CancelBody, *, little_endian: bool) -> bytes:
    writer = Writer()
    for word in (cancel.version, cancel.cancel_id):
        write_u32(writer, word, little=little_endian)
    return writer.getvalue()


def parse_cancel_ack(body: bytes, *, little_endian: bool) -> CancelAckBody | None:
    """Read the body; ``None`` when it is empty, as it answers a cl_cancel without one.

    The boolean is one octet in NDR; a peer may pad it to four.  Raises :class:`DecodeError` (``short``,
    ``bad-version``, ``trailing``).
    """
    if not body:
        return None
    reader = Reader(body)
    version, cancel_id = _read_version(reader, little=little_endian), read_u32(reader, little=little_endian)
    accepting = bool(reader.u8())
    if reader.remaining == 3:
        accepting = any(reader.rest()) or accepting
    reader.expect_end()
    return CancelAckBody(cancel_id, accepting, version)


def emit_cancel_ack(ack: CancelAckBody, *, little_endian: bool) -> bytes:
    """Nine octets."""
    writer = Writer()
    for word in (ack.version, ack.cancel_id):
        write_u32(writer, word, little=little_endian)
    return writer.u8(int(ack.accepting)).getvalue()
