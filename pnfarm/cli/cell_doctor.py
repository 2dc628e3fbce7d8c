"""Will a PLC with this farm be green?  What a farm file alone shows: names, addresses, the controllers' plans.

What is wrong within a section its reader refuses; here it is about stations beside each other, and beside this machine.
"""

from __future__ import annotations

import socket
from typing import TYPE_CHECKING, Any

from pnfarm.cli.farm_file import counted
from pnfarm.cli.file_stations import stations_of
from pnfarm.config.device import DeviceConfig
from pnfarm.config.drive import DriveConfig
from pnfarm.config.links import MemoryLink, SerialLink
from pnfarm.controller.plan import plan_controllers
from pnfarm.errors import ConfigError
from pnfarm.farm.doctor.machine import Finding
from pnfarm.farm.file.choice import bus_of_controller
from pnfarm.farm.file.reading import expand_all
from pnfarm.links.kernel.addresses import kernel_address
from pnfarm.vocabulary.quoting import shortened

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from ipaddress import IPv4Address, IPv4Interface

    from pnfarm.farm.file.reading import FarmConfig

__all__ = ["examine_cell", "own_addresses"]

_Station = DriveConfig | DeviceConfig


def examine_cell(config: FarmConfig) -> list[Finding]:
    """Findings with the line of the farm file; each subject has one at least."""
    stations = expand_all(config)
    found = [Finding("note of the file", None, note) for note in config.notes]
    for name, right, findings in (
        ("names", f"{counted(len(stations), 'station')}, each with a name of its own", _names(config, stations)),
        ("addresses", "each once, and in reach of each other", _addresses(config, stations)),
        ("controller", "", _plans(config, stations)),
    ):
        wrong = list(findings)
        found += wrong or ([Finding(name, True, right)] if right else [])
    return found


def _line(config: FarmConfig, one: _Station, key: str) -> int:
    section = "devices" if isinstance(one, DeviceConfig) else "drives"
    return config.place((section, one.group, key))[1]


def _names(config: FarmConfig, stations: Sequence[_Station]) -> Iterator[Finding]:
    """The reader refuses names that are alike; these differ only in case."""
    before: dict[str, _Station] = {}
    for one in stations:
        other = before.setdefault(one.name.lower(), one)
        if other is not one:
            detail = f"{one.name} and {other.name} differ only in case: engineering tools take them for one"
            yield Finding("names", None, detail, "another name", _line(config, one, "name"))


def _ip(one: object) -> IPv4Interface | None:
    return getattr(one, "ip", None)


def own_addresses() -> dict[IPv4Address, str]:
    """The first address of each interface of this machine, with its name."""
    found = {}
    for _, name in socket.if_nameindex():
        try:
            found[kernel_address(name).ip] = name
        except ConfigError:
            continue  # an interface without an address
    return found


def _addresses(config: FarmConfig, stations: Sequence[_Station]) -> Iterator[Finding]:
    placed = [(one, ip) for one in stations if (ip := _ip(one)) is not None]
    here = {} if isinstance(config.link, MemoryLink | SerialLink) else own_addresses()
    for one, ip in placed:
        if (name := here.get(ip.ip)) is not None:
            detail = f"{ip.ip} of {one.name} is this machine's own, at {name}: two stations would answer for it"
            yield Finding("addresses", False, detail, "another ip", _line(config, one, "ip"), keeps_red=True)
    controllers = [ip for one in config.controllers if (ip := _ip(one)) is not None]
    first = next(iter(controllers), placed[0][1] if placed else None)
    if first is None:
        return
    whose = "the controller's" if controllers else "the first station's"
    networks = {ip.network for ip in controllers or [first]}
    outside: dict[tuple[Any, int], list[_Station]] = {}
    for one, ip in placed:
        if ip.network not in networks:
            outside.setdefault((ip.network, _line(config, one, "ip")), []).append(one)
    for (network, line), members in outside.items():
        names = shortened([one.name for one in members])
        detail = (
            f"{names}: in {network}, and not in {whose} {first.network}: a controller reaches them by a router only"
        )
        # a project may be made so on purpose, where the bus has routers
        remedy = f"ip: an address in {first.network}, or another prefix length"
        yield Finding("addresses", None, detail, remedy, line)


def _plans(config: FarmConfig, stations: Sequence[_Station]) -> Iterator[Finding]:
    """What the built-in controllers make of the file, and stations that are on no controller's bus."""
    if not config.controllers:
        return
    line = config.place(("controller",))[1]
    drives = [one for one in stations if isinstance(one, DriveConfig)]
    devices = [one for one in stations if isinstance(one, DeviceConfig)]
    try:
        planned = plan_controllers(config, drives, devices)
    except ConfigError as exc:
        remedy = "what it names, in the group of that station or in `controller:`"
        yield Finding("controller", False, str(exc), remedy, line, keeps_red=True)
        return
    buses = {bus_of_controller(section).name for section in config.controllers}
    alone = [one for one in stations_of(config) if one.bus not in buses]
    for bus in dict.fromkeys(one.bus for one in alone):
        names = shortened([one.facts.name for one in alone if one.bus == bus])
        first = next(one for one in alone if one.bus == bus)
        detail = f"{names}: `controller:` has no controller on their bus, so no controller connects to them"
        yield Finding("controller", None, detail, f"controller: {{{bus}: ...}}", config.place(first.at)[1])
    if not alone:
        count = sum(len(one.plan.devices) for one in planned)
        yield Finding("controller", True, f"its plan has {counted(count, 'station')}")
