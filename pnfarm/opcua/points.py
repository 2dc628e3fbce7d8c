"""What of a farm is a node with a value: signals of axes and devices, ports of the plant's models.

Values are read and written in the farm's event loop; which there are does not change.  A status is the name of a status
code (OPC 10000-4, 7.39).
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

from pnfarm.api.changes import SignalsWritten
from pnfarm.signals.refusal import SignalError
from pnfarm.station.signals import SIGNALS, find_signal, profile_words
from pnfarm.vocabulary.quoting import shortened

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from pnfarm.farm.core import FarmCore
    from pnfarm.signals.owner import SignalOwner
    from pnfarm.signals.signal import Signal
    from pnfarm.station.axis import Axis
    from pnfarm.station.plain_signals import NamedSignals
    from pnfarm.station.signals import DriveSignal
    from pnfarm.wire.value_types import Value, ValueType

__all__ = ["GOOD", "FarmPoints", "Point", "Reading"]

GOOD = "Good"
#: The folders below the farm's.
DRIVES, DEVICES, PLANT = "Drives", "Devices", "Plant"
#: Types by the form of a drive's signal, and by octets of an integer.
_FORMS = {
    "number": "Double",
    "bit": "Boolean",
    "state": "String",
    "text": "String",
    "fault": "UInt32",
    "word": "UInt16",
}
_SIGNED = ((1, "SByte"), (2, "Int16"), (4, "Int32"), (8, "Int64"))
_UNSIGNED = ((1, "Byte"), (2, "UInt16"), (4, "UInt32"), (8, "UInt64"))
#: What can be said of a drive without power.
_WITHOUT_POWER = frozenset({"powered", "state", "connected"})
_NUMBERED = re.compile(r"p[0-9.]+")
#: Signals that the event of a write names.
_MOST_NAMED = 8


@dataclass(frozen=True, slots=True)
class Point:
    """``name`` is ``OWNER.SIGNAL``, and the text of the NodeId; ``type`` a built-in type of OPC UA."""

    name: str
    signal: str
    type: str
    unit: str
    doc: str
    writable: bool = False


#: Value and status.
Reading = tuple["Value", str]


class FarmPoints:
    """``poke``: the farm was changed from outside."""

    def __init__(self, core: FarmCore, now: Callable[[], int], poke: Callable[[], None]) -> None:
        self._core = core
        self._now = now
        self._poke = poke
        self._axes = {axis.configured_name: axis for axis in core.axes}
        self._owners = core.signal_owners
        self._readers: dict[str, Callable[[], Reading]] = {}

    def owners(self) -> list[tuple[str, str, str]]:
        """Folder, name and kind of whatever has signals."""
        plant = {} if self._core.plant is None else self._core.plant.parts
        return [
            *((DRIVES, name, axis.model.name) for name, axis in self._axes.items()),
            *((PLANT if name in plant else DEVICES, name, each.kinds[-1]) for name, each in self._owners.items()),
        ]

    def points_of(self, owner: str) -> list[Point]:
        """The signals of one owner that a client finds by browsing: of an axis, all but the bits of its words."""
        if (axis := self._axes.get(owner)) is not None:
            names = [*SIGNALS, *profile_words(axis.model)]
            return [self._of_axis(axis, found) for name in names if (found := find_signal(axis.model, name))]
        each = self._owners[owner]
        return [] if each.signals is None else [self._of_owner(each, each.signals, name) for name in each.signals.names]

    def bit(self, owner: str, name: str) -> Point | None:
        """A bit of a word of an axis, which has a node once a client asks for it by its NodeId."""
        axis = self._axes.get(owner)
        if axis is None or "." not in name or name != name.lower() or _NUMBERED.fullmatch(name):
            return None
        found = find_signal(axis.model, name)
        return None if found is None else self._of_axis(axis, found)

    def _of_axis(self, axis: Axis, signal: DriveSignal) -> Point:
        kind, always = _FORMS[signal.form], signal.name in _WITHOUT_POWER

        def read() -> Reading:
            if not always and not axis.powered:
                return 0, "BadOutOfService"
            value = signal.read(axis)
            return (float(value) if kind == "Double" else value), GOOD

        point = Point(f"{axis.configured_name}.{signal.name}", signal.name, kind, signal.unit, signal.doc)
        self._readers[point.name] = read
        return point

    def _of_owner(self, owner: SignalOwner, signals: NamedSignals, name: str) -> Point:
        signal: Signal = signals.signal(name)
        bad = "BadNoCommunication" if signal.direction == "output" else "BadDeviceFailure"

        def read() -> Reading:
            if not owner.powered:
                return 0, "BadOutOfService"
            return (signals.get(name), GOOD) if signals.good(name) else (0, bad)

        plant = self._core.plant
        part = None if plant is None else plant.parts.get(owner.configured_name)
        free = signal.direction == "input" if part is None else part.signals.is_free(name)
        kind = "Double" if signal.scale != 1 else _type_of(signal.type)
        point = Point(
            f"{owner.configured_name}.{name}",
            name,
            kind,
            signal.unit,
            f"{signal.direction} of the {'controller' if owner.configured_name in self._core.devices else 'model'}",
            free,
        )
        self._readers[point.name] = read
        return point

    def read(self, names: Iterable[str]) -> list[Reading]:
        """The present values of points that were found before."""
        return [self._readers[name]() for name in names]

    def write(self, values: Sequence[tuple[Point, Value]], who: str, peer: str, known: set[str]) -> list[str]:
        """Write what is writable, of each owner all at once; the status of each value.

        What is not ``known`` to be written by this client is an event, and known from then on.

        The value takes effect when a fault, a force or a wire ends: ``GoodCompletesAsynchronously``.
        """
        found: dict[str, str] = {}
        wanted: dict[str, dict[str, Value]] = {}
        for point, value in values:
            wanted.setdefault(point.name.removesuffix(f".{point.signal}"), {})[point.signal] = value
        for owner, signals in wanted.items():
            found |= {f"{owner}.{name}": status for name, status in self._write(owner, dict(signals)).items()}
        news = [name for name, status in found.items() if status.startswith(GOOD) and name not in known]
        if news:
            known.update(news)
            self._core.log.record(self._now(), "", SignalsWritten(who, peer, shortened(news, _MOST_NAMED)))
        self._poke()
        return [found[point.name] for point, _ in values]

    def _write(self, owner: str, values: dict[str, Value]) -> dict[str, str]:
        each, signals = self._core.with_signals(owner)
        found: dict[str, str] = {}
        while values:
            try:
                waiting = signals.set(values)
            except SignalError as error:
                refused = [name for name, _, _ in error.issues if name in values] or list(values)
                for name in refused:
                    del values[name]
                    found[name] = "BadOutOfRange"
            else:
                self._core.settle_owner(each, self._now())
                return found | {n: "GoodCompletesAsynchronously" if n in waiting else GOOD for n in values}
        return found


def _type_of(kind: ValueType) -> str:
    match kind.kind:
        case "bool":
            return "Boolean"
        case "octets":
            return "ByteString"
        case "text":
            return "String"
        case "float":
            return "Float" if kind.octets == 4 else "Double"
        case whole:
            sizes = _SIGNED if whole == "int" else _UNSIGNED
            return next(name for most, name in sizes if kind.octets <= most)
