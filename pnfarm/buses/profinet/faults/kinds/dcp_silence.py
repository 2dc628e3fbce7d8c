"""dcp-silence: DCP is lost."""

from __future__ import annotations

from pnfarm.buses.profinet.faults.frame_class import DCP
from pnfarm.buses.profinet.faults.frames import ProfinetFramesEffect
from pnfarm.faults.kind import EACH, EVERY_DIRECTION, InjectionKind

__all__ = ["KIND"]


class DcpSilence(ProfinetFramesEffect):
    """In both directions unless given otherwise."""

    acyclic = frozenset({DCP})


KIND = InjectionKind(
    "dcp-silence",
    "connection",
    "The drive neither receives nor answers DCP: it is not found, named or addressed.",
    "a DCP frame that is lost; `count` holds for each direction",
    DcpSilence,
    directions=EVERY_DIRECTION,
    takes=EACH,
    place=60,
    wire="No DCP from the drive; requests are not answered.",
    reports="A running connection stays. Without one, the device is not found: it stays failed.",
)
