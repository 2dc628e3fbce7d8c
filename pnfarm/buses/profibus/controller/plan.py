"""From the farm file to what the master expects of each slave."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

from pnfarm.buses.controllers.device_plan import PlannedDevice
from pnfarm.buses.controllers.plan import describing, profidrive_keys, reconnect_after_ns, telegram_of
from pnfarm.buses.controllers.signal_steps import KnownSteps, SignalSteps
from pnfarm.buses.profibus.device.product import Product
from pnfarm.buses.profibus.gsd_file import load_gsd
from pnfarm.errors import ConfigError
from pnfarm.protocols.profibus.gsd.station import plug_slave
from pnfarm.protocols.profibus.master import MasterSettings
from pnfarm.protocols.profibus.master_slaves import SlavePlan
from pnfarm.protocols.profibus.wire.dp import V1Status1, watchdog_factors
from pnfarm.vocabulary.durations import format_duration
from pnfarm.vocabulary.regular_file import beside

if TYPE_CHECKING:
    from collections.abc import Sequence
    from ipaddress import IPv4Interface

    from pnfarm.buses.profibus.config.controller import ProfibusController
    from pnfarm.buses.profibus.config.device import ProfibusDeviceConfig
    from pnfarm.buses.profibus.config.drive import ProfibusDriveConfig
    from pnfarm.buses.profibus.config.foreign import GsdDevice
    from pnfarm.drives.description.model import Model
    from pnfarm.protocols.profibus.gsd.station import PluggedSlave

__all__ = ["DevicePlan", "ProfibusPlan", "plan_controller"]

_MS = 1_000_000
#: DPV1_Status_1 to 3: the first of the user's octets of a slave of DP-V1.
_V1_OCTETS = 3
#: The longest watchdog that the base of 1 ms can say.
_SHORT_NS = 255 * 255 * _MS


@dataclass(frozen=True, slots=True, kw_only=True)
class DevicePlan(PlannedDevice):
    """One slave as the master expects it."""

    slave: SlavePlan
    cycle_ns: int
    steps: SignalSteps = field(default_factory=SignalSteps)


@dataclass(frozen=True, slots=True)
class ProfibusPlan:
    """The master and its slaves; ``settings.baud`` is that of its line, set when the line is known."""

    name: str
    settings: MasterSettings
    devices: tuple[DevicePlan, ...]

    @property
    def udp_ports(self) -> tuple[IPv4Interface | None, Sequence[int]]:
        """None: it has a line."""
        return None, ()


def _watchdog(section: ProfibusController) -> tuple[tuple[int, int] | None, int]:
    """The factors of a drive's Set_Prm, and DPV1_Status_1 for their base."""
    if not section.watchdog_ns:
        return None, 0
    short = section.watchdog_ns < _SHORT_NS and section.watchdog_ns % (10 * _MS)
    base = _MS if short else 10 * _MS
    return watchdog_factors(section.watchdog_ns, base), int(V1Status1.WD_BASE_1MS) if short else 0


def _plan_drive(
    section: ProfibusController, drive: ProfibusDriveConfig, model: Model, known_steps: KnownSteps
) -> DevicePlan:
    if drive.address is None:
        raise ConfigError(
            f"drive {drive.name} has no station address: give `address`, or its address parameter (PNU 918) in `params`"
        )
    number = section.telegram if section.telegram is not None else model.profidrive.default_telegram
    telegram = telegram_of(model, number)
    factors, base = _watchdog(section)
    user = bytearray(Product.of(model).parameters).ljust(_V1_OCTETS, b"\0")
    user[0] |= V1Status1.DPV1_ENABLE | base
    return DevicePlan(
        **profidrive_keys(section, drive, model, number, known_steps),
        slave=SlavePlan(
            name=drive.name,
            address=drive.address,
            ident=model.profidrive.identity.device_id,
            identifiers=telegram.identifiers,
            output_octets=2 * len(telegram.output),
            input_octets=2 * len(telegram.input),
            user=bytes(user),
            watchdog_factors=factors,
            reconnect_ns=reconnect_after_ns(section),
            access=section.access,
        ),
        cycle_ns=section.cycle_ns,
    )


