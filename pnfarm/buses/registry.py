"""The only list of all buses, and what they provide together.

It imports little: the command line gets the buses' commands from it before it knows which of them runs.
"""

from __future__ import annotations

from contextlib import contextmanager
from functools import cache
from types import MappingProxyType
from typing import TYPE_CHECKING

from pnfarm.buses.checking import CheckingBus
from pnfarm.buses.ethernetip.bus import ETHERNETIP
from pnfarm.buses.line_parameters import LineParameterBus
from pnfarm.buses.profibus.bus import PROFIBUS
from pnfarm.buses.profinet.bus import PROFINET
from pnfarm.buses.search import SearchBus
from pnfarm.captures.families import filters_of
from pnfarm.errors import ConfigError

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from pnfarm.buses.bus import Bus, Segment
    from pnfarm.buses.ethernetip.device.device import EthernetIpDevice
    from pnfarm.buses.ethernetip.device.segment import EthernetIpSegment
    from pnfarm.buses.profibus.device.device import ProfibusDevice
    from pnfarm.buses.profibus.device.segment import ProfibusSegment
    from pnfarm.buses.profinet.device.device import ProfinetDevice
    from pnfarm.buses.profinet.device.segment import ProfinetSegment
    from pnfarm.captures.decoder import Decoder
    from pnfarm.faults.catalogue import Catalogue
    from pnfarm.station.device import Device
    from pnfarm.terminal.command import Command

    # what a bus finds by its name is of the types that it promises
    _DEVICES: tuple[type[Device], ...] = (EthernetIpDevice, ProfibusDevice, ProfinetDevice)
    _SEGMENTS: tuple[type[Segment], ...] = (EthernetIpSegment, ProfibusSegment, ProfinetSegment)

__all__ = [
    "BUSES",
    "bus",
    "checking",
    "commands",
    "decoder",
    "fault_kinds",
    "frame_filters",
    "line_parameter_bus",
    "registered",
    "searches",
]  # fmt: skip

_buses: dict[str, Bus] = {one.name: one for one in (PROFINET, ETHERNETIP, PROFIBUS)}
#: By name.
BUSES: Mapping[str, Bus] = MappingProxyType(_buses)


def bus(name: str) -> Bus:
    """The bus of this name; raises :class:`ConfigError` for an unknown one."""
    found = BUSES.get(name)
    if found is None:
        raise ConfigError(f"there is no bus {name!r}; there are {', '.join(BUSES)}")
    return found


@contextmanager
def registered(further: Bus) -> Iterator[None]:
    """Add a bus in this process while the block runs: for tests of a bus that the package does not have.

    What was made inside (a farm, an application) keeps what it took from the bus.  Raises :class:`ValueError` where
    the name is taken.
    """
    if further.name in _buses:
        raise ValueError(f"there is a bus {further.name!r} already")
    _buses[further.name] = further
    fault_kinds.cache_clear()
    try:
        yield
    finally:
        del _buses[further.name]
        fault_kinds.cache_clear()


@cache
def fault_kinds() -> Catalogue:
    """Every kind that can be injected into a drive: those for any drive, and those of each bus."""
    from pnfarm.faults.catalogue import Catalogue, neutral

    kinds = [*neutral(), *(kind for one in BUSES.values() for kind in one.fault_kinds())]
    return Catalogue(kinds, {one.name: one.kinds_here() for one in BUSES.values()})


def commands() -> list[Command]:
    """The commands that the buses add to the program."""
    return [command for one in BUSES.values() for command in one.commands()]


def searches() -> dict[str, SearchBus]:
    """The buses whose devices can be found on a wire, by name."""
    return {name: one for name, one in BUSES.items() if isinstance(one, SearchBus)}


def checking() -> dict[str, CheckingBus]:
    """The buses whose plants can be compared with a farm file, by name."""
    return {name: one for name, one in BUSES.items() if isinstance(one, CheckingBus)}


def line_parameter_bus() -> LineParameterBus:
    """The bus whose stations can be asked over a serial line.  Raises :class:`ConfigError` where there is none."""
    for one in BUSES.values():
        if isinstance(one, LineParameterBus):
            return one
    raise ConfigError("no bus has a serial line on which parameters could be asked for")


def frame_filters() -> dict[str, frozenset[str]]:
    """The words by which a capture's frames are chosen, and the families of frames that each stands for."""
    return filters_of(family for one in BUSES.values() for family in one.frame_families)


def decoder(*, gap_cycles: float = 3.0, every_frame: bool = False) -> Decoder:
    """The decoder of one capture; the options are those of :class:`~pnfarm.captures.packet.Capture`."""
    from pnfarm.captures.decoder import Decoder
    from pnfarm.captures.packet import Capture

    capture = Capture(gap_cycles=gap_cycles, every_frame=every_frame)
    return Decoder(capture, {name: one.decoder(capture) for name, one in BUSES.items()})
