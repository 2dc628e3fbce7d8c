"""A described device as the protocol machines know a device: idents, lengths, identification, limits."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import TYPE_CHECKING

from pnfarm.buses.profinet.binding import EVERY_RATIO, serial_number
from pnfarm.protocols.profinet.description import (
    DeviceDescription,
    Im0Description,
    ImCarrier,
    Limits,
    ModuleDescription,
    SubmoduleDescription,
)
from pnfarm.wire.rtc import SEND_CLOCK_FACTORS

if TYPE_CHECKING:
    from collections.abc import Iterable

    from pnfarm.protocols.profinet.gsdml.station import PluggedModule, PluggedStation, PluggedSubmodule
    from pnfarm.protocols.profinet.gsdml.values import Numbers

__all__ = ["describe_plugged", "with_serial_number"]

#: I&M1 to I&M3 where the file names no record that can be written: it is older than the key, and every device must
#: store these since V2.31 of the specification (assumed).
_USUAL_IM = 0b1110
#: Records that IM_Supported counts here.
_IM = range(1, 5)
_RELEASE = re.compile(r"([A-Z]?) ?([0-9]{1,3})(?:\.([0-9]{1,3}))?(?:\.([0-9]{1,3}))?")
#: Octets of DeviceVendorValue that controllers show.
_TYPE_LENGTH = 25
_MOST_REVISION = 0xFFFF


def _module(module: PluggedModule) -> ModuleDescription:
    return ModuleDescription(
        module.slot,
        module.ident,
        tuple(
            SubmoduleDescription(
                slot=one.slot,
                subslot=one.subslot,
                api=one.api,
                module_ident=module.ident,
                submodule_ident=one.ident,
                input_bytes=one.input_octets,
                output_bytes=one.output_octets,
                name=one.name,
            )
            for one in module.submodules
        ),
    )


def _software(text: str) -> tuple[str, int, int, int]:
    """``V1.4.2`` as I&M0 has it; V0.0.0 for a text of another form."""
    found = _RELEASE.match(text.strip().upper())
    if found is None:
        return "V", 0, 0, 0
    numbers = [min(int(number or 0), 0xFF) for number in found.groups()[1:]]
    return found[1] or "V", numbers[0], numbers[1], numbers[2]


def _hardware(text: str) -> int:
    found = re.search(r"[0-9]{1,9}", text)
    return min(int(found[0]), _MOST_REVISION) if found else 0


def _supported(submodules: Iterable[PluggedSubmodule]) -> int:
    """IM_Supported, of the records that can be written."""
    return sum(1 << number for number in _IM if any(number in one.writeable_im for one in submodules))


def _carriers(station: PluggedStation) -> tuple[ImCarrier, ...]:
    """The access point's first submodule for the device, and that of each module with an order number."""
    head, *modules = station.modules
    found = [ImCarrier(head.slot, head.submodules[0].subslot, module=True, device=True)]
    for module in modules:
        if module.info.order_number and module.submodules:
            im0 = Im0Description(
                order_id=_visible(module.info.order_number),
                serial_number="",
                hardware_revision=_hardware(module.info.hardware_release),
                software_revision=_software(module.info.software_release),
                im_supported=_supported(module.submodules),
            )
            found.append(ImCarrier(module.slot, module.submodules[0].subslot, module=True, im0=im0))
    return tuple(found)


def _station_type(station: PluggedStation) -> str:
    """DCP's DeviceVendorValue (assumed, as the file has no key for it): the product family, else the access point."""
    return _visible(station.product_family or station.name)[:_TYPE_LENGTH]


def _visible(text: str) -> str:
    """The text in the characters of a VisibleString."""
    return text.encode("ascii", "replace").decode()


def _within(numbers: Numbers, known: Iterable[int]) -> tuple[int, ...]:
    return tuple(number for number in known if number in numbers)


def describe_plugged(station: PluggedStation, *, strict: bool) -> DeviceDescription:
    """What the devices of a group have in common; without ``strict`` they take every cycle."""
    head, *modules = station.modules
    dap = station.dap
    return DeviceDescription(
        vendor_id=station.vendor_id,
        device_id=station.device_id,
        station_type=_station_type(station),
        dap=_module(head),
        modules=tuple(map(_module, modules)),
        instance=dap.instance,
        own_records=frozenset(record.index for submodule in station.submodules for record in submodule.records),
        min_device_interval=station.min_device_interval if strict else 1,
        send_clocks=_within(station.send_clocks, SEND_CLOCK_FACTORS) if strict else SEND_CLOCK_FACTORS,
        reduction_ratios=_within(station.reduction_ratios, EVERY_RATIO) if strict else EVERY_RATIO,
        im0=Im0Description(
            order_id=_visible(station.order_number),
            serial_number="",
            hardware_revision=_hardware(station.hardware_release),
            software_revision=_software(station.software_release),
            im_supported=_supported(head.submodules) or _USUAL_IM,
        ),
        limits=Limits(
            strict=strict,
            max_ars=station.number_of_ars,
            max_device_access_ars=max(1, dap.device_access_ars) if dap.device_access else 0,
            max_input_crs=station.relations.input_crs,
            max_output_crs=station.relations.output_crs,
        ),
        im_carriers=_carriers(station),
    )


def with_serial_number(group: DeviceDescription, mac: bytes) -> DeviceDescription:
    """The device with this address, of those that :func:`describe_plugged` describes."""
    number = serial_number(mac)
    carriers = (
        one if one.im0 is None else replace(one, im0=replace(one.im0, serial_number=number))
        for one in group.im_carriers
    )
    return replace(group, im0=replace(group.im0, serial_number=number), im_carriers=tuple(carriers))
