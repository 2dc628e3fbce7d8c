"""Messages of the kernel's routing socket (rtnetlink), and attributes in them; linux/netlink.h, linux/rtnetlink.h."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

__all__ = ["DONE", "ERROR", "REQUEST_ACK", "REQUEST_DUMP", "attribute", "attributes", "error_of", "messages", "request"]

_HEADER = struct.Struct("=IHHII")  # length, type, flags, sequence, port
_ATTRIBUTE = struct.Struct("=HH")  # length, type
ERROR, DONE = 2, 3
REQUEST_ACK, REQUEST_DUMP = 0x0005, 0x0301


def request(kind: int, flags: int, body: bytes, sequence: int = 1) -> bytes:
    return _HEADER.pack(_HEADER.size + len(body), kind, flags, sequence, 0) + body + bytes(-len(body) % 4)


def messages(data: bytes) -> Iterator[tuple[int, memoryview]]:
    """Type and content of the messages in a datagram; what is cut ends it."""
    view = memoryview(data)
    while len(view) >= _HEADER.size:
        length, kind, *_ = _HEADER.unpack_from(view)
        if length < _HEADER.size or length > len(view):
            return
        yield kind, view[_HEADER.size : length]
        view = view[length + 3 & ~3 :]


def error_of(content: memoryview) -> int:
    """What a message of type :data:`ERROR` says, as :mod:`errno` has it; 0: the request is carried out."""
    (code,) = struct.unpack_from("=i", content)
    return -int(code)


def attribute(kind: int, payload: bytes) -> bytes:
    length = _ATTRIBUTE.size + len(payload)
    return _ATTRIBUTE.pack(length, kind) + payload + bytes(-length % 4)


def attributes(data: memoryview) -> dict[int, bytes]:
    """Payloads by type; what is cut ends them."""
    found: dict[int, bytes] = {}
    while len(data) >= _ATTRIBUTE.size:
        length, kind = _ATTRIBUTE.unpack_from(data)
        if length < _ATTRIBUTE.size or length > len(data):
            break
        found[kind] = bytes(data[_ATTRIBUTE.size : length])
        data = data[length + 3 & ~3 :]
    return found
