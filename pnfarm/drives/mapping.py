"""A free mapping: what the numbers in PNU 915 and 916 make of a telegram's words."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from pnfarm.drives.parameter import ParameterError, ParameterErrorNumber
from pnfarm.table.signals import SHOWN

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pnfarm.drives.model import Model
    from pnfarm.drives.telegram import Signal

__all__ = ["mapped_signals"]


def mapped_signals(
    model: Model, numbers: Sequence[int], *, setpoint: bool, elements: Sequence[int] = ()
) -> tuple[Signal | None, ...]:
    """Signals of one direction by number, 0 for none; ``elements`` are those of stored arrays, word by word.

    From the drive, a set point is shown as it came, and a stored parameter in one of the places that there are for
    them; the element that stands with the second word of a double word does not count (Moog MSD manual 8.2.3).
    Raises :class:`ParameterError` (value impermissible) with the index.
    """
    found: list[Signal | None] = []
    shown = 0
    for index, number in enumerate(numbers):
        signal = model.signals.get(number)
        if number and (signal is None or signal.shown_as):
            raise _impermissible(index, f"{model.name} has no signal {number}")
        if signal is not None and signal.readable and not setpoint:
            signal = signal.back
        elif signal is not None and signal.stored:
            if _is_second_word(found, signal):
                signal = found[-1]
            else:
                signal = _in_place(model, signal, shown, elements[index] if index < len(elements) else 0, index)
                shown += 1
        found.append(signal)
    return tuple(found)


def _is_second_word(found: Sequence[Signal | None], signal: Signal) -> bool:
    """Whether the last word is the first of a double word that ``signal`` completes."""
    if signal.bits != 32 or not found or found[-1] is None or found[-1].number != signal.number:
        return False
    return len(found) < 2 or found[-2] != found[-1]


def _in_place(model: Model, signal: Signal, place: int, element: int, index: int) -> Signal:
    if place >= SHOWN:
        raise _impermissible(index, f"more than {SHOWN} stored parameters")
    if element >= max(model.parameters[signal.number].elements, 1):
        raise _impermissible(index, f"{signal.number} has no element {element}")
    return replace(signal, name=f"SHOWN_{place}", element=element)


def _impermissible(index: int, why: str) -> ParameterError:
    return ParameterError(ParameterErrorNumber.VALUE_IMPERMISSIBLE, index, f"word {index + 1}: {why}")
