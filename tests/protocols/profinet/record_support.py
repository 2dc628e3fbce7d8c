"""Reading and writing records of a :class:`cm_support.Bench` as a controller or an engineering tool does."""

from dataclasses import replace

from cm_support import AR_BLOCK, DRIVE, DRIVE_API, UUID_1, UUID_2

from pnfarm.protocols.profinet.description import ImCarrier
from pnfarm.protocols.profinet.diagnosis import DiagnosisEntry
from pnfarm.protocols.profinet.wire.any_block import emit_blocks, parse_blocks
from pnfarm.protocols.profinet.wire.records.diagnosis import Maintenance
from pnfarm.protocols.profinet.wire.records.iod import (
    NIL_UUID,
    IodReadReqHeader,
    IodWriteReqHeader,
    emit_write_request,
    parse_read_response,
)

READ, WRITE, READ_IMPLICIT = 2, 3, 5
TOOL = replace(AR_BLOCK, ar_uuid=UUID_2, ar_type=6, properties=0x111, station_name=b"tool")
#: The submodule with the telegram.
DATA_PLACE = {"api": DRIVE_API, "slot": 1, "subslot": 2}
#: A drive with I&M0 to I&M4, and one whose module has I&M0 and I&M1 of its own.
WITH_IM = replace(DRIVE, im0=replace(DRIVE.im0, im_supported=0b11110))
MODULE_IM0 = replace(DRIVE.im0, order_id="MODULE-1", im_supported=0b0010)
SEVERAL_CARRIERS = replace(
    WITH_IM,
    im_carriers=(
        ImCarrier(0, 1, device=True),
        ImCarrier(1, 1, module=True, im0=MODULE_IM0),
        ImCarrier(9, 1),
    ),
)

#: One entry of each severity and coding, on the axis, the telegram and a port.
AXIS = (DRIVE_API, 1, 1)
FAULT = DiagnosisEntry(*AXIS, error_type=5)
REQUIRED = DiagnosisEntry(*AXIS, error_type=6, maintenance=Maintenance.REQUIRED)
DEMANDED = DiagnosisEntry(DRIVE_API, 1, 2, error_type=7, maintenance=Maintenance.DEMANDED)
QUALIFIED = DiagnosisEntry(
    *AXIS, usi=0x8003, error_type=8, maintenance=Maintenance.QUALIFIED, qualifier=1 << 27 | 1 << 7 | 1 << 3
)
ADVICE = replace(QUALIFIED, error_type=9, qualifier=1 << 3)
OWN = DiagnosisEntry(*AXIS, usi=0x0042, data=b"own")
PORT = DiagnosisEntry(0, 0, 0x8001, usi=0x8002, error_type=0x8000, ext_error_type=0x8000)
DIAGNOSES = (FAULT, REQUIRED, DEMANDED, QUALIFIED, ADVICE, OWN, PORT)


def connect_tool(bench):
    """A device access AR, with UUID_2."""
    status, _ = bench.call(0, emit_blocks((TOOL,)))
    assert status.ok


def read(bench, index, slot=0, subslot=1, api=0, *, uuid=UUID_1, target=NIL_UUID, length=4096):
    """ErrorCode1, or the record."""
    request = IodReadReqHeader(5, uuid, api, slot, subslot, index, length, target).emit()
    status, answer = bench.call(READ_IMPLICIT if uuid == NIL_UUID else READ, request, 8192)
    return parse_read_response(answer).data if status.ok else status.error_code1


def read_blocks(bench, index, **place):
    data = read(bench, index, **place)
    assert isinstance(data, bytes), hex(data)
    return parse_blocks(data)


def write(bench, index, data, slot=0, subslot=1, api=0, *, uuid=UUID_1):
    """ErrorCode1; 0 when it was taken."""
    status, _ = bench.call(
        WRITE, emit_write_request(IodWriteReqHeader(5, uuid, api, slot, subslot, index), data)
    )  # fmt: skip
    return status.error_code1
