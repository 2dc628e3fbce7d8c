"""What a farm file's sections and groups must hold between them.

Each check reports a place, what is wrong, and what is allowed; one report per group and cause, not one per drive.
"""

from __future__ import annotations

from collections.abc import Callable
from ipaddress import IPv4Address
from typing import TYPE_CHECKING

from pnfarm.buses.profinet.config.clock import MAX_WATCHDOG_NS
from pnfarm.config.values import expand_name, numbered
from pnfarm.farm.file.expand import Clock, clock_of, controller_mac, expand_sections, own_cycle_ns
from pnfarm.farm.file.sections import MAX_DRIVES, ControllerSection, DriveGroup, FarmSections, MacvlanLink
from pnfarm.protocols.profinet.wire.names import check_station_name
from pnfarm.vocabulary.durations import format_duration
from pnfarm.vocabulary.issues import Location
from pnfarm.vocabulary.quoting import did_you_mean, shown
from pnfarm.wire.mac import format_mac, is_group, mac_from_int, mac_to_int

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pnfarm.config.known import Known, ModelFacts

__all__ = ["Report", "check"]

#: Says that something is wrong: where, what, and what is allowed.
Report = Callable[[Location, str, str], None]


def check(
    sections: FarmSections,
    known: Known,
    report: Report,
    *,
    hangs_together: bool = True,
    places: Sequence[int] | None = None,
) -> None:
    """Report all that does not fit together; one report per group and cause, not one per drive.

    ``hangs_together=False`` leaves out what the sections owe each other, for a file that lost some; ``places`` are
    then the numbers that the drive groups have in the file.
    """
    if hangs_together:
        _check_sections(sections, report)
    numbers = range(len(sections.drives)) if places is None else places
    total = sum(group.count for group in sections.drives)
    for number, group in enumerate(sections.drives):
        _check_group(("drives", number), group, known, report)
    if total > MAX_DRIVES:
        report(("drives",), f"makes {total} drives", f"at most {MAX_DRIVES} in one farm")
    else:
        _check_names(sections, report)
        _check_between(sections, known, report, numbers)
    if sections.controller is not None:
        _check_controller(sections, sections.controller, known, report, numbers)


def _check_sections(sections: FarmSections, report: Report) -> None:
    controller = sections.controller
    if sections.farm is None and controller is None:
        report((), "has neither `farm` nor `controller`", "farm: NAME for drives, controller: for foreign devices")
    if sections.farm is not None and sections.link is None:
        report(
            (),
            "has no `link`, so that the drives hang in the air",
            "link: {kind: macvlan, parent: eth1} or another kind",
        )
    elif sections.farm is None and sections.link is not None and controller is not None:
        report(("link",), "stands in a file without `farm`", "farm: NAME beside it, or controller.interface")
    if controller is None:
        return
    at = ("controller",)
    if controller.interface is not None and controller.link is not None:
        report((*at, "interface"), "stands beside `link`", "one of the two")
    if controller.interface is None and controller.link is None and sections.farm is None:
        report(at, "has no interface to use", "interface: eth1")
    if isinstance(sections.link, MacvlanLink):
        parent = sections.link.parent
        if controller.interface == parent:
            what = f"{parent} does not hear the macvlans that stand on it"
            report((*at, "interface"), what, "another interface, or none: the controller gets a macvlan of its own")
        shares = controller.interface is None and (controller.link is None or controller.link == sections.link)
        if sections.link.transmit == "parent" and shares:
            what = "frames sent through the parent do not reach a controller on the same link"
            report(("link", "transmit"), what, "interface, or a controller with an interface of its own")


def _check_group(at: Location, group: DriveGroup, known: Known, report: Report) -> None:
    if group.count > 1 and not numbered(group.name):
        report(
            (*at, "name"),
            f"{group.count} drives cannot all be called {shown(group.name)}",
            "a name with {n}, or count: 1",
        )
    _check_addresses(at, group, report)
    model = known.model(group.model)
    if model is None:
        hint = did_you_mean(group.model, known.models)
        report((*at, "model"), f"{shown(group.model)} is no model of this version{hint}", ", ".join(known.models))
    else:
        _check_model(at, group, model, report)


def _check_model(at: Location, group: DriveGroup, model: ModelFacts, report: Report) -> None:
    if group.telegram is not None and group.telegram not in set(model.telegrams):
        what = f"{model.name} has no telegram {group.telegram}"
        report((*at, "telegram"), what, ", ".join(map(str, sorted(model.telegrams))))
    for key, what, allowed in model.parameter_complaints(group.params):
        report((*at, "params", key), what, allowed)
    _check_tasks((*at, "motion_tasks"), group, model, report)
    for key, what, allowed in model.identity_complaints(group.identity):
        report((*at, "identity", key) if key else (*at, "identity"), what, allowed)
    for key, what, allowed in model.behaviour_complaints(group.behaviour):
        report((*at, "behaviour", key), what, allowed)
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
    _check_limit((*at, "cycle"), group, model, group.cycle_ns, report)