def _plan_foreign(section: ProfibusController, device: GsdDevice, folder: Path) -> DevicePlan:
    """A slave by its GSD file."""
    path = beside(folder, device.gsd)
    gsd = load_gsd(path)
    with describing(device.name, path):
        slave = plug_slave(gsd, dict(enumerate(device.modules, 1)))
    user = slave.user if device.user is None else device.user
    given = device.outputs or b""
    if len(given) > slave.outputs:
        raise ConfigError(f"device {device.name}: {len(given)} octets of `outputs`, its modules have {slave.outputs}")
    return _plan_described(section, device.name, device.address, slave, user, given)


def _plan_own(section: ProfibusController, device: ProfibusDeviceConfig) -> DevicePlan:
    """A device of the farm: its file was read with the farm file."""
    if device.address is None:
        raise ConfigError(f"device {device.name} has no station address, and this master sets none: give `address`")
    slave = device.described.plugged
    user = bytearray(slave.user)
    if slave.gsd.v1 and len(user) >= _V1_OCTETS:
        # as engineering tools do for a slave of DP-V1: its file leaves these octets to them
        user[0] |= V1Status1.DPV1_ENABLE
    plan = _plan_described(section, device.name, device.address, slave, bytes(user))
    return replace(plan, data_signals=device.described.signals, data_places=device.described.signal_places)


def _plan_described(
    section: ProfibusController, name: str, address: int, slave: PluggedSlave, user: bytes, outputs: bytes = b""
) -> DevicePlan:
    """A slave by what its file says of it."""
    gsd = slave.gsd
    if section.cycle_ns < gsd.interval_ns:
        least = format_duration(gsd.interval_ns)
        raise ConfigError(f"device {name}: a cycle of {format_duration(section.cycle_ns)}, its file allows {least}")
    factors = None
    if section.watchdog_ns:
        # octets of DP-V1 say the base as well
        short = gsd.v1 and user and user[0] & V1Status1.WD_BASE_1MS
        if short and section.watchdog_ns > _SHORT_NS:
            most = format_duration(_SHORT_NS)
            raise ConfigError(f"device {name}: its parameters have a watchdog in steps of 1 ms, which ends at {most}")
        factors = watchdog_factors(section.watchdog_ns, _MS if short else 10 * _MS)
    return DevicePlan(
        name=name,
        model=gsd.model or f"0x{gsd.ident:04X}",
        slave=SlavePlan(
            name=name,
            address=address,
            ident=gsd.ident,
            identifiers=slave.identifiers,
            output_octets=slave.outputs,
            input_octets=slave.inputs,
            user=user,
            watchdog_factors=factors,
            reconnect_ns=reconnect_after_ns(section),
            access=section.access,
        ),
        cycle_ns=section.cycle_ns,
        outputs=outputs.ljust(slave.outputs, b"\0"),
    )


def plan_controller(
    section: ProfibusController,
    drives: Sequence[ProfibusDriveConfig],
    models: Sequence[Model],
    folder: Path | None,
    own: Sequence[ProfibusDeviceConfig] = (),
) -> ProfibusPlan:
    """The master and what it expects, drive by drive and then device by device: the farm's ``own``, and foreign ones.

    Raises :class:`ConfigError`.
    """
    known_steps = KnownSteps()
    devices = [_plan_drive(section, drive, model, known_steps) for drive, model in zip(drives, models, strict=True)]
    devices += [_plan_own(section, device) for device in own]
    devices += [_plan_foreign(section, device, folder or Path()) for device in section.devices]
    settings = MasterSettings(
        address=section.address,
        latency_ns=section.latency_ns,
        retries=section.retries,
        cycle_ns=section.cycle_ns,
    )
    return ProfibusPlan(section.name, settings, tuple(devices))
