"""An axis's servo, as injections see it: its faults, and the mechanics around it.

What is outside of the drive (limit switches, inputs, enable, load) does not change with its control supply.
"""

from __future__ import annotations

import math
from collections import Counter
from typing import TYPE_CHECKING, Any

from pnfarm.drives.axis_handle import CommandRingFullError
from pnfarm.drives.profiles.profidrive.fault_buffer import active_faults
from pnfarm.errors import ConfigError
from pnfarm.faults.effects.parts import DrivePart, InForce, Part
from pnfarm.faults.errors import InjectionError
from pnfarm.table.axis_codes import (
    CMD_CLEAR_WARNING,
    CMD_HOLD_FAULT,
    CMD_RAISE_FAULT,
    CMD_RAISE_WARNING,
    CMD_RELEASE_FAULT,
    FAULT_SLOTS,
    LACKS_ENABLE,
    LACKS_SUPPLY,
    RAMP_ABSENT,
    WARNING_SLOTS,
)

if TYPE_CHECKING:
    from pnfarm.drives.description.parts import Fault
    from pnfarm.station.axis import Axis

__all__ = ["SERVO", "Servo"]

#: Bits of the axis's ``fault_limits`` and ``interlocks``.
_LIMIT_BITS = {"negative": 0x1, "positive": 0x2}
_LACKS = {"enable": LACKS_ENABLE, "supply": LACKS_SUPPLY}


