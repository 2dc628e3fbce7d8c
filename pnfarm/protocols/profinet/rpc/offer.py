"""The calls that a server accepts, and why it refuses others: interface, version, object, operation, boot time."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.wire.rpc.pdu import (
    BODY_MAX,
    NIL_UUID,
    NcaStatus,
    RequestArgs,
    RpcPdu,
    parse_request_args,
)

if TYPE_CHECKING:
    from collections.abc import Iterable
    from uuid import UUID

    from pnfarm.protocols.profinet.rpc.endpoints import Endpoint
    from pnfarm.protocols.profinet.rpc.events import Interface

__all__ = ["Offer", "read_arguments"]


class Offer:
    """``interfaces`` with, for those that ``endpoints`` name, the objects that are registered for them.

    A call of such an interface must name one of its objects: a device at the right address whose vendor, device or
    instance is another is not the one that is meant.  C706 has no code of its own for an object that is not
    registered; the answer is that for an unregistered interface, as from Siemens devices.  An interface without
    endpoints (the endpoint mapper's, a controller's) takes any object.
    """

    def __init__(self, interfaces: Iterable[Interface], endpoints: Iterable[Endpoint], boot_time: int) -> None:
        self._interfaces = {interface.uuid: interface for interface in interfaces}
        self._objects: dict[UUID, tuple[UUID, ...]] = {}
        for endpoint in endpoints:
            known = self._objects.get(endpoint.interface, ())
            self._objects[endpoint.interface] = (*known, endpoint.object_uuid)
        self._boot_time = boot_time

    def refusal(self, pdu: RpcPdu) -> NcaStatus | None:
        """The status that rejects a request, None for one that can be taken."""
        interface = self._interfaces.get(pdu.interface)
        major, minor = pdu.interface_version & 0xFFFF, pdu.interface_version >> 16
        if interface is None or major != interface.version or minor:
            return NcaStatus.UNK_IF
        if self.is_for_another(pdu):
            return NcaStatus.UNK_IF
        if pdu.opnum not in interface.opnums:
            return NcaStatus.OP_RNG_ERROR
        if pdu.activity == NIL_UUID:
            return NcaStatus.BAD_ACTID
        if pdu.auth_protocol:
            return NcaStatus.UNSUPPORTED_AUTHN_LEVEL
        if pdu.trailer or len(pdu.body) > BODY_MAX:
            return NcaStatus.PROTO_ERROR
        if self.is_of_another_boot(pdu):
            return NcaStatus.WRONG_BOOT_TIME
        return None

    def is_for_another(self, pdu: RpcPdu) -> bool:
        """Whether the call is for an object that is not registered for its interface."""
        objects = self._objects.get(pdu.interface)
        return objects is not None and pdu.object_uuid not in objects

    def is_of_another_boot(self, pdu: RpcPdu) -> bool:
        """Whether the client means the server before its restart."""
        known = self._boot_time
        return bool(pdu.server_boot_time and known and pdu.server_boot_time != known)


def read_arguments(stub: bytes, *, little_endian: bool) -> RequestArgs:
    """The arguments of a PROFINET call; :class:`DecodeError` also where MaximumCount is not ArgsMaximum.

    IEC 61158-6-10, 4.10.3.2 wants the two equal in a request.
    """
    args = parse_request_args(stub, little_endian=little_endian)
    if args.maximum_count is not None:
        raise DecodeError("bad-length", f"MaximumCount {args.maximum_count}, ArgsMaximum {args.args_maximum}")
    return args
