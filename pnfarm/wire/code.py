"""Codes of the wire that have a name, and perhaps a text."""

from __future__ import annotations

from enum import IntEnum
from typing import Self

__all__ = ["Code"]


class Code(IntEnum):
    """Members are ``NAME = number``, or ``NAME = number, "text"`` where the name's own words do not do."""

    text: str

    def __new__(cls, value: int, text: str = "") -> Self:
        code = int.__new__(cls, value)
        code._value_ = value
        code.text = text
        return code

    @property
    def words(self) -> str:
        """The text, or the name in lower case."""
        return self.text or self.name.lower().replace("_", " ")

    @classmethod
    def find(cls, value: int) -> Self | None:
        """The member of this number, if there is one."""
        found = cls._value2member_map_.get(value)
        return found if isinstance(found, cls) else None

    @classmethod
    def words_of(cls, value: int, otherwise: str) -> str:
        """Words for any number."""
        found = cls.find(value)
        return otherwise if found is None else found.words
