"""Checks of PROFIBUS's keys: names, station addresses."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.buses.farm_file import CONTROLLER
from pnfarm.buses.profibus.config.drive import HIGHEST_ADDRESS
from pnfarm.buses.profibus.device.product import Product
from pnfarm.drives.description.identity import with_identity
from pnfarm.drives.parameters.parameter import ParameterError
from pnfarm.errors import ConfigError
from pnfarm.vocabulary.quoting import shown

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from pnfarm.buses.farm_file import Claims, PlacedGroup
    from pnfarm.buses.profibus.config.controller import ProfibusController
    from pnfarm.buses.profibus.config.drive import ProfibusDrives
    from pnfarm.config.known import Known, ModelFacts
    from pnfarm.vocabulary.issues import Location, Report

__all__ = [
    "ADDRESS_PARAMETER", "address_in", "check_controller", "check_count", "check_devices", "check_group",
    "check_model", "check_name",
]  # fmt: skip

#: COM_DP_Address (Moog MSD manual 4.2.2).
ADDRESS_PARAMETER = 918
_LONGEST_NAME = 64
_NAME_ALLOWED = f"1 to {_LONGEST_NAME} printable characters"


def check_name(at: Location, name: str, report: Report) -> bool:
    """The wire has no names: any text that fits a table does."""
    fits = 0 < len(name) <= _LONGEST_NAME and name.isprintable()
    if not fits:
        report(at, f"{shown(name)} is not a name", _NAME_ALLOWED)
    return fits


def address_in(params: Mapping[str, Any], model: ModelFacts | None) -> int | None:
    """The value of the address parameter, where a group's ``params`` have it."""
    described = None if model is None else model.described
    if described is None:
        return None
    for key, value in params.items():
        try:
            number = described.resolve(key)[0].pnu
        except ParameterError:
            continue
        if number == ADDRESS_PARAMETER and type(value) is int:
            return value
    return None


def check_group(at: Location, group: ProfibusDrives, report: Report) -> None:
    """Addresses that are counted up stay addresses."""
    for key, first in (("address", group.address), ("control_unit", group.control_unit)):
        check_count(at, key, first, group.count, report)


def check_model(at: Location, group: ProfibusDrives, model: ModelFacts, report: Report) -> None:
    """Identifiers of the farm file or of a maker's file have the lengths of their telegrams."""
    if model.described is None or "telegrams" not in group.identity:
        return
    try:
        described = with_identity(model.described, group.identity)
    except ConfigError:
        return  # reported with the other keys of the section
    try:
        Product.of(described)
    except ConfigError as exc:
        report((*at, "identity", "telegrams"), str(exc), "identifiers with the lengths of the telegram's words")


def check_count(at: Location, key: str, first: int | None, count: int, report: Report) -> None:
    """Addresses of so many stations, the first of which has this one."""
    if first is None or first > HIGHEST_ADDRESS:
        return
    last = first + count - 1
    if last > HIGHEST_ADDRESS:
        report((*at, key), f"counts {count} stations up to {last}", f"station addresses from 0 to {HIGHEST_ADDRESS}")


def check_devices(controller: ProfibusController, claims: Claims, report: Report) -> None:
    """The master's address, and the slaves that are described by files: each name and address once."""
    own = ("profibus", controller.address)
    if (by := claims.claim("address", own, CONTROLLER, controller.name)) is not None:
        what = f"station address {controller.address} belongs to {by} already"
        report(("controller", "address"), what, "each once on the line")
    for number, device in enumerate(controller.devices):
        at: Location = ("controller", "devices", number)
        for key, field, value, text in (
            ("name", "name", device.name, shown(device.name)),
            ("address", "address", ("profibus", device.address), f"station address {device.address}"),
        ):
            if (by := claims.claim(field, value, f"controller.devices[{number}]", device.name)) is not None:
                report((*at, key), f"{text} belongs to {by} already", "each once on the line")


def check_controller(
    controller: ProfibusController, groups: Sequence[PlacedGroup[ProfibusDrives]], known: Known, report: Report
) -> None:
    """The controller's telegram against the models of its drives."""
    if controller.telegram is None:
        return
    for placed in groups:
        model = known.model(placed.group.model)
        if model is not None and controller.telegram not in model.telegrams:
            numbers = ", ".join(str(number) for number in model.telegrams)
            report(("controller", "telegram"), f"{model.name} has no telegram {controller.telegram}", numbers)
            return
