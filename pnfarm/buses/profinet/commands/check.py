"""PROFINET's part of ``pnfarm import --check``: asks the stations at an interface."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ipaddress import IPv4Interface

    from pnfarm.buses.checking import CheckAnswer, CheckQuestion

__all__ = ["read_stations"]


async def read_stations(question: CheckQuestion) -> CheckAnswer:
    """What the stations say of themselves."""
    import os

    from pnfarm.buses.profinet.commands.asking import ask_stations
    from pnfarm.buses.profinet.controller.station_reader import StationReader

    own = _own(question.interface)

    def make(mac: bytes) -> StationReader:
        return StationReader(question.expected, mac, own, os.urandom(16), question.seconds)

    return (await ask_stations(question.interface, own, make)).answer()


def _own(interface: str) -> IPv4Interface | None:
    """The interface's address; None for one without: names and idents are compared nevertheless."""
    from pnfarm.errors import ConfigError
    from pnfarm.links.kernel.addresses import kernel_address

    try:
        return kernel_address(interface)
    except ConfigError:
        return None
