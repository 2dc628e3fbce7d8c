"""A private network namespace per test, made and left again by the test process itself."""

from __future__ import annotations

import contextlib
import ctypes
import os
import subprocess
import time

import pytest

CLONE_NEWNET = 0x40000000
_libc = ctypes.CDLL(None, use_errno=True)


@pytest.fixture
def namespace():
    """Moves this thread into an empty network namespace; the kernel removes it with everything in it afterwards."""
    outside = os.open("/proc/thread-self/ns/net", os.O_RDONLY | os.O_CLOEXEC)
    try:
        if _libc.unshare(CLONE_NEWNET) != 0:
            pytest.skip(f"needs a private network namespace, so root: {os.strerror(ctypes.get_errno())}")
        try:
            yield
        finally:
            assert _libc.setns(outside, CLONE_NEWNET) == 0
    finally:
        os.close(outside)


@pytest.fixture
def ip(namespace):
    """Runs ``ip`` in the namespace: how a user looks at it."""

    def run(*arguments: str) -> str:
        return subprocess.run(["ip", *arguments], check=True, capture_output=True, text=True).stdout

    try:
        run("-V")
    except FileNotFoundError:
        pytest.skip("needs the tool `ip` (iproute2)")
    return run


@pytest.fixture
def frames_pass(ip):
    """Waits until frames pass: before, the kernel drops what is sent through an interface that was set up."""

    def wait(*interfaces: str) -> None:
        end = time.monotonic() + 10.0
        while not all("state UP" in ip("-o", "link", "show", interface) for interface in interfaces):
            assert time.monotonic() < end
            time.sleep(0.002)

    return wait


@pytest.fixture
def cable(ip, frames_pass):
    """A veth pair ``plc0`` <-> ``nic0``, both up: a NIC and what is plugged into it."""
    ip("link", "add", "nic0", "type", "veth", "peer", "name", "plc0")
    for end in ("nic0", "plc0"):
        ip("link", "set", end, "addrgenmode", "none")
        ip("link", "set", end, "up")
    frames_pass("nic0", "plc0")
    return "nic0", "plc0"


@contextlib.contextmanager
def raw_socket(interface: str, ethertype: int = 0x0003):
    """A packet socket at one interface, with a short patience."""
    import socket

    with socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(ethertype)) as sock:
        sock.bind((interface, ethertype))
        sock.settimeout(2.0)
        yield sock


@pytest.fixture
def raw():
    return raw_socket
