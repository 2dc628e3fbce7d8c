"""A 100 Mbit/s network card for a program that looks at the speed of its interface, at the end of a veth cable.

``python peer_cable.py TAP VETH``: makes a TAP that calls itself a copper port of 100 Mbit/s, full duplex, says ``up``
and carries frames between it and the veth, which knows no such speed, until its standard input ends.  A VLAN tag that
comes in is lost, as it is for every reader of a packet socket.
"""

# ruff: noqa: T201 - what it prints is its answer

from __future__ import annotations

import array
import fcntl
import os
import select
import socket
import struct
import subprocess
import sys

TUNSETIFF = 0x400454CA
IFF_TAP_NO_PI = 0x1002
SIOCETHTOOL = 0x8946
ETHTOOL_SSET = 2
ETH_P_ALL = 3
PACKET_OUTGOING = 4


def open_tap(name: str) -> int:
    tap = os.open("/dev/net/tun", os.O_RDWR)
    fcntl.ioctl(tap, TUNSETIFF, struct.pack("16sH22x", name.encode(), IFF_TAP_NO_PI))
    # linux/ethtool.h, struct ethtool_cmd: command, ..., speed, duplex (1 full), port (0 twisted pair), ...
    wanted = array.array("B", struct.pack("=IIIHBB28x", ETHTOOL_SSET, 0, 0, 100, 1, 0))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as control:
        address, _ = wanted.buffer_info()
        fcntl.ioctl(control, SIOCETHTOOL, struct.pack("16sQ16x", name.encode(), address))
    subprocess.run(["ip", "link", "set", name, "addrgenmode", "none", "up"], check=True)
    return tap


def main() -> None:
    tap_name, veth_name = sys.argv[1:3]
    tap = open_tap(tap_name)
    veth = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(ETH_P_ALL))
    veth.bind((veth_name, ETH_P_ALL))
    print("up", flush=True)
    while True:
        ready, _, _ = select.select([tap, veth, sys.stdin], [], [])
        if tap in ready:
            veth.send(os.read(tap, 2048))
        if veth in ready:
            frame, (_, _, kind, *_) = veth.recvfrom(2048)
            if kind != PACKET_OUTGOING:
                os.write(tap, frame)
        if sys.stdin in ready:
            return


if __name__ == "__main__":
    main()
