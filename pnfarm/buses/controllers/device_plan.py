"""What a controller on any bus expects of each device, and of itself."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from pnfarm.buses.controllers.axis_program import IDLE

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from ipaddress import IPv4Interface

    from pnfarm.buses.controllers.axis_program import AxisProgram
    from pnfarm.drives.description.model import Model
    from pnfarm.drives.telegrams.signal_view import AxisSignals
    from pnfarm.signals.signal import Direction, Signal

__all__ = ["IpPlan", "PlannedDevice"]


@dataclass(frozen=True, slots=True, kw_only=True)
class PlannedDevice:
    """A drive, or a device that only its maker's file describes: that one has neither a program nor signals."""

    name: str
    model: str
    program: AxisProgram = IDLE
    #: What the program needs to know of the drive: a dataclass, whose fields are those of the program's row.
    steps: Any
    #: Whether the drive expects a sign of life.
    life: bool = False
    #: The signals of the drive's telegram, for a program of the user's.
    signals: AxisSignals | None = None
    #: The signals of a device of the farm without axes, and the first octet of each submodule's data in its rows.
    data_signals: Mapping[str, Signal] = field(default_factory=dict)
    data_places: Mapping[tuple[int, int, Direction], int] = field(default_factory=dict)
    #: The codes of its telegram's words (:mod:`pnfarm.table.signals`).
    output_words: tuple[int, ...] = ()
    input_words: tuple[int, ...] = ()
    #: The model, whose parameters can be named.
    described: Model | None = None
    #: Octets that a device without a program is sent.
    outputs: bytes = b""
    reconnect_after_ns: int | None = None
    #: The name of its first axis, if that is not the drive's; the axes after it.
    first: str = ""
    further: tuple[PlannedDevice, ...] = ()
    #: The slots of an axis of several; None: all.
    slots: frozenset[int] | None = None

    @property
    def axes(self) -> list[tuple[str, PlannedDevice]]:
        """Each axis by its name, with what is planned for it; a device without axes counts as one."""
        return [(self.first or self.name, self), *((one.name, one) for one in self.further)]

    @property
    def channels(self) -> int:
        """Rows of a table of channels that a connection needs."""
        return len(self.axes)


@dataclass(frozen=True, slots=True)
class IpPlan:
    """A controller with an address, and its devices."""

    name: str
    ip: IPv4Interface
    devices: Sequence[Any]

    @property
    def udp_ports(self) -> tuple[IPv4Interface, Sequence[int]]:
        """Sockets hold the ports that they need."""
        return self.ip, ()
