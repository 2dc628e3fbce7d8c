"""Interface of a bus's controller: plans made from the farm file, and the controller that carries them out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

from pnfarm.buses.node import Node
from pnfarm.links.sockets import sockets_of

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from ipaddress import IPv4Interface

    from pnfarm.drives.profiles.profidrive.pkw import Pkw
    from pnfarm.drives.telegrams.signal_view import AxisSignals
    from pnfarm.links.base import Link, Port
    from pnfarm.links.sockets import SocketCarrier
    from pnfarm.signals.signal import Direction, Signal
    from pnfarm.station.event_log import EventLog
    from pnfarm.table.access.plain_data import ConsumedData, ProvidedData

__all__ = [
    "Controller",
    "ControllerHost",
    "ControllerPlan",
    "DeviceController",
    "DeviceData",
    "ProgrammableDevice",
    "RecordAccess",
    "RecordController",
]


@dataclass(frozen=True, slots=True)
class ControllerHost:
    """What a controller uses and does not own: its port and tables, its log, a seed for its UUIDs.

    ``lldp``: whether it sends LLDP.
    """

    link: Link
    port: Port
    log: EventLog
    seed: bytes
    lldp: bool = True

    @property
    def sockets(self) -> SocketCarrier | None:
        """What carries streams and datagrams of its port; a controller sets itself as its user."""
        return sockets_of(self.link)


class ProgrammableDevice(Protocol):
    """A device of a plan, as a user's program sees it."""

    @property
    def name(self) -> str: ...

    @property
    def model(self) -> str: ...

    @property
    def cycle_ns(self) -> int:
        """Duration of a cycle."""

    @property
    def signals(self) -> AxisSignals | None:
        """The signals of its telegram, None for a device that no model describes."""

    @property
    def life(self) -> bool:
        """Whether the drive expects a sign of life."""

    @property
    def axes(self) -> Sequence[tuple[str, Any]]:
        """Each of its axes by name, as such a device."""


@dataclass(frozen=True, slots=True)
class DeviceData:
    """A controller's rows of a device of the farm that has no axes.

    ``places``: slot, subslot and direction of a submodule's data -> their first octet in the row, in the order of the
    row's statuses.
    """

    signals: Mapping[str, Signal]
    places: Mapping[tuple[int, int, Direction], int]
    sent: ProvidedData
    received: ConsumedData


class ControllerPlan(Protocol):
    """What a controller is to do, derived from the farm file; the rest of it is the bus's own."""

    @property
    def devices(self) -> Sequence[ProgrammableDevice]:
        """What each drive is to be, in the order of the drives, and then each device that no model describes."""

    @property
    def udp_ports(self) -> tuple[IPv4Interface | None, Sequence[int]]:
        """The controller's address, and the UDP ports on which the kernel must not answer in its place."""


class Controller(Node, Protocol):
    """The other end of a farm's wire: bytes and ``now`` in, frames out; no clock, no task."""

    port: Port

    # -- its life

    def start(self, now: int) -> None:
        """Begin to search for the drives."""

    def release(self, now: int) -> None:
        """Release every connection."""

    # -- state for observers

    @property
    def all_connected(self) -> bool:
        """Whether every drive exchanges data both ways."""

    @property
    def all_running(self) -> bool:
        """Whether every enabled axis is in operation."""

    @property
    def all_stopped(self) -> bool:
        """Whether every connection is down, after :meth:`release`."""

    def exchanging(self, name: str) -> bool:
        """Whether a drive's data is valid; false for a drive that is not the controller's."""

    def snapshot(self) -> list[dict[str, Any]]:
        """One dict for each drive, plain JSON values.

        Any bus has ``name``, ``model``, ``ip``, ``state``, ``phase``, ``zsw1``, ``stw1``, ``connects``, ``losses``,
        ``faults``, ``cycle_seconds``, ``frames_sent``, ``frames_received``, ``unusable``, ``last_reason``.
        """

    # -- the parameter channel in the cyclic data (PKW), where a telegram has one

    def put_parameter_task(self, name: str, task: Pkw) -> None:
        """Keep a task set in a drive's channel.

        Raises :class:`ConfigError` for an unknown drive and for one whose cyclic data has no such channel.
        """

    def parameter_answer(self, name: str) -> Pkw:
        """What a drive answers there; raises as :meth:`put_parameter_task` does."""


@runtime_checkable
class DeviceController(Protocol):
    """What a controller says besides if it runs devices without axes."""

    @property
    def device_data(self) -> Mapping[str, DeviceData]:
        """The data of the farm's devices without axes, by name."""


class RecordAccess(Protocol):
    """A record that a controller reads or writes; the results are valid once it is ``done``."""

    @property
    def done(self) -> bool: ...

    @property
    def data(self) -> bytes | None:
        """What was read."""

    @property
    def failure(self) -> str:
        """Why it failed, empty where it did not."""

    @property
    def code(self) -> int:
        """The drive's four octets, the first one highest, as a PLC has them in STATUS; 0 where it gave none."""


@runtime_checkable
class RecordController(Protocol):
    """What a controller does besides if its drives have records."""

    def access_record(self, axis: str, index: int, data: bytes | None, now: int) -> RecordAccess:
        """Write ``data`` to a record of an axis' parameter access, or read it without.

        Raises :class:`ConfigError` for an axis that is not the controller's.
        """
