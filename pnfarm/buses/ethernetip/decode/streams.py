"""The encapsulation's messages out of the TCP segments of a capture.

Each direction of a connection has a sequence of octets.  A segment may hold several messages or a part of one, may come
twice, and may come before one that it follows.  A capture may begin in the middle, or lack segments that the peers had:
then the messages are found again at a segment that begins like one.  All memory is bounded.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

from pnfarm.captures.stations import Bounded
from pnfarm.errors import DecodeError
from pnfarm.protocols.enip.wire.encapsulation import (
    HEADER_OCTETS,
    LONGEST_DATA,
    Command,
    EncapsulationStatus,
    parse_header,
)

if TYPE_CHECKING:
    from collections.abc import Iterator
    from ipaddress import IPv4Address

    from pnfarm.wire.tcp import TcpSegment

__all__ = ["End", "Streams", "begins_message"]

#: Source or destination: address and port.
End = tuple["IPv4Address", int]

#: Directions whose octets are collected at a time.
MOST_STREAMS: Final = 256
#: What one direction keeps of octets that came too early: segments, and octets.
MOST_EARLY: Final = 64
MOST_EARLY_OCTETS: Final = 32_768
_NUMBERS: Final = 1 << 32
_HALF: Final = 1 << 31
_COMMANDS: Final = frozenset(int(command) for command in Command)
_STATUSES: Final = frozenset(int(status) for status in EncapsulationStatus)


def begins_message(data: bytes) -> bool:
    """Whether octets begin like a message: a command and a status that there are, no options."""
    try:
        header = parse_header(data[:HEADER_OCTETS])
    except DecodeError:
        return False
    return header.command in _COMMANDS and header.status in _STATUSES and not header.options


@dataclass(slots=True)
class _Stream:
    """``due`` is the number of the octet after ``octets``; None while no message has been found."""

    due: int | None = None
    octets: bytearray = field(default_factory=bytearray)
    early: dict[int, bytes] = field(default_factory=dict)

    def lose(self) -> None:
        """Forget the rest of a message that cannot be completed."""
        self.due = None
        self.octets.clear()


class Streams:
    """Give it the segments in the order of the capture."""

    def __init__(self) -> None:
        self._streams: Bounded[tuple[End, End], _Stream] = Bounded(MOST_STREAMS)
        #: Segments whose octets had been there before.
        self.repeated = 0

    def take(self, source: End, destination: End, segment: TcpSegment) -> Iterator[tuple[bytes, bool]]:
        """Messages that this segment completes, as octets, and whether octets are missing before each."""
        key = (source, destination)
        if segment.opens:
            self._streams[key] = _Stream((segment.sequence + 1) % _NUMBERS)
            return
        stream = self._streams.get(key)
        if stream is None:
            if not segment.data:
                return
            stream = self._streams[key] = _Stream()
        if segment.data:
            yield from self._messages(stream, segment.sequence, segment.data)
        if segment.ends or segment.resets:
            self._streams.pop(key, None)
            if segment.resets:
                self._streams.pop((destination, source), None)

    def acknowledged(self, source: End, destination: End, segment: TcpSegment) -> Iterator[tuple[bytes, bool]]:
        """Messages of the other direction after octets that its receiver has, and the capture lacks."""
        stream = self._streams.get((destination, source))
        if stream is None or stream.due is None or not stream.early or not segment.acknowledges:
            return
        if 0 < (segment.acknowledged - stream.due) % _NUMBERS < _HALF:
            yield from self._skip(stream)

    def _messages(self, stream: _Stream, number: int, data: bytes) -> Iterator[tuple[bytes, bool]]:
        if stream.due is None:
            yield from self._search(stream, number, data, missing=False)
            return
        ahead = (number - stream.due) % _NUMBERS
        if ahead >= _HALF:
            known = _NUMBERS - ahead
            if known >= len(data):
                # one octet that is known is a keep-alive
                self.repeated += len(data) > 1
                return
            data, ahead = data[known:], 0
        if ahead:
            stream.early.setdefault(number, data)
            if len(stream.early) > MOST_EARLY or sum(map(len, stream.early.values())) > MOST_EARLY_OCTETS:
                yield from self._skip(stream)
            return
        yield from self._append(stream, data, missing=False)
        while stream.due is not None:
            due = stream.due
            first = next((begin for begin in stream.early if not 0 < (begin - due) % _NUMBERS < _HALF), None)
            if first is None:
                return
            data = stream.early.pop(first)
            known = (due - first) % _NUMBERS
            if known < len(data):
                yield from self._append(stream, data[known:], missing=False)

    def _append(self, stream: _Stream, data: bytes, *, missing: bool) -> Iterator[tuple[bytes, bool]]:
        assert stream.due is not None
        stream.due = (stream.due + len(data)) % _NUMBERS
        stream.octets += data
        while len(stream.octets) >= HEADER_OCTETS:
            length = parse_header(bytes(stream.octets[:HEADER_OCTETS])).length
            if length > LONGEST_DATA:
                # no message: where it ends is not known
                yield bytes(stream.octets), missing
                stream.lose()
                return
            if len(stream.octets) < HEADER_OCTETS + length:
                return
            message = bytes(stream.octets[: HEADER_OCTETS + length])
            del stream.octets[: HEADER_OCTETS + length]
            yield message, missing
            missing = False

    def _search(self, stream: _Stream, number: int, data: bytes, *, missing: bool) -> Iterator[tuple[bytes, bool]]:
        """Begin again at a segment that begins like a message."""
        if begins_message(data):
            stream.due = number
            yield from self._append(stream, data, missing=missing)

    def _skip(self, stream: _Stream) -> Iterator[tuple[bytes, bool]]:
        """Octets are missing: go on at the first segment after the gap that begins like a message."""
        due = stream.due or 0
        early = sorted(stream.early.items(), key=lambda entry: (entry[0] - due) % _NUMBERS)
        stream.early.clear()
        stream.lose()
        missing = True
        for number, data in early:
            found = (
                self._search(stream, number, data, missing=missing)
                if stream.due is None
                else self._messages(stream, number, data)
            )
            for message, _ in found:
                yield message, missing
                missing = False
