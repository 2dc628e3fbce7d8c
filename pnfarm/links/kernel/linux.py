"""What macvlan, veth and plain interfaces have in common: packet sockets over interfaces of the kernel."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING

from pnfarm.errors import EnvironmentError_, InternalError
from pnfarm.links.base import Audience, LinkCounters, Port, PortSpec, Receiver
from pnfarm.links.kernel.interfaces import Interfaces, run_to_completion
from pnfarm.links.kernel.packet import PacketSockets
from pnfarm.links.kernel.sockets import KernelSockets

if TYPE_CHECKING:
    import socket
    from collections.abc import Sequence

__all__ = ["PacketLink"]


class PacketLink(ABC):
    """A link over interfaces of the kernel.  Subclasses make and remove them, in a worker thread."""

    kind: str

    def __init__(self) -> None:
        self._counters = LinkCounters()
        self._sockets = PacketSockets(self._counters)
        #: Streams and datagrams of the ports whose stations have addresses of the kernel's.
        self.sockets = KernelSockets(self._counters, own=self.kind != "interface")
        self._ports: dict[int, Port] = {}
        #: Index of the interface that all ports share, None where each has a cable of its own.
        self._shared: int | None = None
        self._touched = False
        self._looked_at = 0

    @property
    def counters(self) -> LinkCounters:
        self._sockets.collect_overflows()
        return self._counters

    async def open(self, wanted: Sequence[PortSpec]) -> list[Port]:
        if self._touched:
            raise InternalError(f"this {self.kind} link is already open")
        if not wanted:
            return []
        self._touched = True
        try:
            ports = await run_to_completion(self._create, list(wanted))
            self._ports = {port.index: port for port in ports}
            kernel = [port for port, spec in zip(ports, wanted, strict=True) if spec.kernel]
            self._sockets.open(ports, shared=self._shared, kernel=[port.index for port in kernel])
            self.sockets.open(kernel)
        except BaseException:
            await self.close()
            raise
        return ports

    async def close(self) -> None:
        self.sockets.close()
        self._sockets.close()
        self._ports = {}
        if self._touched:
            await run_to_completion(self._remove)
            self._touched = False

    def check(self, count: int = 16) -> None:
        """Check whether the next ``count`` interfaces still exist, in turn.

        Raises :class:`~pnfarm.errors.EnvironmentError_` for one that was removed, or whose parent was.
        """
        indexes = list(self._ports)
        for step in range(min(count, len(indexes))):
            port = self._ports[indexes[(self._looked_at + step) % len(indexes)]]
            if not self._sockets.has_interface(port.index):
                raise EnvironmentError_(
                    f"interface {port.name} was removed under the running farm, or its parent was: start the farm again"
                )
        self._looked_at += count

    def send(self, port_index: int, frame: bytes) -> None:
        self._sockets.send(port_index, frame)

    def set_receiver(self, receiver: Receiver) -> None:
        self._sockets.set_receiver(receiver)

    def set_audience(self, audience: Audience) -> None:
        """Set which ports a group-addressed frame of a shared cable can concern; the others do not get it."""
        self._sockets.set_audience(audience)

    def engine_socket(self) -> socket.socket:
        return self._sockets.engine_socket()

    def engine_datagrams(self, service: int) -> socket.socket | None:
        """See :meth:`pnfarm.links.kernel.packet.PacketSockets.engine_datagrams`."""
        return self._sockets.engine_datagrams(service)

    async def set_carrier(self, port_index: int, up: bool) -> None:
        port = self._port(port_index)
        if not up:
            # first: it may be the one that hears for all
            self._sockets.set_pulled(port_index, True)
        try:
            await run_to_completion(self._set_carrier, port, up)
        except BaseException:
            self._sockets.set_pulled(port_index, up)
            raise
        if up:
            self.sockets.restore(port_index)
            self._sockets.set_pulled(port_index, False)

    async def set_mac(self, port_index: int, mac: bytes) -> None:
        await run_to_completion(self._set_mac, self._port(port_index), mac)
        self._sockets.set_mac(port_index, mac)

    def _port(self, index: int) -> Port:
        port = self._ports.get(index)
        if port is None:
            raise InternalError(f"this {self.kind} link has no port {index}")
        return port

    @abstractmethod
    def _create(self, wanted: Sequence[PortSpec]) -> list[Port]:
        """Make the interfaces, all or none."""

    @abstractmethod
    def _remove(self) -> None:
        """Remove what :meth:`_create` made, and nothing else."""

    @abstractmethod
    def _set_carrier(self, port: Port, up: bool) -> None:
        """Pull or plug the cable."""

    def _set_mac(self, port: Port, mac: bytes) -> None:
        with Interfaces() as interfaces:
            interfaces.set_mac(port.index, mac)
