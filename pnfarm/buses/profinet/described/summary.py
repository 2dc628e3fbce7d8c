"""What a described device is, for views."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.station.description import ModuleDescription, StationDescription, SubmoduleDescription

if TYPE_CHECKING:
    from pnfarm.protocols.profinet.gsdml.station import PluggedModule, PluggedStation, PluggedSubmodule

__all__ = ["station_description"]


def station_description(plugged: PluggedStation) -> StationDescription:
    """Identity, access point and modules, as its file has them."""
    return StationDescription(
        title=plugged.name,
        identity={
            "vendor": plugged.vendor_name,
            "vendor_id": plugged.vendor_id,
            "device_id": plugged.device_id,
            "order_number": plugged.order_number,
            "hardware_release": plugged.hardware_release,
            "software_release": plugged.software_release,
        },
        access_point=plugged.dap.id,
        modules=tuple(map(_module, plugged.modules)),
    )


def _module(module: PluggedModule) -> ModuleDescription:
    name = module.info.name or module.id
    return ModuleDescription(module.slot, module.ident, name, tuple(map(_submodule, module.submodules)))


def _submodule(one: PluggedSubmodule) -> SubmoduleDescription:
    return SubmoduleDescription(
        one.subslot, one.ident, one.name or one.id, one.input_octets, one.output_octets, one.profisafe
    )
