"""Finding drives and giving them their addresses: the controller's use of DCP.

The first station of a name is taken; others that answer to it within the search's time are reported (:class:`Outcome`).

An Identify by name reaches every station of the network, so that a thousand of them are a million copies.  Where
many drives are searched for at once, all stations are asked to answer once instead (a roll call).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from pnfarm.buses.profinet.controller.session import DeviceSession, SessionState, Sign
from pnfarm.protocols.profinet.dcp.client import (
    COLLECT_MARGIN_NS,
    DcpClient,
    IdentifyAnswered,
    IdentifyFinished,
    SetFinished,
)
from pnfarm.protocols.profinet.wire.dcp.blocks import NameBlock

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from pnfarm.protocols.profinet.dcp.client import DcpClientEvent

__all__ = ["Duplicate", "Outcome", "Search", "duplicate_names"]

#: How long an Identify by name waits for its one answer.
SEARCH_NS = 500_000_000
#: More drives than this, searched for at once, make a roll call, unless they are a small part of all.
ROLL_CALL = 16
SMALL_PART = 1 / 8
#: Stations of one name that are logged; further ones cannot fill the log.
MOST_TOLD = 8
#: Answers to a roll call that come within 10 ms (the unit of DCP's response delay).
ROLL_CALL_BURST = 16


@dataclass(frozen=True, slots=True)
class Outcome:
    """Result of DCP for a session; ``answer`` when the drive was found, ``reason`` when it was not."""

    session: DeviceSession
    sign: Sign
    answer: IdentifyAnswered | None = None
    reason: str = ""


@dataclass(frozen=True, slots=True)
class Duplicate:
    """Another station answers to the name of a session's drive."""

    session: DeviceSession
    macs: tuple[bytes, ...]

    def __str__(self) -> str:
        return _twice(self.session.plan.name, self.macs)


def _twice(name: str, macs: Iterable[bytes]) -> str:
    stations = " and ".join(mac.hex(":") for mac in macs)
    return f"the name {name} is given twice: {stations} answer to it; give each station a name of its own"


def duplicate_names(answers: Iterable[IdentifyAnswered]) -> list[str]:
    """A sentence for each name that more than one station answered with, in the order of the names."""
    stations: dict[str, dict[bytes, None]] = {}
    for answer in answers:
        if answer.info.name:
            stations.setdefault(answer.info.name, {})[answer.mac] = None
    return [_twice(name, macs) for name, macs in sorted(stations.items()) if len(macs) > 1]


@dataclass(slots=True)
class _Asked:
    """One Identify for one drive, and the stations that answered."""

    session: DeviceSession
    macs: list[bytes] = field(default_factory=list)


class Search:
    """``stations`` is how many drives the controller has in all: it spreads the answers to a roll call."""

    def __init__(self, dcp: DcpClient, stations: int) -> None:
        self._dcp = dcp
        self._stations = stations
        self._requested: list[DeviceSession] = []
        #: Requests by their Xid, and in each by the name that was asked for.
        self._asked: dict[int, dict[str, _Asked]] = {}
        self._addressed: dict[int, DeviceSession] = {}
        #: The Xid of the last roll call.
        self._roll_call = 0

    def seek(self, session: DeviceSession) -> None:
        """Search for this drive; the request goes out with :meth:`ask`."""
        self._requested.append(session)

    def ask(self, now: int) -> None:
        """Send the Identify requests for all drives of :meth:`seek` since the last call."""
        requested, self._requested = self._requested, []
        # where few are missing all others would answer again
        calls = len(requested) > max(ROLL_CALL, SMALL_PART * self._stations)
        if calls and self._roll_call in self._asked:
            # its answers are still coming in: a further one would have all stations answer again
            self._asked[self._roll_call] |= {session.plan.name: _Asked(session) for session in requested}
            return
        if calls:
            factor = max(1, self._stations // ROLL_CALL_BURST)
            self._roll_call = self._dcp.identify(now=now, delay_factor=factor, quiet_ns=COLLECT_MARGIN_NS)
            self._asked[self._roll_call] = {session.plan.name: _Asked(session) for session in requested}
            return
        for session in requested:
            # not over with the first answer: a second station of that name answers as well
            xid = self._dcp.identify([NameBlock(session.plan.name)], now=now, window_ns=SEARCH_NS)
            self._asked[xid] = {session.plan.name: _Asked(session)}

    def address(self, session: DeviceSession, now: int) -> None:
        """Give a found drive its address, until its next power cycle."""
        xid = self._dcp.set_ip(session.mac, session.plan.ip, session.plan.gateway, permanent=False, now=now)
        self._addressed[xid] = session

    def outcomes(self, event: DcpClientEvent) -> Iterator[Outcome | Duplicate]:
        """Results of an event of the DCP client, session by session."""
        match event:
            case IdentifyAnswered():
                requested = self._asked.get(event.xid, {})
                # an answer to a request for one name is for that name
                asked = next(iter(requested.values())) if len(requested) == 1 else requested.get(event.info.name or "")
                if asked is not None:
                    yield from self._answered(asked, event)
            case IdentifyFinished():
                for asked in self._asked.pop(event.xid, {}).values():
                    if not asked.macs and asked.session.state is SessionState.SEARCH:
                        yield Outcome(asked.session, Sign.MISSED, reason="no station of this name answers")
            case SetFinished():
                session = self._addressed.pop(event.xid, None)
                if session is not None and event.error is not None:
                    yield Outcome(session, Sign.MISSED, reason=f"Set IP: {event.error}")
                elif session is not None:
                    yield Outcome(session, Sign.ADDRESSED)
            case _:
                pass

    def _answered(self, asked: _Asked, event: IdentifyAnswered) -> Iterator[Outcome | Duplicate]:
        if len(asked.macs) == MOST_TOLD:
            return
        asked.macs.append(event.mac)
        session = asked.session
        if len(asked.macs) > 1:
            yield Duplicate(session, tuple(asked.macs))
        elif session.state is SessionState.SEARCH:
            ready = not session.plan.assign_ip or event.info.ip == session.plan.ip.ip
            yield Outcome(session, Sign.FOUND_READY if ready else Sign.FOUND, event)
