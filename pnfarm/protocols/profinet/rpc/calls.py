"""The client's rows: open calls, and the activities that they are made in."""

from __future__ import annotations

from dataclasses import dataclass
from enum import auto
from typing import TYPE_CHECKING, Final

from pnfarm.protocols.named import Named
from pnfarm.protocols.profinet.wire.rpc.pdu import FRAGMENT_NONE, NcaStatus, PacketType, RpcPdu, status_name

if TYPE_CHECKING:
    from collections.abc import Callable
    from uuid import UUID

    from pnfarm.protocols.profinet.rpc.fragments import FragmentSender, Peer, Reassembly

__all__ = ["EVENTS_OF_TYPES", "TRANSITIONS", "ActivityPool", "Call", "ClientEventKind", "ClientState", "refusal_text"]


class ClientState(Named):
    """States of one call."""

    SENDING = auto()
    WAITING = auto()
    RECEIVING = auto()
    DONE = auto()


class ClientEventKind(Named):
    """Inputs of a call."""

    FACK = auto()
    ALL_SENT = auto()
    MORE_TO_SEND = auto()
    WORKING = auto()
    NOCALL = auto()
    RESPONSE = auto()
    COMPLETED = auto()
    RETURNED = auto()
    REFUSED = auto()
    BUSY = auto()
    RETRY = auto()
    FAILED = auto()
    CANCELLED = auto()
    CANCEL_ACK = auto()


TRANSITIONS: Final[dict[tuple[ClientState, ClientEventKind], tuple[ClientState, str | None]]] = {
    (ClientState.SENDING, ClientEventKind.FACK): (ClientState.SENDING, "slide"),
    (ClientState.SENDING, ClientEventKind.ALL_SENT): (ClientState.WAITING, None),
    (ClientState.SENDING, ClientEventKind.MORE_TO_SEND): (ClientState.SENDING, None),
    (ClientState.SENDING, ClientEventKind.WORKING): (ClientState.WAITING, "wait_on"),
    (ClientState.SENDING, ClientEventKind.NOCALL): (ClientState.SENDING, "send_again"),
    (ClientState.SENDING, ClientEventKind.RESPONSE): (ClientState.RECEIVING, "collect"),
    (ClientState.SENDING, ClientEventKind.REFUSED): (ClientState.SENDING, "refused"),
    (ClientState.SENDING, ClientEventKind.BUSY): (ClientState.SENDING, "wait_for_room"),
    (ClientState.SENDING, ClientEventKind.RETRY): (ClientState.SENDING, "resume"),
    (ClientState.SENDING, ClientEventKind.FAILED): (ClientState.DONE, "close"),
    (ClientState.SENDING, ClientEventKind.CANCELLED): (ClientState.DONE, "give_up"),
    (ClientState.WAITING, ClientEventKind.FACK): (ClientState.WAITING, "slide"),
    (ClientState.WAITING, ClientEventKind.ALL_SENT): (ClientState.WAITING, None),
    (ClientState.WAITING, ClientEventKind.MORE_TO_SEND): (ClientState.SENDING, None),
    (ClientState.WAITING, ClientEventKind.WORKING): (ClientState.WAITING, "wait_on"),
    (ClientState.WAITING, ClientEventKind.NOCALL): (ClientState.SENDING, "send_again"),
    (ClientState.WAITING, ClientEventKind.RESPONSE): (ClientState.RECEIVING, "collect"),
    (ClientState.WAITING, ClientEventKind.REFUSED): (ClientState.WAITING, "refused"),
    (ClientState.WAITING, ClientEventKind.BUSY): (ClientState.SENDING, "wait_for_room"),
    (ClientState.WAITING, ClientEventKind.RETRY): (ClientState.WAITING, "retry"),
    (ClientState.WAITING, ClientEventKind.FAILED): (ClientState.DONE, "close"),
    (ClientState.WAITING, ClientEventKind.CANCELLED): (ClientState.DONE, "give_up"),
    (ClientState.RECEIVING, ClientEventKind.NOCALL): (ClientState.SENDING, "send_again"),
    (ClientState.RECEIVING, ClientEventKind.RESPONSE): (ClientState.RECEIVING, "collect"),
    (ClientState.RECEIVING, ClientEventKind.COMPLETED): (ClientState.RECEIVING, "deliver"),
    (ClientState.RECEIVING, ClientEventKind.RETURNED): (ClientState.DONE, "close"),
    (ClientState.RECEIVING, ClientEventKind.REFUSED): (ClientState.RECEIVING, "refused"),
    (ClientState.RECEIVING, ClientEventKind.BUSY): (ClientState.SENDING, "wait_for_room"),
    (ClientState.RECEIVING, ClientEventKind.RETRY): (ClientState.RECEIVING, "ping"),
    (ClientState.RECEIVING, ClientEventKind.FAILED): (ClientState.DONE, "close"),
    (ClientState.RECEIVING, ClientEventKind.CANCELLED): (ClientState.DONE, "give_up"),
}
"""The connectionless client's transitions: next state, and the name of the client's action (C706 chapter 10)."""

