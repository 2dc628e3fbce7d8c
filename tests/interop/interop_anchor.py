"""Holds two joined network namespaces open: ``farm`` with ``nic0``, ``peer`` with ``plc0``, a veth cable between them.

Run as a program. It prints one line of JSON with the process ids that hold the namespaces, then waits for the end of
its standard input: when whoever started it ends, in whatever way, the namespaces and all in them vanish.
"""

# ruff: noqa: T201 - what it prints is its answer

from __future__ import annotations

import json
import os
import subprocess
import sys

from pnfarm.errors import EnvironmentError_
from pnfarm.links.kernel.sandbox import enter_sandbox

CANNOT = 4


def ip(*arguments: str) -> None:
    subprocess.run(["ip", *arguments], check=True, capture_output=True)


def wait_for_end() -> None:
    while sys.stdin.buffer.read(4096):
        pass


def hold_farm(ready: int) -> None:
    """The child: a second namespace beside the parent's."""
    enter_sandbox()
    os.write(ready, b"1")
    wait_for_end()


def main() -> int:
    try:
        enter_sandbox()
    except EnvironmentError_ as exc:
        print(json.dumps({"cannot": str(exc)}), flush=True)
        return CANNOT
    here, there = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(here)
        hold_farm(there)
        os._exit(0)
    os.close(there)
    if os.read(here, 1) != b"1":
        print(json.dumps({"cannot": "a second private network namespace could not be made"}), flush=True)
        return CANNOT
    ip("link", "add", "plc0", "type", "veth", "peer", "name", "nic0", "netns", str(child))
    # no IPv6, or the kernel speaks neighbour discovery between the frames that a test looks at
    ip("link", "set", "plc0", "addrgenmode", "none", "up")
    enter = ["nsenter", f"--net=/proc/{child}/ns/net", "ip", "link", "set", "nic0", "addrgenmode", "none", "up"]
    subprocess.run(enter, check=True, capture_output=True)
    print(json.dumps({"peer": os.getpid(), "farm": child}), flush=True)
    wait_for_end()
    os.waitpid(child, 0)
    return 0


if __name__ == "__main__":
    sys.exit(main())
