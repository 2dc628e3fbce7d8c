"""The signals of a farm file's group, placed in the submodules of the device that its maker's file describes."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.signals.signal import place_signal
from pnfarm.vocabulary.problem import Problem

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from pnfarm.config.device import SignalPlace
    from pnfarm.signals.signal import Signal
    from pnfarm.vocabulary.issues import Location, Report

__all__ = ["placed_signals"]


def placed_signals(
    at: Location,
    own: Iterable[Signal],
    wanted: Mapping[str, SignalPlace],
    plugged: Mapping[tuple[int, int], tuple[int, int]],
    report: Report,
) -> dict[str, Signal] | None:
    """The file's ``own`` signals, and those of the group, which take the place of one with their name.

    ``plugged``: octets of inputs and of outputs by slot and subslot.  None where one is wrong, which is reported.
    """
    signals = {signal.name: signal for signal in own}
    wrong = False
    for name, place in wanted.items():
        slot, subslot = place.at[:2]
        octets = plugged.get((slot, subslot))
        here: Location = (*at, "signals", name)
        if octets is None or not any(octets):
            with_data = [f"{each[0]}.{each[1]}" for each, lengths in plugged.items() if any(lengths)]
            what = f"{place.text}: {slot}.{subslot} " + ("is not plugged" if octets is None else "has no data")
            report(here, what, f"slot.subslot of {', '.join(with_data) or 'no submodule'}")
            wrong = True
            continue
        try:
            signals[name] = place_signal(name, place, *octets)
        except Problem as problem:
            report(here, problem.what, problem.allowed)
            wrong = True
    return None if wrong else signals
