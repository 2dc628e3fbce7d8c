"""A described device as data: what is plugged, its signals, its data's places."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from pnfarm.protocols.profibus.gsd.station import PluggedSlave
    from pnfarm.signals.signal import Direction, Signal

__all__ = ["SUBSLOT", "DescribedSlave"]

#: A module on PROFIBUS has no subslots: its data are in this one.
SUBSLOT: Final = 1
_RATES: Final = {1_000: "kbit/s", 1_000_000: "Mbit/s"}


@dataclass(frozen=True)
class DescribedSlave:
    """``file``: the GSD file's name."""

    plugged: PluggedSlave
    signals: Mapping[str, Signal]
    file: str

    @property
    def kinds(self) -> tuple[str, ...]:
        """What it is called in place of a model: its order number, its name, its ident number."""
        gsd = self.plugged.gsd
        found = (gsd.order_number, gsd.model, f"0x{gsd.ident:04X}")
        return tuple(dict.fromkeys(name for name in found if name))

    @property
    def lengths(self) -> dict[tuple[int, int], tuple[int, int]]:
        """Octets of inputs and of outputs by slot and subslot."""
        return {(one.slot, SUBSLOT): (one.inputs, one.outputs) for one in self.plugged.modules}

    @property
    def signal_places(self) -> dict[tuple[int, int, Direction], int]:
        """The first octet of each module's data in a Data_Exchange, of each direction in the order of their slots."""
        return {(slot, SUBSLOT, way): place for slot, way, place in self._places()}

    def _places(self) -> Iterator[tuple[int, Direction, int]]:
        inputs = outputs = 0
        for module in self.plugged.modules:
            if module.inputs:
                yield module.slot, "input", inputs
            if module.outputs:
                yield module.slot, "output", outputs
            inputs += module.inputs
            outputs += module.outputs

    def statuses(self, way: Direction) -> int:
        """How many modules have data of a direction."""
        return sum(each == way for _, each, _ in self._places())

    def sentences(self) -> list[str]:
        """What was taken from the file, for people."""
        plugged, gsd = self.plugged, self.plugged.gsd
        modules = [f"slot {module.slot}: {module.item.name}" for module in plugged.modules]
        safe = [str(module.slot) for module in plugged.modules if module.item.safety]
        octets = f"{plugged.inputs} octets of inputs, {plugged.outputs} of outputs, {len(plugged.user)} of parameters"
        found = [
            f"{gsd.model or self.file} (ident 0x{gsd.ident:04X}), {', '.join(modules) or 'no modules'}",
            f"{octets}, {len(self.signals)} signals",
        ]
        if gsd.rates:
            found.append(f"{'DP-V1' if gsd.v1 else 'DP-V0'}, {', '.join(map(_rate, gsd.rates))}")
        if safe:
            found.append(f"PROFIsafe in slot {', '.join(safe)}: it does not run the safety protocol")
        found += [f"{self.file}, line {one.line}: {one.text}" for one in gsd.warnings[:_MOST_WARNINGS]]
        return found


#: Warnings of the file that are shown.
_MOST_WARNINGS: Final = 5


def _rate(baud: int) -> str:
    unit, word = max((unit, word) for unit, word in _RATES.items() if baud >= unit)
    return f"{baud / unit:g} {word}"
