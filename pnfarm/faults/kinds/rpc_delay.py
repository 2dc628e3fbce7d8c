"""rpc-delay: acyclic messages leave late, so that the drive's stack seems slow."""

from __future__ import annotations

from pnfarm.faults.effects.late import LATE_PARAMS, LateMessages
from pnfarm.faults.kind import EACH, InjectionKind

__all__ = ["KIND"]

KIND = InjectionKind(
    "rpc-delay",
    "connection",
    "Acyclic messages of the drive (connections, parameters, control) leave late, in order.",
    "a message that is late",
    LateMessages,
    LATE_PARAMS,
    takes=EACH,
    place=100,
    wire="UDP datagrams of the drive are late, in order.",
    reports="A slower start-up; requests are repeated when the delay exceeds the controller's retry time.",
)
