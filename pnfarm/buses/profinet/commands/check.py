"""PROFINET's part of ``pnfarm import --check``: asks the stations at an interface."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ipaddress import IPv4Interface

    from pnfarm.buses.checking import CheckAnswer, CheckQuestion

__all__ = ["read_stations"]


async def read_stations(question: CheckQuestion) -> CheckAnswer:
    """Frames in and out of a reader until it is done."""
    import os
    import time

    import anyio

    from pnfarm.buses.profinet.controller.record_client import TOOL_PORT
    from pnfarm.buses.profinet.controller.station_reader import StationReader
    from pnfarm.links.base import PortSpec
    from pnfarm.links.callbacks import raise_of_callbacks
    from pnfarm.links.interface import InterfaceLink
    from pnfarm.links.kernel.addresses import hold_ports

    link = InterfaceLink(question.interface)
    held = []
    woken = anyio.Event()
    try:
        (port,) = await link.open([PortSpec("check", bytes(6))])
        own = _own(question.interface)
        held = [] if own is None else hold_ports(own, (TOOL_PORT,))
        reader = StationReader(question.expected, port.mac, own, os.urandom(16), question.seconds)

        def send() -> None:
            for frame in reader.to_send(time.monotonic_ns()):
                link.send(port.index, frame)

        def receive(_: int, frame: bytes, now: int) -> None:
            reader.receive(frame, now)
            send()
            woken.set()

        link.set_receiver(receive)
        async with raise_of_callbacks():
            reader.start(time.monotonic_ns())
            send()
            while not reader.done:
                woken = anyio.Event()
                due = reader.next_deadline()
                with anyio.move_on_after(None if due is None else max(0.0, (due - time.monotonic_ns()) / 1e9)):
                    await woken.wait()
                reader.handle_timeout(time.monotonic_ns())
                send()
    finally:
        for sock in held:
            sock.close()
        with anyio.CancelScope(shield=True):
            await link.close()
    return reader.answer()


def _own(interface: str) -> IPv4Interface | None:
    """The interface's address; None for one without: names and idents are compared nevertheless."""
    from pnfarm.errors import ConfigError
    from pnfarm.links.kernel.addresses import kernel_address

    try:
        return kernel_address(interface)
    except ConfigError:
        return None
