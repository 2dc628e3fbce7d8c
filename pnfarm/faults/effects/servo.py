"""A drive's servo, as injections see it: its supply, its faults, and the mechanics around it.

What is outside of the drive (limit switches, inputs, enable, load) does not change with its control supply.
"""

from __future__ import annotations

import math
from collections import Counter, deque
from typing import TYPE_CHECKING, Any, Protocol

from pnfarm.drives.axis_handle import CommandRingFullError
from pnfarm.drives.profiles.profidrive.fault_buffer import active_faults
from pnfarm.errors import ConfigError
from pnfarm.faults.effects.parts import DrivePart, Part
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
    from collections.abc import Callable, Mapping

    from pnfarm.drives.axis_handle import AxisHandle
    from pnfarm.drives.description.model import Model
    from pnfarm.drives.description.parts import Fault

__all__ = ["SERVO", "Servo", "ServoStation"]

#: Bits of the axis's ``fault_limits`` and ``interlocks``.
_LIMIT_BITS = {"negative": 0x1, "positive": 0x2}
_LACKS = {"enable": LACKS_ENABLE, "supply": LACKS_SUPPLY}


class ServoStation(Protocol):
    """Host of a servo, whatever its bus."""

    @property
    def configured_name(self) -> str:
        """As the farm file has it."""
        ...

    @property
    def model(self) -> Model: ...

    @property
    def handle(self) -> AxisHandle: ...

    @property
    def powered(self) -> bool:
        """Whether the control supply is on."""
        ...

    @property
    def refused_ns(self) -> int:
        """When it last ignored a request to acknowledge, because of an injection."""
        ...

    @property
    def fault_counts(self) -> Mapping[int, int]:
        """How often each fault began a fault situation."""
        ...

    def power_off(self, now: int) -> None: ...

    def power_on(self, now: int) -> None: ...


