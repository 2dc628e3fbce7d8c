"""One axis of a station: its rows of the tables, its model, its parameters and its faults.

A drive with one axis and its axis have one name; what belongs to the node is found through :attr:`Axis.station`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.drives.parameters.given_values import raw_number
from pnfarm.drives.parameters.store import (
    DisplayBlinkRequested,
    FaultHistoryCleared,
    NonVolatileSaved,
    ParameterStore,
    RebootRequested,
    TelegramChanged,
)
from pnfarm.drives.profiles.profidrive.fault_buffer import active_faults
from pnfarm.errors import ConfigError
from pnfarm.station.events import ParametersSaved
from pnfarm.station.events import TelegramChanged as TelegramTaken
from pnfarm.station.fault_memory import active_of, history_of, restore_history
from pnfarm.table.axis_codes import CMD_HOLD_FAULT, CMD_POWER_ON, CMD_RAISE_FAULT, CMD_RELEASE_FAULT
from pnfarm.table.image import LOST_NEVER

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from pnfarm.drives.axis_handle import AxisHandle
    from pnfarm.drives.description.model import Model
    from pnfarm.drives.motion_tasks import MotionTask
    from pnfarm.station.device import Device
    from pnfarm.station.node import StationNode, StationPort

__all__ = ["Axis", "axes_by_name"]


def axes_by_name(axes: Iterable[Axis]) -> dict[str, list[Axis]]:
    """The axes that a name concerns: each by its own, all of a station by the station's."""
    found: dict[str, list[Axis]] = {}
    for axis in axes:
        for name in dict.fromkeys((axis.configured_name, axis.station.configured_name)):
            found.setdefault(name, []).append(axis)
    return found


class Axis:
    """See the module's docstring.

    ``number`` counts the station's axes from 0; ``index`` is its row of the tables of axes and process images.
    ``params`` and ``motion_tasks`` are those of the farm file.
    """

    def __init__(
        self,
        station: StationNode,
        number: int,
        name: str,
        model: Model,
        index: int,
        handle: AxisHandle,
        *,
        params: Mapping[str, int | float | str | bool],
        motion_tasks: tuple[MotionTask, ...] = (),
    ) -> None:
        self.station = station
        self.number = number
        self.configured_name = name
        self.model = model
        self.index = index
        self.handle = handle
        self._params = params
        self._motion_tasks = motion_tasks
        self.fault_counts: dict[int, int] = {}
        #: Faults that were reported since all were acknowledged.
        self._reported: set[int] = set()
        #: When it last ignored a request to acknowledge, because of an injection, ns; 0: never.
        self.refused_ns = 0
        self.store: ParameterStore

    # -- what its station has ----------------------------------------------------------------------------------------

    @property
    def device(self) -> Device:
        """The station's end of its bus."""
        return self.station.device

    @property
    def port(self) -> StationPort:
        """Where the station is on the wire."""
        return self.station.port

    @property
    def powered(self) -> bool:
        """Whether the station's control supply is on."""
        return self.station.powered

    # -- life --------------------------------------------------------------------------------------------------------

    def restore(self, kept: Mapping[str, Any]) -> list[str]:
        """A new store with the saved parameters; a sentence for each that does not fit."""
        self.store = ParameterStore(self.model, self.handle, self._save)
        return self.store.restore(kept.get(self.key("drive")))

    def commission(self) -> None:
        """Apply the farm file's parameters and tasks, and power the store on."""
        self.store.commission({key: self._raw(key, value) for key, value in self._params.items()})
        self.store.commission_tasks(self._motion_tasks)
        self.store.power_on()

    def restore_history(self, kept: Mapping[str, Any]) -> None:
        """Put the saved fault history into the buffer."""
        restore_history(self.handle.axis, kept.get(self.key("faults"), ()))

    def supply_gone(self) -> None:
        """The supply goes."""
        self.handle.axis.powered = 0

    def supply_returned(self) -> None:
        """The supply returns."""
        # set points written by parameters are gone, too, and so is the reason why a controller's ended
        self.handle.image.received[:] = 0
        self.handle.image.valid = 0
        self.handle.image.lost = LOST_NEVER
        self.handle.axis.powered = 1
        self.handle.push_command(CMD_POWER_ON)
        self._reported.clear()

    def _raw(self, key: str, value: float | str | bool) -> int:
        """A parameter of the farm file as the raw number that the drive accepts."""
        raw = raw_number(self.model.resolve(key)[0], value)
        if raw is None:
            raise ConfigError(f"{self.configured_name}: {key} cannot be {value!r}")
        return raw

    def carry_out(self, now: int) -> bool:
        """Carry out commands of the drive itself; returns whether there were any."""
        ordered = self.store.events()
        for event in ordered:
            match event:
                case NonVolatileSaved(written):
                    if written or self.station.keep(now, self.key("drive"), self.store.snapshot()):
                        self.station.note(now, ParametersSaved(), self.configured_name)
                case TelegramChanged(number):
                    self.device.telegram_changed(self.number)
                    self.station.note(now, TelegramTaken(number), self.configured_name)
                case RebootRequested():
                    self.station.power_cycle(now)
                case DisplayBlinkRequested():
                    self.station.signalled_ns = now
                case FaultHistoryCleared():
                    self.station.keep(now, self.key("faults"), active_of(self.handle.axis) or None)
                case _:
                    pass
        return bool(ordered)

    # -- faults ------------------------------------------------------------------------------------------------------

    def fault_raised(self, number: int, now: int) -> None:
        """It raised a fault: count it, store it, report it on the bus."""
        self.fault_counts[number] = self.fault_counts.get(number, 0) + 1
        self._reported.add(number)
        self.device.fault_raised(self.number, number)
        self._keep_faults(now)

    def faults_cleared(self, now: int) -> None:
        """Every fault was acknowledged."""
        self._reported.clear()
        self.device.faults_cleared(self.number)
        self._keep_faults(now)

    def catch_up(self, now: int) -> list[int]:
        """Reports of the engine were lost: take from the record what they said; faults that were not reported yet."""
        if not self.powered:
            return []
        active = active_faults(self.handle.axis)
        if not self._reported.issubset(active):
            self.faults_cleared(now)
        missed = [number for number in active if number not in self._reported]
        for number in missed:
            self.fault_raised(number, now)
        return missed

    def raise_fault(self, wanted: str | int, *, hold: bool) -> int:
        """Raise a fault of the model by number, name or cause; with ``hold`` its cause stays.  Its number."""
        fault = self.model.fault(wanted)
        self.handle.push_command(CMD_HOLD_FAULT if hold else CMD_RAISE_FAULT, fault.code)
        return fault.number

    def release_fault(self, number: int) -> None:
        """The cause of a held fault is gone; it can be acknowledged."""
        self.handle.push_command(CMD_RELEASE_FAULT, number)

    # -- memory ------------------------------------------------------------------------------------------------------

    def key(self, what: str) -> str:
        """The name of a value in the station's memory: of the first axis alone, of others with the axis number."""
        return what if self.number == 0 else f"{what}.{self.number + 1}"

    def _keep_faults(self, now: int) -> None:
        """The fault history changed: write it through."""
        self.station.keep(now, self.key("faults"), history_of(self.handle.axis) or None)

    def _save(self, snapshot: dict[str, Any]) -> bool:
        """The drive was ordered to save its values."""
        return self.station.try_save({**self.station.kept, self.key("drive"): snapshot})
