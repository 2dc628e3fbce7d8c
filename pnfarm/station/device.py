"""Interface of a bus's device to its station."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

from pnfarm.errors import EnvironmentError_

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from ipaddress import IPv4Address

    from pnfarm.wire.endpoint import Services, SocketAction, SocketEvent

__all__ = ["ChannelCounts", "ConnectionView", "Device", "KeptValueError", "SocketDevice"]


class KeptValueError(EnvironmentError_):
    """A drive's memory holds a value that no drive writes."""


@dataclass(frozen=True, slots=True)
class ConnectionView:
    """The connection that carries a drive's cyclic data, or the one that is closest to being established.

    ``state`` is the bus's own name for its state.  A connection without channels has nothing else.
    ``exchanging``: it is completely set up.
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
    jitter_sum_ns: int
    missed: int
    late: int
    late_own: int
    discarded: Any
    intervals: Any
    jitters: Any


class Device(Protocol):
    """One drive's end of a bus: bytes and ``now`` in, frames and events out; no clock, no socket, no task."""

    # -- life: the machines are recreated at each power-on

    def check(self, kept: Mapping[str, Any]) -> None:
        """Whether the device can boot with this memory; raises :class:`KeptValueError` that names the key."""

    def commission(self, kept: Mapping[str, Any]) -> None:
        """The store has its memory but not yet the farm file's parameters: apply the bus's settings to it."""

    def build(self, kept: dict[str, Any]) -> None:
        """Create the machines as after power-on, with the contents of memory; the store is ready."""

    def start(self, now: int) -> list[str]:
        """The drive comes on the wire; a sentence for each content of memory that does not fit the device."""

    def stop(self, now: int) -> None:
        """The supply is off: connections end without notice."""

    def leave(self, now: int) -> None:
        """The farm stops: end every connection in order."""

    # -- time and frames, only while the drive is on the wire

    def receive(self, data: bytes, now: int) -> None:
        """One acyclic frame that the segment let pass."""

    def pump(self, now: int) -> list[bytes]:
        """Finish what inputs began; the frames to send."""

    def next_deadline(self) -> int | None:
        """When :meth:`handle_timeout` is due."""

    def handle_timeout(self, now: int) -> None:
        """Do what is due by now."""

    def telegram_changed(self, axis: int) -> None:
        """Another telegram of an axis, counted from 0, is in force: cyclic frames carry other signals."""

    # -- events of the engine

    def channel_event(self, kind: int, row: int, when: int, value: int, now: int) -> bool:
        """An event of one of the device's consumers; False when its connection ended while the event waited."""

    def catch_up(self, now: int) -> None:
        """Events of the engine were lost: read from the rows what happened to the connections."""

    def fault_raised(self, axis: int, number: int) -> None:
        """An axis raised a fault: report it in the bus's own way (a diagnosis, an attribute)."""

    def faults_cleared(self, axis: int) -> None:
        """Every fault of an axis was acknowledged."""

    def parameter_task(self, axis: int, value: int, now: int) -> None:
        """A task of an axis came in the cyclic parameter channel."""

    # -- state for observers

    @property
    def name(self) -> str:
        """The drive's present name on the bus; a controller or a tool may have changed it."""

    @property
    def connects(self) -> int:
        """Connections that reached data exchange since the farm started."""

    @property
    def watchdog_expirations(self) -> int:
        """Expired watchdogs on the controller's data."""

    @property
    def watchdog_expirations_by_farm(self) -> int:
        """Those of them that the farm's own lateness caused."""

    @property
    def connected(self) -> bool:
        """Whether some connection exchanges cyclic data."""

    def connection(self) -> ConnectionView | None:
        """The connection that carries cyclic data, or else any other."""

    def losses(self) -> Mapping[str, int]:
        """Connections that ended without a release, by a slug for the reason."""

    def losses_by_farm(self) -> Mapping[str, int]:
        """Those of them that the farm's own lateness caused."""

    def losses_in_words(self) -> Mapping[str, int]:
        """The same, by the reason in words."""

    @property
    def closed(self) -> ChannelCounts:
        """Counters of the closed channels."""

    @property
    def channel_rows(self) -> tuple[Sequence[int], Sequence[int]]:
        """Rows of the open channels: provider's, consumer's."""

    def discards(self) -> Mapping[str, int]:
        """Acyclic frames and PDUs that were dropped, by reason."""

    def view(self, now: int) -> dict[str, Any]:
        """Data of the drive that only this bus has, plain JSON values for its snapshot; read for all drives in turn."""

    def details(self) -> dict[str, Any]:
        """More of them, for the view of this one drive: identifications, layouts of frames, settings of the line.

        ``connections``, where there is the key: of each its ``channels``, of each of these its ``places``.
        """


@runtime_checkable
class SocketDevice(Protocol):
    """What a device offers besides if it speaks over streams or datagrams of an address of its own.

    The farm carries them only while the drive is on the wire.  When its supply goes, address and sockets are gone at
    once, and its peers learn nothing; the device forgets its streams in :meth:`Device.stop`.
    """

    def services(self) -> Services | None:
        """Address and ports; None for now without an address.  Asked after each input: another value restarts them."""

    def socket_event(self, event: SocketEvent, now: int) -> None:
        """A stream was opened, brought octets or is closed, or a datagram came; none from before the last boot."""

    def pump_sockets(self, now: int) -> list[SocketAction]:
        """What to send and to close, after the frames of :meth:`Device.pump`."""
