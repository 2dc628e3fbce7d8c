"""One veth pair per drive: a cable whose other end joins a bridge, or stays free."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.errors import ConfigError
from pnfarm.links.kernel.interfaces import Interfaces, VethPair
from pnfarm.links.kernel.linux import PacketLink

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pnfarm.links.base import Port, PortSpec

__all__ = ["VethLink"]


class VethLink(PacketLink):
    """``link: {kind: veth, bridge: br0}``.

    ``bridge`` names an existing bridge for the far ends; ``own_bridge`` makes one, removed with the farm; with
    neither the far ends (named like the near ones, with a ``p`` behind) are left free.
    """

    kind = "veth"

    def __init__(self, farm: str, *, bridge: str | None = None, own_bridge: bool = False) -> None:
        super().__init__()
        if bridge is not None and own_bridge:
            raise ConfigError(
                "a veth link joins the bridge that is named or makes its own, not both: leave one of them out"
            )
        self._farm = farm
        self._bridge = bridge
        self._own_bridge = own_bridge
        self._made: set[int] = set()
        self._pairs: dict[int, VethPair] = {}

    @property
    def bridge(self) -> str | None:
        """Name of the bridge that the far ends are ports of; an own bridge's is known once the link is open."""
        return self._bridge

    def peer(self, port_index: int) -> Port:
        """The far end of a drive's cable."""
        return self._pairs[port_index].peer

    def _create(self, wanted: Sequence[PortSpec]) -> list[Port]:
        with Interfaces() as interfaces:
            if self._own_bridge:
                own = interfaces.create_bridge(self._farm)
                self._made = {own.index}
                self._bridge = own.name
            pairs = interfaces.create_veths(self._farm, self._bridge, wanted)
        self._made |= {port.index for pair in pairs for port in (pair.port, pair.peer)}
        self._pairs = {pair.port.index: pair for pair in pairs}
        return [pair.port for pair in pairs]

    def _remove(self) -> None:
        with Interfaces() as interfaces:
            interfaces.remove(self._farm, self._made)
        self._made = set()
        self._pairs = {}
        if self._own_bridge:
            self._bridge = None

    def _set_carrier(self, port: Port, up: bool) -> None:
        # Pulled at the far end, as on a real machine: the drive's own interface stays up and sees no carrier.
        with Interfaces() as interfaces:
            peer = self._pairs[port.index].peer
            interfaces.set_up(peer.index, up)
            if up:
                interfaces.wait_operational(port.index, peer.index)
