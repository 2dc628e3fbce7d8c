"""The signals of a described device: those of its file, and those of the farm file beside them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.signals.signal import place_signal
from pnfarm.vocabulary.problem import Problem

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from pnfarm.config.device import SignalPlace
    from pnfarm.signals.signal import Signal
    from pnfarm.vocabulary.issues import Location, Report
    from pnfarm.wire.value_types import ByteOrder

__all__ = ["device_signals"]


def device_signals(
    at: Location,
    given: Mapping[str, SignalPlace],
    of_file: Iterable[Signal],
    octets: Mapping[tuple[int, int], tuple[int, int]],
    report: Report,
    *,
    absent: str,
    order: ByteOrder,
) -> Mapping[str, Signal] | None:
    """By name; one of the farm file takes the place of one with its name.  None where something is wrong.

    ``octets`` of inputs and outputs by slot and subslot; others are ``absent``, in words.
    """
    signals = {signal.name: signal for signal in of_file}
    wrong = False
    for name, place in given.items():
        key = place.at[:2]
        here: Location = (*at, "signals", name)
        inputs, outputs = octets.get(key, (0, 0))
        if not inputs and not outputs:
            with_data = [f"{slot}.{subslot}" for (slot, subslot), both in octets.items() if any(both)]
            what = f"{place.text}: {key[0]}.{key[1]} " + ("has no data" if key in octets else absent)
            report(here, what, f"slot.subslot of {', '.join(with_data) or 'no submodule'}")
            wrong = True
            continue
        try:
            signals[name] = place_signal(name, place, inputs, outputs, order)
        except Problem as problem:
            report(here, problem.what, problem.allowed)
            wrong = True
    return None if wrong else signals
