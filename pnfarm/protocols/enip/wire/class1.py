"""Datagrams of a class 1 connection (CIP volume 2, chapter 3-2.2.1), as tools and tests read and write them.

A list of two items: the sequenced address, and connected data that begin with the 16-bit sequence count.  Data from
an originator may go on with the run/idle header, 32 bits whose lowest is 1 for run.  The engine has its own, compiled
form.
"""

from __future__ import annotations

from dataclasses import dataclass

from pnfarm.errors import DecodeError
from pnfarm.protocols.enip.wire.cpf import ConnectedData, SequencedAddress, emit_items, parse_items
from pnfarm.wire.octets import Reader, Writer

__all__ = ["Class1Pdu", "emit_class1", "parse_class1"]


@dataclass(frozen=True, slots=True)
class Class1Pdu:
    """``sequence`` numbers the datagrams, ``count`` the data; ``header`` is the run/idle header, None without one."""

    connection_id: int
    sequence: int
    count: int
    data: bytes
    header: int | None = None

    @property
    def run(self) -> bool:
        """Whether the sender is in run mode; data without a header count as run."""
        return self.header is None or bool(self.header & 1)


def parse_class1(data: bytes, header: bool = False) -> Class1Pdu:
    """``header`` says whether a run/idle header is expected.  Raises ``short``, ``bad-type`` for other items."""
    match parse_items(data):
        case (SequencedAddress(connection_id, sequence), ConnectedData(payload), *_):
            r = Reader(payload, little=True)
            count = r.u16()
            return Class1Pdu(connection_id, sequence, count, header=r.u32() if header else None, data=r.rest())
    raise DecodeError("bad-type", "no sequenced address with connected data")


def emit_class1(pdu: Class1Pdu) -> bytes:
    w = Writer(little=True).u16(pdu.count)
    if pdu.header is not None:
        w.u32(pdu.header)
    payload = w.bytes(pdu.data).getvalue()
    return emit_items((SequencedAddress(pdu.connection_id, pdu.sequence), ConnectedData(payload)))
