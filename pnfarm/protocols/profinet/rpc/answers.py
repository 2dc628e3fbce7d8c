"""The PDUs with which either end answers another PDU: made of its header, with a body of their own."""

from __future__ import annotations

from pnfarm.protocols.profinet.rpc.fragments import fack_body
from pnfarm.protocols.profinet.wire.rpc.bodies import CancelAckBody, CancelBody
from pnfarm.protocols.profinet.wire.rpc.pdu import FRAGMENT_NONE, NcaStatus, PacketType, RpcPdu, emit_status

__all__ = ["answer_to", "cancel_ack", "fack", "nocall", "nocall_so_far", "reject"]


def answer_to(
    pdu: RpcPdu, packet_type: int, *, fragment_number: int = 0, body: bytes = b"", flags1: int = 0, serial: int = 0
) -> RpcPdu:
    """A PDU about the same call; integers and floats are represented as the peer does it, characters are ASCII."""
    # `replace` would take three times as long
    return RpcPdu(
        packet_type=int(packet_type),
        interface=pdu.interface,
        activity=pdu.activity,
        object_uuid=pdu.object_uuid,
        sequence=pdu.sequence,
        opnum=pdu.opnum,
        body=body,
        flags1=flags1,
        drep=bytes((pdu.drep[0] & 0xF0, *pdu.drep[1:])),
        server_boot_time=pdu.server_boot_time,
        interface_version=pdu.interface_version,
        interface_hint=pdu.interface_hint,
        activity_hint=pdu.activity_hint,
        fragment_number=fragment_number,
        serial=serial,
    )


def fack(pdu: RpcPdu, number: int) -> RpcPdu:
    """Fragments up to ``number`` have arrived; ``pdu`` is the one that asked."""
    body = fack_body(pdu.serial).emit(little_endian=pdu.little_endian)
    return answer_to(pdu, PacketType.FACK, fragment_number=number, body=body)


def nocall(pdu: RpcPdu) -> RpcPdu:
    """The call is unknown."""
    return answer_to(pdu, PacketType.NOCALL, fragment_number=FRAGMENT_NONE)


def nocall_so_far(pdu: RpcPdu, number: int) -> RpcPdu:
    """No call yet, but fragments up to ``number`` of its request."""
    body = fack_body(pdu.serial).emit(little_endian=pdu.little_endian)
    return answer_to(pdu, PacketType.NOCALL, fragment_number=number, body=body)


def reject(pdu: RpcPdu, status: NcaStatus) -> RpcPdu:
    """The call was not started, and why."""
    return answer_to(pdu, PacketType.REJECT, body=emit_status(status, little_endian=pdu.little_endian))


def cancel_ack(pdu: RpcPdu, cancel: CancelBody | None, *, accepting: bool) -> RpcPdu:
    """The answer to a cl_cancel; ``cancel`` is its body, None for one that orphaned the call."""
    body = b""
    if cancel is not None:
        body = CancelAckBody(cancel.cancel_id, accepting).emit(little_endian=pdu.little_endian)
    return answer_to(pdu, PacketType.CANCEL_ACK, body=body)
