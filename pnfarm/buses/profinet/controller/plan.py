"""From the farm file to what the controller expects of each drive."""

from __future__ import annotations

from dataclasses import replace
from ipaddress import IPv4Interface
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from pnfarm.buses.controllers.plan import (
    describing,
    own_address,
    profidrive_keys,
    reconnect_after_ns,
    supplement_of,
    telegram_of,
)
from pnfarm.buses.controllers.signal_steps import KnownSteps
from pnfarm.buses.plain_layout import plain_layout
from pnfarm.buses.profinet.axis_slots import axis_shifts, model_slots
from pnfarm.buses.profinet.config.clock import MAX_WATCHDOG_NS, join_cycle
from pnfarm.buses.profinet.config.send_clock import DEFAULT_CYCLE_NS, clock_of
from pnfarm.buses.profinet.controller.device_plan import DevicePlan, PlannedAxis, ProfinetPlan
from pnfarm.buses.profinet.gsdml_file import load_gsdml
from pnfarm.buses.profinet.model_gsdml import describe_diagnosis
from pnfarm.errors import ConfigError
from pnfarm.protocols.profinet.cm.controller.frames import divide
from pnfarm.protocols.profinet.cm.controller.plan import ParameterRecord, PlannedSubmodule
from pnfarm.protocols.profinet.gsdml.planning import from_gsdml, plan_station
from pnfarm.protocols.profinet.gsdml.texts import DescribedDiagnosis
from pnfarm.protocols.profinet.wire.frame_id import RTC1_UNICAST
from pnfarm.vocabulary.durations import format_duration
from pnfarm.vocabulary.globs import means
from pnfarm.vocabulary.regular_file import beside

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from pnfarm.buses.profinet.config.controller import ForeignDevice, ProfinetController
    from pnfarm.buses.profinet.config.device import ProfinetDeviceConfig
    from pnfarm.buses.profinet.config.drive import ProfinetDriveConfig
    from pnfarm.buses.profinet.maker_file import MakerFile
    from pnfarm.drives.description.model import Model
    from pnfarm.protocols.profinet.cm.controller.plan import Clock
    from pnfarm.protocols.profinet.gsdml.document import Gsdml
    from pnfarm.protocols.profinet.gsdml.planning import PlannedDevice as Described

    #: An axis: how far after the model's its slots are, its telegram, and its supplementary one.
    _Place = tuple[int, int, int | None]

__all__ = ["plan_controller", "plan_devices"]


def _submodules(model: Model, axes: Sequence[_Place]) -> tuple[PlannedSubmodule, ...]:
    """Those of the access point and of each axis's telegrams."""
    modules = [(model.dap, model.dap.submodules, 0)]
    for shift, number, supplementary in axes:
        module = telegram_of(model, number).module
        beside = supplement_of(model, supplementary).module.submodules
        # those without data that are plugged in their places at first go
        kept = [one for one in module.submodules if one.subslot not in {one.subslot for one in beside}]
        every = (*kept, *(replace(one, slot=module.slot) for one in beside))
        modules.append((module, every, shift))
    return tuple(
        PlannedSubmodule(
            api=s.api,
            slot=s.slot + shift,
            module_ident=module.ident,
            subslot=s.subslot,
            submodule_ident=s.ident,
            input_bytes=s.input_bytes,
            output_bytes=s.output_bytes,
        )
        for module, submodules, shift in modules
        for s in submodules
    )


class _Addresses:
    """Gives those without an address the next free one of the controller's subnet."""

    def __init__(
        self, section: ProfinetController, stations: Sequence[ProfinetDriveConfig | ProfinetDeviceConfig]
    ) -> None:
        given = [section.ip, *(one.ip for one in stations), *(device.ip for device in section.devices)]
        taken = {ip.ip for ip in given if ip is not None}
        self._own = section.ip
        hosts = section.ip.network.hosts() if section.ip else ()
        self._free = (address for address in hosts if address not in taken)

    def of(self, ip: IPv4Interface | None, name: str) -> IPv4Interface:
        if ip is not None:
            return ip
        if self._own is None:
            raise ConfigError(f"{name} has no ip and the controller has none to count from: give one of them")
        address = next(self._free, None)
        if address is None:
            raise ConfigError(f"the controller's subnet {self._own.network} has no address left for {name}")
        return IPv4Interface((address, self._own.network.prefixlen))


def _records(section: ProfinetController, name: str, models: Sequence[str] = ()) -> tuple[ParameterRecord, ...]:
    """The file's records for this drive or device; ``models``: the names of a drive's model."""
    return tuple(
        ParameterRecord(r.api, r.slot, r.subslot, r.index, r.data)
        for r in section.records
        if r.on is None or any(means(glob, (name,), models) for glob in r.on)
    )


def _together(of_maker: Iterable[ParameterRecord], own: Iterable[ParameterRecord]) -> tuple[ParameterRecord, ...]:
    """A record of the farm file takes the place of the same one of the maker's file; others follow."""
    return tuple({(r.api, r.slot, r.subslot, r.index): r for r in (*of_maker, *own)}.values())


