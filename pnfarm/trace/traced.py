"""What a trace samples: axes, devices and models of the plant, each with its signals by name."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

from pnfarm.signals.device_signal import DeviceSignal
from pnfarm.signals.places import PLAIN_SOURCES, plain_place
from pnfarm.table.access.places import Place
from pnfarm.table.trace import SOURCE_PLAIN_UNSIGNED, SOURCE_PLANT
from pnfarm.trace.signals import OF_IMAGE, TraceSignal, signals_of

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pnfarm.plant.part import PlantPart
    from pnfarm.signals.signal import Signal
    from pnfarm.station.axis import Axis
    from pnfarm.station.station import Station

__all__ = ["Traced", "TracedAxis", "TracedDevice", "TracedModel"]

#: Octets of whole numbers that a sample, a number of double precision, holds exactly.
_EXACT = 6


class Traced(Protocol):
    """``names`` and ``kinds`` are what globs find it by, as of :func:`pnfarm.vocabulary.globs.means`."""

    #: ``drive``, ``device`` or ``model``.
    what: str
    name: str
    #: Its process image; None of a model.
    image: Any

    @property
    def names(self) -> tuple[str, ...]: ...
    @property
    def kinds(self) -> tuple[str, ...]: ...

    def signals(self) -> Mapping[str, TraceSignal]:
        """By name, as they are now."""

    def place(self, signal: TraceSignal) -> Place:
        """Where the engine finds one of them."""

    def level(self, signal: TraceSignal, value: float, *, exactly: bool) -> float:
        """The number that a sample has for a value; raises :class:`Problem` for one that it never has."""


class TracedAxis:
    """An axis of a drive."""

    what = "drive"

    def __init__(self, axis: Axis) -> None:
        self.name = axis.configured_name
        self.image = axis.handle.image
        self._axis = axis

    @property
    def names(self) -> tuple[str, ...]:
        return (self.name, self._axis.device.name or self.name)

    @property
    def kinds(self) -> tuple[str, ...]:
        return (self._axis.model.name, *self._axis.model.aliases)

    def signals(self) -> dict[str, TraceSignal]:
        return signals_of(self._axis)

    def place(self, signal: TraceSignal) -> Place:
        return signal.place.in_row(self._axis.index)

    def level(self, signal: TraceSignal, value: float, *, exactly: bool) -> float:
        del signal, exactly
        return value

    def fault_number(self, fault: str) -> int:
        """Of one by number or name; raises :class:`ConfigError`."""
        return self._axis.model.fault(fault).number


class TracedDevice:
    """A station without axes: its signals of plain data that are numbers or bits, and those of its connection."""

    what = "device"

    def __init__(self, station: Station) -> None:
        self.name = station.configured_name
        self.image = station.image
        self._station = station

    @property
    def names(self) -> tuple[str, ...]:
        return (self.name, self._station.device.name or self.name)

    @property
    def kinds(self) -> tuple[str, ...]:
        return self._station.kinds

    def signals(self) -> Mapping[str, TraceSignal]:
        signals = self._station.signals
        if signals is None:
            return OF_IMAGE
        own = {name: signals.signal(name) for name in signals.names}
        return {
            **{
                name: _traced(signal, *signals.whereabouts(name))
                for name, signal in own.items()
                if signal.type.kind in PLAIN_SOURCES
            },
            **{name: one for name, one in OF_IMAGE.items() if name not in own},
        }

    def place(self, signal: TraceSignal) -> Place:
        return signal.place.in_row(self._station.index)

    def level(self, signal: TraceSignal, value: float, *, exactly: bool) -> float:
        known = self._station.signals
        if known is None or signal.place.source < SOURCE_PLAIN_UNSIGNED:
            return value
        return DeviceSignal(self.name, known.signal(signal.name)).number(value, exactly=exactly)


class TracedModel:
    """A model of the plant: its ports."""

    what = "model"
    image = None

    def __init__(self, part: PlantPart) -> None:
        self.name = part.configured_name
        self.names = (self.name,)
        self.kinds = part.kinds
        self._signals = {
            signal.name: TraceSignal(
                signal.name,
                signal.unit,
                f"{signal.direction} of the model",
                Place(SOURCE_PLANT, part.signals.number(signal.name), 0),
                "bit" if signal.type.kind == "bool" else "real",
            )
            for signal, _, _ in part.signals.readings()
        }

    def signals(self) -> Mapping[str, TraceSignal]:
        return self._signals

    def place(self, signal: TraceSignal) -> Place:
        return signal.place

    def level(self, signal: TraceSignal, value: float, *, exactly: bool) -> float:
        del signal, exactly
        return value


def _traced(signal: Signal, row: int, octet: int) -> TraceSignal:
    """A signal of a device, whose data begin at ``octet`` of its ``row``."""
    kind = signal.type
    whole = kind.kind in {"int", "uint"} and signal.scale == 1 and kind.octets <= _EXACT
    form = "bit" if kind.kind == "bool" else "word" if whole else "real"
    doc = f"{signal.direction} {signal.place}, {kind.name}"
    return TraceSignal(signal.name, signal.unit, doc, plain_place(signal, row, octet), form, signal.bit)
