"""The signals of a station with plain data: read, written all or nothing, and whether they changed.

*Input* and *output* are the controller's: an input is written here and goes to it, an output is what it sent.  A
*shape* is what a fault makes of an input on its way: while it is there, what users write waits behind it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeAlias

from pnfarm.signals.refusal import SignalError
from pnfarm.table.channel import IOXS_GOOD
from pnfarm.vocabulary.problem import Problem
from pnfarm.vocabulary.quoting import did_you_mean, few_hints, shown

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from pnfarm.signals.signal import Direction, Signal
    from pnfarm.table.access.plain_data import ConsumedData, ProvidedData
    from pnfarm.wire.value_types import Value

__all__ = ["Shape", "StationSignals"]

#: The value that is written -> the one that the controller gets; of the signal's type.
Shape: TypeAlias = "Callable[[Value], Value]"


class StationSignals:
    """``places``: slot, subslot and direction of a submodule's data -> their first octet in the station's row.

    In each direction they are in the order of the row's provider statuses.  ``inputs`` and ``outputs`` are the rows,
    None where the station has no data of that direction.
    """

    def __init__(
        self,
        signals: Mapping[str, Signal],
        places: Mapping[tuple[int, int, Direction], int],
        inputs: ProvidedData | None,
        outputs: ConsumedData | None,
    ) -> None:
        self._signals = dict(signals)
        self._places = dict(places)
        self._inputs = inputs
        self._outputs = outputs
        numbers: dict[str, int] = {}
        #: The number of each submodule's provider status.
        self._statuses: dict[tuple[int, int, Direction], int] = {}
        for place in places:
            self._statuses[place] = numbers.setdefault(place[2], 0)
            numbers[place[2]] += 1
        self._shapes: list[tuple[Signal, Shape]] = []
        #: The inputs as users wrote them, while there are shapes.
        self._written = b""
        self._revision = 0
        self._seen = self._copies()

    @property
    def names(self) -> tuple[str, ...]:
        """In the order of the file."""
        return tuple(self._signals)

    def signal(self, name: str) -> Signal:
        """One by its name; raises :class:`SignalError`."""
        found = self._signals.get(name)
        if found is None:
            raise SignalError([self._unknown(name)])
        return found

    def get(self, name: str) -> Value:
        """The present value; raises :class:`SignalError` for an unknown name."""
        signal = self.signal(name)
        return signal.read(self._data_of(signal, self._copies()))

    def get_all(self) -> dict[str, Value]:
        """Every value; those of one direction are of one time."""
        return {signal.name: value for signal, value, _ in self.readings()}

    def good(self, name: str) -> bool:
        """Whether the provider status of its data is GOOD; raises :class:`SignalError` for an unknown name."""
        return self._is_good(self.signal(name), self._copies())

    def readings(self) -> list[tuple[Signal, Value, bool]]:
        """Every signal with its value and whether its data are good; those of one direction are of one time."""
        copies = self._copies()
        return [
            (signal, signal.read(self._data_of(signal, copies)), self._is_good(signal, copies))
            for signal in self._signals.values()
        ]

    def set(self, values: Mapping[str, Value]) -> None:
        """Write signals, all in force at once; a text is parsed by the signal's type.

        Raises :class:`SignalError` with the reason of every value that is refused; then nothing is changed.
        """
        octets = bytearray(self._unshaped())
        refused = []
        with few_hints():
            for name, value in values.items():
                try:
                    self._put(octets, name, value)
                except Problem as problem:
                    refused.append((name, problem.what, problem.allowed))
                except SignalError as error:
                    refused += error.issues
        if refused:
            raise SignalError(refused)
        self._written = bytes(octets)
        self.apply()

    # -- shapes ------------------------------------------------------------------------------------------------------

    @property
    def shaped(self) -> tuple[str, ...]:
        """The inputs that have a shape, once for each."""
        return tuple(signal.name for signal, _ in self._shapes)

    def put_shape(self, signal: Signal, shape: Shape) -> None:
        """Put a shape over an input; the latest of one input sees what those before it give."""
        self._written = self._unshaped()
        self._shapes.append((signal, shape))
        self.apply()

    def take_shape(self, signal: Signal, shape: Shape) -> None:
        """Remove one: what was written meanwhile goes to the controller."""
        written = self._unshaped()
        self._shapes.remove((signal, shape))
        self._written = written
        self.apply()

    def apply(self) -> None:
        """Send what the shapes make of what was written; to be called as well when a shape changes its mind."""
        if self._inputs is None:
            return
        octets = bytearray(self._written)
        for signal, shape in self._shapes:
            data = memoryview(octets)[self._place(signal) :]
            signal.write(data, shape(signal.read(data)))
        if octets != self._inputs.read():
            self._inputs.write({0: bytes(octets)})

    def _unshaped(self) -> bytes:
        if self._shapes:
            return self._written
        return b"" if self._inputs is None else self._inputs.read()

    def _place(self, signal: Signal) -> int:
        return self._places[signal.slot, signal.subslot, "input"]

    # ----------------------------------------------------------------------------------------------------------------

    @property
    def revision(self) -> int:
        """Counts the changes of values and statuses of either direction, as far as somebody has looked."""
        seen = self._copies()
        if seen != self._seen:
            self._seen = seen
            self._revision += 1
        return self._revision

    def _put(self, octets: bytearray, name: str, value: Value) -> None:
        signal = self.signal(name)
        found = signal.check(value)
        signal.write(memoryview(octets)[self._place(signal) :], found)

    def _unknown(self, name: str) -> tuple[str, str, str]:
        hint = did_you_mean(name, self._signals)
        return shown(name).strip("'"), f"is not a signal{hint}", "" if hint else self._few_names()

    def _few_names(self) -> str:
        names = self.names
        return ", ".join(names[:8]) + (f" and {len(names) - 8} more" if len(names) > 8 else "") or "none"

    def _copies(self) -> tuple[tuple[bytes, bytes], tuple[bytes, bytes]]:
        """Data and statuses of both directions."""
        return (
            (b"", b"") if self._inputs is None else self._inputs.whole(),
            (b"", b"") if self._outputs is None else self._outputs.whole(),
        )

    def _data_of(self, signal: Signal, copies: tuple[tuple[bytes, bytes], tuple[bytes, bytes]]) -> memoryview:
        data, _ = copies[signal.direction == "output"]
        return memoryview(data)[self._places[signal.slot, signal.subslot, signal.direction] :]

    def _is_good(self, signal: Signal, copies: tuple[tuple[bytes, bytes], tuple[bytes, bytes]]) -> bool:
        _, statuses = copies[signal.direction == "output"]
        return bool(statuses[self._statuses[signal.slot, signal.subslot, signal.direction]] & IOXS_GOOD)
