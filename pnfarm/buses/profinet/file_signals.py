"""The signals of a described device: the data items of its GSDML file as named values.

An item that is used as bits gives one signal for each bit that the file names, or for each of its bits; any other one
gives a signal of its type.  Names follow `signals.naming`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.signals.file_signals import FileDatum, named_signals
from pnfarm.signals.naming import Datum
from pnfarm.wire.value_types import BOOL, UINT8, ValueType

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pnfarm.protocols.profinet.gsdml.station import PluggedItem, PluggedStation, PluggedSubmodule
    from pnfarm.signals.signal import Direction, Signal

__all__ = ["file_signals"]

_TYPES = {
    "Boolean": BOOL,
    **{f"Integer{bits}": ValueType("int", bits // 8) for bits in (8, 16, 32, 64)},
    **{f"Unsigned{bits}": ValueType("uint", bits // 8) for bits in (8, 16, 32, 64)},
    "Unsigned8_S": UINT8,
    "Unsigned16_S": ValueType("uint", 2),
    "Integer16_S": ValueType("int", 2),
    "Float32": ValueType("float", 4),
    "Float64": ValueType("float", 8),
    "N2": ValueType("int", 2),
    "N4": ValueType("int", 4),
    "V2": ValueType("uint", 2),
    "L2": ValueType("uint", 2),
}
#: A number and an octet of its status after it.
_WITH_STATUS = {
    "Float32+Status8": ValueType("float", 4),
    "Float32+Unsigned8": ValueType("float", 4),
    "Unsigned8+Unsigned8": UINT8,
}
_TEXTS = ("VisibleString", "UnicodeString8")
#: N2 and N4 in percent: 0x4000 and 0x4000_0000 are 100 % (PROFIdrive, normalised values).
_SCALES = {"N2": (100 / 0x4000, "%"), "N4": (100 / 0x4000_0000, "%")}


def _item_signals(submodule: PluggedSubmodule, direction: Direction, item: PluggedItem) -> Iterator[FileDatum]:
    def datum(text: str, octet: int, bit: int | None = None) -> Datum:
        return Datum(text, direction, submodule.slot, submodule.subslot, octet, bit)

    if item.use_as_bits or item.bits:
        for octet, bit, name in item.bits or item.all_bits:
            yield FileDatum(datum(name, octet, bit), BOOL)
    elif item.data_type in _WITH_STATUS:
        kind = _WITH_STATUS[item.data_type]
        yield FileDatum(datum(item.name, item.octet), kind)
        yield FileDatum(datum(f"{item.name} status", item.octet + kind.octets), UINT8)
    elif item.octets:
        usual = ValueType("text" if item.data_type in _TEXTS else "octets", item.octets)
        scale, unit = _SCALES.get(item.data_type, (1.0, ""))
        yield FileDatum(datum(item.name, item.octet), _TYPES.get(item.data_type, usual), scale, unit)


def file_signals(station: PluggedStation) -> tuple[Signal, ...]:
    """In the order of slots and subslots, inputs before outputs."""
    directions: tuple[Direction, Direction] = ("input", "output")
    found = [
        one
        for submodule in station.submodules
        for direction in directions
        for item in (submodule.inputs if direction == "input" else submodule.outputs)
        for one in _item_signals(submodule, direction, item)
    ]
    return named_signals(found, "big")