EVENTS_OF_TYPES: Final[dict[int, ClientEventKind]] = {
    PacketType.RESPONSE: ClientEventKind.RESPONSE,
    PacketType.FAULT: ClientEventKind.REFUSED,
    PacketType.REJECT: ClientEventKind.REFUSED,
    PacketType.WORKING: ClientEventKind.WORKING,
    PacketType.NOCALL: ClientEventKind.NOCALL,
    PacketType.FACK: ClientEventKind.FACK,
    PacketType.CANCEL_ACK: ClientEventKind.CANCEL_ACK,
}


@dataclass(slots=True)
class ClientActivity:
    """A series of calls to one peer, one at a time."""

    uuid: UUID
    peer: Peer
    sequence: int = 0xFFFFFFFF
    boot_time: int = 0
    call: Call | None = None
    idle_since: int = 0
    last_fragment: int = FRAGMENT_NONE
    """Number that ended the last response, to acknowledge it again when its fack was lost."""


@dataclass(slots=True)
class Call:
    """An open call."""

    call_id: int
    activity: ClientActivity
    peer: Peer
    local_port: int
    request: RpcPdu
    sender: FragmentSender
    answer_max: int
    expires_at: int
    reassembly: Reassembly
    state: ClientState = ClientState.SENDING
    response_drep: bytes = b""
    serial: int = 0
    tries: int = 0
    nocalls: int = 0
    refusals: int = 0
    worked: bool = False


class ActivityPool:
    """Activities by UUID; an unused one serves the next call to its peer, or is forgotten after ``idle_ns``.

    No method searches all activities: several hundred devices are called at once.
    """

    def __init__(self, new_uuid: Callable[[], UUID], idle_ns: int) -> None:
        self._new_uuid = new_uuid
        self._idle_ns = idle_ns
        self._all: dict[UUID, ClientActivity] = {}
        self._unused: dict[UUID, ClientActivity] = {}  # the one unused for longest first
        self._by_peer: dict[Peer, dict[UUID, ClientActivity]] = {}

    def __len__(self) -> int:
        return len(self._all)

    def get(self, uuid: UUID) -> ClientActivity | None:
        return self._all.get(uuid)

    def take(self, peer: Peer) -> ClientActivity:
        """An activity for a call to ``peer``."""
        unused = self._by_peer.get(peer)
        if unused is None:
            uuid = self._new_uuid()
            activity = self._all[uuid] = ClientActivity(uuid, peer)
            return activity
        uuid, activity = unused.popitem()
        if not unused:
            del self._by_peer[peer]
        del self._unused[uuid]
        return activity

    def give_back(self, activity: ClientActivity, now: int) -> None:
        activity.call = None
        activity.idle_since = now
        self._unused[activity.uuid] = activity
        self._by_peer.setdefault(activity.peer, {})[activity.uuid] = activity

    def next_deadline(self) -> int | None:
        oldest = next(iter(self._unused.values()), None)
        return None if oldest is None else oldest.idle_since + self._idle_ns

    def handle_timeout(self, now: int) -> None:
        while (due := self.next_deadline()) is not None and due <= now:
            uuid, activity = next(iter(self._unused.items()))
            del self._unused[uuid], self._all[uuid]
            unused = self._by_peer[activity.peer]
            del unused[uuid]
            if not unused:
                del self._by_peer[activity.peer]


_TEXTS: Final[dict[int, str]] = {
    NcaStatus.RPC_VERSION_MISMATCH: "another version of RPC",
    NcaStatus.UNSPEC_REJECT: "no reason is given",
    NcaStatus.BAD_ACTID: "the activity is not valid",
    NcaStatus.WHO_ARE_YOU_FAILED: "the server could not call back",
    NcaStatus.MANAGER_NOT_ENTERED: "the call was not started",
    NcaStatus.FAULT_CANCEL: "the call was cancelled",
    NcaStatus.FAULT_UNSPEC: "no reason is given",
    NcaStatus.FAULT_CONTEXT_MISMATCH: "the handle is not the server's",
    NcaStatus.FAULT_REMOTE_NO_MEMORY: "the server has no memory for it",
    NcaStatus.UNSUPPORTED_AUTHN_LEVEL: "authentication is not supported",
    NcaStatus.OP_RNG_ERROR: "no such operation",
    NcaStatus.UNK_IF: "no such interface, version or object",
    NcaStatus.WRONG_BOOT_TIME: "the server restarted",
    NcaStatus.YOU_CRASHED: "the server assumes that the client restarted",
    NcaStatus.PROTO_ERROR: "the request violates the protocol",
    NcaStatus.OUT_ARGS_TOO_BIG: "the answer is longer than the client accepts",
    NcaStatus.SERVER_TOO_BUSY: "the server is busy",
    NcaStatus.UNSUPPORTED_TYPE: "not for an object of this type",
}


def refusal_text(kind: int, code: int) -> str:
    """A reject or fault for a log, such as ``reject nca_unk_if (no such interface, version or object)``."""
    text = f" ({_TEXTS[code]})" if code in _TEXTS else ""
    return f"{'reject' if kind == PacketType.REJECT else 'fault'} {status_name(code)}{text}"