def _defaults(maker: MakerFile | None, submodules: Iterable[PlannedSubmodule]) -> list[ParameterRecord]:
    """The records that a project with the maker's file has of a drive, in the order in which they are written."""
    found = [
        (record.transfer_sequence, ParameterRecord(one.api, one.slot, one.subslot, record.index, record.defaults()))
        for one in submodules
        for record in (() if maker is None else maker.records(one.module_ident, one.submodule_ident))
    ]
    return [record for _, record in sorted(found, key=lambda pair: pair[0])]


def _plan_foreign(section: ProfinetController, device: ForeignDevice, folder: Path, ip: IPv4Interface) -> DevicePlan:
    """A device by its GSDML file."""
    path = beside(folder, device.gsdml)
    gsdml = load_gsdml(path)
    if device.watchdog_factor is not None:
        section = section.model_copy(update={"watchdog_factor": device.watchdog_factor})
    with describing(device.name, path):
        planned = from_gsdml(
            gsdml,
            dap=device.dap,
            modules=device.modules,
            submodules={
                (slot, subslot): i for slot, items in device.submodules.items() for subslot, i in items.items()
            },
            replaced={(r.api, r.slot, r.subslot, r.index) for r in _records(section, device.name)},
        )
        remarks = tuple(f"{path.name}, {remark}" for remark in gsdml.remarks)
        return replace(_plan_described(section, device, gsdml, planned, ip, device.startup), remarks=remarks)


def _plan_own(section: ProfinetController, device: ProfinetDeviceConfig, ip: IPv4Interface) -> DevicePlan:
    """A device of the farm: its file was read with the farm file, and it does not run a safety protocol either."""
    station = device.described.plugged
    # what the device begins with, also where the file has a default that a controller cannot put together
    defaults = {
        (one.slot, one.subslot, record.index): record.defaults() for one in station.submodules for record in one.records
    }
    with describing(device.name):
        planned = plan_station(station, {**defaults, **device.described.parameters}, safe=True)
        plan = _plan_described(section, device, station.gsdml, planned, ip)
        return replace(plan, data_signals=device.described.signals, data_places=device.described.signal_places)


def _plan_described(
    section: ProfinetController,
    device: ForeignDevice | ProfinetDeviceConfig,
    gsdml: Gsdml,
    planned: Described,
    ip: IPv4Interface,
    own_startup: Literal["legacy", "advanced"] | None = None,
) -> DevicePlan:
    """A device by what its file says of it.  Raises :class:`ConfigError`."""
    factor, ratio = _clock(section, planned, device.cycle_ns)
    clocks = {slot: _clock(section, planned, cycle_ns) for slot, cycle_ns in device.cycles.items()}
    if without := clocks.keys() - {one.slot for one in planned.submodules}:
        raise ConfigError(f"slot {min(without)} in `cycles` has no module")
    submodules = tuple(replace(one, clock=clocks.get(one.slot)) for one in planned.submodules)
    relations = planned.dap.relations
    inputs, outputs = divide(submodules, (factor, ratio), (relations.input_crs, relations.output_crs))
    startup = planned.startup(own_startup or (section.startup if "startup" in section.model_fields_set else None))
    return DevicePlan(
        name=device.name,
        model=planned.dap.info.name or planned.dap.id,
        ip=ip,
        gateway=device.gateway,
        assign_ip=section.assign_ip,
        vendor_id=planned.vendor_id,
        device_id=planned.device_id,
        submodules=submodules,
        send_clock_factor=factor,
        reduction_ratio=ratio,
        input_crs=len(inputs),
        output_crs=len(outputs),
        watchdog_factor=section.watchdog_factor,
        startup=startup,
        records=_together(planned.records, _records(section, device.name)),
        reconnect_after_ns=reconnect_after_ns(section),
        read_identification=section.identification,
        takeover_allowed=section.takeover_allowed,
        texts=DescribedDiagnosis(gsdml.diagnoses, gsdml.unit_diagnoses),
        instance=planned.instance,
        multiple_write=planned.multiple_write,
        application_ready_ns=_ready_ns(section, planned.dap.application_seconds),
        plain=(
            plain_layout((one.slot, one.subslot, one.output_bytes) for one in planned.submodules),
            plain_layout((one.slot, one.subslot, one.input_bytes) for one in planned.submodules),
        ),
    )


def _clock(section: ProfinetController, planned: Described, cycle_ns: int | None) -> Clock:
    """Send clock factor and reduction ratio of a cycle, None: the controller's.  Raises :class:`ConfigError`."""
    if cycle_ns is None and (section.cycle_ns, section.send_clock_factor, section.reduction_ratio) == (
        None,
        None,
        None,
    ):
        cycle_ns = planned.slowed(DEFAULT_CYCLE_NS)
    try:
        clock = clock_of(section, cycle_ns)
    except ValueError as exc:
        raise ConfigError(f"its cycle does not fit the controller's send clock: {exc}") from exc
    factor, ratio = clock.send_clock_factor, clock.reduction_ratio
    # a cycle without factor and ratio is made of those that the device supports
    if section.send_clock_factor is None and (cycle_ns is not None or section.reduction_ratio is None):
        factor, ratio = planned.clock(factor, ratio)
    planned.check_clock(factor, ratio)
    if join_cycle(factor, ratio) * section.watchdog_factor > MAX_WATCHDOG_NS:
        cycle = format_duration(join_cycle(factor, ratio))
        raise ConfigError(f"{section.watchdog_factor} cycles of {cycle} are too long a watchdog, at most 1.92s")
    return factor, ratio


