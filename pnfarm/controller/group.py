"""The controllers of one file as one: what is asked of a drive goes to the controller that has it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from operator import itemgetter
from typing import TYPE_CHECKING, Any

from pnfarm.buses.controller import DeviceController, RecordController
from pnfarm.controller.line_device import LineDevice
from pnfarm.errors import ConfigError, InternalError

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from pnfarm.buses.controller import Controller, ProgrammableDevice, RecordAccess
    from pnfarm.controller.plan import PlannedController
    from pnfarm.drives.profiles.profidrive.pkw import Pkw
    from pnfarm.engine.columns import Columns

__all__ = ["ControlledDevice", "Controllers"]


@dataclass(frozen=True, slots=True)
class ControlledDevice:
    """An axis of a plan by its name and its drive's, and its row in the images of its controller's table."""

    name: str
    drive: str
    columns: Columns
    row: int
    device: ProgrammableDevice


class Controllers:
    """One controller for each bus of a file, in the order of their first drives.

    Lists have the drives in the file's order, and then the devices that no model describes.  Counts and questions are
    about all of them.
    """

    def __init__(self, planned: Sequence[PlannedController], controllers: Sequence[Controller]) -> None:
        if not controllers:
            raise InternalError("a group of no controllers")
        self._planned = planned
        self._controllers = list(controllers)
        self._order = {drive.name: drive.index for one in planned for drive, _ in one.members}
        self._of = {
            name: controller
            for one, controller in zip(planned, controllers, strict=True)
            for device in one.plan.devices
            for name in (device.name, *(axis for axis, _ in device.axes))
        }

    def __iter__(self) -> Iterator[Controller]:
        return iter(self._controllers)

    def __len__(self) -> int:
        return len(self._controllers)

    @property
    def first(self) -> Controller:
        """The only one, or the first."""
        return self._controllers[0]

    def of(self, name: str) -> Controller:
        """The controller of a drive or device.  Raises :class:`ConfigError` for an unknown name."""
        if len(self._controllers) == 1:
            # it says itself what it does not know
            return self.first
        if name not in self._of:
            raise ConfigError(f"no controller has a drive {name!r}")
        return self._of[name]

    def programmed(self) -> list[ControlledDevice]:
        """The axes that a program of one's own moves: those of controllers without a built-in program."""
        found = [
            (self._place(device.name), ControlledDevice(name, device.name, controller.columns, row, axis))
            for one, controller in zip(self._planned, self._controllers, strict=True)
            if one.section.program.python is not None
            for row, (device, name, axis) in enumerate(
                (device, *each) for device in one.plan.devices for each in device.axes
            )
        ]
        return [each for _, each in sorted(found, key=itemgetter(0))]

    def line_devices(self) -> dict[str, LineDevice]:
        """The devices of the farm, by name, as a program sees them."""
        return {
            name: LineDevice(name, data, partial(controller.exchanging, name))
            for controller in self._controllers
            if isinstance(controller, DeviceController)
            for name, data in controller.device_data.items()
        }

    def _place(self, name: str) -> int:
        """Place of a drive in the file; devices come after the drives."""
        return self._order.get(name, len(self._order) + max(self._order.values(), default=0))

    # -- their life

    def start(self, now: int) -> None:
        """Begin to search for the drives."""
        for controller in self._controllers:
            controller.start(now)

    def release(self, now: int) -> None:
        """Release every connection."""
        for controller in self._controllers:
            controller.release(now)

    # -- state for observers

    @property
    def all_connected(self) -> bool:
        """Whether every drive exchanges data both ways."""
        return all(controller.all_connected for controller in self._controllers)

    @property
    def all_running(self) -> bool:
        """Whether every enabled axis is in operation."""
        return all(controller.all_running for controller in self._controllers)

    @property
    def all_stopped(self) -> bool:
        """Whether every connection is down, after :meth:`release`."""
        return all(controller.all_stopped for controller in self._controllers)

    def exchanging(self, name: str) -> bool:
        """Whether a drive's data is valid; false for a drive that no controller has."""
        return any(controller.exchanging(name) for controller in self._controllers)

    def snapshot(self) -> list[dict[str, Any]]:
        """One dict for each drive, as :meth:`pnfarm.buses.controller.Controller.snapshot` has it.

        With several controllers each has ``bus`` beside its name.
        """
        if len(self._controllers) == 1:
            return self.first.snapshot()
        rows = [
            {"name": row["name"], "bus": one.bus.name, **row}
            for one, controller in zip(self._planned, self._controllers, strict=True)
            for row in controller.snapshot()
        ]
        return sorted(rows, key=lambda row: self._place(row["name"]))

    # -- records and the parameter channel in the cyclic data

    def access_record(self, name: str, index: int, data: bytes | None, now: int) -> RecordAccess:
        """As :meth:`pnfarm.buses.controller.RecordController.access_record`, of the axis' controller."""
        controller = self.of(name)
        if not isinstance(controller, RecordController):
            raise ConfigError(f"drive {name!r} has no records: its bus has none")
        return controller.access_record(name, index, data, now)

    def put_parameter_task(self, name: str, task: Pkw) -> None:
        """As :meth:`pnfarm.buses.controller.Controller.put_parameter_task`, of the drive's controller."""
        self.of(name).put_parameter_task(name, task)

    def parameter_answer(self, name: str) -> Pkw:
        """What a drive answers there."""
        return self.of(name).parameter_answer(name)
