"""A node with its axes."""

from __future__ import annotations

from typing import TYPE_CHECKING, cast

from pnfarm.station.node import StationNode

if TYPE_CHECKING:
    from pnfarm.station.axis import Axis

__all__ = ["Station"]


class Station(StationNode):
    """See :class:`pnfarm.station.node.StationNode`, whose parts are the axes."""

    @property
    def axes(self) -> tuple[Axis, ...]:
        """None of a device, one or more of a drive."""
        return cast("tuple[Axis, ...]", self.parts)

    @property
    def axis(self) -> Axis:
        """The axis of a station on a bus whose stations have one."""
        (axis,) = self.axes
        return axis
