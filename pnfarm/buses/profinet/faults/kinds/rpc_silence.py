"""rpc-silence: calls over UDP are lost."""

from __future__ import annotations

from pnfarm.buses.profinet.faults.frame_class import RPC
from pnfarm.buses.profinet.faults.frames import ProfinetFramesEffect
from pnfarm.faults.kind import EACH, EVERY_DIRECTION, InjectionKind

__all__ = ["KINDS"]


class RpcSilence(ProfinetFramesEffect):
    """In both directions unless given otherwise."""

    acyclic = frozenset({RPC})


KINDS = (
    InjectionKind(
        "rpc-silence",
        "connection",
        "Connect, parameter and control calls (RPC over UDP) are lost; cyclic data and DCP go on.",
        "a datagram that is lost; `count` holds for each direction",
        RpcSilence,
        directions=EVERY_DIRECTION,
        takes=EACH,
        place=50,
        wire="No UDP datagrams of RPC in either direction.",
        reports="A running connection stays; jobs time out, and a new connection is not made.",
    ),
)
