"""XML of a file that is not trusted, element by element: without document types nothing expands, nothing is fetched.

Who reads it bounds what is kept.
"""

from __future__ import annotations

from typing import TYPE_CHECKING
from xml.parsers import expat

if TYPE_CHECKING:
    from collections.abc import Callable

__all__ = ["XmlText", "read_xml"]


class XmlText:
    """The text of an element that is wanted: from :meth:`begin` to :meth:`take`, without blanks around it.

    At most ``most`` characters.
    """

    def __init__(self, most: int) -> None:
        self._most = most
        self._parts: list[str] | None = None
        self._length = 0

    def begin(self) -> None:
        self._parts, self._length = [], 0

    def add(self, text: str) -> None:
        """Characters of any element; those of others are dropped."""
        if self._parts is not None and self._length < self._most:
            self._parts.append(text)
            self._length += len(text)

    def take(self) -> str | None:
        """None if nothing was wanted."""
        found = None if self._parts is None else "".join(self._parts).strip()[: self._most]
        self._parts = None
        return found


def read_xml(
    data: bytes,
    *,
    start: Callable[[str, dict[str, str]], None],
    end: Callable[[str], None],
    characters: Callable[[str], None],
    refused: type[Exception],
) -> None:
    """Call these for each element and its text.  What is wrong with the file is raised as ``refused``."""

    def doctype(*_: object) -> None:
        raise refused("a document type is not allowed")

    parser = expat.ParserCreate()
    parser.StartElementHandler = start
    parser.EndElementHandler = end
    parser.CharacterDataHandler = characters
    parser.StartDoctypeDeclHandler = doctype
    try:
        parser.Parse(data, True)
    except expat.ExpatError as exc:
        raise refused(f"line {exc.lineno}: {expat.ErrorString(exc.code)}") from exc
    except (ValueError, LookupError) as exc:
        # an encoding that does not exist, or that expat does not take
        raise refused(str(exc)) from exc
