"""Stations as a farm file, a project or a plant has them, and what differs: what ``pnfarm import --check`` compares."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal, Protocol

from pnfarm.buses.bus import Bus
from pnfarm.buses.line_parameters import LineWork
from pnfarm.vocabulary.quoting import printable

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from pnfarm.config.device import DeviceConfig
    from pnfarm.config.drive import DriveConfig
    from pnfarm.drives.description.model import Model

__all__ = [
    "NOTHING",
    "CheckAnswer",
    "CheckQuestion",
    "CheckedLine",
    "CheckingBus",
    "Difference",
    "StationCheck",
    "StationFacts",
    "compare",
    "place_text",
    "readable",
]  # fmt: skip

#: In place of an ident: nothing is plugged there.
NOTHING = "nothing"
#: Subslots of interfaces and ports, which users know as hexadecimal numbers.
_INTERFACES = 0x8000


@dataclass(frozen=True, slots=True)
class StationFacts:
    """One station; what is not known of it is left out, and not compared.

    ``name``: its name on the bus, or the file's where the bus has none; ``address``: an IPv4 or a station address.
    ``identity``: what a controller compares when it connects; ``versions``: what it does not.
    ``modules``: ``SLOT`` and ``SLOT.SUBSLOT`` -> idents, or ``connection`` -> what is asked for, any of which will do.
    ``remarks``: why something is not known.
    """

    name: str
    address: str = ""
    identity: Mapping[str, str] = field(default_factory=dict)
    versions: Mapping[str, str] = field(default_factory=dict)
    modules: Mapping[str, tuple[str, ...]] | None = None
    remarks: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Difference:
    """``what``: ``firmware``, ``slot 2`` ...; ``kind`` is the field of :class:`StationFacts` that it is from."""

    kind: Literal["name", "address", "identity", "versions", "modules"]
    what: str
    expected: str
    found: str


@dataclass(frozen=True, slots=True)
class StationCheck:
    """``state``: ``unread`` is there and equal as far as it could be read, ``extra`` is not expected."""

    name: str
    address: str
    state: Literal["equal", "differs", "unread", "missing", "extra"]
    differences: tuple[Difference, ...] = ()
    remarks: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class CheckQuestion:
    """Ask at a network ``interface`` for so many seconds; ``expected`` are the stations that are to be there."""

    interface: str
    seconds: float
    expected: Sequence[StationFacts]


@dataclass(frozen=True, slots=True)
class CheckAnswer:
    """``remarks``: what a user should know of the search as a whole."""

    stations: Sequence[StationFacts]
    remarks: Sequence[str] = ()


class CheckedLine(LineWork, Protocol):
    """A search on a serial line."""

    def answer(self) -> CheckAnswer:
        """What was found, once it is done."""


class CheckingBus(Bus):
    """A bus whose plant can be compared with a farm file; nothing is written to its stations.

    One with a network has ``read_stations`` in ``commands/check.py``, one with a serial line ``checked_line`` in
    ``checking``.
    """

    @property
    def has_names(self) -> bool:
        """Whether stations have names on the bus; others are known by their addresses."""
        return False

    def facts_of(self, config: DriveConfig | DeviceConfig, model: Model | None, *, asked: bool = False) -> StationFacts:
        """A station of a farm file; ``model`` is that of a drive, with what the file changes of it.

        ``asked``: what its controller asks for, and not all that it offers.
        """
        facts: StationFacts = self._own("checking", "facts_of")(config, model, asked=asked)
        return facts

    def planned_facts(self, plan: Any) -> StationFacts:
        """A device that only the controller's section names, by the plan of the bus's controller for it."""
        facts: StationFacts = self._own("checking", "planned_facts")(plan)
        return facts

    async def read_stations(self, question: CheckQuestion) -> CheckAnswer:
        """Ask a network.  Raises :class:`~pnfarm.errors.EnvironmentError_` where this machine cannot."""
        answer: CheckAnswer = await self._own("commands.check", "read_stations")(question)
        return answer

    def checked_line(self, link: Any, port: Any, expected: Sequence[StationFacts], own: int, baud: int) -> CheckedLine:
        """The search on a line, by a station with an own address."""
        search: CheckedLine = self._own("checking", "checked_line")(link, port, expected, own, baud)
        return search


def place_text(slot: int, subslot: int | None = None) -> str:
    """``2``, ``2.1``, ``0.0x8000``: a key of ``modules`` of :class:`StationFacts`."""
    if subslot is None:
        return str(slot)
    return f"{slot}.{subslot}" if subslot < _INTERFACES else f"{slot}.0x{subslot:04X}"


def readable(text: str) -> str:
    """A text from the wire without control characters, and without the blanks around it."""
    return printable(text.strip("\0 "))


def compare(
    expected: Sequence[StationFacts], found: Sequence[StationFacts], *, by_name: bool
) -> Iterator[StationCheck]:
    """Those that are expected, in their order, and then the others.

    With ``by_name`` a name counts more than an address, but a station with the address of a missing one is that one
    under another name.
    """
    keys: list[Callable[[StationFacts], Any]] = [lambda one: one.address]
    if by_name:
        keys = [lambda one: one.name and (one.name, one.address), lambda one: one.name, *keys]
    pairs: dict[int, int] = {}
    left = dict(enumerate(found))
    for key in keys:
        places: dict[Any, list[int]] = {}
        for place, one in left.items():
            places.setdefault(key(one), []).append(place)
        for number, wanted in enumerate(expected):
            if number not in pairs and (value := key(wanted)) and (known := places.get(value)):
                pairs[number] = known.pop(0)
                del left[pairs[number]]
    for number, wanted in enumerate(expected):
        if number in pairs:
            yield _check(wanted, found[pairs[number]], by_name=by_name)
        else:
            yield StationCheck(wanted.name, wanted.address, "missing")
    names = {one.name for one in expected} if by_name else set()
    for one in left.values():
        twice = (f"the name {one.name} is given twice",) if one.name in names else ()
        yield StationCheck(one.name, one.address, "extra", remarks=twice)


def _check(wanted: StationFacts, found: StationFacts, *, by_name: bool) -> StationCheck:
    differences = tuple(_differences(wanted, found, by_name=by_name))
    remarks = (*wanted.remarks, *found.remarks)
    state: Literal["equal", "differs", "unread"] = "differs" if differences else "unread" if remarks else "equal"
    return StationCheck(wanted.name, wanted.address or found.address, state, differences, remarks)


def _differences(wanted: StationFacts, found: StationFacts, *, by_name: bool) -> Iterator[Difference]:
    if by_name and wanted.name != found.name:
        yield Difference("name", "name", wanted.name, found.name or NOTHING)
    if wanted.address and wanted.address != found.address:
        yield Difference("address", "address", wanted.address, found.address or NOTHING)
    for what, value in wanted.identity.items():
        if found.identity.get(what, value) != value:
            yield Difference("identity", what, value, found.identity[what])
    for what, value in wanted.versions.items():
        if found.versions.get(what, value) != value:
            yield Difference("versions", what, value, found.versions[what])
    if wanted.modules is not None and found.modules is not None:
        yield from _modules(wanted.modules, found.modules)


def _modules(wanted: Mapping[str, tuple[str, ...]], found: Mapping[str, tuple[str, ...]]) -> Iterator[Difference]:
    """Of a slot with another module only that is said."""
    others: set[str] = set()
    for place in sorted({*wanted, *found}, key=_place):
        slot = place.partition(".")[0]
        here, there = (side.get(place, (NOTHING,)) for side in (wanted, found))
        if slot in others or not set(here).isdisjoint(there):
            continue
        if place == slot:
            others.add(slot)
        yield Difference("modules", f"slot {place}" if slot.isdigit() else place, " or ".join(here), " or ".join(there))


def _place(text: str) -> list[int]:
    return [int(part, 0) for part in text.split(".")] if text[:1].isdigit() else []
