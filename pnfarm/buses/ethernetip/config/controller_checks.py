"""Checks of the scanner's keys: addresses, packet intervals against the models, what a connection can do."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.config.ip import check_controller_host, check_host
from pnfarm.vocabulary.durations import format_duration
from pnfarm.vocabulary.quoting import shown

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pnfarm.buses.ethernetip.config.controller import EthernetIpController
    from pnfarm.buses.ethernetip.config.drive import EthernetIpDrives
    from pnfarm.buses.farm_file import Claims, PlacedGroup
    from pnfarm.config.known import Known
    from pnfarm.vocabulary.issues import Location, Report

__all__ = ["check_controller", "check_devices"]


def check_devices(controller: EthernetIpController, claims: Claims, report: Report) -> None:
    """The devices that are described by files: each name and address once, each address a host's in reach."""
    for number, device in enumerate(controller.devices):
        at: Location = ("controller", "devices", number)
        check_host((*at, "ip"), device.ip, report)
        for field, value, text in (
            ("name", device.name, shown(device.name)),
            ("ip", device.ip.ip, str(device.ip.ip)),
        ):
            if (by := claims.claim(field, value, f"controller.devices[{number}]", device.name)) is not None:
                report((*at, field), f"{text} belongs to {by} already", "each once in the file")
        if controller.ip is not None and device.ip.ip not in controller.ip.network:
            what = f"{device.ip.ip} is not in the subnet of the controller, {controller.ip}"
            report((*at, "ip"), what, f"an address in {controller.ip.network}")


def check_controller(
    controller: EthernetIpController, groups: Sequence[PlacedGroup[EthernetIpDrives]], known: Known, report: Report
) -> None:
    """The controller's own keys, and each group's packet interval where the controller gives it."""
    at: Location = ("controller",)
    check_controller_host(controller.ip, ((placed.label, placed.group) for placed in groups), report)
    program = controller.program
    if program.python is not None:
        what = "is not possible on EtherNet/IP: a program of your own has the signals of a telegram"
        report((*at, "program", "python"), what, "the keys of a built-in program")
    elif controller.connection != "exclusive-owner" and program.kind != "idle":
        what = f"is {controller.connection}, which sends no commands, but the program is to move the axes"
        report((*at, "connection"), what, "exclusive-owner, or program: {kind: idle}")
    if controller.rpi_ns is None:
        return
    for placed in groups:
        group, model = placed.group, known.model(placed.group.model)
        if model is None or group.rpi_ns is not None or group.limits != "strict":
            continue
        if controller.rpi_ns < model.min_cycle_ns:
            fastest = format_duration(model.min_cycle_ns)
            what = f"{format_duration(controller.rpi_ns)} is faster than {model.name} can; the nearest is {fastest}"
            instead = f"or `rpi: {fastest}` or limits: lax on drives {shown(group.name)}"
            report((*at, "rpi"), what, f"{fastest} and slower, {instead}")
