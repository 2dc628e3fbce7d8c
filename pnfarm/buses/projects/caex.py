"""Engineering projects in AutomationML (``.aml``, ``.amlx``), as TIA Portal writes them: CAEX 2.15 and 3.0 (IEC 62424).

The file is a tree of elements with attributes by name; both editions of CAEX have it in the same form.  It is not
trusted: document types are refused, so that nothing expands and nothing is fetched, and octets, elements and depth are
bounded.
"""

from __future__ import annotations

import io
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from pnfarm.errors import ConfigError
from pnfarm.vocabulary.untrusted_xml import XmlText, read_xml
from pnfarm.vocabulary.zip_files import DamagedZipError, zip_member, zip_names

if TYPE_CHECKING:
    from collections.abc import Iterator

__all__ = ["MAX_OCTETS", "CaexElement", "CaexProject", "NotCaexError", "is_project", "parse_caex"]

#: Largest file, packed or not; projects of many stations have some 50 MB.
MAX_OCTETS = 128 << 20
MAX_ELEMENTS = 2_000_000
MAX_DEPTH = 200
#: Longest value of an attribute that is kept, characters.
MAX_VALUE = 4096
_ZIP, _XML = b"PK\x03\x04", (b"<", b"\xef\xbb\xbf<")


class NotCaexError(ConfigError):
    """What should be CAx data is something else, or too large."""


@dataclass(slots=True)
class CaexElement:
    """An InternalElement: its name, its attributes' values, its roles, and the elements in it.

    ``interfaces`` are its ExternalInterfaces, elements with their class as role.
    """

    name: str
    id: str = ""
    attributes: dict[str, str] = field(default_factory=dict)
    roles: list[str] = field(default_factory=list)
    children: list[CaexElement] = field(default_factory=list)
    interfaces: list[CaexElement] = field(default_factory=list)
    parent: CaexElement | None = field(default=None, repr=False, compare=False)

    def walk(self) -> Iterator[CaexElement]:
        """This element and all in it, in the file's order."""
        waiting = [self]
        while waiting:
            one = waiting.pop()
            yield one
            waiting += reversed(one.children)

    def has_role(self, name: str) -> bool:
        """Whether the last part of one of its roles' paths is this."""
        return any(role.rpartition("/")[2] == name for role in self.roles)

    def around(self) -> Iterator[CaexElement]:
        """What it is in, from the inside."""
        outer = self.parent
        while outer is not None:
            yield outer
            outer = outer.parent


@dataclass(frozen=True, slots=True)
class CaexProject:
    """``root`` is around all InternalElements; ``links`` are pairs of interfaces, each ``ELEMENT-ID:NAME``."""

    root: CaexElement
    links: tuple[tuple[str, str], ...] = ()


def is_project(begin: bytes) -> bool:
    """Whether a file's first octets are those of such a file."""
    return begin.startswith((_ZIP, *_XML))


def parse_caex(data: bytes) -> CaexProject:
    """Raises :class:`NotCaexError` for what is none, or too large."""
    if data.startswith(_ZIP):
        data = _unpacked(data)
    if len(data) > MAX_OCTETS:
        raise NotCaexError(f"the file is longer than {MAX_OCTETS} octets")
    return _Reader().read(data)


def _unpacked(data: bytes) -> bytes:
    """The one ``.aml`` file of a container."""
    container = io.BytesIO(data)
    try:
        names = [name for name in zip_names(container, MAX_ELEMENTS) if name.lower().endswith(".aml")]
        if len(names) != 1:
            raise NotCaexError(f"the container has {len(names)} .aml files, and one is needed")
        return zip_member(container, names[0], MAX_OCTETS + 1)
    except DamagedZipError as exc:
        raise NotCaexError(f"the container cannot be read: {exc}") from exc


class _Reader:
    """Makes the tree while expat reads."""

    def __init__(self) -> None:
        self._root = CaexElement("")
        self._links: list[tuple[str, str]] = []
        self._stack: list[CaexElement] = [self._root]
        #: Names of the open XML elements; attributes of attributes have their parents' names in front.
        self._path: list[str] = []
        self._attribute: list[str] = []
        self._text = XmlText(MAX_VALUE)
        self._elements = 0
        self._seen = False

    def read(self, data: bytes) -> CaexProject:
        read_xml(data, start=self._start, end=self._end, characters=self._text.add, refused=NotCaexError)
        if not self._seen:
            raise NotCaexError("there is no CAEXFile in it")
        return CaexProject(self._root, tuple(self._links))

    def _start(self, qualified: str, attributes: dict[str, str]) -> None:
        name = qualified.rpartition(":")[2]
        self._elements += 1
        if self._elements > MAX_ELEMENTS or len(self._path) >= MAX_DEPTH:
            raise NotCaexError(f"more than {MAX_ELEMENTS} elements, or deeper than {MAX_DEPTH}")
        self._path.append(name)
        match name:
            case "CAEXFile":
                self._seen = True
            case "InternalElement" | "ExternalInterface":
                outer, named = self._stack[-1], attributes.get("Name", "")[:MAX_VALUE]
                element = CaexElement(named, attributes.get("ID", "")[:MAX_VALUE], parent=outer)
                if name == "InternalElement":
                    outer.children.append(element)
                else:
                    element.roles.append(attributes.get("RefBaseClassPath", "")[:MAX_VALUE])
                    outer.interfaces.append(element)
                self._stack.append(element)
            case "InternalLink":
                one, other = (attributes.get(f"RefPartnerSide{side}", "")[:MAX_VALUE] for side in "AB")
                self._links.append((one, other))
            case "Attribute":
                self._attribute.append(attributes.get("Name", ""))
            case "SupportedRoleClass":
                self._stack[-1].roles.append(attributes.get("RefRoleClassPath", "")[:MAX_VALUE])
            case "RoleRequirements":
                self._stack[-1].roles.append(attributes.get("RefBaseRoleClassPath", "")[:MAX_VALUE])
            case "Value":
                self._text.begin()
            case _:
                pass

    def _end(self, qualified: str) -> None:
        name = qualified.rpartition(":")[2]
        self._path.pop()
        match name:
            case "InternalElement" | "ExternalInterface":
                self._stack.pop()
            case "Attribute":
                self._attribute.pop()
            case "Value":
                value = self._text.take()
                if value is not None and self._attribute and len(self._stack) > 1:
                    self._stack[-1].attributes.setdefault("/".join(self._attribute), value)
            case _:
                pass