class Servo(DrivePart):
    """Calls are counted, so that several injections may request the same.

    A drive without supply takes no commands: they wait for the ``supply``.
    """

    def __init__(self, station: Axis) -> None:
        self._station = station
        self._held: Counter[int] = Counter()
        self._warnings: list[Fault] = []
        self._commands: list[tuple[int, int]] = []
        #: Limits of its travel on which the axis is, ``positive`` or ``negative``.
        self.limits: InForce[str] = InForce(self._put_limits)
        #: What is taken away: ``enable`` or ``supply``.
        self.lacks: InForce[str] = InForce(self._put_lacks)
        #: Numbers of digital inputs that are on.
        self.inputs: InForce[int] = InForce(self._put_inputs)
        #: Until so many requests to acknowledge have been ignored since the farm started, more are.
        self.refusals: InForce[int] = InForce(self._put_refusals)
        #: How many times as long every ramp takes; factors multiply.
        self.slow_ramps: InForce[float] = InForce(self._put_ramps)
        #: Torque, inertia and friction of each load that is put on the shaft, N m, kg m^2, N m; loads add up.
        self.loads: InForce[tuple[float, float, float]] = InForce(self._put_loads)

    def refresh(self, now: int) -> None:
        del now
        self._flush()

    def in_force(self) -> list[Any]:
        applied = (self.limits, self.lacks, self.inputs, self.loads, self.refusals, self.slow_ramps)
        held = [*+self._held, *self._warnings, *self._commands]
        return [*held, *(one for some in applied for one in some)]

    @property
    def powered(self) -> bool:
        """Whether the control supply is on."""
        return self._station.powered

    def rebooted(self, now: int) -> None:
        del now
        for fault in self._warnings:
            self._command(CMD_RAISE_WARNING, fault.number)

    # faults and warnings

    def find_fault(self, wanted: str | int) -> Fault:
        """Number, name or cause in the drive's model; raises :class:`~pnfarm.errors.ConfigError`."""
        try:
            return self._station.model.fault(wanted)
        except ConfigError as exc:
            raise InjectionError([("params.fault", f"{self._station.configured_name}: {exc}", "")]) from exc

    def raise_fault(self, fault: Fault) -> None:
        """Its cause is gone at once; it stays until it is acknowledged."""
        self._command(CMD_RAISE_FAULT, fault.code)

    def hold_fault(self, fault: Fault) -> None:
        """Its cause stays until every caller that held it has released it."""
        if fault.number not in self._held and len(self._held) == FAULT_SLOTS:
            raise ConfigError(
                f"{self._station.configured_name} holds {FAULT_SLOTS} faults already, as many as one situation has; "
                "clear one"
            )
        self._held[fault.number] += 1
        if self._held[fault.number] == 1:
            self._command(CMD_HOLD_FAULT, fault.code)

    def release_fault(self, fault: Fault) -> None:
        """Undo one :meth:`hold_fault`."""
        self._held[fault.number] -= 1
        if self._held[fault.number]:
            return
        del self._held[fault.number]
        try:
            # the drive was off all the time and needs no command
            self._commands.remove((CMD_HOLD_FAULT, fault.code))
        except ValueError:
            self._command(CMD_RELEASE_FAULT, fault.number)

    def fault_is_active(self, fault: Fault) -> bool:
        """Whether it is active in the drive."""
        return fault.number in active_faults(self._station.handle.axis)

    def ignores_fault(self, fault: Fault) -> bool:
        """Whether the drive does not raise it, because one of its parameters disables it."""
        return any(int(number) == fault.number for number in self._station.handle.axis.faults.settings.ignored)

    def fault_count(self, fault: Fault) -> int:
        """How often it has begun a fault situation."""
        return self._station.fault_counts.get(fault.number, 0)

    @property
    def acknowledgements_refused(self) -> tuple[int, int]:
        """How many requests to acknowledge it has ignored since the farm started, and when the last one."""
        return int(self._station.handle.axis.faults.refused), self._station.refused_ns

    def _put_refusals(self) -> None:
        self._station.handle.axis.faults.settings.refuse_until = max(self.refusals, default=0)

    def warn(self, fault: Fault) -> None:
        """Show a warning in front of the others; raises :class:`ConfigError` when there is no room for it."""
        if fault not in self._warnings and len({other.number for other in self._warnings}) == WARNING_SLOTS:
            raise ConfigError(
                f"{self._station.configured_name} shows {WARNING_SLOTS} warnings already, the maximum; clear one"
            )
        self._warnings.append(fault)
        self._command(CMD_RAISE_WARNING, fault.number)

    def unwarn(self, fault: Fault) -> None:
        """Undo one :meth:`warn`."""
        self._warnings.remove(fault)
        if fault not in self._warnings:
            self._command(CMD_CLEAR_WARNING, fault.number)

    def warns_of_limit(self, side: str) -> bool:
        """Whether the drive shows a warning on its ``positive`` or ``negative`` limit switch."""
        return any(fault.cause == f"limit-switch-{side}" for fault in self._station.model.faults.values())

    def _command(self, code: int, argument: int) -> None:
        """Send commands to the firmware in this order; those that it cannot take now wait for :meth:`refresh`."""
        self._commands.append((code, argument))
        self._flush()

    def _flush(self) -> None:
        # a drive without supply takes no commands, and its ring must have room for the command that boots it
        while self._commands and self._station.powered:
            try:
                self._station.handle.push_command(*self._commands[0])
            except CommandRingFullError:
                return
            self._commands.pop(0)

    # the mechanics around it

    def _put_limits(self) -> None:
        """The switches are outside of the drive: its supply does not change them."""
        reached = sum(bit for side, bit in _LIMIT_BITS.items() if side in self.limits)
        self._station.handle.axis.machine.settings.fault_limits = reached

    def _put_lacks(self) -> None:
        missing = sum(bit for what, bit in _LACKS.items() if what in self.lacks)
        self._station.handle.axis.drive.settings.interlocks = missing

    def _put_inputs(self) -> None:
        self._station.handle.axis.machine.settings.fault_inputs = sum(1 << number for number in set(self.inputs))

    def _put_loads(self) -> None:
        """Summed again each time: a running sum of floats would keep rounding errors."""
        settings = self._station.handle.axis.load.settings
        settings.added_torque = math.fsum(torque for torque, _, _ in self.loads)
        settings.added_inertia = math.fsum(inertia for _, inertia, _ in self.loads)
        settings.added_friction = math.fsum(friction for _, _, friction in self.loads)

    # the ramps

    @property
    def lacks_ramp(self) -> bool:
        """Whether the drive has no ramp generator: its controller makes the ramps."""
        return int(self._station.handle.axis.ramp.settings.generator) == RAMP_ABSENT

    def _put_ramps(self) -> None:
        axis = self._station.handle.axis
        slowness = math.prod(self.slow_ramps) - 1.0
        axis.ramp.settings.slowness = slowness
        axis.profile.settings.slowness = slowness


SERVO: Part[Servo] = Part("servo")
