"""Inputs for parsers: random octets, and good ones with something wrong in them.

Everything comes from one :class:`random.Random`, so that an input can be made again from its seed.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from random import Random

__all__ = ["LIMIT", "mutated", "random_octets", "variation", "varied_lines", "varied_xml"]

#: No input is longer: two full datagrams.
LIMIT = 4096
INTERESTING = (
    0,
    1,
    2,
    3,
    4,
    6,
    7,
    8,
    0x10,
    0x1A,
    0x7F,
    0x80,
    0xFF,
    0x100,
    0x7FFF,
    0x8000,
    0xFFFE,
    0xFFFF,
    0x7FFFFFFF,
    0x80000000,
    0xFFFFFFFF,
)


def random_octets(rng: Random) -> bytes:
    """Mostly short; now and then all equal, which finds errors in counts."""
    length = rng.choice((0, 1, 2, rng.randrange(16), rng.randrange(64), rng.randrange(256), rng.randrange(1500)))
    if rng.random() < 0.1:
        return bytes([rng.choice((0, 1, 0x55, 0x80, 0xFF))]) * length
    return rng.randbytes(length)


def _flip(rng: Random, data: bytearray, _: Sequence[bytes]) -> None:
    if data:
        data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)


def _octet(rng: Random, data: bytearray, _: Sequence[bytes]) -> None:
    if data:
        data[rng.randrange(len(data))] = rng.choice(INTERESTING) & 0xFF


def _number(rng: Random, data: bytearray, _: Sequence[bytes]) -> None:
    """A number of two or four octets, in either order, becomes one that is easily taken wrong."""
    width = rng.choice((2, 4))
    if len(data) >= width:
        place = rng.randrange(len(data) - width + 1)
        data[place : place + width] = (rng.choice(INTERESTING) & (1 << 8 * width) - 1).to_bytes(
            width, rng.choice(("big", "little"))
        )


def _length(rng: Random, data: bytearray, _: Sequence[bytes]) -> None:
    """What looks like a length, because it fits what follows, becomes a little or much too large or small."""
    places = [
        place
        for place in range(min(len(data) - 1, 600))
        if 0 <= len(data) - place - 2 - int.from_bytes(data[place : place + 2], "big") <= 8
        or 0 < int.from_bytes(data[place : place + 2], "big") <= min(64, len(data) - place)
    ]
    if places:
        place = rng.choice(places)
        value = int.from_bytes(data[place : place + 2], "big") + rng.choice((-2, -1, 1, 2, 4, 255, -255, 0x8000))
        data[place : place + 2] = (value & 0xFFFF).to_bytes(2, "big")


def _cut(rng: Random, data: bytearray, _: Sequence[bytes]) -> None:
    del data[rng.randrange(len(data) + 1) :]


def _grow(rng: Random, data: bytearray, _: Sequence[bytes]) -> None:
    data += rng.randbytes(rng.randrange(1, 40))


def _remove(rng: Random, data: bytearray, _: Sequence[bytes]) -> None:
    start = rng.randrange(len(data) + 1)
    del data[start : start + rng.randrange(1, 24)]


def _insert(rng: Random, data: bytearray, _: Sequence[bytes]) -> None:
    place = rng.randrange(len(data) + 1)
    data[place:place] = rng.randbytes(rng.randrange(1, 24))


def _repeat(rng: Random, data: bytearray, _: Sequence[bytes]) -> None:
    start = rng.randrange(len(data) + 1)
    part = data[start : start + rng.randrange(1, 80)]
    data[start:start] = part * rng.choice((1, 1, 2, 8))


def _splice(rng: Random, data: bytearray, pool: Sequence[bytes]) -> None:
    other = rng.choice(pool)
    data[rng.randrange(len(data) + 1) :] = other[rng.randrange(len(other) + 1) :]


def _swap(rng: Random, data: bytearray, _: Sequence[bytes]) -> None:
    """Two parts change places, as blocks in the wrong order do."""
    if len(data) > 3:
        a, b, c = sorted(rng.sample(range(len(data) + 1), 3))
        data[a:c] = data[b:c] + data[a:b]


_MUTATIONS: tuple[Callable[[Random, bytearray, Sequence[bytes]], None], ...] = (
    _flip, _flip, _octet, _number, _number, _length, _length, _cut, _grow, _remove, _insert, _repeat, _splice, _swap,
)  # fmt: skip


def mutated(rng: Random, data: bytes, pool: Sequence[bytes]) -> bytes:
    """``data`` with one to four things wrong; ``pool`` are others of its kind."""
    changed = bytearray(data)
    for _ in range(rng.choice((1, 1, 1, 2, 2, 3, 4))):
        rng.choice(_MUTATIONS)(rng, changed, pool)
    return bytes(changed[:LIMIT])


def variation(rng: Random, pool: Sequence[bytes]) -> bytes:
    """The next input of one kind: a good one as it is (seldom), random octets (seldom), or a changed one."""
    chance = rng.random()
    if chance < 0.1 or not pool:
        return random_octets(rng)
    chosen = rng.choice(pool)
    return chosen if chance < 0.15 else mutated(rng, chosen, pool)


_ATTRIBUTE = re.compile(rb'="([^"]*)"')
_ELEMENT = re.compile(rb"<([A-Za-z:]+)( [^<>]*)?/>|<([A-Za-z:]+)( [^<>]*)?>[^<>]*</\3>")
_VALUES = (b"", b"0", b"-1", b"65535", b"65536", b"4294967296", b"1..4294967295", b"0x", b"0xFFFFFFFFF", b"1 2 3",
           b"true", b"a" * 300, b"\xc3\xa9", b"..", b"1..0", b"&#0;", b"&amp;", b"NaN", b"1e999")  # fmt: skip


def varied_xml(rng: Random, pool: Sequence[bytes]) -> bytes:
    """A document with other values, with elements doubled, left out or moved; now and then no document any more."""
    data = bytearray(rng.choice(pool))
    if rng.random() < 0.1:
        for _ in range(rng.randrange(1, 4)):
            rng.choice(_MUTATIONS)(rng, data, pool)
        return bytes(data)
    for _ in range(rng.choice((1, 1, 2, 4, 8))):
        pattern = _ATTRIBUTE if rng.random() < 0.6 else _ELEMENT
        found = list(pattern.finditer(data))
        if not found:
            return bytes(data)
        chosen, other = rng.choice(found), rng.choice(found)
        if pattern is _ATTRIBUTE:
            value = rng.choice(_VALUES) if rng.random() < 0.5 else other[1]
            data[chosen.start(1) : chosen.end(1)] = value
        else:
            part = rng.choice((b"", chosen[0] * 2, other[0], chosen[0] + other[0]))
            data[chosen.start() : chosen.end()] = part
    return bytes(data)


_WORD = re.compile(rb"[0-9A-Za-z_.]+")


def varied_lines(rng: Random, pool: Sequence[bytes]) -> bytes:
    """A text of statements with other words, with lines doubled, left out or moved."""
    data = rng.choice(pool)
    for _ in range(rng.choice((1, 1, 2, 4, 8))):
        lines = data.splitlines(keepends=True) or [b""]
        place, other = rng.randrange(len(lines)), rng.choice(lines)
        found = list(_WORD.finditer(lines[place]))
        if found and rng.random() < 0.6:
            word, words = rng.choice(found), _WORD.findall(other)
            value = rng.choice((*_VALUES, *words))
            lines[place] = lines[place][: word.start()] + value + lines[place][word.end() :]
        else:
            lines[place : place + 1] = rng.choice(([], [lines[place]] * 2, [other], [lines[place], other]))
        data = b"".join(lines)
    return data
