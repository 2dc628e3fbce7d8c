"""The serial lines of a farm or a controller, as its file asks for them."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from pnfarm.buses.bus import LineBus
from pnfarm.buses.registry import BUSES
from pnfarm.config.links import SerialLink as SerialSection
from pnfarm.errors import ConfigError
from pnfarm.farm.file.choice import bus_of, bus_of_devices
from pnfarm.links.serial.descriptor import PortLine, PtyLine, is_pty
from pnfarm.links.serial.link import SerialLink
from pnfarm.links.serial.tcp import ConnectLine, ListenLine

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pnfarm.config.links import LineWay
    from pnfarm.farm.file.reading import FarmConfig
    from pnfarm.links.serial.line import Line

__all__ = ["line_bus", "line_ways", "make_line", "make_lines"]

#: A pseudo terminal has neither rate nor parity; drivers want one that they know.
_PTY_BAUD = 38_400
#: Above this rate this process cannot keep what the bus permits, 0.1 ms and less: its user decides.
FASTEST_KEPT = 1_500_000
#: On a pty a late answer disturbs no other station, and at 1.5 Mbit/s an answer in a hundred would be missing.
FASTEST_KEPT_ON_PTY = 500_000


def line_bus(name: str) -> LineBus:
    """The bus with a line of this name.  Raises :class:`ConfigError`."""
    known: dict[str, LineBus] = {each: one for each, one in BUSES.items() if isinstance(one, LineBus)}
    if name not in known:
        raise ConfigError(f"no bus {name!r} has a serial line; those with one: {', '.join(known)}")
    return known[name]


def line_ways(config: FarmConfig) -> dict[str, LineWay]:
    """The lines of a file on this machine, by the names of their buses; none in memory."""
    link = config.link
    if isinstance(link, SerialSection):
        # all of its stations are on one bus
        buses = [*map(bus_of, config.drives), *map(bus_of_devices, config.devices)]
        return {bus.name: link for bus in buses[:1]}
    return dict(getattr(link, "lines", {}))


def make_line(way: LineWay, bus: LineBus) -> SerialLink:
    """The line that a file asks for, not open yet."""
    search = () if way.baud != "auto" else (way.rate, *(rate for rate in bus.baud_rates if rate != way.rate))
    # pieces of a telegram are apart by most at the lowest rate
    slowest = min(search, default=way.rate)
    return SerialLink(_way(way), bus.splitter(slowest), way.rate, search, partial(_latest_ns, way, bus))


def _latest_ns(way: LineWay, bus: LineBus, baud: int) -> int | None:
    """How late an answer may begin at this rate; None: any time."""
    match way.latest_answer:
        case "any":
            return None
        case "tsdr":
            return bus.longest_reply_ns(baud)
        case "auto":
            return bus.longest_reply_ns(baud) if baud <= _fastest_kept(way) else None
        case latest:
            return latest


def _fastest_kept(way: LineWay) -> int:
    if way.connect is not None or way.listen is not None or way.rfc2217 is not None:
        # what a network takes is not the slave's time
        return 0
    return FASTEST_KEPT if way.port is not None and not is_pty(way.port) else FASTEST_KEPT_ON_PTY


def make_lines(ways: Mapping[str, LineWay]) -> dict[str, SerialLink]:
    """Lines by the names of their buses.  Raises :class:`ConfigError`."""
    return {name: make_line(way, line_bus(name)) for name, way in ways.items()}


def _way(way: LineWay) -> Line:
    if way.port is not None:
        return PortLine(way.port, _PTY_BAUD if is_pty(way.port) else way.rate)
    if way.connect is not None:
        return ConnectLine(*_place(way.connect), baud=way.rate)
    if way.rfc2217 is not None:
        # its threads are loaded by those who have one
        from pnfarm.links.serial.rfc2217 import Rfc2217Line  # noqa: PLC0415

        return Rfc2217Line(*_place(way.rfc2217), way.rate)
    if way.listen is not None:
        return ListenLine(*_place(way.listen), baud=way.rate)
    return PtyLine(None if way.pty in {None, "auto"} else Path(str(way.pty)), baud=way.rate)


def _place(text: str) -> tuple[str, int]:
    host, _, port = text.rpartition(":")
    return host.strip("[]"), int(port)
