"""The texts of a file in its other languages, by those of its primary one.

Two texts that the primary language words alike are one here: the first translation counts.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

__all__ = ["Languages"]


@dataclass(frozen=True, slots=True)
class Languages:
    """``texts``: language (``de``) -> text in the primary language -> text."""

    texts: Mapping[str, Mapping[str, str]] = field(default_factory=dict)

    def translated(self, text: str, language: str) -> str:
        """``text`` in that language; itself where the file has no translation."""
        return self.texts.get(language, {}).get(text) or text

    def wordings(self, text: str) -> Iterator[str]:
        """``text`` in each language of the file, the primary one first."""
        yield text
        for texts in self.texts.values():
            if text in texts:
                yield texts[text]

    def called(self, text: str, wanted: str) -> bool:
        """Whether ``text`` is ``wanted`` in one of the languages, in upper or lower case."""
        folded = wanted.strip().casefold()
        return any(word.strip().casefold() == folded for word in self.wordings(text))
