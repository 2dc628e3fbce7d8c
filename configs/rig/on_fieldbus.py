"""Runs a command in a container with the fieldbus's interface named: ``on_fieldbus.py SUBNET COMMAND [ARGUMENT ...]``.

A container in two networks has eth0 and eth1 in an order that its engine chooses.  The one with a route to SUBNET is
the fieldbus's: its name goes into the environment, as ``--parent`` of ``pnfarm up`` and ``--interface`` of
``pnfarm plc``.
"""

from __future__ import annotations

import os
import socket
import struct
import sys
from ipaddress import IPv4Network
from pathlib import Path

#: Settings of `pnfarm up` and `pnfarm plc` that name the interface.
NAMED = ("PNFARM_UP_LINK_PARENT", "PNFARM_PLC_INTERFACE")


def interface_of(subnet: IPv4Network, routes: str) -> str | None:
    """The interface with a direct route to ``subnet``, by the text of /proc/net/route (addresses in host order)."""
    for line in routes.splitlines()[1:]:
        name, destination, _, _, _, _, _, mask = line.split()[:8]
        address, width = (socket.inet_ntoa(struct.pack("=L", int(field, 16))) for field in (destination, mask))
        if IPv4Network(f"{address}/{width}") == subnet:
            return name
    return None


def main(arguments: list[str]) -> None:
    """Become the command; exit with 4 when this container is not in that network."""
    subnet, *command = arguments
    name = interface_of(IPv4Network(subnet), Path("/proc/net/route").read_text("ascii"))
    if name is None:
        sys.stderr.write(f"this container has no interface in {subnet}: put it into the network `fieldbus`\n")
        sys.exit(4)
    os.execvpe(command[0], command, {**os.environ, **dict.fromkeys(NAMED, name)})  # noqa: S606 - no shell needed


if __name__ == "__main__":
    main(sys.argv[1:])
