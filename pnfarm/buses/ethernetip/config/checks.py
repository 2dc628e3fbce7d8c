"""Checks of EtherNet/IP's keys: host names, addresses, packet intervals against the model."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from pnfarm.config.ip import check_addresses
from pnfarm.vocabulary.durations import format_duration
from pnfarm.vocabulary.quoting import shown

if TYPE_CHECKING:
    from pnfarm.buses.ethernetip.config.device import EthernetIpDevices
    from pnfarm.buses.ethernetip.config.drive import EthernetIpDrives
    from pnfarm.config.known import ModelFacts
    from pnfarm.vocabulary.issues import Location, Report

__all__ = ["check_group", "check_model", "check_name"]

_NAME_ALLOWED = "letters, digits, -, _ and ., at most 64 characters, as a host name"
_NAME = re.compile(r"[A-Za-z0-9]([A-Za-z0-9._-]{0,62}[A-Za-z0-9])?")


def check_name(at: Location, name: str, report: Report) -> bool:
    """Whether this can be a host name (TCP/IP Interface object, attribute 6); it is reported if not."""
    fits = _NAME.fullmatch(name) is not None
    if not fits:
        report(at, f"{shown(name)} is not a host name", _NAME_ALLOWED)
    return fits


def check_group(at: Location, group: EthernetIpDrives | EthernetIpDevices, report: Report) -> None:
    """Every station has an address."""
    check_addresses(at, group, report)
    if group.ip is None:
        what = f"is missing: a {group.members[:-1]} on EtherNet/IP needs an address"
        report((*at, "ip"), what, "ip: ADDRESS/PREFIX")


def check_model(at: Location, group: EthernetIpDrives, model: ModelFacts, report: Report) -> None:
    """A group's own packet interval against its model."""
    if group.rpi_ns is None or group.limits != "strict" or group.rpi_ns >= model.min_cycle_ns:
        return
    fastest = format_duration(model.min_cycle_ns)
    what = f"{format_duration(group.rpi_ns)} is faster than {model.name} can; the nearest is {fastest}"
    report((*at, "rpi"), what, f"{fastest} and slower, or limits: lax on drives {shown(group.name)}")
