"""A described device as data: what is plugged, its signals, its data's places, its parameter records."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

from pnfarm.buses.plain_layout import PlainLayout, plain_layout, signal_places
from pnfarm.buses.profinet.described.description import describe_plugged
from pnfarm.buses.profinet.described.summary import station_description
from pnfarm.protocols.profinet.gsdml.diagnosis import DiagnosisCatalogue

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pnfarm.protocols.profinet.description import DeviceDescription
    from pnfarm.protocols.profinet.gsdml.records import ParameterRecord
    from pnfarm.protocols.profinet.gsdml.station import PluggedStation
    from pnfarm.signals.signal import Direction, Signal
    from pnfarm.station.description import StationDescription

__all__ = ["NO_SAFETY", "DescribedStation"]

#: What the device does not do, of a PROFIsafe submodule.
NO_SAFETY = "does not run the safety protocol: an F-CPU passivates it"


@dataclass(frozen=True)
class DescribedStation:
    """``parameters``: (slot, subslot, index) -> a parameter record that the farm file changes from its default."""

    plugged: PluggedStation
    signals: Mapping[str, Signal]
    parameters: Mapping[tuple[int, int, int], bytes]

    @property
    def kinds(self) -> tuple[str, ...]:
        """What it is called in place of a model: the access point's ID and order number, the device's name."""
        found = (self.plugged.dap.id, self.plugged.order_number, self.plugged.name)
        return tuple(dict.fromkeys(name for name in found if name))

    @cached_property
    def devices(self) -> Mapping[bool, DeviceDescription]:
        """What the machines of its devices have in common, by ``limits: strict``."""
        return {strict: describe_plugged(self.plugged, strict=strict) for strict in (False, True)}

    @cached_property
    def description(self) -> StationDescription:
        """For views."""
        return station_description(self.plugged)

    @cached_property
    def inputs(self) -> PlainLayout:
        """What goes to the controller."""
        return plain_layout((one.slot, one.subslot, one.input_octets) for one in self.plugged.submodules)

    @cached_property
    def outputs(self) -> PlainLayout:
        """What comes from it."""
        return plain_layout((one.slot, one.subslot, one.output_octets) for one in self.plugged.submodules)

    @cached_property
    def signal_places(self) -> dict[tuple[int, int, Direction], int]:
        """The first octet of each submodule's data, in the order of their statuses."""
        return signal_places(self.inputs, self.outputs)

    @cached_property
    def diagnoses(self) -> DiagnosisCatalogue:
        """Those that its file names."""
        return DiagnosisCatalogue(self.plugged.gsdml)

    def record(self, slot: int, subslot: int, index: int) -> ParameterRecord | None:
        """A parameter record; None where the submodule has none of this index."""
        submodule = self.plugged.submodule(slot, subslot)
        return None if submodule is None else submodule.record(index)

    def sentences(self) -> list[str]:
        """What was taken from the file, for people: the access point and its modules, octets, signals, PROFIsafe."""
        plugged = self.plugged
        modules = [f"slot {module.slot}: {module.info.name or module.id}" for module in plugged.modules[1:]]
        found = [
            f"{plugged.name} ({plugged.dap.id}), {', '.join(modules) or 'no modules'}",
            f"{self.inputs.octets} octets of inputs, {self.outputs.octets} of outputs, {len(self.signals)} signals",
        ]
        safe = [f"{one.slot}.{one.subslot}" for one in plugged.submodules if one.profisafe]
        if safe:
            found.append(f"PROFIsafe submodule{'' if len(safe) == 1 else 's'} {', '.join(safe)}: it {NO_SAFETY}")
        return found
