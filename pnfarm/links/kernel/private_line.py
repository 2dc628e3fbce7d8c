"""A line in a network of one's own: a veth pair, the farm's macvlans on one end, a controller on the other.

For commands that need neither root nor a network card.  Enter it before any thread exists (:mod:`.sandbox`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.links.base import PortSpec
from pnfarm.links.kernel import bpf
from pnfarm.links.kernel.interfaces import Interfaces
from pnfarm.links.kernel.packet import open_packet_socket
from pnfarm.links.kernel.sandbox import enter_sandbox
from pnfarm.wire.ethernet import ETHERTYPE_PROFINET

if TYPE_CHECKING:
    from pnfarm.links.kernel.sandbox import Sandbox

__all__ = ["create_cable", "enter_private_line"]


def enter_private_line(near: str, far: str) -> Sandbox:
    """Leave the machine's network; ``near`` and ``far`` are the names of a cable that is tried.

    Raises :class:`~pnfarm.errors.EnvironmentError_` where the machine does not permit the network, or the kernel what
    a line needs: a veth pair, a macvlan on it, a raw socket.
    """
    sandbox = enter_sandbox()
    create_cable(near, far)
    with Interfaces() as interfaces:
        try:
            (port,) = interfaces.create_macvlans("trial", near, [PortSpec("trial", b"\x02\0\0\0\0\x01")])
            open_packet_socket(ETHERTYPE_PROFINET, bpf.ethertype_filter(port.index, port.index)).close()
        finally:
            # removes the macvlan with it
            interfaces.remove_cable(near)
    return sandbox


def create_cable(near: str, far: str) -> None:
    """A veth pair of these names, both ends up."""
    with Interfaces() as interfaces:
        interfaces.create_cable(near, far)
