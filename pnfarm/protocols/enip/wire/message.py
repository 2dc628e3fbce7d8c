"""Message Router requests and replies, and the Multiple_Service_Packet (CIP volume 1, chapter 2-4 and appendix A-4.10).

Request: ``Service u8, PathSize u8 (words), Path, Data``.  Reply: ``Service | 0x80, reserved u8, GeneralStatus u8,
ExtendedSize u8 (words), ExtendedStatus u16 ..., Data``.  A request keeps its path as octets, because a path that cannot
be read still has a service to be answered.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from pnfarm.errors import DecodeError
from pnfarm.protocols.enip.wire.epath import Segment, emit_epath
from pnfarm.wire.octets import Reader, Writer

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

__all__ = [
    "REPLY",
    "MessageReply",
    "MessageRequest",
    "emit_multiple_service",
    "emit_reply",
    "emit_request",
    "message_request",
    "parse_multiple_service",
    "parse_reply",
    "parse_request",
]

#: Bit 7 of the service in a reply.
REPLY: Final = 0x80


@dataclass(frozen=True, slots=True)
class MessageRequest:
    """``path`` is a padded EPATH of whole words, at most 510 octets."""

    service: int
    path: bytes
    data: bytes = b""


@dataclass(frozen=True, slots=True)
class MessageReply:
    """``service`` is the request's, without bit 7; ``extended`` are the words behind the general status."""

    service: int
    status: int = 0
    extended: tuple[int, ...] = ()
    data: bytes = b""


def message_request(service: int, segments: Iterable[Segment], data: bytes = b"") -> MessageRequest:
    return MessageRequest(service, emit_epath(segments), data)


def parse_request(data: bytes) -> MessageRequest:
    """Raises ``short``, and ``bad-type`` for a reply."""
    r = Reader(data)
    service = r.u8()
    if service & REPLY:
        raise DecodeError("bad-type", f"service 0x{service:02X} is a reply's")
    return MessageRequest(service, r.bytes(2 * r.u8()), r.rest())


def emit_request(request: MessageRequest) -> bytes:
    if len(request.path) % 2:
        raise ValueError(f"a path has whole words, not {len(request.path)} octets")
    return Writer().u8(request.service).u8(len(request.path) // 2).bytes(request.path).bytes(request.data).getvalue()


def parse_reply(data: bytes) -> MessageReply:
    """Raises ``short``, and ``bad-type`` for a request."""
    r = Reader(data)
    service = r.u8()
    if not service & REPLY:
        raise DecodeError("bad-type", f"service 0x{service:02X} is a request's")
    r.skip(1)
    status = r.u8()
    extended = tuple(r.u16le() for _ in range(r.u8()))
    return MessageReply(service & 0x7F, status, extended, r.rest())


def emit_reply(reply: MessageReply) -> bytes:
    w = Writer().u8(reply.service | REPLY).u8(0).u8(reply.status).u8(len(reply.extended))
    for word in reply.extended:
        w.u16le(word)
    return w.bytes(reply.data).getvalue()


def parse_multiple_service(data: bytes) -> tuple[bytes, ...]:
    """The requests, or the replies, of a packet: ``Count u16, Offset u16 ..., messages``.

    Offsets count from the first octet of ``data`` and rise; each message ends where the next one begins.  Raises
    ``short``, ``bad-length`` for offsets that do not rise or lie outside.
    """
    r = Reader(data)
    count = r.u16le()
    offsets = [r.u16le() for _ in range(count)]
    ends = [*offsets[1:], len(data)][:count]
    first = 2 + 2 * count
    for offset, end in zip(offsets, ends, strict=True):
        if not first <= offset < end <= len(data):
            raise DecodeError("bad-length", f"a message from offset {offset} to {end} of {len(data)}")
        first = end
    return tuple(bytes(data[offset:end]) for offset, end in zip(offsets, ends, strict=True))


def emit_multiple_service(messages: Sequence[bytes]) -> bytes:
    w = Writer().u16le(len(messages))
    offset = 2 + 2 * len(messages)
    for message in messages:
        w.u16le(offset)
        offset += len(message)
    for message in messages:
        w.bytes(message)
    return w.getvalue()
