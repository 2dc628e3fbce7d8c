"""A PROFIBUS station as it can be compared: its address and ident number, of a farm file and of a line."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.buses.checking import CheckAnswer, StationFacts
from pnfarm.errors import ConfigError, DecodeError
from pnfarm.protocols.profibus.gsd.station import EMPTY_SLOT
from pnfarm.protocols.profibus.line_search import ADDRESSES, LineSearch
from pnfarm.protocols.profibus.wire.telegram import parse_telegram

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pnfarm.buses.profibus.controller.plan import DevicePlan
    from pnfarm.drives.description.model import Model
    from pnfarm.links.base import Link, Port

__all__ = ["SearchOnLine", "checked_line", "facts_of", "planned_facts"]


def facts_of(config: Any, model: Model | None, *, asked: bool = False) -> StationFacts:
    """With the identifiers of a device's modules, which its master asks for, and which it takes alone."""
    del asked
    ident = config.described.plugged.gsd.ident if model is None else model.profidrive.identity.device_id
    unknown = ("the file does not say its address",) if config.address is None else ()
    address = "" if config.address is None else str(config.address)
    modules = None
    if model is None:
        identifiers = config.described.plugged.identifiers.rstrip(EMPTY_SLOT)
        modules = {"configuration": (identifiers.hex(" ").upper(),)}
    return StationFacts(config.name, address, {"ident": f"0x{ident:04X}"}, modules=modules, remarks=unknown)


def planned_facts(plan: DevicePlan) -> StationFacts:
    return StationFacts(plan.name, str(plan.slave.address), {"ident": f"0x{plan.slave.ident:04X}"})


class SearchOnLine:
    """See :class:`pnfarm.buses.checking.CheckedLine`."""

    def __init__(self, link: Link, port: Port, search: LineSearch) -> None:
        self.link, self.port, self.search = link, port, search
        link.set_receiver(self.receive)

    @property
    def done(self) -> bool:
        return self.search.done

    def start(self, now: int) -> None:
        self.search.start(now)

    def receive(self, port: int, frame: bytes, now: int) -> None:
        """One telegram of the line; the link counts what is none."""
        del port
        try:
            telegram = parse_telegram(frame)
        except DecodeError:
            return
        self.search.receive(telegram, now)
        self.service(now)

    def service(self, now: int) -> None:
        self.search.handle_timeout(now)
        if (octets := self.search.to_send()) is not None:
            self.link.send(self.port.index, octets)
            self.search.sent(len(octets), now)

    def next_deadline(self) -> int | None:
        return self.search.next_deadline()

    def answer(self) -> CheckAnswer:
        """Of a line whose master is at work, idents are known of those slaves alone that gave it a diagnosis."""
        unread = ("its ident was not heard",)
        stations = [
            StationFacts(f"station {address}", str(address), remarks=unread)
            if ident is None
            else StationFacts(f"station {address}", str(address), {"ident": f"0x{ident:04X}"})
            for address, ident in sorted(self.search.found.items())
        ]
        if (master := self.search.master) is None:
            return CheckAnswer(stations)
        return CheckAnswer(stations, (f"master {master} is active on this line: its slaves were not read",))


def checked_line(link: Link, port: Port, expected: Sequence[StationFacts], own: int, baud: int) -> SearchOnLine:
    """Raises :class:`ConfigError`."""
    if own not in ADDRESSES:
        raise ConfigError(f"{own} is not an own address, which is 0 to {ADDRESSES[-1]}")
    if str(own) in {one.address for one in expected}:
        raise ConfigError(f"the own address {own} is that of a station of the file: choose another one")
    addresses = [int(one.address) for one in expected if one.address]
    return SearchOnLine(link, port, LineSearch(own, baud, addresses))
