"""What a described device is, for views."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.buses.profibus.described.station import SUBSLOT
from pnfarm.station.description import ModuleDescription, StationDescription, SubmoduleDescription

if TYPE_CHECKING:
    from pnfarm.buses.profibus.described.station import DescribedSlave
    from pnfarm.protocols.profibus.gsd.station import PluggedModule

__all__ = ["station_description"]


def station_description(described: DescribedSlave) -> StationDescription:
    """Identity and modules, as its file has them."""
    gsd = described.plugged.gsd
    return StationDescription(
        title=gsd.model,
        identity={
            "vendor": gsd.vendor,
            "ident_number": gsd.ident,
            "order_number": gsd.order_number,
            "revision": gsd.revision,
            "family": gsd.family,
            "hardware_release": gsd.hardware,
            "software_release": gsd.software,
        },
        modules=tuple(map(_module, described.plugged.modules)),
    )


def _module(module: PluggedModule) -> ModuleDescription:
    """The number of a module is the one that its file gives it, 0 for none."""
    item, number = module.item, module.item.number or 0
    data = SubmoduleDescription(SUBSLOT, number, item.name, module.inputs, module.outputs, item.safety)
    return ModuleDescription(module.slot, number, item.name, (data,))
