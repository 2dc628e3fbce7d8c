"""The signals of a station with plain data: read, written all or nothing, whose they are, and whether they changed.

*Input* and *output* are the controller's: an input is written here and goes to it, an output is what it sent.  What is
written waits while a fault, a user's force or the plant has the input (:mod:`pnfarm.signals.layers`).
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from pnfarm.signals.layers import EVERY, InputLayers
from pnfarm.signals.refusal import SignalError, all_or_none
from pnfarm.table.channel import IOXS_GOOD
from pnfarm.vocabulary.quoting import did_you_mean, few_hints, shown

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pnfarm.signals.layers import Owner, Shape
    from pnfarm.signals.signal import Direction, Signal
    from pnfarm.table.access.plain_data import ConsumedData, ProvidedData
    from pnfarm.wire.value_types import Value

__all__ = ["StationSignals"]


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
        self._signals = signals
        self._places = places
        self._inputs = inputs
        self._outputs = outputs
        numbers: dict[str, int] = {}
        #: The number of each submodule's provider status.
        self._statuses: dict[tuple[int, int, Direction], int] = {}
        for place in places:
            self._statuses[place] = numbers.setdefault(place[2], 0)
            numbers[place[2]] += 1
        self._layers = InputLayers(b"" if inputs is None else inputs.read(), self._place)
        self._revision = 0
        self._seen = self._state()

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

    def whereabouts(self, name: str) -> tuple[int, int]:
        """The row of plain data of its direction, and its first octet there; raises as :meth:`signal`."""
        signal = self.signal(name)
        row = self._outputs if signal.direction == "output" else self._inputs
        assert row is not None
        return row.number, self._places[signal.slot, signal.subslot, signal.direction] + signal.octet

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

    def set(self, values: Mapping[str, Value]) -> dict[str, Owner]:
        """Write signals, all in force at once; a text is parsed by the signal's type.

        Returns those that a fault, a force or the plant has now: what was written waits behind it.  Raises
        :class:`SignalError` with the reason of every value that is refused; then nothing is changed.
        """
        written = self._checked(values)
        self._layers.write(written)
        self.apply()
        owners = {signal.name: self.owner(signal.name) for signal in written}
        return {name: owner for name, owner in owners.items() if owner != "value"}

    def force(self, values: Mapping[str, Value | None]) -> dict[str, Owner]:
        """As :meth:`set`, over what is written, until it is released by None; :data:`EVERY`: None releases all.

        Returns those that a fault has now.
        """
        released = [name for name, value in values.items() if value is None]
        names = [name for name in released if name != EVERY] + (list(self._layers.forced) if EVERY in released else [])
        forced = self._checked({name: value for name, value in values.items() if value is not None})
        self._layers.force({**{self.signal(name): None for name in names}, **forced})
        self.apply()
        return {signal.name: "fault" for signal in forced if self._layers.owner(signal) == "fault"}

    def take(self, values: Mapping[str, Value]) -> None:
        """Values of the plant, over what is written, all in force at once; they are right."""
        self._layers.plant({self.signal(name): value for name, value in values.items()})
        self.apply()

    def owner(self, name: str) -> Owner:
        """Whose value it has; raises :class:`SignalError` for an unknown name."""
        signal = self.signal(name)
        return "controller" if signal.direction == "output" else self._layers.owner(signal)

    @property
    def forced(self) -> dict[str, Value]:
        """The inputs that are forced, and their values, which a fault may overrule."""
        return {name: value for name, (_, value) in self._layers.forced.items()}

    # -- its state

    def state(self) -> dict[str, object]:
        """What is written, hexadecimal, and forced; faults and the plant are not part of it."""
        octets, bits = self._layers.state()
        return {"written": octets.hex(), "set": f"{bits:x}", "forced": self.forced}

    def take_state(self, state: Mapping[str, object], *, check: bool = False) -> None:
        """What :meth:`state` gave; ``check``: only look whether it fits.  Raises :class:`SignalError`."""
        written, bits, forced = (state.get(key) for key in ("written", "set", "forced"))
        size = len(self._layers.written)
        if not isinstance(written, str) or not re.fullmatch(rf"[0-9a-f]{{{2 * size}}}", written):
            raise SignalError([("written", f"is {shown(written)}", f"{size} octets of inputs, hexadecimal")])
        if not isinstance(bits, str) or not re.fullmatch(rf"[0-9a-f]{{1,{2 * size or 1}}}", bits):
            raise SignalError([("set", f"is {shown(bits)}", f"at most {size} octets of bits, hexadecimal")])
        if not isinstance(forced, dict):
            raise SignalError([("forced", f"is {shown(forced)}", "a mapping of signals")])
        values = self._checked(forced)
        if not check:
            inputs = {signal.name: (signal, value) for signal, value in values.items()}
            self._layers.put_state(bytes.fromhex(written), int(bits, 16), inputs)
            self.apply()

    # -- shapes of faults

    @property
    def shaped(self) -> tuple[str, ...]:
        """The inputs that have a shape, once for each."""
        return tuple(signal.name for signal, _ in self._layers.shapes)

    def put_shape(self, signal: Signal, shape: Shape) -> None:
        """Put a shape over an input; the latest of one input sees what those before it give."""
        self._layers.put(signal, shape)
        self.apply()

    def take_shape(self, signal: Signal, shape: Shape) -> None:
        """Remove one: what was written meanwhile goes to the controller."""
        self._layers.take(signal, shape)
        self.apply()

    def apply(self) -> None:
        """Send what the layers make of the inputs; to be called as well when a shape changes its mind."""
        if self._inputs is not None and (octets := self._layers.octets()) != self._inputs.read():
            self._inputs.write({0: octets})

    # ----------------------------------------------------------------------------------------------------------------

    @property
    def revision(self) -> int:
        """Counts the changes of values and statuses of either direction, as far as somebody has looked."""
        seen = self._state()
        if seen != self._seen:
            self._seen = seen
            self._revision += 1
        return self._revision

    def _checked(self, values: Mapping[str, Value]) -> dict[Signal, Value]:
        """As they can be written; raises :class:`SignalError` with all that is wrong."""
        with few_hints():
            found = all_or_none(values, lambda name, value: self.signal(name).check(value))
        return {self.signal(name): value for name, value in found.items()}

    def _place(self, signal: Signal) -> int:
        return self._places[signal.slot, signal.subslot, "input"]

    def _state(self) -> tuple[object, int]:
        return self._copies(), self._layers.revision

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
