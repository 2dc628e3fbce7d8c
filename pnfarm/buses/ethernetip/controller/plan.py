"""From the farm file to what the scanner expects of each device."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from pnfarm.buses.controllers.axis_program import axis_program
from pnfarm.buses.controllers.plan import describing, own_address, reconnect_after_ns
from pnfarm.buses.controllers.signal_steps import powered_axis
from pnfarm.buses.ethernetip.config.controller import USUAL_RPI_NS
from pnfarm.buses.ethernetip.controller.device_plan import ConnectionPlan, DevicePlan, EthernetIpPlan, ProgramSteps
from pnfarm.buses.ethernetip.device.product import Product
from pnfarm.buses.ethernetip.eds_file import load_eds
from pnfarm.errors import ConfigError
from pnfarm.protocols.enip.connection import ConnectionKind
from pnfarm.protocols.enip.connection_check import ASSEMBLY
from pnfarm.protocols.enip.wire.epath import DataSegment, ElectronicKey, emit_epath, logical_path
from pnfarm.protocols.enip.wire.forward_open import CYCLIC
from pnfarm.vocabulary.durations import format_duration
from pnfarm.vocabulary.regular_file import beside

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pnfarm.buses.ethernetip.config.controller import EdsDevice, EthernetIpController
    from pnfarm.buses.ethernetip.config.device import EthernetIpDeviceConfig
    from pnfarm.buses.ethernetip.config.drive import EthernetIpDriveConfig
    from pnfarm.drives.description.model import Model
    from pnfarm.protocols.enip.eds.document import Connection

__all__ = ["EthernetIpPlan", "plan_controller", "plan_devices", "program_steps"]

#: The parameter that clears faults when it is written (AKD EtherNet/IP manual 6.6).
CLEAR_FAULTS = "DRV.CLRFAULTS"


def program_steps(model: Model, drive: EthernetIpDriveConfig) -> ProgramSteps:
    """Units, ramps of a speed (DRV.ACC, DRV.DEC), as the drive itself works them out of its parameters."""
    axis = powered_axis(model, drive, motor=True)
    profile = float(axis.ethernetip.settings.profile_step) or 1.0
    return ProgramSteps(
        front=model.front,
        velocity_step=profile,
        ramp_step=profile,
        target_step=float(axis.travel.settings.position_step) or 1.0,
        speed_up=float(axis.ramp.settings.acceleration),
        speed_down=float(axis.ramp.settings.deceleration),
        clear_number=model.resolve(CLEAR_FAULTS)[0].pnu,
    )


def _key(section: EthernetIpController, key: ElectronicKey) -> tuple[ElectronicKey, ...]:
    """The segment in front of a connection path, if there is to be one."""
    if section.keying == "off":
        return ()
    return (replace(key, compatible=section.keying == "compatible"),)


def _connection(section: EthernetIpController, product: Product) -> ConnectionPlan:
    """The connection to a drive of the farm, by its model."""
    consumed, octets = {
        "exclusive-owner": (product.output_assembly, product.output_size),
        "input-only": (product.input_only_assembly, 0),
        "listen-only": (product.listen_only_assembly, 0),
    }[section.connection]
    points = logical_path(ASSEMBLY, product.configuration_assembly, None, consumed, product.input_assembly)
    return ConnectionPlan(
        kind=section.connection,
        path=emit_epath((*_key(section, _identity(product)), *points)),
        output_octets=octets,
        input_octets=product.input_size,
        output_header=product.output_run_idle,
        input_header=product.input_run_idle,
        multicast=section.multicast or section.connection == "listen-only",
    )


def _identity(product: Product) -> ElectronicKey:
    return ElectronicKey(product.vendor_id, product.device_type, product.product_code, *product.revision)


def _plan_drive(section: EthernetIpController, drive: EthernetIpDriveConfig, model: Model) -> DevicePlan:
    if drive.ip is None:
        raise ConfigError(f"drive {drive.name} has no ip")
    product = Product.of(model)
    usual = section.rpi_ns if section.rpi_ns is not None else max(USUAL_RPI_NS, product.min_rpi_ns)
    steps = program_steps(model, drive)
    program = axis_program(section.program)
    return DevicePlan(
        name=drive.name,
        model=model.name,
        ip=drive.ip,
        connection=_connection(section, product),
        rpi_ns=drive.rpi_ns if drive.rpi_ns is not None else usual,
        timeout_multiplier=section.timeout_multiplier,
        steps=steps,
        program=program,
        reconnect_after_ns=reconnect_after_ns(section),
        request_timeout_ns=section.request_timeout_ns,
        key=_identity(product),
        described=model,
    )


def _plan_foreign(section: EthernetIpController, device: EdsDevice, folder: Path) -> DevicePlan:
    """A device by its EDS file."""
    path = beside(folder, device.eds)
    with describing(device.name, path, slugs=True):
        sheet = load_eds(path)
        found = sheet.connection(device.connection)
        connection = _foreign_connection(section, device, found, sheet.key)
    return DevicePlan(
        name=device.name,
        model=sheet.product or path.name,
        ip=device.ip,
        connection=connection,
        rpi_ns=_rpi_ns(section, device.rpi_ns, found),
        timeout_multiplier=section.timeout_multiplier,
        reconnect_after_ns=reconnect_after_ns(section),
        request_timeout_ns=section.request_timeout_ns,
        key=sheet.key,
        outputs=device.outputs or b"",
    )


def _plan_own(section: EthernetIpController, device: EthernetIpDeviceConfig) -> DevicePlan:
    """A device of the farm: its file was read with the farm file."""
    if device.ip is None:
        raise ConfigError(f"device {device.name} has no ip")
    described = device.described
    found, key = described.connection, described.sheet.key
    connection = _described_connection(section, None, found, key, described.configuration(), described.sizes)
    rpi_ns = _rpi_ns(section, device.rpi_ns, found)
    for one in found.intervals if device.strict else ():
        if not one.least * 1000 <= rpi_ns <= one.most * 1000:
            allowed = f"{format_duration(one.least * 1000)} to {format_duration(one.most * 1000)}"
            what = f"its file does not allow a packet interval of {format_duration(rpi_ns)}, but {allowed}"
            raise ConfigError(f"device {device.name}: {what}: give `rpi`, or `limits: lax`")
    octets = described.connected
    return DevicePlan(
        name=device.name,
        data_signals={
            name: one
            for name, one in described.signals.items()
            if one.end <= octets.get((one.slot, one.subslot, one.direction), 0)
        },
        data_places=dict.fromkeys(octets, 0),
        model=described.title,
        ip=device.ip,
        connection=connection,
        rpi_ns=rpi_ns,
        timeout_multiplier=section.timeout_multiplier,
        reconnect_after_ns=reconnect_after_ns(section),
        request_timeout_ns=section.request_timeout_ns,
        key=key,
    )


def _rpi_ns(section: EthernetIpController, own: int | None, found: Connection) -> int:
    """The packet interval: the device's ``own``, the scanner's, the default of the file."""
    given = own if own is not None else section.rpi_ns
    return given or max((1000 * one.default for one in found.intervals), default=0) or USUAL_RPI_NS


def _foreign_connection(
    section: EthernetIpController, device: EdsDevice, found: Connection, key: ElectronicKey
) -> ConnectionPlan:
    configuration, octets = device.configuration or b"", found.configuration.size.default
    if len(configuration) != octets:
        raise ConfigError(
            f"{found.keyword} has {octets} octets of configuration, not {len(configuration)}: give `configuration`"
        )
    if len(device.outputs or b"") > found.outputs.size.default:
        raise ConfigError(
            f"{found.keyword} has {found.outputs.size.default} octets of outputs, not {len(device.outputs or b'')}"
        )
    sizes = found.outputs.size.default, found.inputs.size.default
    return _described_connection(section, device.multicast, found, key, configuration, sizes)


def _described_connection(
    section: EthernetIpController,
    multicast: bool | None,
    found: Connection,
    key: ElectronicKey,
    configuration: bytes,
    sizes: tuple[int, int],
) -> ConnectionPlan:
    """The connection of an EDS file with these octets of outputs and inputs; ``multicast`` None is the scanner's."""
    if CYCLIC not in found.triggers:
        raise ConfigError(f"{found.keyword}: it has no cyclic production")
    if multicast and not found.multicast:
        raise ConfigError(f"{found.keyword} has no multicast connection")
    wanted = section.multicast if multicast is None else multicast
    wanted = wanted or found.kind is ConnectionKind.LISTEN_ONLY or not found.point_to_point
    if not found.multicast and not found.point_to_point:
        raise ConfigError(f"{found.keyword} has neither a multicast nor a point-to-point connection to the originator")
    data = (DataSegment(configuration + bytes(len(configuration) % 2)),) if configuration else ()
    return ConnectionPlan(
        kind=found.kind.value.replace(" ", "-"),
        path=emit_epath(_key(section, key)) + found.path + emit_epath(data),
        output_octets=sizes[0],
        input_octets=sizes[1],
        output_header=found.output_header,
        input_header=found.input_header,
        multicast=found.multicast and wanted,
        output_variable=False not in found.output_sizes,
        input_variable=False not in found.input_sizes,
    )


def plan_devices(
    section: EthernetIpController,
    drives: Sequence[EthernetIpDriveConfig],
    models: Sequence[Model],
    folder: Path | None = None,
    own: Sequence[EthernetIpDeviceConfig] = (),
) -> list[DevicePlan]:
    """What the scanner expects, drive by drive and then device by device: the farm's ``own``, and foreign ones.

    ``folder`` is what the EDS files of the foreign devices are relative to.  Raises :class:`ConfigError`.
    """
    plans = [_plan_drive(section, drive, model) for drive, model in zip(drives, models, strict=True)]
    plans += [_plan_own(section, device) for device in own]
    return plans + [_plan_foreign(section, device, folder or Path()) for device in section.devices]


def plan_controller(
    section: EthernetIpController,
    drives: Sequence[EthernetIpDriveConfig],
    models: Sequence[Model],
    folder: Path | None,
    own: Sequence[EthernetIpDeviceConfig] = (),
) -> EthernetIpPlan:
    """The scanner and what it expects; arguments and errors as those of :func:`plan_devices`."""
    devices = plan_devices(section, drives, models, folder, own)
    address = own_address(section.ip, (device.ip for device in devices))
    return EthernetIpPlan(section.name, address, tuple(devices))
