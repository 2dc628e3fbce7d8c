"""Who makes the inputs of a station, strongest first: a fault, a user's force, the plant, a program or the API.

A force is a value over what is written, a fault's *shape* makes another value of what is below it: what is overruled
waits, and is in force when the stronger one ends.  Signals may share octets and bits: one that lies in another's place
has the same owner.
"""

from __future__ import annotations

from functools import reduce
from operator import or_
from typing import TYPE_CHECKING, Literal, TypeAlias

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from pnfarm.signals.signal import Signal
    from pnfarm.wire.value_types import Value

__all__ = ["EVERY", "InputLayers", "Owner", "Shape"]

#: Instead of a signal's name, where forces are released: all of the station.
EVERY = "*"
#: The value below -> the one that the controller gets; of the signal's type.
Shape: TypeAlias = "Callable[[Value], Value]"
#: ``default``: it was never written; ``controller``: an output.
Owner: TypeAlias = Literal["controller", "fault", "force", "plant", "value", "default"]


class InputLayers:
    """``octets``: the inputs at the start; ``place``: the first octet of a signal's submodule in them."""

    def __init__(self, octets: bytes, place: Callable[[Signal], int]) -> None:
        self.written = octets
        self._place = place
        #: Bits that were written, those of the plant, those that are forced, and those under a shape.
        self._set = self._planted = self._forced = self._shaped = 0
        self._plant: dict[str, tuple[Signal, Value]] = {}
        self.forced: dict[str, tuple[Signal, Value]] = {}
        self.shapes: list[tuple[Signal, Shape]] = []
        #: Counts changes of owners.
        self.revision = 0

    def write(self, values: Mapping[Signal, Value]) -> None:
        """Values of a program or of the API, which are right."""
        octets = bytearray(self.written)
        for signal, value in values.items():
            signal.write(memoryview(octets)[self._place(signal) :], value)
            before, self._set = self._set, self._set | self._bits(signal)
            self.revision += before != self._set
        self.written = bytes(octets)

    def plant(self, values: Mapping[Signal, Value]) -> None:
        """Values of the plant, which are right; the inputs are its own from now on."""
        known = len(self._plant)
        for signal, value in values.items():
            self._plant[signal.name] = signal, value
        if len(self._plant) != known:
            self._planted = reduce(or_, (self._bits(signal) for signal, _ in self._plant.values()), 0)
            self.revision += 1

    def force(self, values: Mapping[Signal, Value | None]) -> None:
        """Values of a user, which are right; None releases one."""
        for signal, value in values.items():
            self.forced.pop(signal.name, None)
            if value is not None:
                self.forced[signal.name] = signal, value
        self._forced = reduce(or_, (self._bits(signal) for signal, _ in self.forced.values()), 0)
        self.revision += 1

    def state(self) -> tuple[bytes, int]:
        """What is written, and the bits that were written."""
        return self.written, self._set

    def put_state(self, written: bytes, bits: int, forced: Mapping[str, tuple[Signal, Value]]) -> None:
        """What :meth:`state` gave, and the inputs that are forced instead of those that are."""
        self.written, self._set = written, bits
        self.forced = dict(forced)
        self.force({})

    def put(self, signal: Signal, shape: Shape) -> None:
        """The latest shape of an input sees what those before it give."""
        self.shapes.append((signal, shape))
        self._shape()

    def take(self, signal: Signal, shape: Shape) -> None:
        """Undo it."""
        self.shapes.remove((signal, shape))
        self._shape()

    def _shape(self) -> None:
        self._shaped = reduce(or_, (self._bits(signal) for signal, _ in self.shapes), 0)
        self.revision += 1

    def octets(self) -> bytes:
        """What the controller gets."""
        octets = bytearray(self.written)
        for signal, value in (*self._plant.values(), *self.forced.values()):
            signal.write(memoryview(octets)[self._place(signal) :], value)
        for signal, shape in self.shapes:
            data = memoryview(octets)[self._place(signal) :]
            if (made := shape(value := signal.read(data))) != value:
                signal.write(data, made)
        return bytes(octets)

    def owner(self, signal: Signal) -> Owner:
        """Who has an input now."""
        bits = self._bits(signal)
        if bits & self._shaped:
            return "fault"
        if bits & self._forced:
            return "force"
        if bits & self._planted:
            return "plant"
        return "value" if bits & self._set else "default"

    def _bits(self, signal: Signal) -> int:
        """One for each bit that it has in the station's inputs."""
        first = 8 * (self._place(signal) + signal.octet)
        return 1 << first + signal.bit if signal.bit is not None else (1 << 8 * signal.type.octets) - 1 << first