class Servo(DrivePart):
    """Calls are counted, so that several injections may request the same.

    ``settle(now)`` lets the station finish what a change of its supply began; ``goes_off()`` and ``came_on(now)``
    notify the other parts.
    """

    def __init__(
        self,
        station: ServoStation,
        *,
        settle: Callable[[int], None],
        goes_off: Callable[[], None],
        came_on: Callable[[int], None],
    ) -> None:
        self._station = station
        self._settle = settle
        self._goes_off = goes_off
        self._came_on = came_on
        self._off = 0
        self._held: Counter[int] = Counter()
        self._warnings: list[Fault] = []
        self._commands: deque[tuple[int, int]] = deque()
        self._limits: Counter[str] = Counter()
        self._lacks: Counter[str] = Counter()
        self._inputs: Counter[int] = Counter()
        self._refusals: list[int] = []
        self._slow_ramps: list[float] = []
        #: Torque, inertia and friction of each load that is put on the shaft.
        self._loads: list[tuple[float, float, float]] = []

    def refresh(self, now: int) -> None:
        del now
        self._flush()

    def in_force(self) -> list[Any]:
        counted: list[Counter[Any]] = [self._held, self._limits, self._lacks, self._inputs]
        off = ["power off"] * self._off
        return [
            *off,
            *(key for counter in counted for key in +counter),
            *self._warnings,
            *self._loads,
            *self._commands,
            *self._refusals,
            *self._slow_ramps,
        ]

    # the control supply

    @property
    def powered(self) -> bool:
        """Whether the control supply is on."""
        return self._station.powered

    def power_off(self, now: int) -> None:
        """Off until every caller that switched off has switched on."""
        self._off += 1
        if self._station.powered:
            self._goes_off()
            self._station.power_off(now)
            self._settle(now)

    def power_on(self, now: int) -> None:
        """Undo one :meth:`power_off`."""
        self._off -= 1
        if self._off == 0 and not self._station.powered:
            self._station.power_on(now)
            for fault in self._warnings:
                self._command(CMD_RAISE_WARNING, fault.number)
            self._came_on(now)
            self._settle(now)

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

    def refuse_acknowledging(self, until: int) -> None:
        """Ignore requests to acknowledge until so many have been ignored since the farm started."""
        self._refusals.append(until)
        self._put_refusals()

    def allow_acknowledging(self, until: int) -> None:
        """Undo one :meth:`refuse_acknowledging` of the same number."""
        self._refusals.remove(until)
        self._put_refusals()

    def _put_refusals(self) -> None:
        self._station.handle.axis.faults.settings.refuse_until = max(self._refusals, default=0)

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
            self._commands.popleft()

    # the mechanics around it

    def reach_limit(self, side: str) -> None:
        """The axis is on this limit of its travel, until each caller has called :meth:`leave_limit`."""
        self._limits[side] += 1
        self._put_limits()

    def leave_limit(self, side: str) -> None:
        """Undo one :meth:`reach_limit`."""
        self._limits[side] -= 1
        self._put_limits()

    def _put_limits(self) -> None:
        """The switches are outside of the drive: its supply does not change them."""
        reached = sum(bit for side, bit in _LIMIT_BITS.items() if self._limits[side])
        self._station.handle.axis.machine.settings.fault_limits = reached

    def take_away(self, what: str) -> None:
        """Take ``enable`` or ``supply`` away from the drive, until each caller has called :meth:`give_back`."""
        self._lacks[what] += 1
        self._put_lacks()

    def give_back(self, what: str) -> None:
        """Undo one :meth:`take_away`."""
        self._lacks[what] -= 1
        self._put_lacks()

    def _put_lacks(self) -> None:
        missing = sum(bit for what, bit in _LACKS.items() if self._lacks[what])
        self._station.handle.axis.drive.settings.interlocks = missing

    def switch_input(self, number: int) -> None:
        """Switch a digital input of the drive on, until each caller has called :meth:`release_input`."""
        self._inputs[number] += 1
        self._put_inputs()

    def release_input(self, number: int) -> None:
        """Undo one :meth:`switch_input`."""
        self._inputs[number] -= 1
        self._put_inputs()

    def _put_inputs(self) -> None:
        self._station.handle.axis.machine.settings.fault_inputs = sum(
            1 << number for number, count in self._inputs.items() if count
        )

    def put_load(self, torque: float, inertia: float, friction: float) -> None:
        """Put more load on the shaft, N m, kg m^2, N m; loads add up."""
        self._loads.append((torque, inertia, friction))
        self._put_loads()

    def take_load(self, torque: float, inertia: float, friction: float) -> None:
        """Undo one :meth:`put_load` of the same numbers; after the last one nothing is left."""
        self._loads.remove((torque, inertia, friction))
        self._put_loads()

    def _put_loads(self) -> None:
        """Summed again each time: a running sum of floats would keep rounding errors."""
        settings = self._station.handle.axis.load.settings
        settings.added_torque = math.fsum(torque for torque, _, _ in self._loads)
        settings.added_inertia = math.fsum(inertia for _, inertia, _ in self._loads)
        settings.added_friction = math.fsum(friction for _, _, friction in self._loads)

    # the ramps

    @property
    def lacks_ramp(self) -> bool:
        """Whether the drive has no ramp generator: its controller makes the ramps."""
        return int(self._station.handle.axis.ramp.settings.generator) == RAMP_ABSENT

    def slow_ramps(self, factor: float) -> None:
        """Let every ramp take ``factor`` times as long; factors of several callers multiply."""
        self._slow_ramps.append(factor)
        self._put_ramps()

    def hasten_ramps(self, factor: float) -> None:
        """Undo one :meth:`slow_ramps` of the same factor; after the last one ramps are as asked."""
        self._slow_ramps.remove(factor)
        self._put_ramps()

    def _put_ramps(self) -> None:
        axis = self._station.handle.axis
        slowness = math.prod(self._slow_ramps) - 1.0
        axis.ramp.settings.slowness = slowness
        axis.profile.settings.slowness = slowness


SERVO: Part[Servo] = Part("servo")
