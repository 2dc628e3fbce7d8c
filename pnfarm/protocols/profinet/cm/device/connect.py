"""The device's positive response to a Connect: frame ids, alarm reference, blocks."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from pnfarm.protocols.profinet.cm.device.check import FRAME_ID_RANGES
from pnfarm.protocols.profinet.wire.any_block import emit_blocks
from pnfarm.protocols.profinet.wire.cm.connect import (
    AlarmCrBlockRes,
    ArBlockRes,
    ArRpcBlockRes,
    ArServerBlock,
    ArVendorBlockRes,
)
from pnfarm.protocols.profinet.wire.cm.iocr import RT_CLASS_MASK, IocrBlockRes
from pnfarm.protocols.profinet.wire.rpc.pdu import RPC_PORT

if TYPE_CHECKING:
    from collections.abc import Iterable

    from pnfarm.protocols.profinet.cm.ar import Ar, IocrLayout
    from pnfarm.protocols.profinet.cm.device.check import ConnectRequest
    from pnfarm.protocols.profinet.wire.block import Block

__all__ = ["connect_response", "fill"]


def fill(ar: Ar, request: ConnectRequest, layouts: tuple[IocrLayout, ...], others: Iterable[Ar]) -> None:
    """Complete a new AR: frame ids of the device's choice, an alarm reference that no other AR has.

    The device chooses the output CR's if the controller leaves it open, or requests one outside of the CR's RT class or
    one that another output CR has: frames of two controllers could not be distinguished.
    """
    standing = tuple(others)
    listened = {c.frame_id for other in standing for c in other.output_crs}
    used = {c.frame_id for other in standing for c in other.iocrs} | {c.frame_id for c in layouts}
    given = []
    for layout in layouts:
        usable = FRAME_ID_RANGES[layout.properties & RT_CLASS_MASK]
        if not layout.is_input and (layout.frame_id not in usable or layout.frame_id in listened):
            layout = replace(layout, frame_id=next(i for i in usable if i not in used))
        if not layout.is_input:
            listened.add(layout.frame_id)
        used.add(layout.frame_id)
        given.append(layout)
    ar.iocrs = tuple(given)
    ar.expected = tuple(request.expected)
    ar.alarm_cr = request.alarm_crs[0] if request.alarm_crs else None
    taken = {other.local_alarm_reference for other in standing if other.alarm_cr}
    ar.local_alarm_reference = next(n for n in range(len(taken) + 1) if n not in taken)
    ar.fsu_adjust = request.fsu_adjust
    ar.initiator_rpc_port = request.rpc.server_port if request.rpc else None


def connect_response(
    ar: Ar, request: ConnectRequest, mac: bytes, station_name: str, max_alarm_data_length: int
) -> bytes:
    """The blocks of the positive response, in the standard's order."""
    blocks: list[Block] = [ArBlockRes(ar.ar_type, ar.uuid, ar.session_key, mac)]
    blocks += [IocrBlockRes(c.iocr_type, c.iocr_reference, c.frame_id) for c in ar.iocrs]
    if ar.alarm_cr is not None:
        blocks.append(AlarmCrBlockRes(ar.alarm_cr.alarm_cr_type, ar.local_alarm_reference, max_alarm_data_length))
    if ar.module_diff is not None:
        blocks.append(ar.module_diff)
    if request.rpc is not None:
        blocks.append(ArRpcBlockRes(RPC_PORT))
    if station_name and not ar.device_access:
        blocks.append(ArServerBlock(station_name.encode("ascii", "replace")))
    blocks += [ArVendorBlockRes(v.ap_structure_identifier, v.api) for v in request.vendor]
    return emit_blocks(blocks)
