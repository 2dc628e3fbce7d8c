"""From the farm file to what the master expects of each slave."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from pnfarm.buses.axis_program import IDLE, axis_program
from pnfarm.buses.signal_steps import SignalSteps, signal_steps
from pnfarm.drives.telegrams.signal_view import axis_signals
from pnfarm.errors import ConfigError, DecodeError
from pnfarm.protocols.profibus.gsd_file import LONGEST
from pnfarm.protocols.profibus.gsd_slave import parse_gsd_slave
from pnfarm.protocols.profibus.master import MasterSettings, SlavePlan
from pnfarm.protocols.profibus.wire.dp import V1Status1, parse_identifiers, watchdog_factors
from pnfarm.table.axis_codes import TASKS_NONE
from pnfarm.vocabulary.regular_file import read_regular

if TYPE_CHECKING:
    from collections.abc import Sequence
    from ipaddress import IPv4Interface

    from pnfarm.buses.axis_program import AxisProgram
    from pnfarm.buses.profibus.config.controller import ProfibusController
    from pnfarm.buses.profibus.config.device import GsdDevice
    from pnfarm.buses.profibus.config.drive import ProfibusDriveConfig
    from pnfarm.drives.description.model import Model
    from pnfarm.drives.telegrams.signal_view import AxisSignals

__all__ = ["DevicePlan", "ProfibusPlan", "plan_controller"]

_MS = 1_000_000
#: Octets of a Data_Exchange each way.
MOST_DATA = 244
#: The longest watchdog that the base of 1 ms can say.
_SHORT_NS = 255 * 255 * _MS


@dataclass(frozen=True, slots=True)
class DevicePlan:
    """One slave as the master expects it."""

    name: str
    model: str
    slave: SlavePlan
    cycle_ns: int
    program: AxisProgram
    output_words: tuple[int, ...]
    input_words: tuple[int, ...]
    steps: SignalSteps
    #: None for a slave by its GSD file, whose outputs are ``outputs``.
    described: Model | None
    signals: AxisSignals | None
    life: bool = False
    outputs: bytes = b""


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


def _watchdog(section: ProfibusController, *, v1: bool) -> tuple[tuple[int, int] | None, int]:
    """The factors of Set_Prm, and DPV1_Status_1 for their base."""
    if not section.watchdog_ns:
        return None, 0
    short = v1 and section.watchdog_ns < _SHORT_NS and section.watchdog_ns % (10 * _MS)
    base = _MS if short else 10 * _MS
    return watchdog_factors(section.watchdog_ns, base), int(V1Status1.WD_BASE_1MS) if short else 0


def _plan_drive(section: ProfibusController, drive: ProfibusDriveConfig, model: Model) -> DevicePlan:
    if drive.address is None:
        raise ConfigError(
            f"drive {drive.name} has no station address: give `address`, or `params: {{P-0918: 5}}` with both switches "
            "at F"
        )
    number = section.telegram if section.telegram is not None else model.profidrive.default_telegram
    telegram = model.profidrive.telegrams.get(number)
    if telegram is None:
        known = ", ".join(map(str, model.profidrive.telegrams))
        raise ConfigError(f"{model.name} has no telegram {number}; it has {known}")
    steps = signal_steps(model, drive, number)
    if section.program.kind == "positions" and steps.task_form == TASKS_NONE:
        raise ConfigError(f"drive {drive.name}: telegram {number} of {model.name} has no signal of a position task")
    factors, base = _watchdog(section, v1=True)
    return DevicePlan(
        name=drive.name,
        model=model.name,
        slave=SlavePlan(
            name=drive.name,
            address=drive.address,
            ident=model.profidrive.identity.device_id,
            identifiers=telegram.identifiers,
            output_octets=2 * len(telegram.output),
            input_octets=2 * len(telegram.input),
            user=bytes((int(V1Status1.DPV1_ENABLE) | base, 0, 0)),
            watchdog_factors=factors,
            reconnect_ns=section.reconnect.after_ns if section.reconnect is not None else None,
            access=section.access,
        ),
        cycle_ns=section.cycle_ns,
        program=axis_program(section.program),
        output_words=telegram.output_words,
        input_words=telegram.input_words,
        steps=steps,
        described=model,
        signals=axis_signals(model.profidrive, number, steps.units()),
    )


def _plan_foreign(section: ProfibusController, device: GsdDevice, folder: Path) -> DevicePlan:
    """A slave by its GSD file."""
    path = folder / device.gsd
    try:
        slave = parse_gsd_slave(read_regular(path, LONGEST + 1))
        identifiers, user = slave.chosen(device.modules)
        parts = parse_identifiers(identifiers)
    except OSError as exc:
        raise ConfigError(
            f"device {device.name}, {path}: cannot be read: {(exc.strerror or str(exc)).lower()}"
        ) from exc
    except DecodeError as exc:
        raise ConfigError(f"device {device.name}, {path}: {exc.detail or exc.reason}") from exc
    outputs, inputs = sum(part.outputs for part in parts), sum(part.inputs for part in parts)
    if outputs > MOST_DATA or inputs > MOST_DATA:
        raise ConfigError(
            f"device {device.name}: {outputs} octets of outputs and {inputs} of inputs, at most {MOST_DATA}"
        )
    given = device.outputs or b""
    if len(given) > outputs:
        raise ConfigError(f"device {device.name}: {len(given)} octets of `outputs`, its modules have {outputs}")
    user = device.user if device.user is not None else user
    factors, _ = _watchdog(section, v1=False)
    return DevicePlan(
        name=device.name,
        model=slave.name or path.name,
        slave=SlavePlan(
            name=device.name,
            address=device.address,
            ident=slave.ident,
            identifiers=identifiers,
            output_octets=outputs,
            input_octets=inputs,
            user=user,
            watchdog_factors=factors,
            reconnect_ns=section.reconnect.after_ns if section.reconnect is not None else None,
            access=section.access,
        ),
        cycle_ns=section.cycle_ns,
        program=IDLE,
        output_words=(),
        input_words=(),
        steps=SignalSteps(),
        described=None,
        signals=None,
        outputs=given.ljust(outputs, b"\0"),
    )


def plan_controller(
    section: ProfibusController,
    drives: Sequence[ProfibusDriveConfig],
    models: Sequence[Model],
    folder: Path | None,
) -> ProfibusPlan:
    """The master and what it expects, drive by drive.  Raises :class:`ConfigError`."""
    devices = [_plan_drive(section, drive, model) for drive, model in zip(drives, models, strict=True)]
    devices += [_plan_foreign(section, device, folder or Path()) for device in section.devices]
    settings = MasterSettings(
        address=section.address,
        latency_ns=section.latency_ns,
        retries=section.retries,
        cycle_ns=section.cycle_ns,
    )
    return ProfibusPlan(section.name, settings, tuple(devices))
