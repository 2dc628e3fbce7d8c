"""no-application-ready: the drive never sends ApplicationReady."""

from __future__ import annotations

from pnfarm.buses.profinet.faults.kinds.late_application_ready import LateReady
from pnfarm.faults.kind import EACH, InjectionKind

__all__ = ["KIND"]

KIND = InjectionKind(
    "no-application-ready",
    "connection",
    "After parametrisation the drive never sends ApplicationReady.",
    "a connection whose ApplicationReady is withheld",
    LateReady,
    takes=EACH,
    preset={"delay": None},
    place=30,
    wire="No ApplicationReady request after the end of parametrisation.",
    reports="The start-up does not end; the controller's monitoring ends the connection and sets it up again.",
)
