"""Frames of a client that asks stations at an interface, until it is done."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Protocol, TypeVar

import anyio

from pnfarm.buses.profinet.controller.record_client import TOOL_PORT
from pnfarm.links.base import PortSpec
from pnfarm.links.callbacks import raise_of_callbacks
from pnfarm.links.interface import InterfaceLink
from pnfarm.links.kernel.addresses import hold_ports

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable
    from ipaddress import IPv4Interface

__all__ = ["ask_stations"]


class _Asking(Protocol):
    """Sans-I/O: frames in and out, times in ns."""

    @property
    def done(self) -> bool: ...

    def start(self, now: int) -> None: ...

    def receive(self, frame: bytes, now: int) -> None: ...

    def to_send(self, now: int) -> Iterable[bytes]: ...

    def next_deadline(self) -> int | None: ...

    def handle_timeout(self, now: int) -> None: ...


_Client = TypeVar("_Client", bound=_Asking)


def _nothing(_: object) -> bool:
    return False


async def ask_stations(
    interface: str,
    own: IPv4Interface | None,
    make: Callable[[bytes], _Client],
    more: Callable[[_Client], bool] = _nothing,
) -> _Client:
    """The client that ``make`` makes of the interface's MAC address, once it is done and ``more`` gives it no work.

    With an address of its ``own`` it holds the UDP port that answers come to.
    """
    link = InterfaceLink(interface)
    held = [] if own is None else hold_ports(own, (TOOL_PORT,))
    woken = anyio.Event()
    try:
        (port,) = await link.open([PortSpec("tool", bytes(6))])
        client = make(port.mac)

        def send() -> None:
            for frame in client.to_send(time.monotonic_ns()):
                link.send(port.index, frame)

        def receive(_: int, frame: bytes, now: int) -> None:
            client.receive(frame, now)
            send()
            woken.set()

        link.set_receiver(receive)
        async with raise_of_callbacks():
            client.start(time.monotonic_ns())
            send()
            while not client.done or more(client):
                send()
                woken = anyio.Event()
                due = client.next_deadline()
                with anyio.move_on_after(None if due is None else max(0.0, (due - time.monotonic_ns()) / 1e9)):
                    await woken.wait()
                client.handle_timeout(time.monotonic_ns())
                send()
    finally:
        for sock in held:
            sock.close()
        with anyio.CancelScope(shield=True):
            await link.close()
    return client
