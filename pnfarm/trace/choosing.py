"""What a request for a trace means on a farm: columns and their places, what its trigger watches, and which level."""

from __future__ import annotations

from collections import defaultdict
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from pnfarm.errors import ConfigError
from pnfarm.faults.errors import InjectionError
from pnfarm.faults.plan import matching
from pnfarm.signals.device_signal import split_name
from pnfarm.station.axis import axes_by_name
from pnfarm.table import trace as codes
from pnfarm.trace.request import TraceError
from pnfarm.trace.signals import choose_signals, chooses_any, code_of, is_glob
from pnfarm.trace.traced import TracedAxis, TracedDevice, TracedModel
from pnfarm.trace.trigger import OF_DRIVES, TRIGGER, EventTrigger, SignalTrigger, read_level, read_number
from pnfarm.vocabulary.globs import means
from pnfarm.vocabulary.problem import Problem
from pnfarm.vocabulary.quantities import in_unit
from pnfarm.vocabulary.quoting import did_you_mean, shown

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from pnfarm.plant.part import PlantPart
    from pnfarm.station.axis import Axis
    from pnfarm.station.station import Station
    from pnfarm.table.access.places import Place
    from pnfarm.trace.request import TraceRequest
    from pnfarm.trace.signals import TraceSignal
    from pnfarm.trace.traced import Traced

__all__ = ["ColumnPlace", "TracedStations", "names_of"]

#: Columns of one trace.
MOST_COLUMNS = 2048


@dataclass(frozen=True, slots=True)
class ColumnPlace:
    """A column: where its value is among the probes, counted from the trace's first."""

    drive: str
    signal: TraceSignal
    probe: int


class TracedStations:
    """The axes, ``devices`` and ``models`` of the plant of a farm; what chooses among them raises :class:`TraceError`.

    ``by_name`` has each of them, ``concerned`` those that an event of a drive, an axis or a device is about.
    """

    def __init__(self, axes: Sequence[Axis], devices: Iterable[Station], models: Iterable[PlantPart]) -> None:
        self.by_name: dict[str, Traced] = {axis.configured_name: TracedAxis(axis) for axis in axes}
        found: dict[str, Traced] = {device.configured_name: TracedDevice(device) for device in devices}
        #: Those whose names may be before their signals'.
        self._named: dict[str, Traced] = {**found, **{model.configured_name: TracedModel(model) for model in models}}
        self.concerned: dict[str, list[Traced]] = {
            **{
                name: [self.by_name[one.configured_name] for one in found] for name, found in axes_by_name(axes).items()
            },
            **{name: [device] for name, device in found.items()},
        }
        self.by_name |= self._named

    def chosen(self, request: TraceRequest) -> list[Traced]:
        """Those that its globs mean."""
        known = {name: (one.names, one.kinds) for name, one in self.by_name.items()}
        return [self.by_name[name] for name in names_of(request, known)]

    def _signals(self, names: Sequence[str], of: Sequence[Traced]) -> list[tuple[Traced, TraceSignal]]:
        """The signals that names and globs choose ``of`` these, and those with a device or a model before theirs.

        Raises :class:`ConfigError`.
        """
        wanted: dict[str, list[str]] = defaultdict(list)
        plain = []
        for name in names:
            owner, signal = split_name(name.strip())
            if owner in self._named:
                wanted[owner].append(signal)
            else:
                plain.append(name)
        known = {one.name: one.signals() for one in of}
        has = {
            name: {
                what
                for what in {one.what for one in of}
                if any(one.what == what and chooses_any(known[one.name], name) for one in of)
            }
            for name in plain
        }
        for one in of:
            # words differ from profile to profile, and devices are no drives: a glob has to choose something on one of
            # all, a name on all of one kind
            wanted[one.name] += [
                name
                for name in plain
                if not (has[name] if is_glob(name) else has[name] - {one.what}) or chooses_any(known[one.name], name)
            ]
        found: dict[tuple[str, str], tuple[Traced, TraceSignal]] = {}
        for name in dict.fromkeys((*known, *wanted)):
            one = self.by_name[name]
            for chosen in choose_signals(name, known.get(name) or one.signals(), wanted[name]):
                found[name, chosen.name] = (one, chosen)
            if len(found) > MOST_COLUMNS:
                what = f"more than {MOST_COLUMNS} signals of {len(of)} drives and devices"
                raise ConfigError(f"{what}; allowed: fewer of them, or fewer signals")
        return list(found.values())

    def columns(self, request: TraceRequest, chosen: Sequence[Traced], places: list[Place]) -> list[ColumnPlace]:
        """The columns; ``places`` gets each field that is sampled once, also if several bits are in it."""
        with _error_of("signals"):
            signals = self._signals(request.signals, chosen)
        found: list[ColumnPlace] = []
        numbers: dict[Place, int] = {}
        for one, signal in signals:
            place = one.place(signal)
            if place not in numbers:
                numbers[place] = len(places)
                places.append(place)
            found.append(ColumnPlace(one.name, signal, numbers[place]))
        return found

    def trigger(
        self, request: TraceRequest, chosen: Sequence[Traced]
    ) -> tuple[list[tuple[Traced, Place]], float, int | None, list[Traced]]:
        """What the trigger watches: fields of drives and devices, its level, the number of a fault, whose events."""
        trigger = request.trigger
        watched = list(chosen)
        if trigger.on:
            # not only those that are traced: what one does may be seen at another
            watched = [one for one in self.by_name.values() if means(trigger.on, one.names, one.kinds)]
            if not watched:
                what = f"no drive matches {shown(trigger.on)}{did_you_mean(trigger.on, self.by_name)}"
                raise TraceError([("trigger", what, "a drive, a device, a model or a glob after `on`")])
        if isinstance(trigger, EventTrigger):
            if all(one.what == "model" for one in watched):
                what = f"{watched[0].name} is a model of the plant, which has no event {trigger.event}"
                raise TraceError([("trigger", what, "a comparison of a port, or `on` a drive or a device")])
            return [], 0.0, self._fault_number(trigger, watched), watched
        if not isinstance(trigger, SignalTrigger):
            return [], 0.0, None, watched
        if trigger.on and split_name(trigger.signal)[0] in self._named:
            what = f"{shown(trigger.text)} names two stations"
            raise TraceError([("trigger", what, "the device or the model before the signal, or after `on`")])
        with _error_of("trigger"):
            signals = self._signals([trigger.signal], watched)
        levels = {_level(trigger, signal, one) for one, signal in signals}
        if len(levels) > 1:
            what = f"{shown(trigger.text)} is not the same value on all drives"
            raise TraceError([("trigger", what, "drives of one model, or `on DRIVE`")])
        places = [(one, _bit_place(one.place(signal), signal.bit)) for one, signal in signals]
        return places, levels.pop(), None, [one for one, _ in signals]

    @staticmethod
    def _fault_number(trigger: EventTrigger, watched: Sequence[Traced]) -> int | None:
        if trigger.event not in OF_DRIVES:
            return None
        drives = [one for one in watched if isinstance(one, TracedAxis)]
        if not drives:
            what = f"{watched[0].name} is a device, and {trigger.event} is an event of a drive"
            raise TraceError([("trigger", what, "an event such as disconnect or injection, or `on DRIVE`")])
        if not trigger.argument:
            return None
        with _error_of("trigger"):
            numbers = {one.fault_number(trigger.argument) for one in drives}
        if len(numbers) > 1:
            what = f"{shown(trigger.text)} is not the same fault on all drives"
            raise TraceError([("trigger", what, "drives of one model, or `on DRIVE`")])
        return numbers.pop()


