"""rpc-silence: acyclic messages are lost."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.faults.effects.frames import FramesEffect
from pnfarm.faults.effects.wire import MESSAGES
from pnfarm.faults.gate.gate import GateRule
from pnfarm.faults.kind import EACH, EVERY_DIRECTION, InjectionKind

if TYPE_CHECKING:
    from pnfarm.faults.gate.gate import FrameClasses

__all__ = ["KIND"]


class RpcSilence(FramesEffect):
    """In both directions unless given otherwise."""

    messages = MESSAGES

    def acts_on(self) -> tuple[int | None, FrameClasses | None]:
        return None, self.messages.messages

    def rule(self, *args: Any, **fields: Any) -> GateRule:
        return GateRule(*args, of_messages=True, **fields)


KIND = InjectionKind(
    "rpc-silence",
    "connection",
    "Acyclic messages (for connections, parameters, control) are lost; cyclic data continue.",
    "a message that is lost; `count` holds for each direction",
    RpcSilence,
    directions=EVERY_DIRECTION,
    takes=EACH,
    place=50,
    wire="No UDP datagrams of RPC in either direction.",
    reports="A running connection stays; jobs time out, and a new connection is not made.",
)
