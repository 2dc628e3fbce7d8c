"""ApplicationReady: the calls that a device makes to its controllers (IEC 61158-6-10, CMDEV and PLUGSM)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from pnfarm.protocols.profinet.wire.any_block import emit_blocks
from pnfarm.protocols.profinet.wire.block import BlockType
from pnfarm.protocols.profinet.wire.cm.control import ControlBlock, ControlCommand

if TYPE_CHECKING:
    from ipaddress import IPv4Address
    from uuid import UUID

    from pnfarm.protocols.profinet.cm.ar import Ar
    from pnfarm.protocols.profinet.cm.device.plug import Plug
    from pnfarm.protocols.profinet.wire.block import Block

__all__ = ["OutgoingCall", "ReadyCalls"]


@dataclass(frozen=True, slots=True)
class OutgoingCall:
    """A Control call to the controller's object; ``port`` is where an ARRPCBlock asked for it, None for the usual one.

    ``token`` names the call in :meth:`CmDevice.call_returned`; ``sequence`` is the alarm that it follows, if any.
    """

    token: int
    ar_key: int
    peer_ip: IPv4Address
    object_uuid: UUID
    payload: bytes
    port: int | None = None
    block_type: BlockType = BlockType.APPLICATION_READY_REQ
    sequence: int = 0


class ReadyCalls:
    """Calls to be sent, and those that are under way; those of an AR are dropped when it ends."""

    def __init__(self) -> None:
        self._next_token = 1
        self._waiting: list[OutgoingCall] = []
        self._under_way: dict[int, OutgoingCall] = {}

    def call(self, ar: Ar, plug: Plug | None = None) -> None:
        """The whole AR's application is ready, or that of one plugged submodule, with the AR's ModuleDiffBlock."""
        block_type = BlockType.APPLICATION_READY_REQ if plug is None else BlockType.APPLICATION_READY_PLUG_REQ
        sequence = 0 if plug is None or plug.sequence is None else plug.sequence
        blocks: list[Block] = [
            ControlBlock(block_type, ar.uuid, ar.session_key, ControlCommand.APPLICATION_READY, sequence)
        ]
        if ar.module_diff is not None:
            blocks.append(ar.module_diff)
        call = OutgoingCall(
            token=self._next_token,
            ar_key=ar.key,
            peer_ip=ar.peer_ip,
            object_uuid=ar.request.initiator_object_uuid,
            payload=emit_blocks(blocks),
            port=ar.initiator_rpc_port,
            block_type=block_type,
            sequence=sequence,
        )
        self._next_token += 1
        self._under_way[call.token] = call
        self._waiting.append(call)

    def to_send(self) -> list[OutgoingCall]:
        drained, self._waiting = self._waiting, []
        return drained

    def under_way(self, token: int) -> bool:
        """Whether the call waits for its answer."""
        return token in self._under_way

    def ended(self, token: int) -> OutgoingCall | None:
        """The call that was answered or given up; None when its AR is gone."""
        return self._under_way.pop(token, None)

    def forget(self, ar_key: int) -> None:
        self._waiting = [call for call in self._waiting if call.ar_key != ar_key]
        self._under_way = {token: call for token, call in self._under_way.items() if call.ar_key != ar_key}
