"""A drive as injections see it: parts, each with its actions and what can be observed.

Why parts: what can be injected depends on the bus.  A drive on any bus has a servo, a wire and a connection; other
parts, such as modules in slots, only drives on one bus have.  So an effect names the parts that it needs, a bus gives
its drives the parts that they have, and neither knows the other's name.  Every method of a part that changes
something has one that undoes it, and both may be called by several injections at once.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Generic, Protocol, Self, TypeVar, cast, overload

from pnfarm.errors import InternalError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

__all__ = ["DrivePart", "InForce", "InjectedDrive", "Part"]

P = TypeVar("P")


class _OnDrive(Protocol):
    """What acts on one drive."""

    @property
    def drive(self) -> InjectedDrive: ...


class Part(Generic[P]):
    """The name of a part; ``title`` names it in messages about drives that lack it, such as ``alarms``."""

    __slots__ = ("title",)

    def __init__(self, title: str) -> None:
        self.title = title

    @overload
    def __get__(self, effect: None, owner: type) -> Self: ...
    @overload
    def __get__(self, effect: _OnDrive, owner: type) -> P: ...

    def __get__(self, effect: _OnDrive | None, owner: type) -> Self | P:
        """As an attribute of an effect's class: the drive's part, of the class the name."""
        return self if effect is None else effect.drive.part(self)

    def __repr__(self) -> str:
        return f"Part({self.title!r})"


class DrivePart:
    """Base of all parts: what happens when the drive boots."""

    def refresh(self, now: int) -> None:
        """The drive is about to get a frame, or was switched on.  ``now`` holds until the next call."""
        del now

    def rebooted(self, now: int) -> None:
        """The drive has new machines: apply to them what is in force."""
        del now

    def in_force(self) -> list[Any]:
        """What injections have applied here and not undone."""
        return []


class InForce(list[P]):
    """What injections have applied of one kind, the latest last, the same several times if several want it.

    ``changed()`` applies it to the drive.
    """

    __slots__ = ("_changed",)

    def __init__(self, changed: Callable[[], None]) -> None:
        super().__init__()
        self._changed = changed

    def put(self, what: P) -> None:
        self.append(what)
        self._changed()

    def take(self, what: P) -> None:
        """Undo one :meth:`put` of the same."""
        self.remove(what)
        self._changed()


@dataclass(eq=False)
class InjectedDrive:
    """One drive.

    ``names`` are that of the farm file and that of its bus; ``models`` the model's name and aliases.
    ``machines`` returns a new object after each boot.  ``bus`` is the name of its bus.
    """

    name: str
    _names: Callable[[], tuple[str, ...]]
    models: tuple[str, ...]
    _parts: Mapping[Part[Any], DrivePart]
    _machines: Callable[[], object]
    bus: str = ""
    #: The node that an axis belongs to, and the names of a node's axes, where there are several.
    node: InjectedDrive | None = None
    axes: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._known = self._machines()

    def with_axis(self, name: str, parts: Mapping[Part[Any], DrivePart]) -> InjectedDrive:
        """An axis of this node: it has ``parts`` of its own, and finds the others here."""
        self.axes.append(name)
        return InjectedDrive(name, lambda: (name,), self.models, parts, self._machines, self.bus, self)

    def hit_by(self, needs: Iterable[Part[Any]]) -> list[str]:
        """Names of those whom an effect with these needs hits if it is aimed here: the node once, or its axes."""
        node = self.node or self
        if all(part in node._parts for part in needs):  # noqa: SLF001 - of the same class
            return [node.name]
        return self.axes or [self.name]

    @property
    def names(self) -> tuple[str, ...]:
        """Names by which it is found."""
        return self._names()

    def find(self, part: Part[P]) -> P | None:
        """None where the drive's bus has no such part."""
        # a mapping from keys to values of the key's own type cannot be written as a type
        found = self._parts.get(part)
        if found is None and self.node is not None:
            return self.node.find(part)
        return cast("P | None", found)

    def part(self, part: Part[P]) -> P:
        """A part that the effect needs."""
        found = self.find(part)
        if found is None:
            raise InternalError(f"an effect uses {part.title} of {self.name} that it does not name")
        return found

    def refresh(self, now: int) -> None:
        """The drive may have booted since: apply everything that is in force to its machines."""
        if self.node is not None:
            self.node.refresh(now)
        parts = dict.fromkeys(self._parts.values())
        if self._known is not (machines := self._machines()):
            self._known = machines
            for part in parts:
                part.rebooted(now)
        for part in parts:
            part.refresh(now)

    def in_force(self) -> dict[str, list[Any]]:
        """What injections have applied to each part and not undone."""
        return {part.title: left for part, found in self._parts.items() if (left := found.in_force())}