def names_of(request: TraceRequest, known: Mapping[str, tuple[tuple[str, ...], tuple[str, ...]]]) -> list[str]:
    """Those of the ``known`` that its globs mean; raises :class:`TraceError`."""
    try:
        return matching(request.on, known)
    except InjectionError as exc:
        raise TraceError(list(exc.issues)) from exc


@contextmanager
def _error_of(field: str) -> Iterator[None]:
    """What a drive cannot is wrong with this field of the request."""
    try:
        yield
    except ConfigError as exc:
        raise TraceError([(field, str(exc), "")]) from exc


def _bit_place(place: Place, bit: int | None) -> Place:
    """The place of a signal alone, also of a bit."""
    return place if bit is None else replace(place, shift=place.shift + bit, mask=1, sign=0)


def _level(trigger: SignalTrigger, signal: TraceSignal, of: Traced) -> float:
    """The level in the signal's unit; raises :class:`TraceError`."""
    edge = trigger.kind in {codes.TRIGGER_RISING, codes.TRIGGER_FALLING}
    if trigger.level is None:
        if edge and signal.is_real:
            what = f"{signal.name} needs a level in {signal.unit or 'its unit'}"
            raise TraceError([("trigger", what, f"such as `{signal.name} {trigger.text.split()[1]} 100`")])
        # between 0 and 1
        return 0.5
    if isinstance(of, TracedAxis) and signal.form == "fault":
        number = read_number(trigger.level)
        # a number is one of the manual, as in conditions: what no fault has would never be there
        if number is not None and (number == 0 or trigger.kind not in {codes.TRIGGER_EQUAL, codes.TRIGGER_UNEQUAL}):
            return number
        with _error_of("trigger"):
            return float(of.fault_number(trigger.level))
    if (code := code_of(signal.form, trigger.level)) is not None:
        return float(code)
    value, unit = read_level(trigger.level)
    if value is None:
        what = f"{shown(trigger.level)} is not a value of {signal.name}"
        raise TraceError([("trigger", what, "a number" if signal.is_real else f"a number or a name; {TRIGGER}")])
    try:
        # a signal's unit may be of two words: N m
        own = in_unit(value, unit, signal.unit.replace(" ", ""))
        return of.level(signal, own, exactly=trigger.kind in {codes.TRIGGER_EQUAL, codes.TRIGGER_UNEQUAL})
    except Problem as problem:
        raise TraceError([("trigger", f"{signal.name} {problem.what}", problem.allowed)]) from problem
