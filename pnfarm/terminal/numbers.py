"""Numbers on the command line: decimal or 0x, limited to the size of their field."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.errors import ConfigError

if TYPE_CHECKING:
    from collections.abc import Callable

__all__ = ["LONG", "WORD", "number_of"]

#: Largest numbers of two and four octets: SlotNumber, SubslotNumber and Index; API and ModuleIdentNumber.
WORD, LONG = 0xFFFF, 0xFFFF_FFFF
#: Characters of a wrong text that an error shows.
_SHOWN = 40


def number_of(what: str, most: int) -> Callable[[str | int], int]:
    """The reader of one argument or option; it raises :class:`ConfigError` for anything but 0 to ``most``."""

    def read(text: str | int) -> int:
        word = str(text)
        try:
            value = int(word, 0)
        except ValueError:
            value = -1
        if not 0 <= value <= most:
            shown = word if len(word) <= _SHOWN else f"{word[:_SHOWN]}..."
            raise ConfigError(f"{shown!r} is not a valid {what}; give a number such as 1 or 0x8000, at most 0x{most:X}")
        return value

    return read
