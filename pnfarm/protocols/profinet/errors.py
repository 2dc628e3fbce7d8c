"""PNIOStatus: the four octets of PROFINET's error codes, and texts for them.

``ErrorCode`` names the service, ``ErrorDecode`` the table that the other two follow: PNIORW for records,
PNIO for everything else.  Under PNIO, ``ErrorCode1`` is a block or a protocol machine and ``ErrorCode2``
the number of the faulty field, in the order of the wire, or the machine's own code
(IEC 61158-6-10, coding of PNIOStatus).
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

from pnfarm.protocols.profinet.wire.rpc.pdu import OK, PnioStatus
from pnfarm.wire.code import Code, words_of

__all__ = [
    "OK",
    "AccessError",
    "AlarmAckError",
    "AlarmCrField",
    "ArField",
    "ArRpcField",
    "CmdevError",
    "CmrpcError",
    "ConnectFault",
    "ControlField",
    "ErrorCode",
    "ErrorDecode",
    "ExpectedField",
    "IocrField",
    "PnioStatus",
    "RecordError",
    "RecordField",
    "RtaError",
    "SubmoduleListField",
    "describe_status",
    "pnio_error",
    "rta_status",
]


class ErrorCode(Code):
    """Which service failed."""

    OK = 0x00
    PNIO = 0x81, "PNIO"
    RTA_ERROR = 0xCF, "RTA error"
    ALARM_ACK = 0xDA, "AlarmAck"
    CONNECT = 0xDB, "IODConnectRes"
    RELEASE = 0xDC, "IODReleaseRes"
    CONTROL = 0xDD, "IODControlRes"
    READ = 0xDE, "IODReadRes"
    WRITE = 0xDF, "IODWriteRes"


class ErrorDecode(IntEnum):
    """Which table ErrorCode1 and ErrorCode2 follow."""

    OK = 0x00
    PNIORW = 0x80
    PNIO = 0x81


class ConnectFault(Code):
    """ErrorCode1 under PNIO: the faulty block or the machine that refused."""

    AR_BLOCK = 0x01, "ARBlockReq"
    IOCR_BLOCK = 0x02, "IOCRBlockReq"
    EXPECTED_SUBMODULE_BLOCK = 0x03, "ExpectedSubmoduleBlockReq"
    ALARM_CR_BLOCK = 0x04, "AlarmCRBlockReq"
    PRM_SERVER_BLOCK = 0x05, "PrmServerBlockReq"
    MCR_BLOCK = 0x06, "MCRBlockReq"
    AR_RPC_BLOCK = 0x07, "ARRPCBlockReq"
    RECORD = 0x08, "record header"
    IR_INFO_BLOCK = 0x09, "IRInfoBlock"
    SR_INFO_BLOCK = 0x0A, "SRInfoBlock"
    AR_FSU_BLOCK = 0x0B, "ARFSUBlock"
    AR_VENDOR_BLOCK = 0x0C, "ARVendorBlockReq"
    RS_INFO_BLOCK = 0x0D, "RSInfoBlock"
    CONTROL_BLOCK = 0x14, "IODControl block"
    CONTROL_BLOCK_PLUG = 0x15, "IODControl block after a plug alarm"
    IOX_CONTROL_BLOCK = 0x16, "IOXControl block"
    IOX_CONTROL_BLOCK_PLUG = 0x17, "IOXControl block after a plug alarm"
    PRM_BEGIN_BLOCK = 0x18, "PrmBegin block"
    SUBMODULE_LIST_BLOCK = 0x19, "SubmoduleListBlock"
    RELEASE_BLOCK = 0x28, "release block"
    AR_BLOCK_RES = 0x32, "ARBlockRes"
    IOCR_BLOCK_RES = 0x33, "IOCRBlockRes"
    ALARM_CR_BLOCK_RES = 0x34, "AlarmCRBlockRes"
    MODULE_DIFF_BLOCK = 0x35, "ModuleDiffBlock"
    AR_RPC_BLOCK_RES = 0x36, "ARRPCBlockRes"
    AR_SERVER_BLOCK_RES = 0x37, "ARServerBlockRes"
    AR_VENDOR_BLOCK_RES = 0x38, "ARVendorBlockRes"
    ALARM_ACK = 0x3C
    CMDEV = 0x3D
    CMCTL = 0x3E
    CTLDINA = 0x3F
    CMRPC = 0x40
    ALPMI = 0x41
    ALPMR = 0x42
    LMPM = 0x43
    MAC = 0x44
    RPC = 0x45
    APMR = 0x46
    APMS = 0x47
    CPM = 0x48
    PPM = 0x49
    DCPUCS = 0x4A
    DCPUCR = 0x4B
    DCPMCS = 0x4C
    DCPMCR = 0x4D
    FSPM = 0x4E
    CMSM = 0xC8
    CMRDR = 0xCA
    CMWRR = 0xCC
    CMIO = 0xCD
    CMSU = 0xCE
    CMINA = 0xD0
    CMPBE = 0xD1
    CMDMC = 0xD3
    RTA_ERR_CLS_PROTOCOL = 0xFD
    USER_SPECIFIC = 0xFF


#: ErrorCode2 of ARBlockReq.
ArField = IntEnum(
    "ArField",
    "BLOCK_TYPE BLOCK_LENGTH BLOCK_VERSION_HIGH BLOCK_VERSION_LOW AR_TYPE AR_UUID SESSION_KEY "
    "CM_INITIATOR_MAC CM_INITIATOR_OBJECT_UUID AR_PROPERTIES ACTIVITY_TIMEOUT_FACTOR "
    "INITIATOR_UDP_RT_PORT STATION_NAME_LENGTH STATION_NAME",
    start=0,
)


#: ErrorCode2 of IOCRBlockReq.
IocrField = IntEnum(
    "IocrField",
    "BLOCK_TYPE BLOCK_LENGTH BLOCK_VERSION_HIGH BLOCK_VERSION_LOW IOCR_TYPE IOCR_REFERENCE LT "
    "IOCR_PROPERTIES DATA_LENGTH FRAME_ID SEND_CLOCK_FACTOR REDUCTION_RATIO PHASE SEQUENCE "
    "FRAME_SEND_OFFSET WATCHDOG_FACTOR DATA_HOLD_FACTOR IOCR_TAG_HEADER MULTICAST_MAC NUMBER_OF_APIS API "
    "NUMBER_OF_IO_DATA_OBJECTS DATA_SLOT DATA_SUBSLOT DATA_FRAME_OFFSET NUMBER_OF_IOCS IOCS_SLOT "
    "IOCS_SUBSLOT IOCS_FRAME_OFFSET",
    start=0,
)


#: ErrorCode2 of ExpectedSubmoduleBlockReq.
ExpectedField = IntEnum(
    "ExpectedField",
    "BLOCK_TYPE BLOCK_LENGTH BLOCK_VERSION_HIGH BLOCK_VERSION_LOW NUMBER_OF_APIS API SLOT MODULE_IDENT "
    "MODULE_PROPERTIES NUMBER_OF_SUBMODULES SUBSLOT SUBMODULE_IDENT SUBMODULE_PROPERTIES DATA_DESCRIPTION "
    "SUBMODULE_DATA_LENGTH LENGTH_IOPS LENGTH_IOCS",
    start=0,
)


#: ErrorCode2 of AlarmCRBlockReq.
AlarmCrField = IntEnum(
    "AlarmCrField",
    "BLOCK_TYPE BLOCK_LENGTH BLOCK_VERSION_HIGH BLOCK_VERSION_LOW ALARM_CR_TYPE LT ALARM_CR_PROPERTIES "
    "RTA_TIMEOUT_FACTOR RTA_RETRIES LOCAL_ALARM_REFERENCE MAX_ALARM_DATA_LENGTH TAG_HEADER_HIGH "
    "TAG_HEADER_LOW",
    start=0,
)


#: ErrorCode2 of ARRPCBlockReq.
ArRpcField = IntEnum(
    "ArRpcField",
    "BLOCK_TYPE BLOCK_LENGTH BLOCK_VERSION_HIGH BLOCK_VERSION_LOW INITIATOR_RPC_SERVER_PORT",
    start=0,
)


#: ErrorCode2 of a read or write header.
RecordField = IntEnum(
    "RecordField",
    "BLOCK_TYPE BLOCK_LENGTH BLOCK_VERSION_HIGH BLOCK_VERSION_LOW SEQUENCE_NUMBER AR_UUID API SLOT "
    "SUBSLOT PADDING INDEX RECORD_DATA_LENGTH TARGET_AR_UUID",
    start=0,
)


#: ErrorCode2 of a control or release block.
ControlField = IntEnum(
    "ControlField",
    "BLOCK_TYPE BLOCK_LENGTH BLOCK_VERSION_HIGH BLOCK_VERSION_LOW PADDING AR_UUID SESSION_KEY "
    "ALARM_SEQUENCE_NUMBER CONTROL_COMMAND CONTROL_BLOCK_PROPERTIES",
    start=0,
)


#: ErrorCode2 of SubmoduleListBlock, in the order of the wire.
SubmoduleListField = IntEnum(
    "SubmoduleListField",
    "BLOCK_TYPE BLOCK_LENGTH BLOCK_VERSION_HIGH BLOCK_VERSION_LOW NUMBER_OF_ENTRIES API SLOT SUBSLOT",
    start=0,
)


class AlarmAckError(Code):
    """ErrorCode2 of AlarmAck: why an alarm was not accepted."""

    ALARM_TYPE_NOT_SUPPORTED = 0
    WRONG_SUBMODULE_STATE = 1
    BACKUP_ALARM_NOT_EXECUTED = 2


class CmdevError(Code):
    """ErrorCode2 of CMDEV."""

    STATE_CONFLICT = 0
    RESOURCES = 1


class CmrpcError(Code):
    """ErrorCode2 of CMRPC."""

    ARGS_LENGTH_INVALID = 0
    UNKNOWN_BLOCKS = 1
    IOCR_MISSING = 2
    WRONG_ALARM_CR_BLOCK_COUNT = 3
    OUT_OF_AR_RESOURCES = 4
    AR_UUID_UNKNOWN = 5
    STATE_CONFLICT = 6
    OUT_OF_PROVIDER_CONSUMER_ALARM_RESOURCES = 7
    OUT_OF_MEMORY = 8
    PDEV_ALREADY_OWNED = 9
    ARSET_STATE_CONFLICT = 10
    ARSET_PARAMETER_CONFLICT = 11
    PDEV_PORTS_WITHOUT_INTERFACE = 12


class AccessError(Code):
    """ErrorCode1 under PNIORW: why a record was not read or written."""

    READ_ERROR = 0xA0
    WRITE_ERROR = 0xA1
    MODULE_FAILURE = 0xA2
    BUSY = 0xA7
    VERSION_CONFLICT = 0xA8
    NOT_SUPPORTED = 0xA9
    INVALID_INDEX = 0xB0
    WRITE_LENGTH_ERROR = 0xB1
    INVALID_SLOT_SUBSLOT = 0xB2
    TYPE_CONFLICT = 0xB3
    INVALID_AREA = 0xB4
    STATE_CONFLICT = 0xB5
    ACCESS_DENIED = 0xB6
    INVALID_RANGE = 0xB7
    INVALID_PARAMETER = 0xB8
    INVALID_TYPE = 0xB9
    BACKUP = 0xBA
    READ_CONFLICT = 0xC0
    WRITE_CONFLICT = 0xC1
    RESOURCE_BUSY = 0xC2
    RESOURCE_UNAVAILABLE = 0xC3


class RtaError(Code):
    """ErrorCode2 of RTA_ERR_CLS_PROTOCOL: why an AR was aborted."""

    SEQUENCE = 0x01, "alarm sequence numbers do not fit (RTA_ERR_CODE_SEQ)"
    INSTANCE_CLOSED = 0x02, "instance closed (RTA_ERR_ABORT)"
    OUT_OF_MEMORY = 0x03, "AR out of memory (RTA_ERR_ABORT)"
    ADD_PROVIDER_CONSUMER_FAILED = 0x04, "AR add provider or consumer failed (RTA_ERR_ABORT)"
    CONSUMER_DHT_EXPIRED = 0x05, "AR consumer DHT/WDT expired (RTA_ERR_ABORT)"
    CMI_TIMEOUT = 0x06, "AR CMI timeout (RTA_ERR_ABORT)"
    ALARM_OPEN_FAILED = 0x07, "AR alarm open failed (RTA_ERR_ABORT)"
    ALARM_SEND_FAILED = 0x08, "AR alarm send not confirmed (RTA_ERR_ABORT)"
    ALARM_ACK_SEND_FAILED = 0x09, "AR alarm acknowledgement not confirmed (RTA_ERR_ABORT)"
    ALARM_DATA_TOO_LONG = 0x0A, "AR alarm data too long (RTA_ERR_ABORT)"
    ALARM_IND_ERROR = 0x0B, "AR faulty alarm indication (RTA_ERR_ABORT)"
    RPC_CLIENT_CALL_FAILED = 0x0C, "AR RPC client call failed (RTA_ERR_ABORT)"
    ABORT_REQUEST = 0x0D, "AR abort requested (RTA_ERR_ABORT)"
    RE_RUN_ABORTS_EXISTING = 0x0E, "AR re-run aborts the existing one (RTA_ERR_ABORT)"
    RELEASE_RECEIVED = 0x0F, "AR release received (RTA_ERR_ABORT)"
    DEVICE_DEACTIVATED = 0x10, "AR device deactivated (RTA_ERR_ABORT)"
    REMOVED = 0x11, "AR removed (RTA_ERR_ABORT)"
    PROTOCOL_VIOLATION = 0x12, "AR protocol violation (RTA_ERR_ABORT)"
    NAME_RESOLUTION_ERROR = 0x13, "AR name resolution error (RTA_ERR_ABORT)"
    RPC_BIND_ERROR = 0x14, "AR RPC bind error (RTA_ERR_ABORT)"
    RPC_CONNECT_ERROR = 0x15, "AR RPC Connect error (RTA_ERR_ABORT)"
    RPC_READ_ERROR = 0x16, "AR RPC Read error (RTA_ERR_ABORT)"
    RPC_WRITE_ERROR = 0x17, "AR RPC Write error (RTA_ERR_ABORT)"
    RPC_CONTROL_ERROR = 0x18, "AR RPC Control error (RTA_ERR_ABORT)"
    FORBIDDEN_PULL_OR_PLUG = 0x19, "AR forbidden pull or plug (RTA_ERR_ABORT)"
    AP_REMOVED = 0x1A, "AR application process removed (RTA_ERR_ABORT)"
    LINK_DOWN = 0x1B, "AR link down (RTA_ERR_ABORT)"
    MULTICAST_REGISTER_FAILED = 0x1C, "AR multicast address not registered (RTA_ERR_ABORT)"
    NOT_SYNCHRONIZED = 0x1D, "not synchronised (RTA_ERR_ABORT)"
    WRONG_TOPOLOGY = 0x1E, "wrong topology (RTA_ERR_ABORT)"
    STATION_NAME_CHANGED = 0x1F, "DCP changed the station name (RTA_ERR_ABORT)"
    RESET_TO_FACTORY = 0x20, "DCP reset to factory settings (RTA_ERR_ABORT)"
    PDEV_PORT_SPEED = 0x24, "no port offers the required speed (RTA_ERR_ABORT)"
    IP_SUITE_CHANGED = 0x25, "IP suite changed (RTA_ERR_ABORT)"


#: Which table ErrorCode2 follows, by ErrorCode1 under PNIO.
_CODE2: dict[int, type[IntEnum]] = {
    ConnectFault.AR_BLOCK: ArField,
    ConnectFault.IOCR_BLOCK: IocrField,
    ConnectFault.EXPECTED_SUBMODULE_BLOCK: ExpectedField,
    ConnectFault.ALARM_CR_BLOCK: AlarmCrField,
    ConnectFault.AR_RPC_BLOCK: ArRpcField,
    ConnectFault.RECORD: RecordField,
    **dict.fromkeys(range(ConnectFault.CONTROL_BLOCK, ConnectFault.SUBMODULE_LIST_BLOCK), ControlField),
    ConnectFault.SUBMODULE_LIST_BLOCK: SubmoduleListField,
    ConnectFault.RELEASE_BLOCK: ControlField,
    ConnectFault.ALARM_ACK: AlarmAckError,
    ConnectFault.CMDEV: CmdevError,
    ConnectFault.CMRPC: CmrpcError,
    ConnectFault.RTA_ERR_CLS_PROTOCOL: RtaError,
}


@dataclass(frozen=True, slots=True)
class RecordError:
    """Why a record handler refused; it becomes a PNIOStatus with the decode PNIORW."""

    error_code1: int
    error_code2: int = 0

    def status(self, service: int) -> PnioStatus:
        """``service`` is :attr:`ErrorCode.READ` or :attr:`ErrorCode.WRITE`."""
        return PnioStatus(int(service), int(ErrorDecode.PNIORW), int(self.error_code1), int(self.error_code2))


def pnio_error(service: int, error_code1: int, error_code2: int) -> PnioStatus:
    """A refusal with the decode PNIO."""
    return PnioStatus(int(service), int(ErrorDecode.PNIO), int(error_code1), int(error_code2))


def rta_status(code: int) -> PnioStatus:
    """The PNIOStatus of an ERR-RTA-PDU: CF 81 FD and ``code``."""
    return pnio_error(ErrorCode.RTA_ERROR, ConnectFault.RTA_ERR_CLS_PROTOCOL, code)


def abort_status(code1: int, code2: int) -> PnioStatus:
    """The PNIOStatus of an ERR-RTA-PDU with these two codes."""
    return pnio_error(ErrorCode.RTA_ERROR, code1, code2)


def abort_label(code1: int, code2: int) -> str:
    """A short slug for why an AR was aborted, such as ``consumer-dht-expired``; of an unknown code its numbers."""
    if code1 == ConnectFault.RTA_ERR_CLS_PROTOCOL and (error := RtaError.find(code2)):
        return error.name.lower().replace("_", "-")
    return f"code-{code1:02x}-{code2:02x}"


def _text_of(enum: type[IntEnum], code: int) -> str:
    return words_of(enum, code, f"code {code}")


def _pnio_text(code1: int, code2: int) -> str:
    fault = ConnectFault.find(code1)
    if fault is None:
        return f"ErrorCode1 0x{code1:02X}, ErrorCode2 0x{code2:02X}"
    second = _text_of(_CODE2[code1], code2) if code1 in _CODE2 else f"code {code2}"
    return f"faulty {fault.text}, {second}" if fault.text else f"{fault.name}: {second}"


def describe_status(status: PnioStatus) -> str:
    """One line that an engineer reads, e.g. ``IODConnectRes: faulty IOCRBlockReq, reduction ratio (DB 81 02 0B)``."""
    if status.ok:
        return "OK"
    decode, code1 = status.error_decode, status.error_code1
    octets = int(status).to_bytes(4, "big").hex(" ").upper()
    service = ErrorCode.text_of(status.error_code) or f"service 0x{status.error_code:02X}"
    if decode == ErrorDecode.PNIORW:
        reason = _text_of(AccessError, code1)
    elif decode == ErrorDecode.PNIO:
        reason = _pnio_text(code1, status.error_code2)
    else:
        reason = f"ErrorDecode 0x{decode:02X}"
    return f"{service}: {reason} ({octets})"
