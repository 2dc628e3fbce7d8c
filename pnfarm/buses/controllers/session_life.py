"""The life of sessions on any bus: a table of transitions, and what follows from a connection and its loss."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Any, ClassVar, Generic, TypeVar

from pnfarm.buses.controllers.session import STOPPED, Session

if TYPE_CHECKING:
    from collections.abc import Mapping
    from enum import Enum, StrEnum

    from pnfarm.station.event import Event
    from pnfarm.station.event_log import EventLog

__all__ = ["RETRY_NS", "Life"]

#: Without `reconnect`, a station that was never connected is tried again after this time.
RETRY_NS = 1_000_000_000

S = TypeVar("S", bound=Session)


class Life(ABC, Generic[S]):
    """``touched`` holds the sessions that were acted on; the controller carries what their machines send.

    ``transitions``: (state, sign) to the next state and the name of an action, empty for none; the action is a method
    ``_do_NAME(session, now)``.
    """

    transitions: ClassVar[Mapping[tuple[Any, Any], tuple[Any, str]]]

    def __init__(self, log: EventLog) -> None:
        self._log = log
        self.touched: dict[int, S] = {}

    def touch(self, session: S) -> None:
        self.touched[session.index] = session

    def note(self, session: S, event: Event, now: int) -> None:
        """Report an event of a session's station."""
        self._log.record(now, session.plan.name, event)

    def sign(self, session: S, sign: Enum, now: int) -> None:
        """The only writer of a session's state."""
        row = self.transitions.get((session.state, sign))
        if row is None:
            return
        before = session.state
        session.state, action = row
        self.moved(session, before)
        if action:
            getattr(self, f"_do_{action}")(session, now)
        self.touch(session)

    def moved(self, session: S, before: StrEnum) -> None:
        """A session has another state, or the same again; its action has not begun."""

    @abstractmethod
    def timed(self, session: S, now: int) -> None:
        """What a session waits for is due."""

    @abstractmethod
    def expired(self, session: S, now: int) -> None:
        """No cyclic data came for longer than the time to wait."""

    def pause(self, session: S, now: int, *, doublings: int = 0) -> None:
        """Wait before the next attempt, or for ever after a loss without `reconnect`."""
        after = session.plan.reconnect_after_ns
        if after is None and session.measures.connects:
            session.state, session.due_ns = type(session.state)(STOPPED), None
            return
        session.due_ns = now + ((RETRY_NS if after is None else after) << doublings)