def _ready_ns(section: ProfinetController, named_seconds: int) -> int:
    """What the farm file says, else what the GSDML file names, else the usual time."""
    if named_seconds and "application_ready_ns" not in section.model_fields_set:
        return named_seconds * 1_000_000_000
    return section.application_ready_ns


def _axis_keys(
    section: ProfinetController,
    drive: ProfinetDriveConfig,
    model: Model,
    places: Sequence[_Place],
    known_steps: KnownSteps,
) -> list[dict[str, Any]]:
    """What is planned for each axis, by the fields of ``PlannedDevice``."""
    own = model_slots(model)
    found = []
    for axis, (shift, number, supplementary) in zip(drive.axes, places, strict=True):
        alone = replace(
            drive,
            name=axis.name,
            load=axis.load,
            motor=axis.motor,
            machine=axis.machine,
            params=axis.params,
            several=(),
        )
        keys = profidrive_keys(section, alone, model, number, known_steps, supplementary)
        keys["life"] = model.profidrive.sign_of_life is not None
        if len(places) > 1:
            keys["slots"] = frozenset(slot + shift for slot in own)
        found.append(keys)
    return found


def plan_devices(
    section: ProfinetController,
    drives: Sequence[ProfinetDriveConfig],
    models: Sequence[Model],
    folder: Path | None = None,
    own: Sequence[ProfinetDeviceConfig] = (),
) -> list[DevicePlan]:
    """What the controller expects, drive by drive and then device by device: the farm's ``own``, and foreign ones.

    ``folder`` is what the GSDML files of the devices are relative to.  A device without an address gets the next free
    one of the controller's subnet.  Raises :class:`ConfigError`.
    """
    addresses = _Addresses(section, (*drives, *own))
    known_steps = KnownSteps()
    plans = []
    for drive, model in zip(drives, models, strict=True):
        ip = addresses.of(drive.ip, f"drive {drive.name}")
        # without a telegram in the section each model has its own
        usual = section.telegram if "telegram" in section.model_fields_set else model.profidrive.default_telegram
        shifts = axis_shifts(model, [axis.slot for axis in drive.axes])
        places = [
            (shift, usual if axis.telegram is None else axis.telegram, axis.supplementary)
            for shift, axis in zip(shifts, drive.axes, strict=True)
        ]
        first, *further = _axis_keys(section, drive, model, places, known_steps)
        submodules = _submodules(model, places)
        channels, units = describe_diagnosis(model)
        if drive.maker is not None:
            # of two texts the last counts
            channels += drive.maker.document.diagnoses
            units += drive.maker.document.unit_diagnoses
        clock = clock_of(section, drive.cycle_ns)
        plans.append(
            DevicePlan(
                **first | {"name": drive.name, "first": drive.axes[0].name},
                further=tuple(PlannedAxis(**keys, cycle_ns=clock.cycle_ns) for keys in further),
                ip=ip,
                gateway=drive.gateway,
                assign_ip=section.assign_ip,
                vendor_id=model.profidrive.identity.vendor_id,
                device_id=model.profidrive.identity.device_id,
                submodules=submodules,
                texts=DescribedDiagnosis(channels, units),
                send_clock_factor=clock.send_clock_factor,
                reduction_ratio=clock.reduction_ratio,
                watchdog_factor=section.watchdog_factor,
                startup=section.startup,
                records=_together(
                    _defaults(drive.maker, submodules), _records(section, drive.name, (model.name, *model.aliases))
                ),
                read_identification=section.identification,
                takeover_allowed=section.takeover_allowed,
                application_ready_ns=section.application_ready_ns,
            )
        )
    plans += [_plan_own(section, one, addresses.of(one.ip, f"device {one.name}")) for one in own]
    for device in section.devices:
        ip = addresses.of(device.ip, f"device {device.name}")
        plans.append(_plan_foreign(section, device, folder or Path(), ip))
    return plans


def plan_controller(
    section: ProfinetController,
    drives: Sequence[ProfinetDriveConfig],
    models: Sequence[Model],
    folder: Path | None,
    own: Sequence[ProfinetDeviceConfig] = (),
) -> ProfinetPlan:
    """The controller and what it expects; arguments and errors as those of :func:`plan_devices`."""
    others = [*(one.ip for one in drives), *(one.ip for one in own), *(one.ip for one in section.devices)]
    address = own_address(section.ip, others)
    devices = tuple(plan_devices(section, drives, models, folder, own))
    if (crs := sum(device.input_crs for device in devices)) > len(RTC1_UNICAST):
        raise ConfigError(f"the devices need {crs} input CRs, there are {len(RTC1_UNICAST)} frame ids for them")
    return ProfinetPlan(section.name, address, devices)
