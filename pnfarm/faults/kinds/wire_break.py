"""wire-break: an input of the controller reads as if its wire was broken."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.faults.kind import HELD, InjectionKind, ParamSpec
from pnfarm.faults.signals import SIGNAL, TO_CONTROLLER, SignalEffect

if TYPE_CHECKING:
    from pnfarm.signals.signal import Signal
    from pnfarm.wire.value_types import Value

__all__ = ["KIND"]

_LAST_CHANNEL = 0x7FFF


class Broken(SignalEffect):
    """At its lowest, and reported where the device can report it; both go together."""

    def prepare(self) -> None:
        super().prepare()
        signal, text, channel = self.signal, self.values["value"], self.values["channel"]
        self._value = _lowest(signal) if text is None else self.value_of(text)
        if channel is None:
            # the bits and the values of a submodule are counted from its first octet on
            first = signal.octet // signal.type.octets if signal.bit is None else 8 * signal.octet + signal.bit
            channel = min(first, _LAST_CHANNEL)
        self._report = self.signals.wire_break(signal, channel)

    def begin(self, now: int) -> None:
        if self._report is not None:
            self._report[0](now)
        super().begin(now)

    def end(self, now: int) -> None:
        super().end(now)
        if self._report is not None:
            self._report[1](now)

    def shaped(self, value: Value) -> Value:
        del value
        return self._value


def _lowest(signal: Signal) -> Value:
    """Of whole numbers the lowest raw value, else zeros."""
    octets = bytearray(signal.end)
    if signal.type.kind in {"int", "uint"}:
        octets[signal.octet :] = signal.type.encode(int(signal.type.limits[0]), signal.order)
    return signal.read(octets)


KIND = InjectionKind(
    "wire-break",
    "signals",
    "The wire of an input of a device is broken: a bit is 0, a whole number has its lowest raw value, others are 0.",
    "the broken wire",
    Broken,
    {
        "signal": SIGNAL,
        "value": ParamSpec("text", "What is read instead.", other="a value of the signal's type"),
        "channel": ParamSpec(
            "whole number",
            "The channel of the diagnosis; left out, the place of the bit or value in its submodule, from 0 (assumed).",
            low=0,
            high=_LAST_CHANNEL,
        ),
    },
    takes=HELD,
    place=60,
    wire=TO_CONTROLLER,
    reports="The bus reports nothing.",
)
