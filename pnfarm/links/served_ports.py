"""Addresses and ports of stations, kept open: what the machine refuses is asked for again each second."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Protocol

from pnfarm.errors import EnvironmentError_

if TYPE_CHECKING:
    from collections.abc import Callable

    from pnfarm.links.sockets import SocketCarrier
    from pnfarm.wire.endpoint import Services

__all__ = ["ServedPorts"]

#: Between two tries.
AGAIN_NS = 1_000_000_000


class _Gate(Protocol):
    """Injected faults on the streams of a port."""

    def restart(self, port: int) -> None: ...

    def refuses(self, port: int) -> bool: ...


class ServedPorts:
    """``refused`` is called with a port, the reason and the time, once until it is open.

    Until ``may_wait`` is set a refusal is an error: the farm has not started.
    """

    def __init__(self, carrier: SocketCarrier, gate: _Gate, refused: Callable[[int, str, int], None]) -> None:
        self.may_wait = False
        self._carrier = carrier
        self._gate = gate
        self._refused = refused
        self._wanted: dict[int, tuple[int, Services]] = {}
        #: When a port that the machine refused is tried again.
        self._again: dict[int, int] = {}

    def next_deadline(self, port: int) -> int | None:
        """When :meth:`keep` is due for a port of which nothing changes."""
        return self._again.get(port)

    def keep(self, port: int, wanted: tuple[int, Services] | None, now: int) -> None:
        """Give a port its address and what it listens to; ``wanted`` has the number of the start. None: nothing."""
        is_same = wanted == self._wanted.get(port)
        if is_same and self._again.get(port, now + 1) > now:
            return
        if is_same and self._carrier.serves(port):
            # only its listeners are not open again
            self.refuse(port, refused=self._gate.refuses(port), now=now)
            return
        # its streams are gone
        self._gate.restart(port)
        if wanted is None:
            del self._wanted[port]
            self._again.pop(port, None)
            self._carrier.withdraw(port)
            return
        self._wanted[port] = wanted
        self._ask(port, partial(self._carrier.serve, port, wanted[1]), now)
        if self._gate.refuses(port):
            self.refuse(port, refused=True, now=now)

    def refuse(self, port: int, *, refused: bool, now: int) -> None:
        """Refuse further streams of a port, or take them again; nothing where it is not open."""
        if self._carrier.serves(port):
            self._ask(port, partial(self._carrier.refuse, port, refused=refused), now)

    def _ask(self, port: int, work: Callable[[], None], now: int) -> None:
        try:
            work()
        except EnvironmentError_ as exc:
            if not self.may_wait:
                raise
            if port not in self._again:
                self._refused(port, str(exc), now)
            self._again[port] = now + AGAIN_NS
            return
        self._again.pop(port, None)
