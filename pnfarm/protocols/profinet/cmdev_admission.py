"""Room for one more AR (IEC 61158-6-10, CMDEV; limits are the device's)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.protocols.profinet.cmdev_check import RefusedError
from pnfarm.protocols.profinet.errors import CmrpcError, ConnectFault, ErrorCode, pnio_error
from pnfarm.protocols.profinet.wire.blocks_connect import ArProperties, ArType

if TYPE_CHECKING:
    from collections.abc import Iterable

    from pnfarm.protocols.profinet.ar import Ar
    from pnfarm.protocols.profinet.description import Limits
    from pnfarm.protocols.profinet.wire.blocks_connect import ArBlockReq

__all__ = ["check_resources", "of_same_initiator"]


def of_same_initiator(request: ArBlockReq, ars: Iterable[Ar]) -> list[Ar]:
    """Older ARs of the same kind by the same controller, which give way to the one that is requested."""
    access = ArProperties.DEVICE_ACCESS

    def kind(one: ArBlockReq) -> tuple[object, ...]:
        return one.initiator_object_uuid, one.station_name, one.ar_type, one.properties & access

    return [ar for ar in ars if kind(ar.request) == kind(request)]


def check_resources(request: ArBlockReq, ars: Iterable[Ar], limits: Limits) -> None:
    """Raises :class:`RefusedError` when as many ARs of this kind stand as the device has."""
    access = bool(request.properties & ArProperties.DEVICE_ACCESS)
    supervisor = request.ar_type == ArType.IOSAR and not access
    standing = sum((ar.device_access, ar.supervisor) == (access, supervisor) for ar in ars)
    most = limits.max_device_access_ars if access else limits.max_supervisor_ars if supervisor else limits.max_ars
    if standing >= most:
        status = pnio_error(ErrorCode.CONNECT, ConnectFault.CMRPC, CmrpcError.OUT_OF_AR_RESOURCES)
        raise RefusedError(status, f"ARs that stand already: {standing}")
