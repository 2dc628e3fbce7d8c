"""The signals of a described device: a GSD file names no data, so that their places name them.

An identifier in octets of at most eight gives a signal for each bit, a longer one a text of octets; one in words gives
a signal for each word: ``slot1_in_0_3`` (octet, bit), ``slot3_in_2``, ``slot4_out_0``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from pnfarm.buses.profibus.described.station import SUBSLOT
from pnfarm.signals.signal import Direction, Signal
from pnfarm.wire.value_types import BOOL, ValueType

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from pnfarm.protocols.profibus.gsd.station import PluggedSlave

__all__ = ["file_signals"]

_MOST_BITS: Final = 8
_WORD: Final = ValueType("uint", 2)


def file_signals(slave: PluggedSlave) -> Iterator[Signal]:
    """In the order of the slots, inputs of a module before its outputs."""
    for module in slave.modules:
        inputs = [(part.inputs, part.input_words) for part in module.parts]
        outputs = [(part.outputs, part.output_words) for part in module.parts]
        yield from _way("input", f"slot{module.slot}_in", module.slot, inputs)
        yield from _way("output", f"slot{module.slot}_out", module.slot, outputs)


def _way(way: Direction, name: str, slot: int, parts: Sequence[tuple[int, bool]]) -> Iterator[Signal]:
    first = 0
    for length, in_words in parts:
        yield from _part(name, way, slot, first, length, in_words=in_words)
        first += length


def _part(name: str, way: Direction, slot: int, first: int, length: int, *, in_words: bool) -> Iterator[Signal]:
    if in_words:
        for octet in range(first, first + length, 2):
            yield Signal(f"{name}_{octet}", way, slot, SUBSLOT, octet, _WORD)
    elif length <= _MOST_BITS:
        for octet in range(first, first + length):
            for bit in range(8):
                yield Signal(f"{name}_{octet}_{bit}", way, slot, SUBSLOT, octet, BOOL, bit)
    else:
        yield Signal(f"{name}_{first}", way, slot, SUBSLOT, first, ValueType("octets", length))
