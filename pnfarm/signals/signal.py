"""A named value of a station: where it lies in a submodule's cyclic data, its type, unit and scale.

*Input* and *output* are the controller's: an input goes to it.  ``value = raw * scale``, in ``unit``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from pnfarm.vocabulary.problem import Problem
from pnfarm.vocabulary.quoting import shown

if TYPE_CHECKING:
    from pnfarm.config.device import SignalPlace
    from pnfarm.wire.value_types import ByteOrder, Value, ValueType

__all__ = ["Direction", "Signal", "place_signal"]

Direction = Literal["input", "output"]

#: Of a number of double precision that was multiplied and divided.
_ROUNDING = 1e-15
_WORDS = {"true": True, "on": True, "1": True, "false": False, "off": False, "0": False}


@dataclass(frozen=True, slots=True)
class Signal:
    """One signal.

    ``octet`` counts from the first of the submodule's inputs or outputs, ``bit`` (0 to 7, of a ``bool``) from the least
    significant one; None where the value has octets of its own.  ``exported``: as a metric.  ``stepped``: in virtual
    time it changes with its model's own steps alone, each of which is an event.
    """

    name: str
    direction: Direction
    slot: int
    subslot: int
    octet: int
    type: ValueType
    bit: int | None = None
    unit: str = ""
    scale: float = 1.0
    order: ByteOrder = "big"
    exported: bool = False
    stepped: bool = False

    @property
    def end(self) -> int:
        """The octet after its last one."""
        return self.octet + self.type.octets

    @property
    def place(self) -> str:
        """``slot.subslot.octet.bit``, as a farm file writes it."""
        numbers = (self.slot, self.subslot, self.octet, self.bit)
        return ".".join(str(number) for number in numbers if number is not None)

    def read(self, octets: bytes | bytearray | memoryview) -> Value:
        """The value in a submodule's data of its direction."""
        self._check_length(octets)
        if self.bit is not None:
            return bool(octets[self.octet] >> self.bit & 1)
        value = self.type.decode(bytes(octets[self.octet : self.end]), self.order)
        return value * self.scale if self.scale != 1 and isinstance(value, int | float) else value

    def write(self, octets: bytearray | memoryview, value: Value) -> None:
        """Put a value into a submodule's data; :class:`Problem`, and nothing changed, for one that does not fit."""
        self._check_length(octets)
        raw = self._raw(value)
        encoded = self.type.encode(raw, self.order)
        if self.bit is None:
            octets[self.octet : self.end] = encoded
        elif encoded[0]:
            octets[self.octet] |= 1 << self.bit
        else:
            octets[self.octet] &= ~(1 << self.bit) & 0xFF

    def check(self, value: object) -> Value:
        """A value that a user gives, as :meth:`write` takes it; :class:`Problem` for one that cannot be written."""
        if self.direction == "output":
            raise Problem("is an output: the controller alone writes it", "an input of the controller")
        if not isinstance(value, bool | int | float | str | bytes):
            raise Problem(f"is {shown(value)}", f"a value of type {self.type.name}")
        found = self.parse(value) if isinstance(value, str) else value
        self.write(bytearray(self.end), found)
        return found

    def refusal(self, value: object) -> Problem | None:
        """Why :meth:`check` refuses a value; None if it does not."""
        try:
            self.check(value)
        except Problem as problem:
            return problem
        return None

    def taken(self, value: Value) -> Value:
        """The value as it is read back when it has been written; a text is parsed.  :class:`Problem` as there."""
        octets = bytearray(self.end)
        self.write(octets, self.parse(value) if isinstance(value, str) else value)
        return self.read(octets)

    def parse(self, text: str) -> Value:
        """A user's text as a value: ``true``, ``off``, ``12.5``, ``0x1F``, ``00 ff``; :class:`Problem` otherwise.

        The value is one that :meth:`write` takes.
        """
        value = self._parsed(text)
        self.type.encode(self._raw(value), self.order)
        return value

    def show(self, value: Value) -> str:
        """A value as :meth:`parse` takes it: without its unit."""
        match value:
            case bool():
                return "true" if value else "false"
            case bytes():
                return value.hex(" ")
            case float() if self.scale != 1:
                return f"{value:.12g}"
            case float() if self.type.octets == 4 and math.isfinite(value):
                # the fewest digits that single precision keeps
                return next(text for digits in range(6, 10) if _is(text := f"{value:.{digits}g}", value, self.type))
            case _:
                return str(value)

    def _check_length(self, octets: bytes | bytearray | memoryview) -> None:
        if self.end > len(octets):
            raise Problem(
                f"{self.name} ends with octet {self.end - 1} of its submodule", f"places in its {len(octets)} octets"
            )

    def _parsed(self, text: str) -> Value:
        word = text.strip()
        match self.type.kind:
            case "bool":
                found = _WORDS.get(word.lower())
                if found is None:
                    raise Problem(f"{shown(text)} is not a switch", "true, false, on, off, 1 or 0")
                return found
            case "octets":
                try:
                    return bytes.fromhex(word.removeprefix("0x"))
                except ValueError as error:
                    raise Problem(f"{shown(text)} is not hexadecimal", "octets such as '00 01 ff'") from error
            case "text":
                return text
            case _:
                return _number(word)

    def _raw(self, value: Value) -> Value:
        """What the octets hold."""
        if not self.type.is_number:
            return value
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise Problem(f"{shown(value)} is not a number", "a number")
        if self.scale == 1:
            return value
        try:
            exact = value / self.scale
        except OverflowError as error:
            raise Problem(f"{shown(value)} is too large", "a number with fewer digits") from error
        if self.type.kind == "float":
            return exact
        low, high = sorted(limit * self.scale for limit in self.type.limits)
        if not math.isfinite(exact):
            raise Problem(f"{shown(value)} is not a finite number", f"{low:g} to {high:g}")
        raw = round(exact)
        least, most = self.type.limits
        if math.isclose(exact, most, rel_tol=_ROUNDING) or math.isclose(exact, least, rel_tol=_ROUNDING):
            # a limit of 64 bits, as it is read, is beyond it on the way back
            raw = min(max(raw, int(least)), int(most))
        if not least <= raw <= most:
            raise Problem(f"{shown(value)} is outside of {self.type.name} scaled by {self.scale:g}",
                          f"{low:g} to {high:g}{self.unit and f' {self.unit}'}")  # fmt: skip
        return raw


