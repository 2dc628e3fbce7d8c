"""What a bus offers to the house, and what the house asks of a device on it.

A bus is one room under :mod:`pnfarm.buses`; the house above knows it only through these types, and no bus knows
another.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence
    from ipaddress import IPv4Address

    from pnfarm.engine.columns import Columns
    from pnfarm.engine.impairments import ImpairmentTable
    from pnfarm.faults.carrier import Carriers
    from pnfarm.faults.gate import GatedLink
    from pnfarm.faults.kind import InjectionKind
    from pnfarm.faults.parts import InjectedDrive

__all__ = ["Bus", "ChannelCounts", "ConnectionView", "Device", "InjectionHost", "Segment"]


@dataclass(frozen=True, slots=True)
class ConnectionView:
    """The connection that carries a drive's cyclic data, or the one that is nearest to it.

    ``state`` is the bus's own word for how far it is.  A connection without channels has nothing else.
    ``exchanging``: it is all set up.
    """

    state: str
    controller: str = ""
    ip: IPv4Address | None = None
    mac: bytes = b""
    cycle_ns: int = 0
    watchdog_ns: int = 0
    connected_ns: int = 0
    cyclic: bool = False
    exchanging: bool = False


class ChannelCounts(Protocol):
    """Counters of cyclic frames; arrays as :mod:`pnfarm.table.channel` has them."""

    sent: int
    suppressed: int
    received: int
    interval_sum_ns: int
    discarded: Any
    intervals: Any


class Device(Protocol):
    """One drive's end of a bus: bytes and ``now`` in, frames and events out; no clock, no socket, no task."""

    # -- time and frames

    def boot(self, now: int) -> None:
        """The supply came; the device comes on the wire at once, or when it is done with booting."""
        ...

    def leave(self, now: int) -> None:
        """The farm stops: tell every controller that the drive goes."""
        ...

    def receive(self, data: bytes, now: int) -> None:
        """One acyclic frame that the segment let pass."""
        ...

    def pump(self, now: int) -> list[bytes]:
        """Finish what inputs began; the frames to send."""
        ...

    def next_deadline(self) -> int | None:
        """When :meth:`handle_timeout` is wanted."""
        ...

    def handle_timeout(self, now: int) -> None:
        """Whatever is due by now."""
        ...

    # -- the engine's word

    def channel_event(self, kind: int, row: int, when: int, value: int, now: int) -> bool:
        """An event of one of the device's consumers; False when the connection went while it waited."""
        ...

    def catch_up(self, now: int) -> None:
        """Events of the engine were lost: learn from the rows what became of the connections."""
        ...

    def fault_raised(self, number: int) -> None:
        """The drive raised a fault: tell it in the bus's own way (a diagnosis, an attribute)."""
        ...

    def faults_cleared(self) -> None:
        """Every fault of the drive was acknowledged."""
        ...

    def parameter_task(self, value: int, now: int) -> None:
        """A task came in the cyclic parameter channel."""
        ...

    # -- what there is to see

    @property
    def connects(self) -> int:
        """Connections that came to data exchange since the farm started."""
        ...

    @property
    def watchdog_expirations(self) -> int:
        """Watchdogs on the controller's data that ran out."""
        ...

    @property
    def connected(self) -> bool:
        """Whether some connection exchanges cyclic data."""
        ...

    def connection(self) -> ConnectionView | None:
        """The connection that carries cyclic data, or else any other."""
        ...

    def losses(self) -> Mapping[str, int]:
        """Connections that ended without a release, by a slug for the reason."""
        ...

    def losses_in_words(self) -> Mapping[str, int]:
        """The same, by the reason in words."""
        ...

    @property
    def closed(self) -> ChannelCounts:
        """What was counted on channels that are closed now."""
        ...

    @property
    def channel_rows(self) -> tuple[Sequence[int], Sequence[int]]:
        """Rows of the open channels: provider's, consumer's."""
        ...

    def discards(self) -> Mapping[str, int]:
        """Acyclic frames and PDUs that were dropped, by reason."""
        ...

    def view(self, now: int) -> dict[str, Any]:
        """What only this bus has to show of a drive, plain JSON values for its snapshot."""
        ...


class Segment(Protocol):
    """What the devices of one farm on one bus have in common: whom a frame concerns."""

    def admits(self, port: int, frame: bytes, now: int) -> bool:
        """Whether the device at this port has to do anything about a frame; what it has not is counted there."""
        ...

    def audience(self, frame: bytes) -> Sequence[int] | None:
        """Ports that a group-addressed frame can concern, None for any: saves a switch in memory the copies."""
        ...

    def settled(self, port: int) -> None:
        """The device at this port may have another address now."""
        ...


@dataclass(frozen=True, slots=True)
class InjectionHost:
    """What a farm has for the injections into one drive.  ``settle(now)`` lets its device finish what was begun."""

    columns: Columns
    impairments: ImpairmentTable
    gate: GatedLink
    carriers: Carriers
    settle: Callable[[int], None]


class Bus(Protocol):
    """One fieldbus; :mod:`pnfarm.buses.registry` has them all."""

    @property
    def name(self) -> str:
        """As a model says which bus it is for: ``profinet``."""
        ...

    def fault_kinds(self) -> Iterable[InjectionKind]:
        """The kinds of injections that only drives on this bus can have."""
        ...

    def injected_drive(self, device: Any, host: InjectionHost) -> InjectedDrive:
        """A drive of this bus as injections see it; ``device`` is the bus's own."""
        ...
