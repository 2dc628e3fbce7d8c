"""One macvlan per drive on a NIC: each drive has its own MAC address on the real network.

Mode ``bridge``: drives of one farm receive each other's frames, and the NIC's own traffic goes on as before.  The
parent itself (an address that this host has on the NIC) and the drives do not receive each other's frames: a controller
on this host uses another macvlan on the same parent.  The parent is never changed; it receives LLDP for all drives.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.links.egress import Egress, EgressChoice
from pnfarm.links.kernel.interfaces import Interfaces
from pnfarm.links.kernel.linux import PacketLink
from pnfarm.wire.ethernet import ETHERTYPE_LLDP

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pnfarm.links.base import Port, PortSpec

__all__ = ["MacvlanLink"]

_LLDP = ETHERTYPE_LLDP.to_bytes(2, "big")


class MacvlanLink(PacketLink):
    """``link: {kind: macvlan, parent: eth1}``.  ``farm`` names and tags what is made."""

    kind = "macvlan"

    def __init__(self, farm: str, parent: str, *, send: EgressChoice = "own") -> None:
        super().__init__()
        self.egress = Egress(send)
        self._farm = farm
        self._parent = parent
        self._made: set[int] = set()

    @property
    def parent(self) -> str:
        """Name of the interface that the drives' interfaces are made on."""
        return self._parent

    async def open(self, wanted: Sequence[PortSpec]) -> list[Port]:
        ports = await super().open(wanted)
        if self._shared is not None:
            self.egress.open(self._shared, {port.index: port.mac for port in ports})
        return ports

    async def close(self) -> None:
        self.egress.close()
        await super().close()

    def send(self, port_index: int, frame: bytes) -> None:
        # of all frames of a group LLDP is the only one that does not go beyond the cable
        alone = frame[12:14] == _LLDP and self.egress.leaves_unheard(port_index)
        self._sockets.send(port_index, frame, self._parent if alone else None)

    async def set_mac(self, port_index: int, mac: bytes) -> None:
        await super().set_mac(port_index, mac)
        self.egress.set_mac(port_index, mac)

    async def set_carrier(self, port_index: int, up: bool) -> None:
        if not up:
            self.egress.set_pulled(port_index, pulled=True)
        await super().set_carrier(port_index, up)
        self.egress.set_pulled(port_index, not up)

    def _create(self, wanted: Sequence[PortSpec]) -> list[Port]:
        with Interfaces() as interfaces:
            ports = interfaces.create_macvlans(self._farm, self._parent, wanted)
            self._shared = interfaces.find(self._parent, "parent interface").index
        self._made = {port.index for port in ports}
        return ports

    def _remove(self) -> None:
        with Interfaces() as interfaces:
            interfaces.remove(self._farm, self._made)

    def _set_carrier(self, port: Port, up: bool) -> None:
        # The interface itself goes down: it has no cable of its own.  Its address and the memberships that the
        # socket holds survive in the kernel, and are programmed into the parent again when it comes up.
        with Interfaces() as interfaces:
            interfaces.set_up(port.index, up)
