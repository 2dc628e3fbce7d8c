"""Bodies of connectionless RPC's control PDUs: fack, cl_cancel and cancel_ack (C706 12.5.3).

Integers follow the header's data representation, as everywhere in connectionless RPC.
"""

from typing import Annotated

from pnfarm.errors import DecodeError
from pnfarm.wire.layout import Fixed, List16, Pad, Structure, UInt8, UInt16, UInt32
from pnfarm.wire.octets import Reader

__all__ = ["CancelAckBody", "CancelBody", "FackBody", "parse_cancel", "parse_cancel_ack", "parse_fack"]

# --- body of fack, and of a nocall that reports what has arrived (C706 12.5.3.4) --------------------------------


class FackBody(Structure, wire="version window_size max_tsdu max_fragment_size serial selective"):
    """What a receiver of fragments says about itself; versions 0 and 1 share this layout.

    ``window_size`` is in units of 1024 octets, ``max_tsdu`` and ``max_fragment_size`` in octets; ``serial`` is the
    serial number of the PDU that asked.
    """

    window_size: Annotated[UInt16, Pad(1)]
    max_tsdu: UInt32
    max_fragment_size: UInt32
    serial: UInt16
    selective: List16[UInt32] = ()
    version: UInt8 = 1


def parse_fack(body: bytes, *, little_endian: bool) -> FackBody | None:
    """Read the body; ``None`` when it is empty, as several peers send it.

    Raises :class:`DecodeError` (``short``, ``bad-version``, ``trailing``).
    """
    if not body:
        return None
    if body[0] > 1:
        raise DecodeError("bad-version", f"fack body version {body[0]}, 0 and 1 are known")
    reader = Reader(body, little_endian)
    fack = FackBody.read(reader)
    # one stack always sends a single word of selective acknowledgement, with a count of 0
    if reader.remaining not in {0, 4}:
        reader.expect_end()
    return fack


# --- cl_cancel and cancel_ack (C706 12.5.3.2, 12.5.3.3) ----------------------------------------------------------


class CancelBody(Structure, wire="version cancel_id"):
    """What makes a cl_cancel a cancel; without a body it orphans the call."""

    cancel_id: UInt32
    version: UInt32 = 0


class CancelAckBody(Structure, wire="version cancel_id accepting"):
    """The answer to a cancel: which one, and whether the call can still be cancelled."""

    cancel_id: UInt32
    accepting: Annotated[bool, Fixed("B", bool, int)]
    version: UInt32 = 0


def _check_version(body: bytes, *, little: bool) -> None:
    if version := Reader(body, little).u32():
        raise DecodeError("bad-version", f"cancel body version {version}, 0 is known")


def parse_cancel(body: bytes, *, little_endian: bool) -> CancelBody | None:
    """Read the body; ``None`` when it is empty, which orphans the call.

    Raises :class:`DecodeError` (``short``, ``bad-version``, ``trailing``).
    """
    if not body:
        return None
    _check_version(body, little=little_endian)
    return CancelBody.parse(body, little_endian=little_endian)


def parse_cancel_ack(body: bytes, *, little_endian: bool) -> CancelAckBody | None:
    """Read the body; ``None`` when it is empty, as it answers a cl_cancel without one.

    The boolean is one octet in NDR; a peer may pad it to four.  Raises :class:`DecodeError` (``short``,
    ``bad-version``, ``trailing``).
    """
    if not body:
        return None
    _check_version(body, little=little_endian)
    if len(body) == 12:
        body = body[:8] + bytes((any(body[8:]),))
    return CancelAckBody.parse(body, little_endian=little_endian)
