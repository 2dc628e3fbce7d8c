"""Projects of Studio 5000 and RSLogix 5000 in L5X: modules, their connections, and tags that are aliases.

The file is XML (Rockwell Automation publication 1756-RM014).  It is not trusted: document types are refused, so that
nothing expands and nothing is fetched, and octets, modules, tags and depth are bounded.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from pnfarm.errors import ConfigError
from pnfarm.vocabulary.untrusted_xml import XmlText, read_xml

if TYPE_CHECKING:
    from collections.abc import Mapping

__all__ = ["L5xConnection", "L5xModule", "L5xProject", "NotL5xError", "is_l5x", "parse_l5x"]

MAX_OCTETS = 128 << 20
MAX_DEPTH = 200
#: Modules of a project, connections of all of them, and aliases.
MAX_MODULES, MAX_CONNECTIONS, MAX_ALIASES = 10_000, 40_000, 200_000
#: Longest value of an attribute, and of a configuration, that is kept, characters: one has up to 400 octets.
MAX_VALUE, MAX_CONFIGURATION = 1024, 4096
_ROOT = "RSLogix5000Content"


class NotL5xError(ConfigError):
    """What should be an L5X file is something else, or too large."""


@dataclass(slots=True)
class L5xConnection:
    """``attributes`` are those of the file; ``elements``: the type of the data's elements, by ``I`` and ``O``."""

    attributes: Mapping[str, str]
    elements: dict[str, str] = field(default_factory=dict)


@dataclass(slots=True)
class L5xModule:
    """``address``: the IP address of its port towards the controller, empty for one on a backplane.

    ``keyed``: whether its controller compares the identity.
    ``communications``: the attributes of its element Communications; ``configuration``: the beginning of its
    configuration as the file has it in one line, ``[octets,instance,...``.
    """

    attributes: Mapping[str, str]
    address: str = ""
    communications: Mapping[str, str] = field(default_factory=dict)
    configuration: str = ""
    keyed: bool = True
    connections: list[L5xConnection] = field(default_factory=list)

    @property
    def name(self) -> str:
        return self.attributes.get("Name", "")

    def number(self, key: str) -> int:
        """An attribute as a number, 0 for none."""
        text = self.attributes.get(key, "")
        return int(text) if text.isascii() and text.isdigit() and len(text) < 10 else 0


@dataclass(frozen=True, slots=True)
class L5xProject:
    """``aliases``: name of a tag, and what it stands for (``Module:I.Data[0].3``)."""

    modules: tuple[L5xModule, ...]
    aliases: tuple[tuple[str, str], ...] = ()


def is_l5x(begin: bytes) -> bool:
    """Whether a file's first octets are those of such a file."""
    return f"<{_ROOT}".encode() in begin


def parse_l5x(data: bytes) -> L5xProject:
    """Raises :class:`NotL5xError` for what is none, or too large."""
    if len(data) > MAX_OCTETS:
        raise NotL5xError(f"the file is longer than {MAX_OCTETS} octets")
    return _Reader().read(data)


class _Reader:
    def __init__(self) -> None:
        self._path: list[str] = []
        self._modules: list[L5xModule] = []
        self._aliases: list[tuple[str, str]] = []
        self._connections = 0
        self._text = XmlText(MAX_CONFIGURATION)
        self._way = ""

    def read(self, data: bytes) -> L5xProject:
        read_xml(data, start=self._start, end=self._end, characters=self._text.add, refused=NotL5xError)
        return L5xProject(tuple(self._modules), tuple(self._aliases))

    def _start(self, name: str, attributes: dict[str, str]) -> None:
        if not self._path and name != _ROOT:
            raise NotL5xError(f"its root is no {_ROOT}")
        if len(self._path) >= MAX_DEPTH:
            raise NotL5xError(f"elements are deeper than {MAX_DEPTH}")
        self._path.append(name)
        module = self._modules[-1] if "Module" in self._path[:-1] else None
        if name == "Module":
            self._modules.append(L5xModule(_bounded(attributes)))
        elif name == "Tag" and attributes.get("TagType") == "Alias":
            self._aliases.append((attributes.get("Name", "")[:MAX_VALUE], attributes.get("AliasFor", "")[:MAX_VALUE]))
        elif module is not None:
            self._of_module(module, name, attributes)
        counts = len(self._modules), self._connections, len(self._aliases)
        if any(one > most for one, most in zip(counts, (MAX_MODULES, MAX_CONNECTIONS, MAX_ALIASES), strict=True)):
            most = f"{MAX_MODULES} modules, {MAX_CONNECTIONS} connections or {MAX_ALIASES} aliases"
            raise NotL5xError(f"there are more than {most}")

    def _of_module(self, module: L5xModule, name: str, attributes: dict[str, str]) -> None:
        match name:
            case "Port" if attributes.get("Type") == "Ethernet" and attributes.get("Upstream") == "true":
                module.address = module.address or attributes.get("Address", "")[:MAX_VALUE]
            case "EKey":
                module.keyed = attributes.get("State") != "Disabled"
            case "Communications":
                module.communications = _bounded(attributes)
            case "Connection":
                self._connections += 1
                module.connections.append(L5xConnection(_bounded(attributes)))
            case "InputTag" | "OutputTag":
                self._way = name[0]
            case "ArrayMember" if self._way and module.connections and attributes.get("Name") == "Data":
                kind = attributes.get("DataType", "")[:MAX_VALUE]
                module.connections[-1].elements.setdefault(self._way, kind)
            case "Data" if self._path[-2] == "ConfigTag" and attributes.get("Format") == "L5K":
                self._text.begin()
            case _:
                pass

    def _end(self, name: str) -> None:
        self._path.pop()
        if name in {"InputTag", "OutputTag"}:
            self._way = ""
        elif name == "Data" and (text := self._text.take()) is not None:
            self._modules[-1].configuration = text


def _bounded(attributes: dict[str, str]) -> dict[str, str]:
    return {key: value[:MAX_VALUE] for key, value in attributes.items()}
