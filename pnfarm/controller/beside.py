"""The built-in controllers of a farm in memory: they run in the farm's own process, on the farm's clock."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.controller.line import join_controllers
from pnfarm.errors import ConfigError
from pnfarm.station.event_log import EventLog

if TYPE_CHECKING:
    from pnfarm.controller.line import JoinedControllers
    from pnfarm.farm.farm import Farm
    from pnfarm.farm.virtual import VirtualWorld

__all__ = ["ControllerBeside"]


class ControllerBeside:
    """Join a farm's world when it starts, and leave at its end; nothing is done on a link with interfaces.

    There the controller is the one on the wire: a PLC, or ``pnfarm plc`` in another process.
    """

    def __init__(self, farm: Farm, *, log: EventLog | None = None) -> None:
        self._farm = farm
        self.log = log or EventLog(quiet=True)
        self._joined: JoinedControllers | None = None
        farm.on_world.append(self._join)
        farm.on_close.append(self._close)

    @property
    def joined(self) -> JoinedControllers:
        """The controllers.  Raises :class:`ConfigError` where there is none in this process."""
        if self._joined is None:
            raise ConfigError(
                "no controller runs in this process: that needs `link: {kind: memory}` and a `controller:` section"
            )
        return self._joined

    async def _join(self, world: VirtualWorld) -> None:
        self._joined = await join_controllers(
            world, self._farm.config, self._farm.drives, self.log, devices=self._farm.devices
        )

    async def _close(self) -> None:
        joined, self._joined = self._joined, None
        if joined is not None:
            await joined.close()
