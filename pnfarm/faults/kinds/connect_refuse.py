"""connect-refuse: the drive refuses connections."""

from __future__ import annotations

from typing import Any

from pnfarm.faults.effects.effect import ChanceEffect, Held
from pnfarm.faults.effects.requests import CONNECT_REQUESTS
from pnfarm.faults.kind import EACH, InjectionKind

__all__ = ["KIND"]


class ConnectRefuse(ChanceEffect):
    """Each request for cyclic data, as the drive's bus refuses it."""

    requests = CONNECT_REQUESTS

    def prepare(self) -> None:
        super().prepare()
        self._refusal = self.requests.refusal(self.values)

    def _asked(self, now: int) -> Any:
        return self._refusal if self.occurs(now) else None

    def held(self) -> Held:
        return self.requests.hooks, self._asked


KIND = InjectionKind(
    "connect-refuse",
    "connection",
    "The drive refuses connections, with an error code of its bus.",
    "a request for a connection that is refused",
    ConnectRefuse,
    takes=EACH,
    place=20,
    wire="Requests for a connection are answered with an error code.",
    reports=("The device stays failed; the diagnosis shows the connection as refused. A controller tries repeatedly."),
)
