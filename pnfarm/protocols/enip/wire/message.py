"""Message Router requests and replies, and the Multiple_Service_Packet (CIP volume 1, chapter 2-4 and appendix A-4.10).

Request: ``Service u8, PathSize u8 (words), Path, Data``.  Reply: ``Service | 0x80, reserved u8, GeneralStatus u8,
ExtendedSize u8 (words), ExtendedStatus u16 ..., Data``.  A request keeps its path as octets, because a path that cannot
be read still has a service to be answered.
"""

from collections.abc import Iterable, Sequence
from typing import Annotated, Final

from pnfarm.errors import DecodeError
from pnfarm.protocols.enip.wire.epath import Segment, emit_epath
from pnfarm.wire.layout import Fixed, Length, List8, Rest, Structure, UInt8, UInt16
from pnfarm.wire.octets import Reader, Writer

__all__ = [
    "REPLY",
    "MessageReply",
    "MessageRequest",
    "emit_multiple_service",
    "message_request",
    "parse_multiple_service",
    "parse_reply",
    "parse_request",
]

#: Bit 7 of the service in a reply.
REPLY: Final = 0x80


class MessageRequest(Structure, little=True):
    """``path`` is a padded EPATH of whole words, at most 510 octets."""

    service: UInt8
    path: Annotated[bytes, Length("B", unit=2)]
    data: Rest = b""


class MessageReply(Structure, little=True):
    """``service`` is the request's, without bit 7; ``extended`` are the words after the general status."""

    service: Annotated[int, Fixed("Bx", lambda octet: octet & ~REPLY, lambda service: service | REPLY)]
    status: UInt8 = 0
    extended: List8[UInt16] = ()
    data: Rest = b""


def message_request(service: int, segments: Iterable[Segment], data: bytes = b"") -> MessageRequest:
    return MessageRequest(service, emit_epath(segments), data)


def parse_request(data: bytes) -> MessageRequest:
    """Raises ``short``, and ``bad-type`` for a reply."""
    if (service := Reader(data).u8()) & REPLY:
        raise DecodeError("bad-type", f"service 0x{service:02X} is a reply's")
    return MessageRequest.parse(data)


def parse_reply(data: bytes) -> MessageReply:
    """Raises ``short``, and ``bad-type`` for a request."""
    if not (service := Reader(data).u8()) & REPLY:
        raise DecodeError("bad-type", f"service 0x{service:02X} is a request's")
    return MessageReply.parse(data)


def parse_multiple_service(data: bytes) -> tuple[bytes, ...]:
    """The requests, or the replies, of a packet: ``Count u16, Offset u16 ..., messages``.

    Offsets count from the first octet of ``data`` and rise; each message ends where the next one begins.  Raises
    ``short``, ``bad-length`` for offsets that do not rise or lie outside.
    """
    r = Reader(data, little=True)
    count = r.u16()
    offsets = [r.u16() for _ in range(count)]
    ends = [*offsets[1:], len(data)][:count]
    first = 2 + 2 * count
    for offset, end in zip(offsets, ends, strict=True):
        if not first <= offset < end <= len(data):
            raise DecodeError("bad-length", f"a message from offset {offset} to {end} of {len(data)}")
        first = end
    return tuple(bytes(data[offset:end]) for offset, end in zip(offsets, ends, strict=True))


def emit_multiple_service(messages: Sequence[bytes]) -> bytes:
    w = Writer(little=True).u16(len(messages))
    offset = 2 + 2 * len(messages)
    for message in messages:
        w.u16(offset)
        offset += len(message)
    for message in messages:
        w.bytes(message)
    return w.getvalue()
