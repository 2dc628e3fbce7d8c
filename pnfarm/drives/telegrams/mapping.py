"""A free mapping: the words of a telegram from the numbers in PNU 915 and 916."""

from __future__ import annotations

from dataclasses import replace
from itertools import takewhile
from typing import TYPE_CHECKING

from pnfarm.drives.parameters.parameter import ParameterError, ParameterErrorNumber
from pnfarm.table.signals import SHOWN

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pnfarm.drives.description.model import Model
    from pnfarm.drives.telegrams.telegram import Signal

__all__ = ["mapped_signals"]


def mapped_signals(
    model: Model, numbers: Sequence[int], *, setpoint: bool, elements: Sequence[int] = ()
) -> tuple[Signal | None, ...]:
    """Signals of one direction by number, 0 for none; ``elements`` are those of stored arrays, word by word.

    From the drive, a set point is echoed as received, and a stored parameter takes one of the slots for
    them; the element given for the second word of a double word is ignored (Moog MSD manual 8.2.3).
    Raises :class:`ParameterError` (value impermissible) with the index.
    """
    found: list[Signal | None] = []
    places: dict[tuple[int, int], Signal] = {}
    for index, number in enumerate(numbers):
        signal = model.profidrive.signals.get(number)
        if number and (signal is None or signal.shown_as):
            raise _impermissible(index, f"{model.name} has no signal {number}")
        if signal is None:
            found.append(None)
        elif signal.readable and not setpoint:
            found.append(signal.back)
        elif signal.setpoint != setpoint:
            wanted, given = ("set point", "an actual value") if setpoint else ("actual value", "a set point")
            raise _impermissible(index, f"{signal.name} is {given}; this direction takes {wanted}s")
        elif signal.stored and _is_second_word(found, signal):
            found.append(found[-1])
        elif signal.stored:
            element = elements[index] if index < len(elements) else 0
            found.append(_in_place(model, signal, element, places, index))
        else:
            found.append(signal)
    return tuple(found)


def _is_second_word(found: Sequence[Signal | None], signal: Signal) -> bool:
    """Whether the last word is the first of a double word that ``signal`` completes."""
    alike = takewhile(lambda before: before is not None and before.number == signal.number, reversed(found))
    return signal.bits == 32 and sum(1 for _ in alike) % 2 == 1


def _in_place(model: Model, signal: Signal, element: int, places: dict[tuple[int, int], Signal], index: int) -> Signal:
    """The slot of an element: the one that it already has, or the next free one."""
    if element >= max(model.parameters[signal.number].elements, 1):
        raise _impermissible(index, f"{signal.number} has no element {element}")
    key = (signal.number, element)
    if key not in places:
        if len(places) >= SHOWN:
            raise _impermissible(index, f"more than {SHOWN} stored parameters")
        places[key] = replace(signal, name=f"SHOWN_{len(places)}", element=element)
    return places[key]


def _impermissible(index: int, why: str) -> ParameterError:
    return ParameterError(ParameterErrorNumber.VALUE_IMPERMISSIBLE, index, f"word {index + 1}: {why}")
