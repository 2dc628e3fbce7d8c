"""From groups to drives: names, addresses and MACs counted up."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.buses.bus import line_of
from pnfarm.buses.farm_file import Expansion
from pnfarm.config.device import DeviceConfig
from pnfarm.config.drive import DriveConfig
from pnfarm.config.ip import IpController, Macs, auto_mac
from pnfarm.config.links import MemoryLink
from pnfarm.config.own_faults import drive_fault
from pnfarm.config.tasks import drive_task
from pnfarm.config.values import expand_name
from pnfarm.farm.file.choice import bus_of, bus_of_controller, bus_of_devices, device_part

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pnfarm.config.controller import ControllerSection
    from pnfarm.config.known import Known
    from pnfarm.farm.file.sections import FarmSections

__all__ = ["controller_mac", "expand_device_sections", "expand_sections"]


def controller_mac(sections: FarmSections, controller: ControllerSection) -> bytes | None:
    """The MAC address of one of the file's controllers; None where it uses an interface's own."""
    if line_of(bus_of_controller(controller)):
        return None
    mac = controller.mac if isinstance(controller, IpController) else None
    if isinstance(mac, bytes):
        return mac
    if mac is None and controller.interface is not None:
        return None
    return auto_mac(sections.farm or "", f"controller:{controller.name}")


def expand_sections(sections: FarmSections, known: Known) -> Iterator[DriveConfig]:
    """The drives in the file's order.  Errors that :func:`check` reports are not corrected."""
    macs = _macs(sections)
    controllers = {bus_of_controller(section).name: section for section in sections.controllers}
    real_link = sections.link is not None and not isinstance(sections.link, MemoryLink)
    index = 0
    for number, group in enumerate(sections.drives):
        bus = bus_of(group)
        expansion = Expansion(macs, controllers.get(bus.name))
        model = known.model(group.model)
        for step in range(group.count):
            common = DriveConfig(
                index=index,
                group=number,
                name=expand_name(group.name, group.start + step),
                model=model.name if model is not None else group.model,
                load=group.load,
                motor=group.motor,
                machine=group.machine,
                strict=group.limits == "strict",
                identity=group.identity,
                params=group.params,
                impair=tuple(group.impair),
                motion_tasks=tuple(drive_task(task) for task in group.motion_tasks),
                behaviour=group.behaviour,
                words=group.words,
                faults=tuple(drive_fault(fault) for fault in group.faults),
                realism=group.realism,
                realism_by_source=real_link and group.limits == "strict",
                listed=model.described if model is not None and model.name in known.listed else None,
            )
            yield bus.farm_file.drive(common, group, step, model, expansion)
            index += 1


def _macs(sections: FarmSections) -> Macs:
    own = [mac for section in sections.controllers if (mac := controller_mac(sections, section)) is not None]
    return Macs(sections.farm or "", [*sections.drives, *sections.devices], own)


def expand_device_sections(sections: FarmSections) -> Iterator[DeviceConfig]:
    """The devices in the file's order, of groups whose files are read."""
    macs = _macs(sections)
    index = 0
    for number, group in enumerate(sections.devices):
        if not group.is_described:
            continue
        bus = bus_of_devices(group)
        for step in range(group.count):
            common = DeviceConfig(
                index=index,
                group=number,
                name=expand_name(group.name, group.start + step),
                bus=bus.name,
                kinds=(),
                strict=group.limits == "strict",
                impair=tuple(group.impair),
            )
            yield device_part(group).device(common, group, step, macs)
            index += 1
