"""Records that every PROFINET device has: who it is, what is plugged, which ARs stand, the I/O data of one submodule.

:class:`RecordHandler` is how the AR machine asks for a record; :class:`DeviceRecords` answers the standard's
indexes (IEC 61158-6-10, coding of the field Index; I&M: PI profile guideline 1) and hands every other index to the
application's handler, the drive's parameter access.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.errors import AccessError, RecordError
from pnfarm.protocols.profinet.wire.blocks import BlockType, RawBlock, emit_raw_block, split_blocks
from pnfarm.protocols.profinet.wire.blocks_expected import emit_module_diff_block
from pnfarm.protocols.profinet.wire.iod import NIL_UUID
from pnfarm.protocols.profinet.wire.records import (
    IM_TEXT_SIZES,
    ApiData,
    ArData,
    ArDataEntry,
    ArDataIocr,
    IdentificationApi,
    IdentificationData,
    IdentificationSlot,
    Im0,
    ImText,
    RecordInputData,
    RecordOutputData,
    emit_api_data,
    emit_ar_data,
    emit_identification_data,
    emit_im0,
    emit_im_text,
    emit_record_input_data,
    emit_record_output_data,
    parse_im_text,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from pnfarm.protocols.profinet.ar import Ar
    from pnfarm.protocols.profinet.description import DeviceDescription, Plugged

__all__ = ["DeviceRecords", "Index", "IoData", "NoRecords", "RecordHandler", "im0_of"]


class Index:
    """Record indexes (IEC 61158-6-10, coding of the field Index)."""

    USER_LAST = 0x7FFF
    EXPECTED_IDENTIFICATION_SUBSLOT = 0x8000
    REAL_IDENTIFICATION_SUBSLOT = 0x8001
    RECORD_INPUT_DATA = 0x8028
    RECORD_OUTPUT_DATA = 0x8029
    IM0 = 0xAFF0
    IM4 = 0xAFF4
    EXPECTED_IDENTIFICATION_SLOT = 0xC000
    REAL_IDENTIFICATION_SLOT = 0xC001
    EXPECTED_IDENTIFICATION_AR = 0xE000
    REAL_IDENTIFICATION_AR = 0xE001
    MODULE_DIFF = 0xE002
    REAL_IDENTIFICATION_API = 0xF000
    AR_DATA_API = 0xF020
    AR_DATA = 0xF820
    API_DATA = 0xF821
    IM0_FILTER_DATA = 0xF840


#: Records of the physical device that a controller writes at start-up; kept and read back, nothing more:
#: PDPortDataCheck, PDPortDataAdjust, PDInterfaceMrpDataCheck and -Adjust, PDPortMrpDataAdjust, PDNCDataCheck,
#: PDInterfaceAdjust, PDInterfaceFSUDataAdjust.
_PDEV_WRITABLE = frozenset({0x802B, 0x802F, 0x8051, 0x8052, 0x8053, 0x8070, 0x8071, 0x8090})
_FIRST_PDEV_SUBSLOT = 0x8000


class RecordHandler(Protocol):
    """Answers at once.  ``ar`` is None for an implicit read that names no AR.

    ``read`` returns at most ``max_length`` octets.  Neither method raises.
    """

    def read(
        self, ar: Ar | None, api: int, slot: int, subslot: int, index: int, max_length: int, now: int
    ) -> bytes | RecordError: ...

    def write(
        self, ar: Ar, api: int, slot: int, subslot: int, index: int, data: bytes, now: int
    ) -> RecordError | None: ...


class NoRecords:
    """An application without any record: every index is invalid."""

    def read(
        self, ar: Ar | None, api: int, slot: int, subslot: int, index: int, max_length: int, now: int
    ) -> bytes | RecordError:
        del ar, api, slot, subslot, index, max_length, now
        return RecordError(AccessError.INVALID_INDEX)

    def write(self, ar: Ar, api: int, slot: int, subslot: int, index: int, data: bytes, now: int) -> RecordError | None:
        del ar, api, slot, subslot, index, data, now
        return RecordError(AccessError.INVALID_INDEX)


@dataclass(frozen=True, slots=True)
class IoData:
    """One submodule's data in one direction, as last sent or received."""

    data: bytes
    iops: int
    iocs: int


