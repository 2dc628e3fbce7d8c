"""From a group of the farm file to a described device: its EDS file read, a connection chosen, and checked."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.buses.device_signals import device_signals
from pnfarm.buses.ethernetip.described.file_signals import SUBSLOT, assembly_signals
from pnfarm.buses.ethernetip.described.station import DescribedStation, points_of
from pnfarm.buses.ethernetip.eds_file import load_eds
from pnfarm.errors import ConfigError
from pnfarm.table.plain_data import PLAIN_OCTETS
from pnfarm.vocabulary.durations import format_duration
from pnfarm.vocabulary.problem import Problem
from pnfarm.vocabulary.regular_file import beside

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from pnfarm.buses.ethernetip.config.device import EthernetIpDevices
    from pnfarm.buses.ethernetip.described.station import Point
    from pnfarm.protocols.enip.eds.document import Connection, Limits, Sheet
    from pnfarm.vocabulary.issues import Location, Report

__all__ = ["describe_group"]

_NETWORK = "EtherNetIP"
#: Instances that a signal's place can name.
_HIGHEST_INSTANCE = 0x7FFF
_US = 1000


def describe_group(at: Location, group: EthernetIpDevices, folder: Path, report: Report) -> DescribedStation | None:
    """What a group's devices are; None where something is wrong, which is reported."""
    path = beside(folder, group.eds)
    try:
        sheet = load_eds(path)
    except ConfigError as exc:
        report((*at, "eds"), str(exc), "the maker's EDS file, its name relative to the folder of this file")
        return None
    if sheet.networks and _NETWORK.casefold() not in {one.casefold() for one in sheet.networks}:
        report((*at, "eds"), f"{path.name} describes a device on {', '.join(sheet.networks)}", f"one on {_NETWORK}")
        return None
    chosen = _chosen(at, group, sheet, path.name, report)
    if chosen is None:
        return None
    wrong = []

    def told(place: Location, what: str, allowed: str) -> None:
        wrong.append(place)
        report(place, what, allowed)

    offered = tuple(one for one in sheet.connections if one.is_class_1 and not _refusal(one))
    notes = [f"{one.keyword} is not offered: {_refusal(one)}" for one in sheet.connections if _refusal(one)]
    points = points_of(offered)
    for way in ("inputs", "outputs"):
        own = [one for one in points if f"{one.direction}s" == way]
        octets = sum(one.octets for one in own)
        if octets + len(own) > PLAIN_OCTETS:
            told((*at, "eds"), f"{path.name}: its assemblies have {octets} octets of {way}", f"at most {PLAIN_OCTETS}")
    sizes = (
        _size((*at, "sizes", "outputs"), group.sizes.outputs, chosen.outputs.size, told),
        _size((*at, "sizes", "inputs"), group.sizes.inputs, chosen.inputs.size, told),
    )
    _check_rpi(at, group, chosen, told)
    parameters = _parameters(at, group, sheet, told)
    signals = device_signals(
        at,
        group.signals,
        assembly_signals((one.direction, one.instance, one.octets, one.members) for one in points),
        _octets(points),
        report,
        absent="is no assembly with cyclic data",
        order="little",
    )
    if wrong or signals is None:
        return None
    notes += (*sheet.unusable.values(), *sheet.remarks)
    return DescribedStation(sheet, chosen, sizes, offered, points, signals, parameters, tuple(notes))


def _chosen(at: Location, group: EthernetIpDevices, sheet: Sheet, file: str, report: Report) -> Connection | None:
    """The connection that the built-in controller asks for."""
    key = "eds" if group.connection is None else "connection"
    try:
        chosen = sheet.connection(group.connection)
    except ConfigError as exc:
        report((*at, key), f"{file}: {exc}", "a connection of class 1, by its number, keyword or name")
        return None
    if (why := _refusal(chosen)) != "":
        report((*at, key), f"{file}: {chosen.keyword} cannot be offered: {why}", "another connection of the file")
        return None
    return chosen


def _refusal(one: Connection) -> str:
    """Why a connection cannot be offered, empty for nothing."""
    if not one.is_class_1:
        return ""
    if max(one.points, default=0) > _HIGHEST_INSTANCE:
        return f"its path names an instance above {_HIGHEST_INSTANCE}"
    return one.unsupported


def _size(at: Location, given: int | None, limits: Limits, report: Report) -> int:
    if given is None:
        return limits.default
    if not limits.least <= given <= limits.most:
        fixed = limits.least == limits.most
        allowed = f"{limits.least}, which the file fixes" if fixed else f"{limits.least} to {limits.most}"
        report(at, f"{given} octets are not possible with this connection", allowed)
    return given


def _check_rpi(at: Location, group: EthernetIpDevices, chosen: Connection, report: Report) -> None:
    """The group's packet interval against both directions of its connection."""
    for limits in chosen.intervals:
        if group.rpi_ns is None or group.limits != "strict":
            return
        if not limits.least * _US <= group.rpi_ns <= limits.most * _US:
            what = f"{format_duration(group.rpi_ns)} is outside of what its file allows"
            allowed = f"{format_duration(limits.least * _US)} to {format_duration(limits.most * _US)}, or limits: lax"
            report((*at, "rpi"), what, allowed)
            return


def _parameters(at: Location, group: EthernetIpDevices, sheet: Sheet, report: Report) -> dict[int, bytes]:
    found: dict[int, bytes] = {}
    for name, value in group.parameters.items():
        try:
            parameter = sheet.named(name)
            found[parameter.number] = parameter.given(value)
        except Problem as problem:
            report((*at, "parameters", name), problem.what, problem.allowed)
    return found


def _octets(points: Sequence[Point]) -> dict[tuple[int, int], tuple[int, int]]:
    """Octets of inputs and outputs of each assembly."""
    found: dict[tuple[int, int], tuple[int, int]] = {}
    for one in points:
        inputs, outputs = found.get((one.instance, SUBSLOT), (0, 0))
        own = (one.octets, outputs) if one.direction == "input" else (inputs, one.octets)
        found[one.instance, SUBSLOT] = own
    return found