def _check_tasks(at: Location, group: DriveGroup, model: ModelFacts, report: Report) -> None:
    seen: set[int] = set()
    for place, task in enumerate(group.motion_tasks):
        if not model.motion_tasks:
            report((*at, place), f"{model.name} keeps no motion tasks", "none")
        elif task.number >= model.motion_tasks:
            report((*at, place, "number"), f"is {task.number}", f"0 to {model.motion_tasks - 1}")
        elif task.number in seen:
            report((*at, place, "number"), f"{task.number} stands twice", "each number once")
        seen.add(task.number)


def _check_limit(at: Location, group: DriveGroup, model: ModelFacts, cycle_ns: int | None, report: Report) -> None:
    if cycle_ns is None or group.limits != "strict":
        return
    if 0 < model.max_cycle_ns < cycle_ns:
        slowest = format_duration(model.max_cycle_ns)
        what = f"{format_duration(cycle_ns)} is slower than {model.name} can; the nearest is {slowest}"
        report(at, what, f"{slowest} and faster, or limits: lax on drives {shown(group.name)}")
    if cycle_ns >= model.min_cycle_ns:
        return
    fastest = format_duration(model.min_cycle_ns)
    what = f"{format_duration(cycle_ns)} is faster than {model.name} can; the nearest is {fastest}"
    report(at, what, f"{fastest} and slower, or limits: lax on drives {shown(group.name)}")


def _check_names(sections: FarmSections, report: Report) -> None:
    allowed = "a-z, 0-9, - and . as PROFINET has it"
    for number, group in enumerate(sections.drives):
        for step in range(group.count):
            name = expand_name(group.name, group.start + step)
            if (wrong := check_station_name(name)) is not None:
                report(("drives", number, "name"), f"{shown(name)} is no station name: {wrong}", allowed)
                break


def _check_addresses(at: Location, group: DriveGroup, report: Report) -> None:
    if isinstance(group.mac, bytes):
        last = mac_to_int(group.mac) + group.count - 1
        if last >> 48 or is_group(mac_from_int(last)):
            report((*at, "mac"), f"counts {group.count} drives up into multicast addresses", "a lower first address")
    if group.ip is None:
        if group.gateway is not None:
            report((*at, "gateway"), "stands without `ip`", "ip: ADDRESS/PREFIX beside it")
        return
    network = group.ip.network
    first, last = int(network.network_address) + 1, int(network.broadcast_address) - 1
    start = int(group.ip)
    if start < first:
        report((*at, "ip"), f"{group.ip.ip} is the address of the network {network}", _hosts(first, last))
    elif start > last:
        report((*at, "ip"), f"{group.ip.ip} is the broadcast address of {network}", _hosts(first, last))
    elif start + group.count - 1 > last:
        name = expand_name(group.name, group.start + last + 1 - start)
        report((*at, "ip"), f"counts past the end of {network} at {shown(name)}", _hosts(first, last))
    if group.gateway is None:
        return
    gateway = int(group.gateway)
    if not first <= gateway <= last:
        report((*at, "gateway"), f"{group.gateway} is no host of the drives' subnet {network}", _hosts(first, last))
    elif start <= gateway < start + group.count:
        name = expand_name(group.name, group.start + gateway - start)
        report((*at, "gateway"), f"{group.gateway} is the address of the drive {shown(name)}", _hosts(first, last))


def _hosts(first: int, last: int) -> str:
    return f"{IPv4Address(first)} to {IPv4Address(last)}"


def _check_between(sections: FarmSections, known: Known, report: Report, numbers: Sequence[int]) -> None:
    """Duplicates: one report for a group and the group (or the controller) that it collides with."""
    seen: dict[tuple[str, object], tuple[str, str]] = {}
    controller = sections.controller
    if controller is not None:
        owner = ("the controller", controller.name)
        seen["name", controller.name] = owner
        if (mac := controller_mac(sections)) is not None:
            seen["mac", mac] = owner
        if controller.ip is not None:
            seen["ip", controller.ip.ip] = owner
        _check_devices(controller, seen, report)
    reported: set[tuple[int, str, str]] = set()
    for drive in expand_sections(sections, known):
        group = sections.drives[drive.group]
        values: list[tuple[str, object, str]] = [("mac", drive.mac, format_mac(drive.mac))]
        # a pattern that does not count is reported as that
        if group.count == 1 or numbered(group.name):
            values.append(("name", drive.name, shown(drive.name)))
        if drive.ip is not None:
            values.append(("ip", drive.ip.ip, str(drive.ip.ip)))
        for field, value, words in values:
            own = (f"drives[{numbers[drive.group]}]", drive.name)
            where, who = owner = seen.setdefault((field, value), own)
            if owner != own and (drive.group, field, where) not in reported:
                reported.add((drive.group, field, where))
                by = "the controller" if where == "the controller" else f"{shown(who)} of {where}"
                what = f"{words} belongs to {by} already"
                if field != "name":
                    what = f"{shown(drive.name)}: {what}"
                report(("drives", drive.group, field), what, "each once in the farm")