def _is(text: str, value: float, kind: ValueType) -> bool:
    return kind.decode(kind.encode(float(text))) == value


def _number(word: str) -> int | float:
    """A number: whole ones exactly, with 0x or decimal, else a fraction."""
    bare = word.removeprefix("-").lower()
    if len(word) <= 64:
        try:
            return int(word, 16) if bare.startswith("0x") else int(word)
        except ValueError:
            pass
        try:
            return float(word)
        except ValueError:
            pass
    raise Problem(f"{shown(word)} is not a number", "a number such as 12, 0x1F or 1.5")


def place_signal(
    name: str, place: SignalPlace, input_octets: int, output_octets: int, order: ByteOrder = "big"
) -> Signal:
    """A signal of the farm file in a submodule with these octets, whose order is the bus's unless it has its own.

    Without a direction it is an input where the submodule has inputs, else an output.  Raises :class:`Problem` where
    the place is outside of the data.
    """
    slot, subslot, octet, bit = place.at
    direction: Direction = place.direction or ("input" if input_octets else "output")
    octets = input_octets if direction == "input" else output_octets
    kind = place.value_type
    signal = Signal(
        name,
        direction,
        slot,
        subslot,
        octet,
        kind,
        bit,
        place.unit,
        place.scale,
        place.order or order,
        bool(place.metrics),
    )
    if signal.end > octets:
        other = output_octets if direction == "input" else input_octets
        hint = f"; it has {other} octets of {'output' if direction == 'input' else 'input'}s" if other else ""
        raise Problem(
            f"slot {slot}, subslot {subslot} has {octets} octets of {direction}s, {place.text} ends after them" + hint,
            f"octets 0 to {octets - kind.octets}" if octets >= kind.octets else "a submodule with data",
        )
    return signal
