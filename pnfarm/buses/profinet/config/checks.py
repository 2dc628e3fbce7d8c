"""Checks of PROFINET's keys: station names, telegrams, cycles against send clock, watchdog and model."""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING

from pnfarm.buses.profinet.axis_slots import axis_shifts, axis_stride, model_slots
from pnfarm.buses.profinet.config.clock import MAX_WATCHDOG_NS
from pnfarm.buses.profinet.config.send_clock import Clock, clock_key, clock_of, own_cycle_ns
from pnfarm.config.ip import check_controller_host, check_host
from pnfarm.drives.description.identity_modules import absent
from pnfarm.errors import ConfigError
from pnfarm.protocols.profinet.cm.controller.plan import MAX_SLOT
from pnfarm.protocols.profinet.wire.names import check_station_name
from pnfarm.vocabulary.durations import format_duration
from pnfarm.vocabulary.quoting import shown

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pnfarm.buses.farm_file import Claims, PlacedGroup
    from pnfarm.buses.profinet.config.controller import ProfinetController
    from pnfarm.buses.profinet.config.drive import ProfinetAxis, ProfinetDrives
    from pnfarm.config.known import Known, ModelFacts
    from pnfarm.drives.description.model import Model
    from pnfarm.vocabulary.issues import Location, Report

__all__ = ["check_controller", "check_devices", "check_model", "check_name"]

_NAME_ALLOWED = "a-z, 0-9, - and . as PROFINET has it"


def check_name(at: Location, name: str, report: Report) -> bool:
    """Whether this is a valid station name; it is reported if not."""
    wrong = check_station_name(name)
    if wrong is not None:
        report(at, f"{shown(name)} is not a station name: {wrong}", _NAME_ALLOWED)
    return wrong is None


def check_model(at: Location, group: ProfinetDrives, model: ModelFacts, report: Report) -> None:
    """A group's telegrams and its own cycle against its model, under the maker's file if there is one."""
    _check_telegrams(at, group, group, model, report)
    _check_limit((*at, "cycle"), group, model, group.cycle_ns, report)
    _check_axes((*at, "axes"), group, model, report)


def _check_telegrams(
    at: Location, group: ProfinetDrives, asked: ProfinetDrives | ProfinetAxis, model: ModelFacts, report: Report
) -> None:
    gone: set[int] = set()
    # a wrong list is reported with the identity
    with suppress(ConfigError):
        gone = set(absent(group.identity))
    of = f"{model.name} has" if not gone else f"{model.name} under its maker's file has"
    for key, kind, known in (
        ("telegram", "telegram", set(model.telegrams)),
        ("supplementary", "supplementary telegram", set(model.supplements)),
    ):
        wanted = getattr(asked, key)
        if wanted is not None and wanted not in known - gone:
            allowed = ", ".join(map(str, sorted(known - gone))) or "none"
            report((*at, key), f"{of} no {kind} {wanted}", allowed)


def _check_axes(at: Location, group: ProfinetDrives, model: ModelFacts, report: Report) -> None:
    """The axes of a drive with several."""
    if len(group.axes) > model.most_axes and group.limits == "strict":
        most = "one axis" if model.most_axes == 1 else f"at most {model.most_axes} axes"
        report(at, f"{model.name} has {most}, by its manual", f"{model.most_axes}, or limits: lax")
    seen: set[str] = set()
    for number, axis in enumerate(group.axes):
        here: Location = (*at, number)
        if axis.name in seen:
            report((*here, "name"), f"{axis.name} is given twice", "each name once")
        seen.add(axis.name)
        _check_telegrams(here, group, axis, model, report)
        for key, what, allowed in model.parameter_complaints(axis.params):
            report((*here, "params", key), what, allowed)
        motor = group.motor if axis.motor is None else axis.motor
        if (motor.kind, motor.pitch) != (group.motor.kind, group.motor.pitch):
            report((*here, "motor"), "is of another kind or pitch than the drive's", "those of the drive")
        load = group.load if axis.load is None else axis.load
        for key, what, allowed in model.axis_complaints(load, motor):
            report((*here, key), what, allowed)
    if model.described is not None:
        _check_slots(at, group, model.described, report)


