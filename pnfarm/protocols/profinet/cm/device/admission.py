"""Admission of ARs: whether there is room for one more, and which older ones it replaces (IEC 61158-6-10, CMDEV).

A Connect names its initiator by texts and numbers that any station on the wire can read, so they alone end nothing.  An
older AR is replaced only by a Connect of its own initiator from the same origin: the same
CMInitiatorMacAdd, the same IP address, the same Ethernet address.  Two device stacks whose sources are public (p-net's
and a controller maker's) go further and end an AR by its own UUID only; but a controller that lost its memory has a new
UUID, and must be admitted at once.  A faulty Connect ends nothing.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from pnfarm.protocols.profinet.cm.device.check import RefusedError
from pnfarm.protocols.profinet.errors import CmdevError, CmrpcError, ConnectFault, ErrorCode, pnio_error

if TYPE_CHECKING:
    from collections.abc import Sequence
    from ipaddress import IPv4Address

    from pnfarm.protocols.profinet.cm.ar import Ar
    from pnfarm.protocols.profinet.description import Limits
    from pnfarm.protocols.profinet.wire.cm.connect import ArBlockReq

__all__ = ["Caller", "admit", "rerun_refusal"]

_STATE_CONFLICT = pnio_error(ErrorCode.CONNECT, ConnectFault.CMDEV, CmdevError.STATE_CONFLICT)


@dataclass(frozen=True, slots=True)
class Caller:
    """Origin of a Connect; ``mac`` is the frame's, None if unknown."""

    ip: IPv4Address
    mac: bytes | None = None

    def is_of(self, ar: Ar, request: ArBlockReq) -> bool:
        """Whether the AR's own Connect had the same origin."""
        same_frame = self.mac is None or ar.source_mac is None or self.mac == ar.source_mac
        return same_frame and self.ip == ar.peer_ip and request.initiator_mac == ar.initiator_mac


def admit(request: ArBlockReq, caller: Caller, ars: Sequence[Ar], limits: Limits) -> list[Ar]:
    """The ARs that the requested one replaces.

    One of them has the same AR UUID when the initiator runs its start-up again (:func:`rerun_refusal`).  Raises
    :class:`RefusedError` when another initiator uses the UUID of an existing AR, or when all ARs of this kind are in
    use.
    """
    standing = next((ar for ar in ars if ar.uuid == request.ar_uuid), None)
    if standing is not None:
        if not caller.is_of(standing, request):
            raise RefusedError(_STATE_CONFLICT, f"another initiator ({standing.peer_ip}) has an AR with this UUID")
        return [standing]
    older = [ar for ar in ars if _kind(ar.request) == _kind(request) and caller.is_of(ar, request)]
    access, supervisor = request.device_access, request.supervisor
    count = sum((ar.device_access, ar.supervisor) == (access, supervisor) for ar in ars if ar not in older)
    most = limits.max_device_access_ars if access else limits.max_supervisor_ars if supervisor else limits.max_ars
    if count >= most:
        status = pnio_error(ErrorCode.CONNECT, ConnectFault.CMRPC, CmrpcError.OUT_OF_AR_RESOURCES)
        raise RefusedError(status, f"ARs that exist already: {count}")
    return older


def rerun_refusal() -> RefusedError:
    """The refusal for an initiator whose own AR had the same UUID; its next Connect succeeds."""
    return RefusedError(_STATE_CONFLICT, "an AR with this UUID existed; it is aborted")


def _kind(one: ArBlockReq) -> tuple[object, ...]:
    """The identity that a newer AR must share with the older one that it replaces."""
    return one.initiator_object_uuid, one.station_name, one.ar_type, one.device_access
