"""Records of the plugged modules, the expected modules and the present ARs."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.protocols.profinet.cm.device.ownership import expected_keys
from pnfarm.protocols.profinet.records.directory import Index, Scope
from pnfarm.protocols.profinet.wire.block import BlockType
from pnfarm.protocols.profinet.wire.records.identification import (
    ApiData,
    ArData,
    ArDataEntry,
    ArDataIocr,
    IdentificationApi,
    IdentificationData,
    IdentificationSlot,
)
from pnfarm.protocols.profinet.wire.records.iod import NIL_UUID

if TYPE_CHECKING:
    from collections.abc import Iterable

    from pnfarm.protocols.profinet.cm.ar import Ar, ExpectedKey
    from pnfarm.protocols.profinet.description import Plugged
    from pnfarm.protocols.profinet.wire.cm.expected import ExpectedApi

__all__ = ["EXPECTED", "ar_data_record", "identification_record", "in_scope"]

#: These are about what an AR expects, and so need one.
EXPECTED = frozenset({
    Index.EXPECTED_IDENTIFICATION_SUBSLOT,
    Index.EXPECTED_IDENTIFICATION_SLOT,
    Index.EXPECTED_IDENTIFICATION_AR,
})  # fmt: skip

_UDP_RT_PORT = 0x8892


def in_scope(scope: Scope, asked: ExpectedKey, found: ExpectedKey) -> bool:
    """Whether a record of ``scope`` at ``asked`` is about ``found``.  (Not for the scope of an AR.)"""
    match scope:
        case Scope.SUBSLOT:
            return found == asked
        case Scope.SLOT:
            return found[:2] == asked[:2]
        case Scope.API:
            return found[0] == asked[0]
        case _:
            return True


def identification_record(plugged: Plugged, ar: Ar | None, index: int, scope: Scope, asked: ExpectedKey) -> bytes:
    """ExpectedIdentificationData or RealIdentificationData; ``ar`` is needed where the record is about an AR."""
    if index in EXPECTED:
        return _expected(ar.expected if ar else (), scope, asked)
    expected = set(expected_keys(ar.expected)) if scope is Scope.AR and ar else None
    apis = []
    for api in plugged.apis():
        slots = []
        for module in plugged.modules():
            keys = [((api, s.slot, s.subslot), s.submodule_ident) for s in module.submodules if s.api == api]
            subs = tuple(
                (key[2], ident)
                for key, ident in keys
                if in_scope(scope, asked, key) and (expected is None or key in expected)
            )
            if subs:
                slots.append(IdentificationSlot(module.slot, module.module_ident, subs))
        if slots:
            apis.append(IdentificationApi(api, tuple(slots)))
    return IdentificationData(BlockType.REAL_IDENTIFICATION_DATA, tuple(apis)).emit()


def _expected(expected: Iterable[ExpectedApi], scope: Scope, asked: ExpectedKey) -> bytes:
    apis: dict[int, list[IdentificationSlot]] = {}
    for entry in expected:
        subs = tuple(
            (s.subslot, s.submodule_ident)
            for s in entry.submodules
            if in_scope(scope, asked, (entry.api, entry.slot, s.subslot))
        )
        if subs:
            apis.setdefault(entry.api, []).append(IdentificationSlot(entry.slot, entry.module_ident, subs))
    data = tuple(IdentificationApi(api, tuple(slots)) for api, slots in apis.items())
    return IdentificationData(BlockType.EXPECTED_IDENTIFICATION_DATA, data).emit()


def ar_data_record(plugged: Plugged, ars: Iterable[Ar], ar: Ar | None, index: int, api: int) -> bytes:
    """APIData, ModuleDiffBlock, or ARData; empty where there is nothing to report."""
    match index:
        case Index.API_DATA:
            return ApiData(plugged.apis()).emit()
        case Index.MODULE_DIFF:
            return ar.module_diff.emit() if ar and ar.module_diff else b""
        case _:
            return _ar_data(ars, None if index == Index.AR_DATA else api)


def _ar_data(ars: Iterable[Ar], api: int | None) -> bytes:
    entries = []
    for ar in ars:
        apis = tuple(dict.fromkeys(e.api for e in ar.expected))
        if api is not None and api not in apis:
            continue
        entries.append(
            ArDataEntry(
                ar_uuid=ar.uuid,
                initiator_object_uuid=ar.request.initiator_object_uuid,
                parameter_server_object_uuid=NIL_UUID,
                properties=ar.properties,
                ar_type=ar.ar_type,
                alarm_cr_type=ar.alarm_cr.alarm_cr_type if ar.alarm_cr else 0,
                local_alarm_reference=ar.local_alarm_reference,
                remote_alarm_reference=ar.remote_alarm_reference,
                initiator_udp_rt_port=ar.request.udp_rt_port,
                responder_udp_rt_port=_UDP_RT_PORT,
                initiator_station_name=ar.request.station_name,
                iocrs=tuple(ArDataIocr(c.properties, c.iocr_type, c.frame_id) for c in ar.iocrs),
                apis=apis if api is None else (api,),
            )
        )
    return ArData(tuple(entries)).emit() if entries else b""