def im0_of(description: DeviceDescription) -> Im0:
    im0 = description.im0
    return Im0(
        vendor_id=description.vendor_id,
        order_id=im0.order_id.encode("ascii", "replace").ljust(20)[:20],
        serial_number=im0.serial_number.encode("ascii", "replace").ljust(16)[:16],
        hardware_revision=im0.hardware_revision,
        software_revision=im0.software_revision,
        revision_counter=im0.revision_counter,
        profile_id=im0.profile_id,
        profile_specific_type=im0.profile_specific_type,
        im_supported=im0.im_supported,
    )


class DeviceRecords:
    """The records of one device.

    ``ars`` gives the ARs that stand (:attr:`CmDevice.ars`).  ``io_data(slot, subslot, output)`` gives a submodule's
    cyclic data, or None while there is none.
    """

    def __init__(
        self,
        description: DeviceDescription,
        plugged: Plugged,
        ars: Callable[[], Iterable[Ar]],
        application: RecordHandler | None = None,
        io_data: Callable[[int, int, bool], IoData | None] | None = None,
    ) -> None:
        self._description = description
        self._plugged = plugged
        self._ars = ars
        self._application: RecordHandler = application if application is not None else NoRecords()
        self._io_data = io_data
        self._im_texts: dict[int, bytes] = {}
        self._pdev: dict[tuple[int, int, int], bytes] = {}

    def read(
        self, ar: Ar | None, api: int, slot: int, subslot: int, index: int, max_length: int, now: int
    ) -> bytes | RecordError:
        """The record's octets, or why not: invalid index, slot or API, another state, or too short a buffer."""
        answer = self._read(ar, api, slot, subslot, index, max_length, now)
        if isinstance(answer, bytes) and len(answer) > max_length:
            return RecordError(AccessError.INVALID_RANGE)
        return answer

    def _read(
        self, ar: Ar | None, api: int, slot: int, subslot: int, index: int, max_length: int, now: int
    ) -> bytes | RecordError:
        match index:
            case Index.IM0_FILTER_DATA:
                return self._im0_filter()
            case Index.API_DATA:
                return emit_api_data(ApiData(self._plugged.apis()))
            case Index.AR_DATA:
                return self._ar_data(None)
            case Index.AR_DATA_API | Index.REAL_IDENTIFICATION_API if api not in self._plugged.apis():
                return RecordError(AccessError.INVALID_AREA)
            case Index.AR_DATA_API:
                return self._ar_data(api)
            case Index.REAL_IDENTIFICATION_API:
                return self._real(lambda a, _s, _u: a == api)
            case Index.EXPECTED_IDENTIFICATION_AR | Index.REAL_IDENTIFICATION_AR | Index.MODULE_DIFF if ar is None:
                return RecordError(AccessError.STATE_CONFLICT)
            case Index.EXPECTED_IDENTIFICATION_AR:
                return self._expected(ar, lambda _a, _s, _u: True)
            case Index.REAL_IDENTIFICATION_AR:
                owned = {(e.api, e.slot, s.subslot) for e in ar.expected for s in e.submodules} if ar else set()
                return self._real(lambda a, s, u: (a, s, u) in owned)
            case Index.MODULE_DIFF:
                return emit_module_diff_block(ar.module_diff) if ar and ar.module_diff else b""
        wrong = self._wrong_place(api, slot, subslot, index)
        if wrong is not None:
            return wrong
        return self._read_placed(ar, api, slot, subslot, index, max_length, now)

    def _read_placed(
        self, ar: Ar | None, api: int, slot: int, subslot: int, index: int, max_length: int, now: int
    ) -> bytes | RecordError:
        match index:
            case Index.IM0:
                return emit_im0(im0_of(self._description))
            case index if Index.IM0 < index <= Index.IM4:
                return self._read_im_text(index)
            case Index.REAL_IDENTIFICATION_SLOT:
                return self._real(lambda a, s, _u: (a, s) == (api, slot))
            case Index.REAL_IDENTIFICATION_SUBSLOT:
                return self._real(lambda a, s, u: (a, s, u) == (api, slot, subslot))
            case Index.EXPECTED_IDENTIFICATION_SLOT:
                return self._expected(ar, lambda a, s, _u: (a, s) == (api, slot))
            case Index.EXPECTED_IDENTIFICATION_SUBSLOT:
                return self._expected(ar, lambda a, s, u: (a, s, u) == (api, slot, subslot))
            case Index.RECORD_INPUT_DATA | Index.RECORD_OUTPUT_DATA:
                return self._io_record(slot, subslot, output=index == Index.RECORD_OUTPUT_DATA)
            case index if self._is_pdev(subslot, index):
                kept = self._pdev.get((slot, subslot, index))
                return b"" if kept is None else kept
        return self._application.read(ar, api, slot, subslot, index, max_length, now)

    def write(self, ar: Ar, api: int, slot: int, subslot: int, index: int, data: bytes, now: int) -> RecordError | None:
        """None when the record was taken."""
        wrong = self._wrong_place(api, slot, subslot, index)
        if wrong is not None:
            return wrong
        if Index.IM0 < index <= Index.IM4:
            return self._write_im_text(index, data)
        if self._is_pdev(subslot, index):
            try:
                split_blocks(data)
            except DecodeError:
                return RecordError(AccessError.WRITE_LENGTH_ERROR)
            self._pdev[slot, subslot, index] = data
            return None
        if index in _READ_ONLY:
            return RecordError(AccessError.ACCESS_DENIED)
        return self._application.write(ar, api, slot, subslot, index, data, now)

    def _wrong_place(self, api: int, slot: int, subslot: int, index: int) -> RecordError | None:
        if api not in self._plugged.apis():
            return RecordError(AccessError.INVALID_AREA)
        if index in _SLOT_SCOPE:
            present = self._plugged.module(slot) is not None
        else:
            present = self._plugged.submodule(api, slot, subslot) is not None
        return None if present else RecordError(AccessError.INVALID_SLOT_SUBSLOT)

    @staticmethod
    def _is_pdev(subslot: int, index: int) -> bool:
        return subslot >= _FIRST_PDEV_SUBSLOT and index in _PDEV_WRITABLE

    # I&M

    def _im_block(self, index: int) -> BlockType | None:
        number = index - Index.IM0
        return BlockType(BlockType.IM0 + number) if self._description.im0.im_supported >> number & 1 else None

    def _read_im_text(self, index: int) -> bytes | RecordError:
        block = self._im_block(index)
        if block is None:
            return RecordError(AccessError.INVALID_INDEX)
        text = self._im_texts.get(block, b"")
        return emit_im_text(ImText(block, text.ljust(IM_TEXT_SIZES[block])))

    def _write_im_text(self, index: int, data: bytes) -> RecordError | None:
        block = self._im_block(index)
        if block is None:
            return RecordError(AccessError.INVALID_INDEX)
        try:
            (raw,) = split_blocks(data)
            value = parse_im_text(raw)
        except (DecodeError, ValueError):
            return RecordError(AccessError.WRITE_LENGTH_ERROR)
        if value.block_type != block:
            return RecordError(AccessError.INVALID_PARAMETER)
        self._im_texts[block] = value.text
        return None

    def _im0_filter(self) -> bytes:
        # one I&M0 for the whole device: its carrier is the DAP's first submodule, which stands for the device too
        dap = self._description.dap
        carrier = dap.submodules[0]
        slot = IdentificationSlot(dap.slot, dap.module_ident, ((carrier.subslot, carrier.submodule_ident),))
        apis = (IdentificationApi(carrier.api, (slot,)),)
        types = (BlockType.IM0_FILTER_DATA_SUBMODULE, BlockType.IM0_FILTER_DATA_DEVICE)
        return b"".join(emit_identification_data(IdentificationData(t, apis, 0x0100)) for t in types)

    # identification

    def _real(self, wanted: Callable[[int, int, int], bool]) -> bytes:
        apis = []
        for api in self._plugged.apis():
            slots = []
            for module in self._plugged.modules():
                subs = tuple(
                    (s.subslot, s.submodule_ident)
                    for s in module.submodules
                    if s.api == api and wanted(api, module.slot, s.subslot)
                )
                if subs:
                    slots.append(IdentificationSlot(module.slot, module.module_ident, subs))
            if slots:
                apis.append(IdentificationApi(api, tuple(slots)))
        return emit_identification_data(IdentificationData(BlockType.REAL_IDENTIFICATION_DATA, tuple(apis)))

    @staticmethod
    def _expected(ar: Ar | None, wanted: Callable[[int, int, int], bool]) -> bytes | RecordError:
        if ar is None:
            return RecordError(AccessError.STATE_CONFLICT)
        apis: dict[int, list[IdentificationSlot]] = {}
        for entry in ar.expected:
            subs = tuple(
                (s.subslot, s.submodule_ident) for s in entry.submodules if wanted(entry.api, entry.slot, s.subslot)
            )
            if subs:
                apis.setdefault(entry.api, []).append(IdentificationSlot(entry.slot, entry.module_ident, subs))
        data = tuple(IdentificationApi(api, tuple(slots)) for api, slots in apis.items())
        return emit_identification_data(IdentificationData(BlockType.EXPECTED_IDENTIFICATION_DATA, data))

    # ARs and data

    def _ar_data(self, api: int | None) -> bytes:
        entries = []
        for ar in self._ars():
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
                    responder_udp_rt_port=0x8892,
                    initiator_station_name=ar.request.station_name,
                    iocrs=tuple(ArDataIocr(c.properties, c.iocr_type, c.frame_id) for c in ar.iocrs),
                    apis=apis if api is None else (api,),
                )
            )
        return emit_ar_data(ArData(tuple(entries))) if entries else b""

    def _io_record(self, slot: int, subslot: int, *, output: bool) -> bytes | RecordError:
        sub = self._plugged[slot, subslot]
        if not (sub.output_bytes if output else sub.input_bytes) and (output or sub.output_bytes):
            return RecordError(AccessError.INVALID_INDEX)
        found = self._io_data(slot, subslot, output) if self._io_data else None
        if found is None:
            return RecordError(AccessError.STATE_CONFLICT)
        iocs, iops = bytes([found.iocs]), bytes([found.iops])
        if output:
            # the element ends with the substitute value: mode 0, all octets zero, with the same statuses
            value = RawBlock(BlockType.SUBSTITUTE_VALUE, bytes(2) + iocs + bytes(len(found.data)) + iops)
            return emit_record_output_data(RecordOutputData(iocs, iops, found.data, 0, emit_raw_block(value)))
        return emit_record_input_data(RecordInputData(iocs, iops, found.data))


_SLOT_SCOPE = frozenset({Index.EXPECTED_IDENTIFICATION_SLOT, Index.REAL_IDENTIFICATION_SLOT})
_READ_ONLY = frozenset({
    Index.EXPECTED_IDENTIFICATION_SUBSLOT,
    Index.REAL_IDENTIFICATION_SUBSLOT,
    Index.RECORD_INPUT_DATA,
    Index.RECORD_OUTPUT_DATA,
    Index.IM0,
    Index.EXPECTED_IDENTIFICATION_SLOT,
    Index.REAL_IDENTIFICATION_SLOT,
    Index.EXPECTED_IDENTIFICATION_AR,
    Index.REAL_IDENTIFICATION_AR,
    Index.MODULE_DIFF,
    Index.REAL_IDENTIFICATION_API,
    Index.AR_DATA_API,
    Index.AR_DATA,
    Index.API_DATA,
    Index.IM0_FILTER_DATA,
})  # fmt: skip
