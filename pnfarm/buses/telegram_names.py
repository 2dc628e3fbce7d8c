"""How makers name the modules and submodules of telegrams in their files."""

from __future__ import annotations

import re

__all__ = ["frame_class", "is_numbered", "numbers_in"]

#: Words of a telegram's name before its number, in makers' languages and abbreviations.
_NUMBERED = re.compile(
    r"(?:tele?gramm?|tele?gr?\.?|tlg\.?|tel\.?|ppo|dp_?v?\d?|standard|std\.?)[\s_:#-]*0*(\d+)(?![\d.])", re.IGNORECASE
)
_ANY_NUMBER = re.compile(r"(?<![\d.])0*(\d+)(?![\d.])")
#: Makers have a telegram once for each class of frames.
_CLASS = re.compile(r"\bI?RT\b|isochron|taktsynchron", re.IGNORECASE)


def numbers_in(words: str) -> set[int]:
    """Numbers that a module's name gives its telegram: after a word for it, else any."""
    found = _NUMBERED.findall(words) or _ANY_NUMBER.findall(words)
    return {int(number) for number in found if len(number) < 6}


def is_numbered(words: str) -> bool:
    """Whether a word for a telegram has a number after it."""
    return _NUMBERED.search(words) is not None


def frame_class(words: str) -> str:
    """The class of frames that a module's name says: RT, IRT, or an empty text."""
    found = _CLASS.search(words)
    return "" if found is None else "RT" if found[0].upper() == "RT" else "IRT"
