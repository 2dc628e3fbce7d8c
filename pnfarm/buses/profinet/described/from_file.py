"""From a group of the farm file to a described device: its GSDML file read, plugged, and checked."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.buses.device_signals import device_signals
from pnfarm.buses.profinet.described.station import DescribedStation
from pnfarm.buses.profinet.file_signals import file_signals
from pnfarm.buses.profinet.gsdml_file import load_gsdml
from pnfarm.config.slots import names_module
from pnfarm.errors import ConfigError
from pnfarm.protocols.profinet.gsdml.parameters import parameter_records
from pnfarm.protocols.profinet.gsdml.station import PlugError, plug_station
from pnfarm.table.plain_data import PLAIN_OCTETS
from pnfarm.vocabulary.regular_file import beside

if TYPE_CHECKING:
    from pathlib import Path

    from pnfarm.buses.profinet.config.device import ProfinetDevices
    from pnfarm.protocols.profinet.gsdml.station import PluggedStation
    from pnfarm.vocabulary.issues import Location, Report

__all__ = ["describe_group"]


def describe_group(at: Location, group: ProfinetDevices, folder: Path, report: Report) -> DescribedStation | None:
    """What a group's devices are; None where something is wrong, which is reported."""
    path = beside(folder, group.gsdml)
    try:
        gsdml = load_gsdml(path)
    except ConfigError as exc:
        report((*at, "gsdml"), str(exc), "the maker's GSDML file, its name relative to the folder of this file")
        return None
    try:
        plugged = plug_station(
            gsdml,
            access_point=group.access_point,
            modules={
                slot: None if one is None else one.module for slot, one in group.slots.items() if names_module(one)
            },
            submodules={
                (slot, subslot): wanted
                for slot, one in group.slots.items()
                if one is not None
                for subslot, wanted in one.submodules.items()
            },
        )
    except PlugError as exc:
        chooses = exc.slot is None and group.access_point is None and len(gsdml.daps) > 1
        report(_place_of(at, group, exc), f"{path.name}: {exc}", "`access_point`, the ID of one" if chooses else "")
        return None
    found = _refused(at, plugged, path.name, report)
    parameters: dict[tuple[int, int, int], bytes] = {}
    for slot, one in group.slots.items():
        module = plugged.module(slot)
        if one is None or module is None or not one.parameters:
            continue
        try:
            changed = parameter_records(module, one.parameters, gsdml.languages)
        except PlugError as exc:
            report((*at, "slots", str(slot), "parameters"), str(exc), "")
            found = True
        else:
            parameters |= {(slot, subslot, index): data for (subslot, index), data in changed.items()}
    for slot in group.cycles.keys() - {module.slot for module in plugged.modules}:
        report((*at, "cycles", str(slot)), "nothing is plugged there", "a slot with a module")
        found = True
    if group.hello and not plugged.dcp_hello:
        report((*at, "hello"), f"{path.name} says of {plugged.dap.id} that it does not support DCP Hello", "false")
        found = True
    octets = {(one.slot, one.subslot): (one.input_octets, one.output_octets) for one in plugged.submodules}
    signals = device_signals(
        at, group.signals, file_signals(plugged), octets, report, absent="is not plugged", order="big"
    )
    if found or signals is None:
        return None
    return DescribedStation(plugged, signals, parameters)


def _place_of(at: Location, group: ProfinetDevices, error: PlugError) -> Location:
    """The key that is wrong: a slot's, that of the access point, or the file's."""
    if error.slot is None:
        return (*at, "access_point") if group.access_point is not None else (*at, "gsdml")
    if error.slot not in group.slots:
        return (*at, "slots") if group.slots else (*at, "gsdml")
    here: Location = (*at, "slots", str(error.slot))
    one = group.slots[error.slot]
    if one is not None and error.subslot in one.submodules:
        return (*here, "submodules", str(error.subslot))
    return here


def _refused(at: Location, plugged: PluggedStation, file: str, report: Report) -> bool:
    """What the file describes and no device of this version can do."""
    head, *_ = plugged.modules
    if not head.submodules:
        report(
            (*at, "gsdml"), f"{file}: access point {head.id} has no submodule", "at least one, which has its I&M data"
        )
    wide = next((one for one in plugged.submodules if (one.iops_length, one.iocs_length) != (1, 1)), None)
    if wide is not None:
        what = f"{file}: {wide.id} has status fields longer than one octet, which are not supported"
        report((*at, "gsdml"), what, "submodules with one octet of status")
    inputs = sum(one.input_octets + 1 for one in plugged.submodules if one.inputs)
    outputs = sum(one.output_octets + 1 for one in plugged.submodules if one.outputs)
    if max(inputs, outputs) > PLAIN_OCTETS:
        what = f"its modules have {max(inputs, outputs)} octets of data and status in one direction"
        report((*at, "slots"), what, f"at most {PLAIN_OCTETS}")
    return not head.submodules or wide is not None or max(inputs, outputs) > PLAIN_OCTETS
