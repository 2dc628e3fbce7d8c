"""The lists of a file that elements refer to for their texts: ``ExternalTextList`` and ``ValueList``."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.gsdml.languages import Languages

if TYPE_CHECKING:
    from collections.abc import Iterable

    from pnfarm.protocols.profinet.gsdml.safe_xml import Node
    from pnfarm.protocols.profinet.gsdml.versions import Attributes

__all__ = ["FileTexts", "by_id"]

#: Besides the primary one; makers' files have up to ten.
_MOST_LANGUAGES = 100


class FileTexts:
    """The texts of one file."""

    def __init__(self, attributes: Attributes, process: Node) -> None:
        self._at = attributes
        self._process = process
        self._texts = _texts_of(process.all("ExternalTextList", "PrimaryLanguage", "Text"))
        self._values = by_id(attributes, process.all("ValueList", "ValueItem"))
        self._assigned: dict[str, tuple[tuple[str, str], ...]] = {}

    def text(self, node: Node | None) -> str:
        """The text that TextId names; the name itself when the list has no such text."""
        if node is None:
            return ""
        name = node.text("TextId")
        return self._texts.get(name, name)

    def assigned(self, node: Node) -> tuple[tuple[str, str], ...]:
        """Values and what they mean, of an element that names a ValueItem."""
        name = self._at.text(node, "ValueItemTarget")
        if not name:
            return ()
        item = self._values.get(name)
        if item is None:
            node.refuse("ValueItemTarget", "the ID of none that the file describes")
        found = self._assigned.get(name)
        if found is None:
            assigned = item.all("Assignments", "Assign")
            found = tuple((self._at.word(assign, "Content"), self.text(assign)) for assign in assigned)
            self._assigned[name] = found
        return found

    def languages(self) -> Languages:
        """The other ones; of two texts that the primary language words alike, the first translation."""
        found: dict[str, dict[str, str]] = {}
        for language in self._process.all("ExternalTextList", "Language"):
            texts = found.setdefault(language.text("lang"), {})
            if len(found) > _MOST_LANGUAGES:
                raise DecodeError("too-large", f"line {language.line}: more than {_MOST_LANGUAGES} languages")
            for name, text in _texts_of(language.all("Text")).items():
                texts.setdefault(self._texts.get(name, name), text)
        return Languages(found)


def _texts_of(nodes: Iterable[Node]) -> dict[str, str]:
    return {node.text("TextId"): node.text("Value") for node in nodes}


def by_id(attributes: Attributes, nodes: Iterable[Node]) -> dict[str, Node]:
    """Elements that references lead to."""
    found: dict[str, Node] = {}
    for node in nodes:
        first = found.setdefault(attributes.word(node, "ID"), node)
        if first is not node:
            node.refuse("ID", f"as that of the {first.name} in line {first.line}; each has its own")
    return found
