"""What is behind a device on EtherNet/IP: a drive with an axis, or a device that its maker's file describes.

The device knows the standard's objects, connections and channels; its kind gives the identity, the application's
objects, what can be connected, and where the data are.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from ipaddress import IPv4Address, IPv4Interface

    from pnfarm.engine.channels.parts import Piece
    from pnfarm.protocols.enip.connection import Connection, ConnectionSettings, IoOffer
    from pnfarm.protocols.enip.connection_check import Refusal
    from pnfarm.protocols.enip.object import CipObject
    from pnfarm.protocols.enip.objects.assembly import AssemblyData
    from pnfarm.protocols.enip.objects.identity import IdentityData
    from pnfarm.protocols.enip.wire.epath import ElectronicKey

__all__ = ["Carried", "Kind", "Settings"]


class Settings(Protocol):
    """The station in the farm file."""

    @property
    def ip(self) -> IPv4Interface | None: ...
    @property
    def gateway(self) -> IPv4Address | None: ...


@dataclass(frozen=True, slots=True)
class Carried:
    """One direction of a connection: ``words`` (code, offset) of the axis, or ``pieces`` of plain data."""

    words: Sequence[tuple[int, int]] = ()
    pieces: Sequence[Piece] = ()


class Kind(Protocol):
    """See the module's docstring; ``plain_row`` is the station's row of plain data, ``label`` its interface's name.

    ``sessions``: TCP connections that it takes at once.  ``assemblies`` and ``objects``, those beside the standard's,
    are new after each :meth:`build`.
    """

    plain_row: int
    label: str
    #: What of a Forward_Open may not fit (``key``, ``path``, ``sizes``, ``interval``) -> where the farm file says it.
    keys: Mapping[str, tuple[str, ...]]
    io_connections: int
    sessions: int
    assemblies: Sequence[AssemblyData]
    objects: Sequence[CipObject]

    def build(self) -> None:
        """The station was powered on: its objects start again."""

    def identity(self, serial: int) -> IdentityData:
        """What the Identity object says."""

    def settings(self, key: ElectronicKey, multicast: IPv4Address) -> ConnectionSettings:
        """What can be connected; ``multicast`` is the first address of the groups to which it may send."""

    def configure(self, offer: IoOffer, data: bytes) -> Refusal | None:
        """Take the configuration that came with a Forward_Open; what refuses it, or None."""

    # -- cyclic data

    def consumed(self, connection: Connection) -> Carried:
        """What comes with a connection."""

    def produced(self, connection: Connection) -> Carried:
        """What goes out with it."""

    def fed(self, timeout_ns: int, cycle_ns: int) -> None:
        """A connection was opened whose originator commands the station."""

    def unfed(self) -> None:
        """It ended."""

    def lost(self) -> None:
        """It ended without Forward_Close, and its data had come."""

    def paced(self, fastest_ns: int | None) -> None:
        """The shortest packet interval of the open connections; None without any."""

    @property
    def faulty(self) -> bool:
        """Whether the application has a fault."""

    # -- tasks that come in cyclic data

    def parameter_task(self, value: int, now: int) -> None:
        """One came."""

    def next_deadline(self) -> int | None:
        """When :meth:`handle_timeout` is due."""

    def handle_timeout(self, now: int) -> None:
        """Do what is due by now."""
