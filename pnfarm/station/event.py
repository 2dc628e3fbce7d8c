"""How an event is declared: a class with its text, its level and its facts.

::

    @event("ar connected")
    class ArConnected(ConnectionOpened):
        \"""An AR with cyclic data was connected; parametrisation follows.\"""

        controller: str
        ip: IPv4Address
        cycle_ns: int

Log, API, hub and docs read ``text``, a few lower-case words that rigs may search for, and :meth:`Event.details`, the
facts as plain JSON values: ``cycle_ns`` becomes ``cycle_seconds``, an address its text, octets hexadecimal.  A field
that is shown otherwise says how: :func:`shown`, :func:`unshown`.
"""

from __future__ import annotations

from collections.abc import Mapping
from collections.abc import Set as AbstractSet
from dataclasses import MISSING, dataclass, field, fields
from ipaddress import IPv4Address, IPv4Interface
from typing import TYPE_CHECKING, Any, ClassVar, Final, Literal, TypeVar, dataclass_transform

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

__all__ = ["ATTEMPT", "BY_PEER", "Event", "Level", "Pace", "event", "shown", "texts_of", "unshown"]

Level = Literal["debug", "info", "warning", "error"]
_Kind = TypeVar("_Kind", bound="Event")
_NANOSECONDS = "_ns"


@dataclass(frozen=True, slots=True)
class Pace:
    """How often the log has an event: ``at_once`` entries, then one in each ``every_ns``.

    See :mod:`pnfarm.station.paces`.
    """

    at_once: int
    every_ns: int


#: Events of attempts to connect, which may come to nothing for hours; others that a peer may cause without end.
ATTEMPT: Final = Pace(12, 60_000_000_000)
BY_PEER: Final = Pace(32, 1_000_000_000)


@dataclass(frozen=True, slots=True)
class Event:
    """Base of all events; see the module's docstring."""

    TEXT: ClassVar[str] = ""
    LEVEL: ClassVar[Level] = "info"
    #: None: each has an entry in the log.
    PACE: ClassVar[Pace | None] = None

    @property
    def text(self) -> str:
        """Its text in the log."""
        return self.TEXT

    @property
    def level(self) -> Level:
        """Severity in the log."""
        return self.LEVEL

    def details(self) -> dict[str, Any]:
        """Plain JSON values."""
        found: dict[str, Any] = {}
        # what stands after a subclass's own fields
        for one in sorted(fields(self), key=lambda one: one.kw_only is True):
            show, value = one.metadata.get("show", plain), getattr(self, one.name)
            if show is None or not (value or one.metadata.get("always", True)):
                continue
            told = show(value)
            if isinstance(told, Mapping):
                # what a value is made of
                found |= told
            elif one.name.endswith(_NANOSECONDS):
                name = one.metadata.get("name") or f"{one.name.removesuffix(_NANOSECONDS)}_seconds"
                found[name] = value / 1e9
            else:
                found[one.metadata.get("name") or one.name] = told
        return found

    def logged(self) -> dict[str, Any]:
        """The same for the program's own log, which may have what no client of the API may read."""
        return self.details()


def shown(
    show: Callable[[Any], Any] | None = None,
    *,
    name: str = "",
    always: bool = True,
    default: Any = MISSING,
    kw_only: Any = MISSING,
) -> Any:
    """A field that is shown under another name, or as what ``show`` makes of it; a mapping takes its place.

    Without ``always`` it is shown where it is not empty.
    """
    return field(metadata={"show": show or plain, "name": name, "always": always}, default=default, kw_only=kw_only)


def unshown(*, default: Any = MISSING, kw_only: Any = MISSING) -> Any:
    """A field for subscribers alone."""
    return field(metadata={"show": None}, default=default, kw_only=kw_only)


@dataclass_transform(frozen_default=True, field_specifiers=(field, shown, unshown))
def event(
    text: str = "", level: Level | None = None, *, pace: Pace | None = None
) -> Callable[[type[_Kind]], type[_Kind]]:
    """A class of events; what is left out is its base's, or a property of the class."""

    def declare(kind: type[_Kind]) -> type[_Kind]:
        made = dataclass(frozen=True, slots=True)(kind)
        if text:
            made.TEXT = text
        if level is not None:
            made.LEVEL = level
        if pace is not None:
            made.PACE = pace
        return made

    return declare


def texts_of(kinds: Iterable[type[Event]]) -> frozenset[str]:
    """By which the log has these events, and what buses make of them."""
    return frozenset(text for kind in kinds for text in (kind.TEXT, *texts_of(kind.__subclasses__())))


def plain(value: Any) -> Any:
    """A value of an event as a JSON value."""
    if isinstance(value, (IPv4Address, IPv4Interface)):
        return str(value)
    if isinstance(value, bytes):
        return value.hex(":")
    if isinstance(value, (tuple, list, AbstractSet)):
        return [plain(item) for item in value]
    return value
