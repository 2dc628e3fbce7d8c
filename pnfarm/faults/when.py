"""``when``: injections that wait for a condition on each of their drives.

The language is that of scenarios (:mod:`pnfarm.signals.conditions`).  The condition is compiled to rows of the table,
and the engine checks it in each of its steps (:mod:`pnfarm.engine.conditions`), so that no step in which it holds is
missed.  What only the event loop knows (connections, parameters) it writes into these rows whenever something has
happened to the drive.  A condition of such names alone needs no row.  Signals of devices it reads every millisecond.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

from pnfarm.errors import ConfigError
from pnfarm.faults.errors import InjectionError
from pnfarm.firmware.axis import AXIS
from pnfarm.signals.conditions import bind
from pnfarm.station.signals import DriveSignal
from pnfarm.table import condition as codes
from pnfarm.table.access.places import Place, place_of
from pnfarm.table.access.plain import plain
from pnfarm.table.segments import Segments
from pnfarm.table.trace import SOURCE_AXIS_REAL
from pnfarm.vocabulary.conditions import Both, Comparison, ConditionError, Either, Name, Not, Text, evaluate

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from pnfarm.drives.description.model import Model
    from pnfarm.engine.columns import Columns
    from pnfarm.signals.conditions import Condition
    from pnfarm.signals.device_signal import KnownDevices, LiveDevices
    from pnfarm.station.axis import Axis
    from pnfarm.vocabulary.conditions import Operand, Tree, Value

__all__ = ["ConditionWatch", "Conditions"]

_SIGNS = {
    "==": codes.OP_EQUAL,
    "!=": codes.OP_UNEQUAL,
    "<": codes.OP_BELOW,
    "<=": codes.OP_AT_MOST,
    ">": codes.OP_ABOVE,
    ">=": codes.OP_AT_LEAST,
}
#: An operation's row, field by field, unless it says otherwise; it counts operations from its condition's first.
_OPERATION: Mapping[str, float] = {
    "code": codes.OP_GIVEN, "left": 0, "right": 0, "given": 0.0, "word": 0, "less": -1, "shift": 0, "mask": 0,
    "sign": 0, "value": 0.0,
}  # fmt: skip
_POWERED = place_of(AXIS, "powered")
_STATE = place_of(AXIS, "drive.state")


#: Between two checks of signals of devices.
LOOK_NS = 1_000_000


class Conditions:
    """The conditions for which injections wait on a farm's axes, on its devices, and on its plant."""

    def __init__(self, axes: Sequence[Axis], columns: Columns, owners: LiveDevices) -> None:
        self._axes = {axis.configured_name: axis for axis in axes}
        self._live = owners
        self._known: KnownDevices = {
            name: {} if station.signals is None else {one: station.signals.signal(one) for one in station.signals.names}
            for name, station in self._live.items()
        }
        self._bound = lru_cache(maxsize=64)(self._bind)
        self._engine = columns.engine
        self._conditions, self._ops = plain(columns.condition), plain(columns.condition_op)
        self._watches: dict[int, ConditionWatch] = {}
        #: Rows below the highest one in use that are free.
        self._rows: list[int] = []
        self._most_rows = 0
        self._segments = Segments(len(self._ops))
        self._serial = 0

    def bind(self, drive: str, text: str) -> Condition:
        """The condition as this drive's model, or this device, understands it.  Raises :class:`InjectionError`."""
        axis = self._axes.get(drive)
        try:
            return self._bound(text, None if axis is None else axis.model, "" if axis is not None else drive)
        except ConditionError as exc:
            raise InjectionError([("when", f"column {exc.column}: {exc.what}", exc.allowed)]) from exc

    def _bind(self, text: str, model: Model | None, own: str) -> Condition:
        return bind(text, model, self._known, own)

    def watch(self, drive: str, text: str) -> ConditionWatch:
        """Watch from the first :meth:`ConditionWatch.look` on.  Raises :class:`InjectionError`."""
        return ConditionWatch(self, drive, self._axes.get(drive), self.bind(drive, text), self._live)

    def reported(self, row: int, serial: int, now: int) -> str | None:
        """The engine saw the condition in this row hold at ``now``: the name of its drive, None if it is over."""
        watch = self._watches.get(row)
        if watch is None or watch.serial != serial:
            return None
        watch.held_ns = now
        return watch.drive

    def catch_up(self, now: int) -> list[str]:
        """Reports of the engine were lost: the drives whose condition it saw hold, as its rows say."""
        found = []
        for row, watch in self._watches.items():
            if watch.held_ns is None and self._conditions[row]["reported"] == watch.serial:
                watch.held_ns = now
                found.append(watch.drive)
        return found

    @property
    def watched(self) -> int:
        """Rows in use."""
        return len(self._watches)

    def open(self, watch: ConditionWatch, ops: Sequence[Mapping[str, float]]) -> tuple[int, int]:
        """A row for a condition: its number, and its first operation.  Raises :class:`ConfigError` without room."""
        length = len(ops)
        row = self._rows[-1] if self._rows else self._most_rows
        first = self._segments.allocate(length) if row < len(self._conditions) else None
        if first is None:
            raise ConfigError(f"{len(self._watches)} conditions are watched already, the maximum")
        if self._rows:
            self._rows.pop()
        self._most_rows = max(self._most_rows, row + 1)
        for number, op in enumerate(ops, start=first):
            fields = {**_OPERATION, **op}
            fields["left"] += first
            fields["right"] += first
            # at once, as fields one by one take ten times as long; the engine's value is that of no tick yet
            self._ops[number] = tuple(fields.values())
        table = self._conditions[row]
        table["first_op"], table["ops"] = first, length
        self._serial += 1
        table["serial"] = self._serial
        table["active"] = 1
        watch.serial = self._serial
        self._watches[row] = watch
        self._engine[0].condition_rows = self._most_rows
        return row, first

    def give(self, op: int, value: float) -> None:
        """What the event loop knows, for the engine."""
        self._ops[op]["given"] = value

    def close(self, row: int, first: int) -> None:
        """Free a row."""
        self._conditions[row]["active"] = 0
        del self._watches[row]
        self._rows.append(row)
        self._segments.release(first)
        if not self._watches:
            self._rows.clear()
            self._most_rows = 0
            self._engine[0].condition_rows = 0


