"""Checks of a farm file's sections and groups against each other, for any bus.

Each check reports a place, what is wrong, and what is allowed; one report per group and cause, not one per drive.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.buses.bus import LineBus, line_of
from pnfarm.buses.farm_file import CONTROLLER, Claims, PlacedGroup
from pnfarm.buses.registry import BUSES
from pnfarm.config.database import is_database
from pnfarm.config.drive import MAX_DRIVES
from pnfarm.config.ip import IpController
from pnfarm.config.links import MacvlanLink, MemoryLink, SerialLink
from pnfarm.config.values import expand_name, numbered
from pnfarm.farm.file.choice import bus_of, bus_of_controller, bus_of_devices, device_part, titles
from pnfarm.farm.file.expand import controller_mac, expand_device_sections, expand_sections
from pnfarm.vocabulary.quoting import did_you_mean, shown
from pnfarm.wire.mac import format_mac

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from pnfarm.buses.bus import Bus
    from pnfarm.config.controller import ControllerSection
    from pnfarm.config.device import DeviceConfig, DeviceGroup
    from pnfarm.config.drive import DriveConfig, DriveGroup
    from pnfarm.config.known import Known, ModelFacts
    from pnfarm.config.links import LineWay, Link
    from pnfarm.farm.file.sections import FarmSections
    from pnfarm.vocabulary.issues import Location, Report

__all__ = ["check"]


def check(
    sections: FarmSections,
    known: Known,
    folder: Path,
    report: Report,
    *,
    is_complete: bool = True,
    has_all_stations: bool = True,
    places: Sequence[int] | None = None,
    device_places: Sequence[int] | None = None,
) -> None:
    """Report all that does not fit together; one report per group and cause, not one per drive.

    ``folder``: files of models of the plant are relative to it.
    ``is_complete=False`` leaves out the checks between sections, for a file of which some were set aside, and
    ``has_all_stations=False`` that of names of stations, where a group or a key of one was; ``places`` are then the
    numbers that the drive groups have in the file, ``device_places`` those of the groups of devices.
    """
    if is_complete:
        _check_sections(sections, report)
        _check_lease(sections, report)
    _check_state(sections, report)
    numbers = range(len(sections.drives)) if places is None else places
    groups = [
        PlacedGroup(("drives", index), f"drives[{number}]", group)
        for index, (number, group) in enumerate(zip(numbers, sections.drives, strict=True))
    ]
    devices = list(range(len(sections.devices)) if device_places is None else device_places)
    for placed in groups:
        _check_group(placed.at, placed.group, known, report)
    for number, group in zip(devices, sections.devices, strict=True):
        _check_devices(("devices", number), group, report)
    if is_complete and sections.link is not None:
        _check_links(sections.link, groups, report)
        _check_device_links(sections, devices, report)
    total = sum(group.count for group in sections.drives)
    total_devices = sum(group.count for group in sections.devices)
    if total > MAX_DRIVES:
        report(("drives",), f"makes {total} drives", f"at most {MAX_DRIVES} in one farm")
    elif total + total_devices > MAX_DRIVES:
        report(
            ("devices",), f"makes {total_devices} devices beside {total} drives", f"at most {MAX_DRIVES} in one farm"
        )
    else:
        _check_names(groups, report)
        _check_between(sections, groups, devices, known, report)
        if is_complete:
            _check_plant(sections, known, folder, report, has_all_stations=has_all_stations)
    for controller in sections.controllers:
        bus = bus_of_controller(controller)
        _check_program(controller, report)
        own = [placed for placed in groups if bus_of(placed.group) is bus]
        bus.farm_file.check_controller(controller, own, known, _of(controller, sections, report))


def _check_plant(sections: FarmSections, known: Known, folder: Path, report: Report, *, has_all_stations: bool) -> None:
    """The plant as far as no file of a model is run."""
    if sections.plant is None:
        return
    from pnfarm.plant.axis_ports import PlantAxis  # noqa: PLC0415 - takes the compiler with it
    from pnfarm.plant.plan import plan_plant  # noqa: PLC0415 - the same

    axes = {
        axis.name: PlantAxis.of(described, axis.load)
        for drive in expand_sections(sections, known)
        if (model := known.model(drive.model)) is not None and (described := model.described) is not None
        for axis in drive.axes
    }
    devices = {device.name: device.known_signals for device in expand_device_sections(sections)}
    has_all_stations = has_all_stations and all(group.is_described for group in sections.devices)
    plan_plant(sections.plant, axes, devices, folder, report, runs_files=False, has_all_stations=has_all_stations)


def _check_state(sections: FarmSections, report: Report) -> None:
    if sections.state is not None and "://" in sections.state and not is_database(sections.state):
        scheme = sections.state.partition("://")[0]
        report(("state",), f"is a URL of {shown(scheme)}", "a folder, or a database: postgresql://USER@HOST/DATABASE")


def _check_lease(sections: FarmSections, report: Report) -> None:
    if "lease" in sections.model_fields_set and not is_database(sections.state):
        report(("lease",), "needs a database, which holds it", "with `state: postgresql://...`")


def _of(controller: ControllerSection, sections: FarmSections, report: Report) -> Report:
    """Reports of one of the controllers: where the file has the key, and of which bus, if that is not plain."""

    def told(location: Location, what: str, allowed: str) -> None:
        match location:
            case ("controller", *keys) if len(sections.controllers) > 1:
                location = controller.at(*keys)
                title = bus_of_controller(controller).title
                if len(location) == len(keys) + 1 and title not in what:
                    what = f"on {title}: {what}"
            case ("controller", *keys):
                location = controller.at(*keys)
            case _:
                pass
        report(location, what, allowed)

    return told


def _check_program(controller: ControllerSection, report: Report) -> None:
    program = controller.program
    for key in program.beside_python:
        what = "does not go with `python`" if program.python is not None else "is a key of a program with `python` only"
        report(controller.at("program", key), what, "python, class and limit, or the keys of a built-in program")


def _check_sections(sections: FarmSections, report: Report) -> None:
    controller = sections.controller
    if sections.devices and sections.farm is None:
        report(
            ("devices",), "has no farm to be in", "farm: NAME; devices of others are in `controller: {devices: ...}`"
        )
    if sections.farm is None and controller is None:
        report((), "has neither `farm` nor `controller`", "farm: NAME for drives, controller: for foreign devices")
    if sections.farm is not None and sections.link is None:
        report(
            (),
            "has no `link`, so that there is nothing to attach the drives to",
            "link: {kind: macvlan, parent: eth1} or another kind",
        )
    elif sections.farm is None and sections.link is not None and controller is not None:
        report(("link",), "is given in a file without `farm`", "farm: NAME beside it, or controller.interface")
    for controller in sections.controllers:
        _check_link(controller, sections, _of(controller, sections, report))
    _check_interfaces(sections.controllers, report)


def _check_link(controller: ControllerSection, sections: FarmSections, report: Report) -> None:
    """How a controller is attached; places are those of a file with one controller."""
    at = ("controller",)
    if controller.interface is not None and controller.link is not None:
        report((*at, "interface"), "is given beside `link`", "one of the two")
    if controller.interface is None and controller.link is None and sections.farm is None:
        report(at, "has no interface to use", "interface: eth1")
    if isinstance(sections.link, MemoryLink):
        what = "is not reached from drives in memory: their controller is in the same process"
        if controller.interface is not None:
            report((*at, "interface"), what, "leave it out, or a farm on a macvlan, veth or tap link")
        elif controller.link is not None and not isinstance(controller.link, MemoryLink):
            report((*at, "link"), what, "leave it out, or a farm on a macvlan, veth or tap link")
        elif isinstance(controller, IpController) and controller.ip is None:
            report(at, "is in memory and has no `ip`", "ip: 10.77.0.1/24")
    if isinstance(sections.link, MacvlanLink):
        parent = sections.link.parent
        if controller.interface == parent:
            what = f"{parent} does not receive the frames of its macvlans"
            report((*at, "interface"), what, "another interface, or none: the controller gets a macvlan of its own")
        shares = controller.interface is None and (controller.link is None or controller.link == sections.link)
        if sections.link.send == "parent" and shares:
            what = "frames sent through the parent do not reach a controller on the same link"
            report(("link", "send"), what, "auto, own, or a controller with an interface of its own")


def _check_interfaces(controllers: Sequence[ControllerSection], report: Report) -> None:
    """An interface has one address, and each controller is a station of its own."""
    for place, controller in enumerate(controllers):
        before = [other for other in controllers[:place] if other.interface == controller.interface]
        if controller.interface is None or not before:
            continue
        who = titles([bus_of_controller(one) for one in (before[0], controller)])
        own = bus_of_controller(controller).name
        what = f"{controller.interface} is given to the controllers of {who}"
        report(controller.at("interface"), what, f"one for each: {own}: {{interface: ...}}")


def _check_count(at: Location, group: DriveGroup | DeviceGroup, report: Report) -> None:
    if group.count > 1 and not numbered(group.name):
        what = f"{group.count} {group.members} cannot all be called {shown(group.name)}"
        report((*at, "name"), what, "a name with {n}, or count: 1")


def _check_group(at: Location, group: DriveGroup, known: Known, report: Report) -> None:
    _check_count(at, group, report)
    bus_of(group).farm_file.check_group(at, group, report)
    model = known.model(group.model)
    if model is None:
        lower = group.model.lower()
        hint = did_you_mean(group.model, known.models) or f", did you mean {lower}?" * (known.find(lower) is not None)
        report((*at, "model"), f"{shown(group.model)} is not a model of this version{hint}", ", ".join(known.models))
    else:
        _check_model(at, group, model, report)


def _check_devices(at: Location, group: DeviceGroup, report: Report) -> None:
    _check_count(at, group, report)
    names = (expand_name(group.name, group.start + step) for step in range(min(group.count, MAX_DRIVES)))
    part = bus_of_devices(group).farm_file
    # one report for a group, however many of its names are wrong
    all(part.check_name((*at, "name"), name, report) for name in names)
    device_part(group).check_devices_group(at, group, report)


def _check_device_links(sections: FarmSections, places: Sequence[int], report: Report) -> None:
    for number, group in zip(places, sections.devices, strict=True):
        _check_carried(sections.link, bus_of_devices(group), ("devices", number), group.name, report)


def _check_carried(link: Link | None, bus: Bus, at: Location, what: str, report: Report) -> None:
    """Whether the link, or a line of it, carries what is on this bus."""
    kind = "" if link is None else link.kind
    if kind in bus.link_kinds or (line_of(bus) and bus.name in getattr(link, "lines", {})):
        return
    if line_of(bus):
        told = f"{shown(what)} is on {bus.title}, and the link has no line for it"
        report(at, told, f"lines: {{{bus.name}: {{pty: auto}}}} in `link`, or kind: serial")
    else:
        told = f"{shown(what)} is on {bus.title}, which a link of the kind {kind} does not carry"
        report(at, told, "link: {kind: ...}, " + ", ".join(sorted(bus.link_kinds)))


def _check_model(at: Location, group: DriveGroup, model: ModelFacts, report: Report) -> None:
    for key, what, allowed in model.parameter_complaints(group.params):
        report((*at, "params", key), what, allowed)
    _check_tasks((*at, "motion_tasks"), group, model, report)
    for key, what, allowed in model.identity_complaints(group.identity):
        report((*at, "identity", key) if key else (*at, "identity"), what, allowed)
    for key, what, allowed in model.behaviour_complaints(group.behaviour):
        report((*at, "behaviour", key), what, allowed)
    for key, what, allowed in model.words_complaints(group.words):
        report((*at, "words", key) if key else (*at, "words"), what, allowed)
    numbers = [fault.number for fault in group.faults]
    for index, number in enumerate(numbers):
        if number in numbers[:index]:
            report((*at, "faults", index, "number"), f"{number} is given twice", "each number once")
    for key, what, allowed in model.motor_complaints(group.motor.kind, group.motor.pitch):
        report((*at, "motor", key), what, allowed)
    if not model.moves_straight(group.motor.kind):
        if group.load.lead is None and (group.load.mass or group.load.force):
            report((*at, "load"), "has a mass or a force, but nothing that moves them straight", "`lead`, in mm")
    elif group.load.lead is not None or group.load.gear != 1.0 or group.load.driven_inertia:
        report((*at, "load"), "has a gear or a spindle behind a linear motor", "`mass` and `force`")
    for key, what, allowed in model.axis_complaints(group.load, group.motor):
        report((*at, key), what, allowed)
    for place, what, allowed in model.realism_complaints(group.realism):
        report((*at, "realism", *place), what, allowed)
    bus_of(group).farm_file.check_model(at, group, model, report)


def _check_tasks(at: Location, group: DriveGroup, model: ModelFacts, report: Report) -> None:
    seen: set[int] = set()
    for place, task in enumerate(group.motion_tasks):
        if not model.motion_tasks:
            report((*at, place), f"{model.name} keeps no motion tasks", "none")
        elif task.number >= model.motion_tasks:
            report((*at, place, "number"), f"is {task.number}", f"0 to {model.motion_tasks - 1}")
        elif task.number in seen:
            report((*at, place, "number"), f"{task.number} is given twice", "each number once")
        seen.add(task.number)


def _check_links(link: Link, groups: Sequence[PlacedGroup[DriveGroup]], report: Report) -> None:
    lines: Mapping[str, LineWay] = getattr(link, "lines", {})
    for name in lines:
        if name not in BUSES or not line_of(BUSES[name]):
            known = [each for each, one in BUSES.items() if line_of(one)]
            report(("link", "lines", name), f"{shown(name)} is not a bus with a serial line", ", ".join(known))
            continue
        _check_baud(("link", "lines", name), lines[name].rate, BUSES[name], report)
    if isinstance(link, MemoryLink | SerialLink):
        on_line = next((bus for placed in groups if line_of(bus := bus_of(placed.group))), None)
        if on_line is not None:
            _check_baud(("link",), link.rate if isinstance(link, SerialLink) else link.baud, on_line, report)
    for placed in groups:
        _check_carried(link, bus_of(placed.group), (*placed.at, "model"), placed.group.model, report)


def _check_baud(at: Location, baud: int, bus: Bus, report: Report) -> None:
    if isinstance(bus, LineBus) and baud not in bus.baud_rates:
        report((*at, "baud"), f"{baud} bit/s is not a rate of {bus.title}", ", ".join(map(str, bus.baud_rates)))


def _check_names(groups: Sequence[PlacedGroup[DriveGroup]], report: Report) -> None:
    for placed in groups:
        group, part = placed.group, bus_of(placed.group).farm_file
        names = (expand_name(group.name, group.start + step) for step in range(group.count))
        # one report for a group, however many of its names are wrong
        all(part.check_name((*placed.at, "name"), name, report) for name in names)


def _claim(controller: ControllerSection, sections: FarmSections, claims: Claims, report: Report) -> None:
    """What a controller takes; with several, a key beside the maps gives the same to each."""
    bus = bus_of_controller(controller)
    label = CONTROLLER if len(sections.controllers) == 1 else f"{CONTROLLER} on {bus.title}"
    values: list[tuple[str, object, str]] = [("name", controller.name, shown(controller.name))]
    if (mac := controller_mac(sections, controller)) is not None:
        values.append(("mac", mac, format_mac(mac)))
    if isinstance(controller, IpController) and controller.ip is not None:
        values.append(("ip", controller.ip.ip, str(controller.ip.ip)))
    taken: set[str] = set()
    for key, value, text in values:
        by = claims.claim(key, value, label, controller.name)
        # an automatic MAC address follows from the name
        if by is not None and not (key == "mac" and "name" in taken):
            taken.add(key)
            what = f"{text} belongs to {by} already"
            if (at := controller.at(key)) == ("controller", key):
                what = f"{label}: {what}"
            report(at, what, f"each once in the farm: {bus.name}: {{{key}: ...}}")


def _check_between(
    sections: FarmSections,
    groups: Sequence[PlacedGroup[DriveGroup]],
    devices: Sequence[int],
    known: Known,
    report: Report,
) -> None:
    """Duplicates: one report for a group and the group (or the controller) that it collides with."""
    claims = Claims()
    for controller in sections.controllers:
        _claim(controller, sections, claims, report)
    for controller in sections.controllers:
        own = _of(controller, sections, report)
        bus_of_controller(controller).farm_file.check_devices(controller, claims, own)
    reported: set[tuple[Location, str, str]] = set()

    def claim(at: Location, label: str, pattern: DriveGroup | DeviceGroup, one: DriveConfig | DeviceConfig) -> None:
        values = list(one.claims())
        # a pattern that does not count is reported as that
        if pattern.count == 1 or numbered(pattern.name):
            values += [("name", name, shown(name)) for name in one.names]
        for key, value, text in values:
            by = claims.claim(key, value, label, one.name)
            if by is None or (at, key, claims.place(key, value)) in reported:
                continue
            reported.add((at, key, claims.place(key, value)))
            what = f"{text} belongs to {by} already"
            if key != "name":
                what = f"{shown(one.name)}: {what}"
            report((*at, key), what, "each once in the farm")

    for drive in expand_sections(sections, known):
        placed = groups[drive.group]
        claim(placed.at, placed.label, placed.group, drive)
    for device in expand_device_sections(sections):
        number = devices[device.group]
        claim(("devices", number), f"devices[{number}]", sections.devices[device.group], device)
