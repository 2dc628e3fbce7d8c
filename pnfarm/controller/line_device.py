"""A device (a station without axes) as a program sees it: ``self.line.device("island-1").outputs.valve_1 = True``.

Values are those of the device's signals, by name.  What is read in one cycle is of one time, and what is written in one
cycle is sent together.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.table.channel import IOXS_GOOD
from pnfarm.vocabulary.problem import Problem
from pnfarm.vocabulary.quoting import did_you_mean

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from pnfarm.buses.controller import DeviceData
    from pnfarm.signals.signal import Direction, Signal
    from pnfarm.wire.value_types import Value

__all__ = ["DeviceInputs", "DeviceOutputs", "LineDevice"]


class _Values:
    """Signals of one direction in a copy of the device's data."""

    _device: str
    _signals: Mapping[str, tuple[Signal, int]]
    _octets: bytearray

    def __init__(self, device: str, signals: Mapping[str, tuple[Signal, int]], octets: int) -> None:
        own = {"_device": device, "_signals": signals, "_octets": bytearray(octets)}
        for name, value in own.items():
            object.__setattr__(self, name, value)

    def _find(self, name: str, error: type[Exception]) -> tuple[Signal, memoryview]:
        found = self._signals.get(name)
        if found is None:
            hint, known = did_you_mean(name, self._signals), ", ".join(list(self._signals)[:20]) or "none"
            raise error(f"{self._device} has no signal {name!r} in this direction{hint}; it has {known}")
        signal, place = found
        return signal, memoryview(self._octets)[place:]

    def __getitem__(self, name: str) -> Value:
        signal, data = self._find(name, KeyError)
        return signal.read(data)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        signal, data = self._find(name, AttributeError)
        return signal.read(data)

    def __contains__(self, name: object) -> bool:
        return name in self._signals

    def __iter__(self) -> Iterator[str]:
        return iter(self._signals)

    def __len__(self) -> int:
        return len(self._signals)

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *self._signals]

    def __repr__(self) -> str:
        return f"{type(self).__name__}({', '.join(f'{name}={self[name]!r}' for name in self._signals)})"


class DeviceInputs(_Values):
    """What the device sent last."""

    _numbers: Mapping[tuple[int, int], int]
    _statuses: bytes

    def __init__(
        self,
        device: str,
        signals: Mapping[str, tuple[Signal, int]],
        octets: int,
        statuses: Mapping[tuple[int, int], int],
    ) -> None:
        super().__init__(device, signals, octets)
        object.__setattr__(self, "_numbers", statuses)
        object.__setattr__(self, "_statuses", bytes(len(statuses)))

    def __setattr__(self, name: str, value: object) -> None:
        self._find(name, AttributeError)
        raise AttributeError(f"{self._device}: {name} comes from the device")

    def good(self, name: str) -> bool:
        """Whether the provider status of a signal's data is GOOD; raises :class:`KeyError`."""
        signal, _ = self._find(name, KeyError)
        # a bus whose submodules have no status of their own has one for all
        number = min(self._numbers[signal.slot, signal.subslot], len(self._statuses) - 1)
        return bool(self._statuses[number] & IOXS_GOOD)

    def _take(self, octets: bytes, statuses: bytes) -> None:
        self._octets[:] = octets
        object.__setattr__(self, "_statuses", statuses)


class DeviceOutputs(_Values):
    """What the device gets next; values stay until they are changed."""

    def __setitem__(self, name: str, value: Value) -> None:
        signal, data = self._find(name, KeyError)
        self._put(signal, data, value)

    def __setattr__(self, name: str, value: Value) -> None:
        signal, data = self._find(name, AttributeError)
        self._put(signal, data, value)

    @staticmethod
    def _put(signal: Signal, data: memoryview, value: Value) -> None:
        try:
            signal.write(data, signal.parse(value) if isinstance(value, str) else value)
        except Problem as problem:
            raise ValueError(f"{signal.name}: {problem.what}; allowed: {problem.allowed}") from None


class LineDevice:
    """See the module's docstring."""

    def __init__(self, name: str, data: DeviceData, is_connected: Callable[[], bool]) -> None:
        def those(way: Direction) -> dict[str, tuple[Signal, int]]:
            found = (one for one in data.signals.values() if one.direction == way)
            return {one.name: (one, data.places[one.slot, one.subslot, way]) for one in found}

        inputs = [(slot, subslot) for slot, subslot, way in data.places if way == "input"]
        self.name = name
        self.inputs = DeviceInputs(name, those("input"), data.received.octets, {at: i for i, at in enumerate(inputs)})
        self.outputs = DeviceOutputs(name, those("output"), data.sent.octets)
        self._sent, self._received = data.sent, data.received
        self._is_connected = is_connected
        self._given = bytes(data.sent.octets)

    @property
    def connected(self) -> bool:
        """Whether the device exchanges data with the controller."""
        return self._is_connected()

    def take(self) -> None:
        """Copy what came last."""
        self.inputs._take(*self._received.whole())  # noqa: SLF001 - the view is this device's own

    def give(self) -> None:
        """Send what was written since the last time."""
        octets = bytes(self.outputs._octets)  # noqa: SLF001 - the view is this device's own
        if octets != self._given:
            self._given = octets
            self._sent.write({0: octets})
