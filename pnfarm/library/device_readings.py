"""A device of a farm in this process: what it reads now, and its signals."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from pnfarm.errors import ConfigError
from pnfarm.farm.views.stations import device_snapshot
from pnfarm.signals.layers import EVERY
from pnfarm.signals.refusal import SignalError
from pnfarm.vocabulary.problem import Problem

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from pnfarm.farm.core import FarmCore
    from pnfarm.signals.signal import Signal
    from pnfarm.station.plain_signals import PlainSignals
    from pnfarm.station.station import Station
    from pnfarm.wire.value_types import Value

__all__ = ["DeviceReadings", "Signals", "read_back"]


def read_back(signal: Signal, value: Value) -> Value:
    """A value as it is read once it has been written; raises :class:`SignalError` for one that there cannot be."""
    try:
        return signal.taken(value)
    except Problem as problem:
        raise SignalError([(signal.name, problem.what, problem.allowed)]) from problem


class Signals(Mapping[str, "Value"]):
    """The signals of a device by name: values are the present ones, an assignment writes an input of the controller.

    Errors are :class:`pnfarm.errors.ConfigError`, with a sentence about each signal.
    """

    def __init__(self, known: PlainSignals | None, changed: Callable[[], None]) -> None:
        self._known = known
        self._changed = changed

    def __getitem__(self, name: str) -> Value:
        return self._any.get(name)

    def __setitem__(self, name: str, value: Value) -> None:
        self.set({name: value})

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)

    def __contains__(self, name: object) -> bool:
        return name in self._names

    def set(self, values: Mapping[str, Value]) -> dict[str, str]:
        """Write several, all in force at once, or none.

        Returns those that have a stronger owner, ``fault`` or ``force``: the written value takes effect when that ends.
        """
        overruled = dict(self._any.set(values))
        self._changed()
        return overruled

    def force(self, values: Mapping[str, Value]) -> dict[str, str]:
        """Values over what is written, until :meth:`release`; returns those that a fault has."""
        overruled = dict(self._any.force(values))
        self._changed()
        return overruled

    def release(self, *names: str) -> None:
        """End the force of these inputs, or of all: what was written meanwhile is in force."""
        self._any.force(dict.fromkeys(names or (EVERY,)))
        self._changed()

    def owner(self, name: str) -> str:
        """Whose value it has: ``controller``, ``fault``, ``force``, ``value``, ``default``."""
        return self._any.owner(name)

    @property
    def forced(self) -> dict[str, Value]:
        """The forced inputs with their values."""
        return {} if self._known is None else dict(self._known.forced)

    def good(self, name: str) -> bool:
        """Whether the provider status of its data is GOOD."""
        return self._any.good(name)

    def signal(self, name: str) -> Signal:
        """Its type, unit and place."""
        found: Signal = self._any.signal(name)
        return found

    @property
    def _names(self) -> tuple[str, ...]:
        return () if self._known is None else self._known.names

    @property
    def _any(self) -> PlainSignals:
        if self._known is None:
            raise ConfigError("the device has no signals: none of its modules has data")
        return self._known


class DeviceReadings:
    """``now`` is the farm's clock, ns."""

    def __init__(self, core: FarmCore, station: Station, now: Callable[[], int], changed: Callable[[], None]) -> None:
        self._core = core
        self._station = station
        self._now = now
        #: Its signals by name; ``device.signals["part_present"] = True`` writes one.
        self.signals = Signals(station.signals, changed)

    @property
    def name(self) -> str:
        return self._station.configured_name

    @property
    def connected(self) -> bool:
        """Whether it exchanges data with its controller."""
        return bool(self.snapshot()["connected"])

    def snapshot(self) -> dict[str, Any]:
        """Everything at once, as ``GET devices/{name}`` gives it."""
        return device_snapshot(self._station, self._now())

    def holds(self, name: str, value: Value | Callable[[Value], object]) -> Callable[[], bool]:
        """Whether a signal has a value, or one that a function accepts; raises for one that it cannot have."""
        signal = self.signals.signal(name)
        if callable(value):
            return lambda: bool(value(self.signals[name]))
        wanted = read_back(signal, value)
        return lambda: self.signals[name] == wanted

    def in_words(self, name: str) -> str:
        """A signal as messages show it."""
        signal = self.signals.signal(name)
        text = signal.show(self.signals[name])
        return f"{self.name}.{name} = {text}{f' {signal.unit}' if signal.unit else ''}"

    def __repr__(self) -> str:
        link = "connected" if self.connected else "not connected"
        return f"<{type(self).__name__} {self.name}, {link}, {len(self.signals)} signals>"
