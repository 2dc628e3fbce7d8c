"""Station names (IEC 61158-6-10, coding of the field NameOfStationValue, 4.3.1.4.16.2)."""

from __future__ import annotations

import re
from unicodedata import category

__all__ = ["MAXIMUM_LABEL", "MAXIMUM_NAME", "check_station_name"]

MAXIMUM_NAME = 240
MAXIMUM_LABEL = 63

_LABEL = re.compile(r"[a-z0-9-]+")
_PORT = re.compile(r"port-[0-9]{3}(?:-[0-9]{5})?")
_ADDRESS = re.compile(r"[0-9]{1,3}(?:\.[0-9]{1,3}){3}")
# Prefix of an internationalized label (RFC 5890, A-label), the one kind in which two hyphens may follow each other.
_ACE_PREFIX = "xn--"
# Unicode's categories of the characters that such a label may have (RFC 5892, 2.1; capitals are folded before).
_LETTERS_DIGITS = frozenset({"Ll", "Lo", "Lm", "Mn", "Mc", "Nd"})


def check_station_name(name: str) -> str | None:
    """What is wrong with a station name, as a sentence, or None for a valid one.

    The empty name, DCP's "no name", is not valid.
    """
    if not name:
        return "the name is empty; a station name has 1 to 240 characters"
    if len(name) > MAXIMUM_NAME:
        return f"the name has {len(name)} characters; a station name has at most {MAXIMUM_NAME}"
    if _ADDRESS.fullmatch(name):
        return f"{name!r} looks like an IP address; a station name must not"
    labels = name.split(".")
    for label in labels:
        wrong = _check_label(label)
        if wrong is not None:
            return wrong
    if _PORT.fullmatch(labels[0]):
        return f"{labels[0]!r} is the name of a port; a station name must not begin with port-xyz or port-xyz-abcde"
    return None


def _check_label(label: str) -> str | None:
    if not label:
        return "a label is empty; the labels between the dots have 1 to 63 characters"
    if len(label) > MAXIMUM_LABEL:
        return f"the label {label!r} has {len(label)} characters; a label has at most {MAXIMUM_LABEL}"
    if not _LABEL.fullmatch(label):
        return f"the label {label!r} has other characters than a to z (lower case), 0 to 9 and '-'"
    if label.startswith("-") or label.endswith("-"):
        return f"the label {label!r} begins or ends with '-'"
    if label.startswith(_ACE_PREFIX):
        return None if _is_a_label(label) else f"the label {label!r} begins with 'xn--' and is not Punycode (RFC 5890)"
    if "--" in label:
        return f"the label {label!r} has two '-' in a row"
    return None


def _is_a_label(label: str) -> bool:
    """Whether the label stands for one with other characters than ASCII, and for that one alone (RFC 5890, 2.3.2.1)."""
    code = label.removeprefix(_ACE_PREFIX).encode("ascii")
    try:
        text = code.decode("punycode")
    except ValueError:
        return False
    if text.isascii() or text.startswith("-") or text.endswith("-"):
        return False
    allowed = all(character == "-" or category(character) in _LETTERS_DIGITS for character in text)
    return allowed and text.encode("punycode") == code
