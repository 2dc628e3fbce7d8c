"""An existing interface used as it is: a NIC, a veth end, a macvlan made by others.

For the built-in controller (``interface: eth1``) and for a single drive in a container. Nothing about the
interface is changed: its address is the port's address, its kernel addresses stay, and it is there when the
link has closed.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.errors import ConfigError, EnvironmentError_
from pnfarm.links.base import Port, PortSpec
from pnfarm.links.kernel.interfaces import Interfaces
from pnfarm.links.kernel.linux import PacketLink

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["InterfaceLink"]


class InterfaceLink(PacketLink):
    """One port on ``interface``; the spec's MAC address is ignored in favour of the interface's own."""

    kind = "interface"

    def __init__(self, interface: str) -> None:
        super().__init__()
        self._interface = interface

    async def open(self, wanted: Sequence[PortSpec]) -> list[Port]:
        if len(wanted) > 1:
            raise ConfigError(
                f"interface {self._interface} has one address, so one station: {len(wanted)} were given, "
                "use a macvlan link"
            )
        return await super().open(wanted)

    def _create(self, wanted: Sequence[PortSpec]) -> list[Port]:
        with Interfaces() as interfaces:
            facts = interfaces.find_usable(self._interface, "interface")
        return [Port(facts.name, facts.index, facts.mac) for _ in wanted]

    def _remove(self) -> None:
        """Nothing was made."""

    def _set_carrier(self, port: Port, up: bool) -> None:
        word = "up" if up else "down"
        raise EnvironmentError_(
            f"interface {port.name} is not the farm's, so its cable stays as it is: `ip link set {port.name} {word}`"
        )

    def _set_mac(self, port: Port, mac: bytes) -> None:
        raise EnvironmentError_(
            f"interface {port.name} is not the farm's, so its address stays as it is: "
            f"use a macvlan link to have {mac.hex(':')}"
        )
