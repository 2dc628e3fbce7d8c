"""Which part of a device a user means: by ID, order number, ident, or name in any language of the file."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeVar

from pnfarm.protocols.profinet.gsdml.document import PortSubmodule
from pnfarm.protocols.profinet.gsdml.values import parse_number

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from pnfarm.protocols.profinet.gsdml.document import Dap, ModuleItem, SubmoduleItem
    from pnfarm.protocols.profinet.gsdml.languages import Languages

    Item = Dap | ModuleItem | SubmoduleItem | PortSubmodule

__all__ = ["listed", "matching", "name_of", "words"]

T = TypeVar("T", bound="Item")

#: Choices that a message lists.
_LISTED = 12


def name_of(item: Item) -> str:
    """The name in the primary language, empty for none."""
    return item.name if isinstance(item, PortSubmodule) else item.info.name


def _order_number(item: Item) -> str:
    return "" if isinstance(item, PortSubmodule) else item.info.order_number


def _ident(wanted: str | int) -> int | None:
    if isinstance(wanted, int):
        return wanted
    try:
        return parse_number(wanted, 0xFFFF_FFFF)
    except ValueError:
        return None


def words(item: Item, languages: Languages) -> Iterator[str]:
    """What a user may call it, apart from its ident."""
    yield item.id
    if number := _order_number(item):
        yield number
    yield from languages.wordings(name_of(item))


def matching(wanted: str | int, items: Sequence[T], languages: Languages) -> tuple[T, ...]:
    """Those that are meant: by ID, else by order number, else by name, else by ident; an integer by ident first.

    IDs count as written, order numbers and names in upper or lower case.
    """
    text = str(wanted).strip()
    if not text:
        return ()
    ident, folded = _ident(wanted), text.casefold()
    ways = [
        [item for item in items if item.id == text],
        [item for item in items if _order_number(item).strip().casefold() == folded],
        [item for item in items if languages.called(name_of(item), text)],
    ]
    ways.insert(0 if isinstance(wanted, int) else len(ways), [item for item in items if item.ident == ident])
    return tuple(next(filter(None, ways), ()))


def listed(items: Sequence[Item]) -> str:
    """IDs with their names, as a message lists them: ``M1 (16DI), M2 (8DO)``; without names that do not differ."""
    names = [name_of(item) for item in items[:_LISTED]]
    telling = len(set(names)) == len(names)
    named = [
        f"{item.id} ({name})" if telling and name not in {"", item.id} else item.id
        for item, name in zip(items, names, strict=False)
    ]
    return ", ".join(named) + (" and others" if len(items) > _LISTED else "")