def _check_slots(at: Location, group: ProfinetDrives, model: Model, report: Report) -> None:
    """The slots of a drive's axes: each in its own, and within the drive."""
    first, stride = min(model_slots(model)), axis_stride(model)
    strict = group.limits == "strict"
    highest = first + max(model.limits.axes, len(group.axes)) * stride - 1 if strict else MAX_SLOT
    taken: dict[int, str] = {}
    for number, (axis, shift) in enumerate(
        zip(group.axes, axis_shifts(model, [axis.slot for axis in group.axes]), strict=True)
    ):
        here: Location = (*at, number) if axis.slot is None else (*at, number, "slot")
        own = range(first + shift, first + shift + stride)
        if own[0] < first or own[-1] > highest:
            what = f"{axis.name} is in slot {own[0]}, {model.name} has axes in slots {first} to {highest}"
            report(here, what, f"{first} to {highest - stride + 1}" + (", or limits: lax" if strict else ""))
        for slot in own:
            if (owner := taken.setdefault(slot, axis.name)) != axis.name:
                report(here, f"slot {slot} is that of axis {owner}", "each slot once")
                break


def _check_limit(at: Location, group: ProfinetDrives, model: ModelFacts, cycle_ns: int | None, report: Report) -> None:
    if cycle_ns is None or group.limits != "strict":
        return
    if 0 < model.max_cycle_ns < cycle_ns:
        slowest = format_duration(model.max_cycle_ns)
        what = f"{format_duration(cycle_ns)} is slower than {model.name} can; the nearest is {slowest}"
        report(at, what, f"{slowest} and faster, {_else(group, slowest)}")
    if cycle_ns >= model.min_cycle_ns:
        return
    fastest = format_duration(model.min_cycle_ns)
    what = f"{format_duration(cycle_ns)} is faster than {model.name} can; the nearest is {fastest}"
    report(at, what, f"{fastest} and slower, {_else(group, fastest)}")


def _else(group: ProfinetDrives, nearest: str) -> str:
    """What else helps these drives, where the controller's cycle is none of theirs."""
    own = f"`cycle: {nearest}` or " if group.cycle_ns is None else ""
    return f"or {own}limits: lax on drives {shown(group.name)}"


def check_devices(controller: ProfinetController, claims: Claims, report: Report) -> None:
    """The devices that are described by files: each name and address once, each address a host's."""
    for number, device in enumerate(controller.devices):
        at: Location = ("controller", "devices", number)
        check_name((*at, "name"), device.name, report)
        values: list[tuple[str, object, str]] = [("name", device.name, shown(device.name))]
        if device.ip is not None:
            values.append(("ip", device.ip.ip, str(device.ip.ip)))
            check_host((*at, "ip"), device.ip, report)
        for field, value, shown_value in values:
            if (by := claims.claim(field, value, f"controller.devices[{number}]", device.name)) is not None:
                report((*at, field), f"{shown_value} belongs to {by} already", "each once in the file")
        try:
            clock = clock_of(controller, device.cycle_ns)
        except ValueError as error:
            if device.cycle_ns is not None:
                what = f"does not fit the controller's send clock: {error}"
                report((*at, "cycle"), what, "a multiple of it by a power of two to 512")
            continue
        own = device.watchdog_factor
        factor = controller.watchdog_factor if own is None else own
        if clock.cycle_ns * factor > MAX_WATCHDOG_NS:
            what = f"{factor} cycles of {format_duration(clock.cycle_ns)} are too long a watchdog"
            report((*at, "cycle" if own is None else "watchdog_factor"), what, "a watchdog of at most 1.92s")


def check_controller(
    controller: ProfinetController, groups: Sequence[PlacedGroup[ProfinetDrives]], known: Known, report: Report
) -> None:
    """The controller's own keys, and each group's cycle against its send clock."""
    at: Location = ("controller",)
    check_name((*at, "name"), controller.name, report)
    check_controller_host(controller.ip, ((placed.label, placed.group) for placed in groups), report)
    try:
        general = clock_of(controller)
    except ValueError as error:
        report((*at, clock_key(controller)), str(error), "cycle = 31.25us x send_clock_factor x reduction_ratio")
        return
    for placed in groups:
        _check_clock(placed.at, placed.group, controller, general, known, report)


def _check_clock(
    at: Location, group: ProfinetDrives, controller: ProfinetController, general: Clock, known: Known, report: Report
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
        what = f"a send clock factor of {clock.send_clock_factor} is not supported by {model.name}"
        allowed = f"one of {', '.join(map(str, clocks))}, or limits: lax on drives {shown(group.name)}"
        report(("controller", clock_key(controller)), what, allowed)