def _check_devices(
    controller: ControllerSection, seen: dict[tuple[str, object], tuple[str, str]], report: Report
) -> None:
    """The devices that are described by files: each name and address once, each address a host's."""
    for number, device in enumerate(controller.devices):
        at: Location = ("controller", "devices", number)
        if (wrong := check_station_name(device.name)) is not None:
            what = f"{shown(device.name)} is no station name: {wrong}"
            report((*at, "name"), what, "a-z, 0-9, - and . as PROFINET has it")
        values: list[tuple[str, object, str]] = [("name", device.name, shown(device.name))]
        if device.ip is not None:
            values.append(("ip", device.ip.ip, str(device.ip.ip)))
            network = device.ip.network
            first, last = int(network.network_address) + 1, int(network.broadcast_address) - 1
            if not first <= int(device.ip) <= last:
                what = f"{device.ip.ip} is the network's or the broadcast address of {network}"
                report((*at, "ip"), what, _hosts(first, last))
        own = (f"controller.devices[{number}]", device.name)
        for field, value, words in values:
            owner = seen.setdefault((field, value), own)
            if owner != own:
                by = "the controller" if owner[0] == "the controller" else f"{shown(owner[1])} of {owner[0]}"
                report((*at, field), f"{words} belongs to {by} already", "each once in the file")
        try:
            clock = clock_of(controller, device.cycle_ns)
        except ValueError as error:
            if device.cycle_ns is not None:
                what = f"does not fit the controller's send clock: {error}"
                report((*at, "cycle"), what, "a multiple of it by a power of two to 512")
            continue
        if clock.cycle_ns * controller.watchdog_factor > MAX_WATCHDOG_NS:
            what = f"{controller.watchdog_factor} cycles of {format_duration(clock.cycle_ns)} are too long a watchdog"
            report((*at, "cycle"), what, "a watchdog of at most 1.92s")


def _check_controller(
    sections: FarmSections, controller: ControllerSection, known: Known, report: Report, numbers: Sequence[int]
) -> None:
    at: Location = ("controller",)
    if (wrong := check_station_name(controller.name)) is not None:
        report(
            (*at, "name"),
            f"{shown(controller.name)} is no station name: {wrong}",
            "a-z, 0-9, - and . as PROFINET has it",
        )
    if controller.ip is not None:
        network = controller.ip.network
        first, last = int(network.network_address) + 1, int(network.broadcast_address) - 1
        if not first <= int(controller.ip) <= last:
            what = f"{controller.ip.ip} is the network's or the broadcast address of {network}"
            report((*at, "ip"), what, _hosts(first, last))
        for number, group in enumerate(sections.drives):
            if group.ip is not None and group.gateway is None and group.ip.ip not in network:
                what = f"{controller.ip} cannot reach drives[{numbers[number]}], {group.ip}, which has no gateway"
                report((*at, "ip"), what, f"an address in {group.ip.network}")
    try:
        general = clock_of(controller)
    except ValueError as error:
        report((*at, _clock_key(controller)), str(error), "cycle = 31.25us x send_clock_factor x reduction_ratio")
        return
    for number, group in enumerate(sections.drives):
        _check_clock(("drives", number), group, controller, general, known, report)


def _check_clock(
    at: Location, group: DriveGroup, controller: ControllerSection, general: Clock, known: Known, report: Report
) -> None:
    """One group's cycle against the controller's send clock, the watchdog and the model."""
    own = group.cycle_ns is not None
    place: Location = (*at, "cycle") if own else ("controller", "cycle")
    model = known.model(group.model)
    cycle_ns = own_cycle_ns(group, controller, model)
    try:
        clock = general if cycle_ns is None else clock_of(controller, cycle_ns)
    except ValueError as error:
        report(place, f"does not fit the controller's send clock: {error}", "a multiple of it by a power of two to 512")
        return
    watchdog_ns = clock.cycle_ns * controller.watchdog_factor
    if watchdog_ns > MAX_WATCHDOG_NS:
        cycle, watchdog = format_duration(clock.cycle_ns), format_duration(watchdog_ns)
        what = f"{controller.watchdog_factor} cycles of {cycle} are {watchdog}"
        most = MAX_WATCHDOG_NS // clock.cycle_ns
        report(("controller", "watchdog_factor"), what, f"a watchdog of at most 1.92s, here a factor to {most}")
    if model is None:
        return
    if not own:
        _check_limit(place, group, model, clock.cycle_ns, report)
    clocks = list(model.send_clocks)
    if group.limits == "strict" and clock.send_clock_factor not in clocks and clock.cycle_ns >= model.min_cycle_ns:
        what = f"a send clock factor of {clock.send_clock_factor} is none of {model.name}"
        allowed = f"one of {', '.join(map(str, clocks))}, or limits: lax on drives {shown(group.name)}"
        report(("controller", _clock_key(controller)), what, allowed)


def _clock_key(controller: ControllerSection) -> str:
    """What the controller's send clock follows from."""
    keys = ("send_clock_factor", "reduction_ratio")
    return next((key for key in keys if getattr(controller, key) is not None), "cycle")
