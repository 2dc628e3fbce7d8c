"""A drive's address at an interface that is down, against a kernel that answers as Linux does; nothing is changed."""

import errno
import os
import struct
from ipaddress import IPv4Address, IPv4Interface

import pytest

from pnfarm.errors import EnvironmentError_
from pnfarm.links.kernel import network

INTERFACE = IPv4Interface("10.77.0.11/24")
NEW_ROUTE, DEL_ROUTE = 24, 25
#: linux/rtnetlink.h: scopes of a route.
HOST = 254


class Kernel:
    """Answers in place of the socket.  ``broken``: refuses every route."""

    def __init__(self, *, broken=False):
        self.broken = broken
        self.asked = []
        self._code = 0

    def send(self, request):
        (_, kind, *_rest) = struct.unpack_from("=IHHII", request)
        scope = request[16 + 6]
        # fib_semantics.c, fib_check_nh: a route over an interface that is down; one of the host itself needs no other
        down = kind == NEW_ROUTE and scope != HOST
        self._code = -errno.EINVAL if self.broken and kind == NEW_ROUTE else -errno.ENETDOWN if down else 0
        self.asked.append(kind)

    def recv(self, _):
        return struct.pack("=IHHIIi", 20, 2, 0, 1, 0, self._code)

    def close(self):
        pass


@pytest.fixture
def kernel(monkeypatch):
    made = Kernel()

    def enter(self):
        self._socket = made
        return self

    monkeypatch.setattr(network._Netlink, "__enter__", enter)
    return made


def test_a_drive_may_be_switched_on_while_its_cable_is_pulled(kernel):
    network.attach(7, "pf0000-0", INTERFACE, IPv4Address("10.77.0.1"))
    # the address is in no table of the host's nevertheless
    assert kernel.asked.count(DEL_ROUTE) == 2


def test_any_other_refusal_is_told(kernel):
    kernel.broken = True
    with pytest.raises(EnvironmentError_, match=os.strerror(errno.EINVAL)):
        network.attach(7, "pf0000-0", INTERFACE)
