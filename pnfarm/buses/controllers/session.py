"""A controller's session with one station, on buses where each has channels of its own; and what is measured of it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Sequence
    from enum import StrEnum

    from pnfarm.buses.controllers.device_plan import PlannedDevice

__all__ = ["DATA", "STOPPED", "Measures", "Session"]

#: States that a session has on each bus: it exchanges data; it waits for nothing.
DATA, STOPPED = "DATA", "STOPPED"


@dataclass(slots=True)
class Measures:
    """What the controller measured of one station; times in nanoseconds."""

    connects: int = 0
    losses: int = 0
    refusals: int = 0
    search_ns: int = 0
    #: From the search to the established connection, last time.
    connect_ns: int | None = None
    #: From the loss to the established connection, last time.
    reconnect_ns: int | None = None
    lost_ns: int | None = None
    last_reason: str = ""
    expirations: int = 0
    #: Cyclic frames of the connections that were closed; those of the present one count in its channels.
    frames_sent: int = 0
    frames_received: int = 0

    def established(self, now: int) -> int:
        """Count a connection; how long it took to make."""
        if not self.connects:
            # why it took a while is of no interest any more
            self.last_reason = ""
        self.connects += 1
        took = self.connect_ns = now - self.search_ns
        if self.lost_ns is not None:
            self.reconnect_ns = now - self.lost_ns
            self.lost_ns = None
        return took


@dataclass(slots=True, eq=False)
class Session:
    """``index`` counts the devices, ``row`` is the first axis's of programs and images.

    ``machine`` is the connection's, while there is one.
    """

    index: int
    plan: PlannedDevice
    state: StrEnum
    due_ns: int | None = 0
    mac: bytes = b""
    machine: Any = None
    #: Rows of the open channels.
    providers: list[int] = field(default_factory=list)
    consumers: list[int] = field(default_factory=list)
    #: What the station says of itself, read in this connection or an earlier one.
    identification: Any = None
    measures: Measures = field(default_factory=Measures)
    row: int = 0

    @property
    def provider(self) -> int | None:
        """The row of the first provider."""
        return next(iter(self.providers), None)

    @property
    def consumer(self) -> int | None:
        """The row of the first consumer."""
        return next(iter(self.consumers), None)

    @property
    def rows(self) -> range:
        return range(self.row, self.row + len(self.plan.axes))

    @property
    def out_of_use(self) -> Sequence[str]:
        """What of the station cannot be used at present, and why."""
        return []