class ConditionWatch:
    """A condition on one drive or device, until it held or :meth:`close` is called."""

    def __init__(
        self, conditions: Conditions, drive: str, station: Axis | None, condition: Condition, devices: LiveDevices
    ) -> None:
        self.drive = drive
        #: How often to look, if what happens to the drive is not enough.
        self.every_ns = LOOK_NS if any(not isinstance(one, DriveSignal) for one in condition.signals.values()) else None
        self.serial = 0
        #: When the engine saw it hold.
        self.held_ns: int | None = None
        self._conditions = conditions
        self._station = station
        self._condition = condition
        self._devices = devices
        #: Its row and its first operation.
        self._row: tuple[int, int] | None = None
        #: Operations whose value the event loop gives.
        self._given: dict[int, Tree] = {}
        self._telegram = -1

    def look(self, now: int) -> int | None:
        """When it held, if it did; something may have happened to the drive.

        Raises :class:`ConfigError` without room in the table.
        """
        if self.held_ns is not None:
            return self.held_ns
        if self._condition.holds(self._station, self._devices):
            return now
        if self._station is not None and self._telegram != self._station.store.telegram_number:
            # bits of words have other places
            self.close()
            self._telegram = self._station.store.telegram_number
            self._open(self._station)
        elif self._row is not None:
            for op, leaf in self._given.items():
                self._conditions.give(self._row[1] + op, self._value(leaf))
        return None

    def close(self) -> None:
        """Watch it no longer."""
        if self._row is not None:
            self._conditions.close(*self._row)
            self._row = None
        self._telegram = -1

    def _open(self, station: Axis) -> None:
        builder = _Builder(station, self._condition, self._value)
        builder.add(self._condition.tree)
        self._given = builder.given
        if builder.in_table:
            self._row = self._conditions.open(self, builder.ops)

    def _value(self, leaf: Tree) -> float:
        def value_of(operand: Operand) -> Value:
            if isinstance(operand, Name):
                return self._condition.read(operand.name, self._station, self._devices)
            return operand.value

        return float(evaluate(leaf, value_of))


