"""Any block: from its type to its codec.  What has no codec stays a :class:`RawBlock`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.wire.block import BlockType, RawBlock, emit_raw_block, parse_raw_block, split_blocks
from pnfarm.protocols.profinet.wire.cm import connect, control, expected, iocr
from pnfarm.protocols.profinet.wire.records import container, diagnosis, fsu, identification, log_book, pdev
from pnfarm.wire.octets import Reader

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

__all__ = ["Block", "emit_block", "emit_blocks", "parse_block", "parse_blocks", "read_blocks"]

Block = (
    connect.ArBlockReq
    | connect.ArBlockRes
    | connect.AlarmCrBlockReq
    | connect.AlarmCrBlockRes
    | connect.PrmServerBlockReq
    | connect.PrmServerBlockRes
    | connect.McrBlockReq
    | connect.ArRpcBlockReq
    | connect.ArRpcBlockRes
    | connect.ArServerBlock
    | connect.ArVendorBlockReq
    | connect.ArVendorBlockRes
    | iocr.IocrBlockReq
    | iocr.IocrBlockRes
    | expected.ExpectedSubmoduleBlockReq
    | expected.ModuleDiffBlock
    | control.ControlBlock
    | control.SubmoduleList
    | identification.Im0
    | identification.ImText
    | identification.IdentificationData
    | identification.ApiData
    | identification.ArData
    | identification.RecordInputData
    | identification.RecordOutputData
    | identification.SubstituteValue
    | diagnosis.DiagnosisData
    | log_book.LogData
    | pdev.PortDataCheck
    | pdev.PortDataAdjust
    | pdev.PortDataReal
    | pdev.PortStatistic
    | pdev.InterfaceDataReal
    | pdev.InterfaceAdjust
    | pdev.MultipleBlock
    | container.ContainerContent
    | fsu.ArFsuDataAdjust
    | RawBlock
)

_PARSERS: dict[int, Callable[[RawBlock], Block]] = {
    BlockType.AR_REQ: connect.parse_ar_block_req,
    BlockType.AR_RES: connect.parse_ar_block_res,
    BlockType.ALARM_CR_REQ: connect.parse_alarm_cr_block_req,
    BlockType.ALARM_CR_RES: connect.parse_alarm_cr_block_res,
    BlockType.PRM_SERVER_REQ: connect.parse_prm_server_block_req,
    BlockType.PRM_SERVER_RES: connect.parse_prm_server_block_res,
    BlockType.MCR_REQ: connect.parse_mcr_block_req,
    BlockType.AR_RPC_REQ: connect.parse_ar_rpc_block_req,
    BlockType.AR_RPC_RES: connect.parse_ar_rpc_block_res,
    BlockType.AR_SERVER_RES: connect.parse_ar_server_block,
    BlockType.AR_VENDOR_REQ: connect.parse_ar_vendor_block_req,
    BlockType.AR_VENDOR_RES: connect.parse_ar_vendor_block_res,
    BlockType.IOCR_REQ: iocr.parse_iocr_block_req,
    BlockType.IOCR_RES: iocr.parse_iocr_block_res,
    BlockType.EXPECTED_SUBMODULE_REQ: expected.parse_expected_submodule_block_req,
    BlockType.MODULE_DIFF: expected.parse_module_diff_block,
    **dict.fromkeys(control.CONTROL_BLOCK_TYPES, control.parse_control_block),
    BlockType.SUBMODULE_LIST: control.parse_submodule_list,
    BlockType.IM0: identification.parse_im0,
    **dict.fromkeys(identification.IM_TEXT_SIZES, identification.parse_im_text),
    BlockType.EXPECTED_IDENTIFICATION_DATA: identification.parse_identification_data,
    BlockType.REAL_IDENTIFICATION_DATA: identification.parse_identification_data,
    BlockType.IM0_FILTER_DATA_SUBMODULE: identification.parse_identification_data,
    BlockType.IM0_FILTER_DATA_MODULE: identification.parse_identification_data,
    BlockType.IM0_FILTER_DATA_DEVICE: identification.parse_identification_data,
    BlockType.API_DATA: identification.parse_api_data,
    BlockType.AR_DATA: identification.parse_ar_data,
    BlockType.RECORD_INPUT_DATA_OBJECT: identification.parse_record_input_data,
    BlockType.RECORD_OUTPUT_DATA_OBJECT: identification.parse_record_output_data,
    BlockType.SUBSTITUTE_VALUE: identification.parse_substitute_value,
    BlockType.DIAGNOSIS_DATA: diagnosis.parse_diagnosis_data,
    BlockType.LOG_DATA: log_book.parse_log_data,
    BlockType.CONTAINER_CONTENT: container.parse_container_content,
    BlockType.AR_FSU_DATA_ADJUST: fsu.parse_ar_fsu_data_adjust,
    **pdev.PARSERS,
}

_EMITTERS: dict[type, Callable[[Any], bytes]] = {
    connect.ArBlockReq: connect.emit_ar_block_req,
    connect.ArBlockRes: connect.emit_ar_block_res,
    connect.AlarmCrBlockReq: connect.emit_alarm_cr_block_req,
    connect.AlarmCrBlockRes: connect.emit_alarm_cr_block_res,
    connect.PrmServerBlockReq: connect.emit_prm_server_block_req,
    connect.PrmServerBlockRes: connect.emit_prm_server_block_res,
    connect.McrBlockReq: connect.emit_mcr_block_req,
    connect.ArRpcBlockReq: connect.emit_ar_rpc_block_req,
    connect.ArRpcBlockRes: connect.emit_ar_rpc_block_res,
    connect.ArServerBlock: connect.emit_ar_server_block,
    connect.ArVendorBlockReq: connect.emit_ar_vendor_block_req,
    connect.ArVendorBlockRes: connect.emit_ar_vendor_block_res,
    iocr.IocrBlockReq: iocr.emit_iocr_block_req,
    iocr.IocrBlockRes: iocr.emit_iocr_block_res,
    expected.ExpectedSubmoduleBlockReq: expected.emit_expected_submodule_block_req,
    expected.ModuleDiffBlock: expected.emit_module_diff_block,
    control.ControlBlock: control.emit_control_block,
    control.SubmoduleList: control.emit_submodule_list,
    identification.Im0: identification.emit_im0,
    identification.ImText: identification.emit_im_text,
    identification.IdentificationData: identification.emit_identification_data,
    identification.ApiData: identification.emit_api_data,
    identification.ArData: identification.emit_ar_data,
    identification.RecordInputData: identification.emit_record_input_data,
    identification.RecordOutputData: identification.emit_record_output_data,
    identification.SubstituteValue: identification.emit_substitute_value,
    diagnosis.DiagnosisData: diagnosis.emit_diagnosis_data,
    log_book.LogData: log_book.emit_log_data,
    pdev.PortDataCheck: pdev.emit_port_data,
    pdev.PortDataAdjust: pdev.emit_port_data,
    pdev.PortDataReal: pdev.emit_port_data_real,
    pdev.PortStatistic: pdev.emit_port_statistic,
    pdev.InterfaceDataReal: pdev.emit_interface_data_real,
    pdev.InterfaceAdjust: pdev.emit_interface_adjust,
    pdev.MultipleBlock: pdev.emit_multiple_block,
    container.ContainerContent: container.emit_container_content,
    fsu.ArFsuDataAdjust: fsu.emit_ar_fsu_data_adjust,
    RawBlock: emit_raw_block,
}


def parse_block(block: RawBlock) -> Block:
    """The typed form of ``block``, or ``block`` itself when its type has no codec.

    Raises :class:`DecodeError` when the type is known and the body does not follow it.
    """
    parser = _PARSERS.get(block.block_type)
    return parser(block) if parser else block


def emit_block(block: Block) -> bytes:
    return _EMITTERS[type(block)](block)


def parse_blocks(data: bytes) -> tuple[Block, ...]:
    """Every block of a Connect, Control or Release payload, or of a record."""
    return tuple(parse_block(raw) for raw in split_blocks(data))


def read_blocks(data: bytes) -> tuple[tuple[Block, ...], tuple[str, ...]]:
    """As many blocks as can be read, for display; and a sentence for each one that cannot.

    A block that does not follow its type stays a :class:`RawBlock`; behind a wrong length nothing more is read.
    """
    reader = Reader(data)
    blocks: list[Block] = []
    wrong: list[str] = []
    while reader.remaining:
        try:
            raw = parse_raw_block(reader)
        except DecodeError as exc:
            wrong.append(f"behind {len(blocks)} blocks: {exc}")
            break
        try:
            blocks.append(parse_block(raw))
        except DecodeError as exc:
            blocks.append(raw)
            wrong.append(f"block 0x{raw.block_type:04X}: {exc}")
    return tuple(blocks), tuple(wrong)


def emit_blocks(blocks: Iterable[Block]) -> bytes:
    return b"".join(emit_block(block) for block in blocks)
