"""XML of a file that is not trusted, element by element: without document types nothing expands, nothing is fetched.

Who reads it bounds what is kept.
"""

from __future__ import annotations

from typing import TYPE_CHECKING
from xml.parsers import expat

if TYPE_CHECKING:
    from collections.abc import Callable

__all__ = ["read_xml"]


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
