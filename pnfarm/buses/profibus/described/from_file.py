"""From a group of the farm file to a described device: its GSD file read, plugged, and checked."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.buses.device_signals import device_signals
from pnfarm.buses.profibus.described.file_signals import file_signals
from pnfarm.buses.profibus.described.station import DescribedSlave
from pnfarm.buses.profibus.gsd_file import load_gsd
from pnfarm.config.slots import names_module
from pnfarm.errors import ConfigError
from pnfarm.protocols.profibus.gsd.station import plug_slave
from pnfarm.protocols.profibus.gsd.values import PlugError
from pnfarm.vocabulary.regular_file import beside

if TYPE_CHECKING:
    from pathlib import Path

    from pnfarm.buses.profibus.config.device import ProfibusDevices
    from pnfarm.vocabulary.issues import Location, Report

__all__ = ["describe_group"]


def describe_group(at: Location, group: ProfibusDevices, folder: Path, report: Report) -> DescribedSlave | None:
    """What a group's devices are; None where something is wrong, which is reported."""
    path = beside(folder, group.gsd)
    try:
        gsd = load_gsd(path)
    except ConfigError as exc:
        report((*at, "gsd"), str(exc), "the maker's GSD file, its name relative to the folder of this file")
        return None
    try:
        plugged = plug_slave(
            gsd,
            {slot: None if one is None else one.module for slot, one in group.slots.items() if names_module(one)},
            {slot: one.parameters for slot, one in group.slots.items() if one is not None and one.parameters},
        )
    except PlugError as exc:
        report(_place_of(at, group, exc), f"{path.name}: {exc}", "")
        return None
    wrong = False
    if group.address is None and not gsd.address_changes:
        report((*at, "address"), f"is missing, and {path.name} says that no master can set it", "address: 7")
        wrong = True
    here = DescribedSlave(plugged, {}, path.name)
    signals = device_signals(
        at, group.signals, file_signals(plugged), here.lengths, report, absent="is not plugged", order="big"
    )
    return None if wrong or signals is None else DescribedSlave(plugged, signals, path.name)


def _place_of(at: Location, group: ProfibusDevices, error: PlugError) -> Location:
    """The key that is wrong: a slot's, that of its parameters, or the file's."""
    if error.slot not in group.slots:
        return (*at, "slots") if group.slots else (*at, "gsd")
    return (*at, "slots", str(error.slot), "parameters") if error.parameter else (*at, "slots", str(error.slot))
