"""Codes of the wire that have a name, and perhaps a text."""

from __future__ import annotations

from enum import IntEnum
from typing import Self

__all__ = ["Code", "words_of"]


class Code(IntEnum):
    """Members are ``NAME = number``, or ``NAME = number, "text"`` where the name's own words do not do."""

    text: str

    def __new__(cls, value: int, text: str = "") -> Self:
        code = int.__new__(cls, value)
        code._value_ = value
        code.text = text
        return code

    @classmethod
    def find(cls, value: int) -> Self | None:
        """The member of this number, if there is one."""
        found = cls._value2member_map_.get(value)
        return found if isinstance(found, cls) else None

    @classmethod
    def text_of(cls, value: int) -> str:
        """The text of any number, empty where there is none."""
        found = cls.find(value)
        return "" if found is None else found.text


def words_of(kind: type[IntEnum], value: int, otherwise: str) -> str:
    """A number in words: its text, or its name in lower case; ``otherwise`` for one without a name."""
    found = kind._value2member_map_.get(value)
    return otherwise if found is None else getattr(found, "text", "") or found.name.lower().replace("_", " ")
