"""Station names of a project as they are on the network.

A name in a project may have blanks and underscores, which no station may have.  TIA Portal writes ``xa`` and ``xb``
for them, and appends four hexadecimal digits of the result's CRC-16: ``plc_1`` is searched for as ``plcxb1d0ed``.
That is not documented; it is so of each of the names of S7 controllers in public captures that have such characters.
"""

from __future__ import annotations

__all__ = ["name_on_network"]

_ESCAPES = {" ": "xa", "_": "xb"}
#: CRC-16/ARC: x^16 + x^15 + x^2 + 1, the least significant bit first.
_POLYNOMIAL = 0xA001


def name_on_network(name: str) -> str:
    """The name as it is searched for; unchanged, apart from capitals, if it has none of these characters."""
    plain = name.lower()
    if not any(one in plain for one in _ESCAPES):
        return plain
    for character, written in _ESCAPES.items():
        plain = plain.replace(character, written)
    return f"{plain}{_crc(plain.encode()):04x}"


def _crc(octets: bytes) -> int:
    value = 0
    for octet in octets:
        value ^= octet
        for _ in range(8):
            value = (value >> 1) ^ (_POLYNOMIAL if value & 1 else 0)
    return value
