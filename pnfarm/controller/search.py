"""Finding drives and giving them their addresses: the controller's use of DCP.

A question by name reaches every station of the network, so that a thousand of them are a million copies.  Where
many drives are sought in one instant, everybody is asked to answer once instead (a roll call).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from pnfarm.controller.session import DeviceSession, SessionState, Sign
from pnfarm.protocols.profinet.dcp_client import DcpClient, IdentifyAnswered, IdentifyFinished, SetFinished
from pnfarm.protocols.profinet.wire.dcp_blocks import NameBlock

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pnfarm.protocols.profinet.dcp_client import DcpClientEvent

__all__ = ["Outcome", "Search"]

#: How long an Identify by name waits for its one answer.
SEARCH_NS = 500_000_000
#: More drives than this, sought at once, make a roll call.
ROLL_CALL = 16
#: Answers to a roll call that come within 10 ms (the unit of DCP's response delay).
ROLL_CALL_BURST = 16


@dataclass(frozen=True, slots=True)
class Outcome:
    """What DCP means for a session; ``answer`` is there when the drive was found, ``reason`` when it was not."""

    session: DeviceSession
    sign: Sign
    answer: IdentifyAnswered | None = None
    reason: str = ""


class Search:
    """``stations`` is how many drives the controller has in all: it spreads the answers to a roll call."""

    def __init__(self, dcp: DcpClient, stations: int) -> None:
        self._dcp = dcp
        self._stations = stations
        self._sought: list[DeviceSession] = []
        self._by_xid: dict[int, DeviceSession] = {}
        self._roll_calls: dict[int, dict[str, DeviceSession]] = {}

    def seek(self, session: DeviceSession) -> None:
        """Look for this drive; the question goes out with :meth:`ask`."""
        self._sought.append(session)

    def ask(self, now: int) -> None:
        """Send the Identify requests for all that were sought since the last call."""
        sought, self._sought = self._sought, []
        if len(sought) > ROLL_CALL:
            xid = self._dcp.identify(now=now, delay_factor=max(1, self._stations // ROLL_CALL_BURST))
            self._roll_calls[xid] = {session.plan.name: session for session in sought}
            return
        for session in sought:
            xid = self._dcp.identify([NameBlock(session.plan.name)], now=now, window_ns=SEARCH_NS, expected=1)
            self._by_xid[xid] = session

    def address(self, session: DeviceSession, now: int) -> None:
        """Give a found drive its address, until its next power cycle."""
        xid = self._dcp.set_ip(session.mac, session.plan.ip, session.plan.gateway, permanent=False, now=now)
        self._by_xid[xid] = session

    def outcomes(self, event: DcpClientEvent) -> Iterator[Outcome]:
        """What an event of the DCP client means, session by session."""
        if not isinstance(event, (IdentifyAnswered, IdentifyFinished, SetFinished)):
            return
        called = self._roll_calls.get(event.xid)
        if called is not None:
            if isinstance(event, IdentifyAnswered):
                session = called.get(event.info.name or "")
                if session is not None:
                    yield from self._found(session, event)
            elif isinstance(event, IdentifyFinished):
                del self._roll_calls[event.xid]
                for session in called.values():
                    yield from self._missed(session)
            return
        session = self._by_xid.get(event.xid)
        if session is None:
            return
        if isinstance(event, IdentifyAnswered):
            yield from self._found(session, event)
            return
        del self._by_xid[event.xid]
        if isinstance(event, IdentifyFinished):
            yield from self._missed(session)
        elif event.error is not None:
            yield Outcome(session, Sign.MISSED, reason=f"Set IP: {event.error}")
        else:
            yield Outcome(session, Sign.ADDRESSED)

    def _found(self, session: DeviceSession, event: IdentifyAnswered) -> Iterator[Outcome]:
        if session.state is SessionState.SEARCH:
            ready = not session.plan.assign_ip or event.info.ip == session.plan.ip.ip
            yield Outcome(session, Sign.FOUND_READY if ready else Sign.FOUND, event)

    def _missed(self, session: DeviceSession) -> Iterator[Outcome]:
        if session.state is SessionState.SEARCH:
            yield Outcome(session, Sign.MISSED, reason="no station of this name answers")