class _Builder:
    """Operations of a condition, numbered from 0."""

    def __init__(self, station: Axis, condition: Condition, value: Callable[[Tree], float]) -> None:
        self._station = station
        self._signals = condition.signals
        self._value = value
        self.ops: list[Mapping[str, float]] = []
        self.given: dict[int, Tree] = {}
        #: Whether any of its signals is in the table.
        self.in_table = False

    def _push(self, **fields: float) -> int:
        self.ops.append(fields)
        return len(self.ops) - 1

    def add(self, tree: Tree) -> int:
        """The operation that says whether this part of the condition holds."""
        match tree:
            case Both(parts) | Either(parts):
                code = codes.OP_AND if isinstance(tree, Both) else codes.OP_OR
                number = self.add(parts[0])
                for part in parts[1:]:
                    number = self._push(code=code, left=number, right=self.add(part))
                return number
            case Not(inner):
                number = self.add(inner)
                return self._push(code=codes.OP_NOT, left=number, right=number)
            case _:
                return self._leaf(tree)

    def _leaf(self, tree: Tree) -> int:
        if isinstance(tree, Name) and (place := self._place(tree)) is not None:
            return self._signal(tree, place)
        if isinstance(tree, Comparison):
            name, other = (tree.left, tree.right) if isinstance(tree.left, Name) else (tree.right, tree.left)
            if isinstance(name, Name) and isinstance(other, Text) and self._signals[name.name].form == "state":
                return self._state(other.value, equal=tree.sign == "==")
            sides = [self._place(side) if isinstance(side, Name) else None for side in (tree.left, tree.right)]
            if any(sides) and all(
                place is not None or not isinstance(side, Name)
                for place, side in zip(sides, (tree.left, tree.right), strict=True)
            ):
                left, right = (
                    self._push(code=codes.OP_GIVEN, given=float(side.value))
                    if not isinstance(side, Name)
                    else self._side(side, place)
                    for place, side in zip(sides, (tree.left, tree.right), strict=True)
                )
                return self._push(code=_SIGNS[tree.sign], left=left, right=right)
        number = self._push(code=codes.OP_GIVEN, given=self._value(tree))
        self.given[number] = tree
        return number

    def _place(self, name: Name) -> Place | None:
        signal = self._signals[name.name]
        return signal.place(self._station) if isinstance(signal, DriveSignal) else None

    def _side(self, name: Name, place: Place | None) -> int:
        """One side of a comparison; of a bit whose field is a number, such as that of a fault, 0 or 1."""
        number = self._signal(name, place)
        if self._signals[name.name].form != "bit":
            return number
        return self._push(code=codes.OP_UNEQUAL, left=number, right=self._push(code=codes.OP_GIVEN))

    def _signal(self, name: Name, place: Place | None) -> int:
        number = self._field(place)
        signal = self._signals[name.name]
        if not isinstance(signal, DriveSignal) or not signal.is_said:
            return number
        return self._push(code=codes.OP_PRODUCT, left=number, right=self._field(_POWERED))

    def _field(self, place: Place | None) -> int:
        assert place is not None
        self.in_table = True
        own = place.in_row(self._station.index)
        code = codes.OP_AXIS_REAL if own.source == SOURCE_AXIS_REAL else codes.OP_AXIS_INTEGER
        return self._push(code=code, word=own.word, less=own.less, shift=own.shift, mask=own.mask, sign=own.sign)

    def _state(self, word: str, *, equal: bool) -> int:
        """``state == S4``: of a drive that is on; ``off`` is one that is not."""
        number = self._field(_POWERED)
        if word == "off":
            number = self._push(code=codes.OP_NOT, left=number, right=number)
        else:
            wanted = self._push(code=codes.OP_GIVEN, given=0.0 if word == "boot" else float(word[1:]))
            state = self._push(code=codes.OP_EQUAL, left=self._field(_STATE), right=wanted)
            number = self._push(code=codes.OP_AND, left=number, right=state)
        return number if equal else self._push(code=codes.OP_NOT, left=number, right=number)
