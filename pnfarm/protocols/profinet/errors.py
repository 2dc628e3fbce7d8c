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


class ErrorCode(IntEnum):
    """Which service failed."""

    OK = 0x00
    PNIO = 0x81
    RTA_ERROR = 0xCF
    ALARM_ACK = 0xDA
    CONNECT = 0xDB
    RELEASE = 0xDC
    CONTROL = 0xDD
    READ = 0xDE
    WRITE = 0xDF


class ErrorDecode(IntEnum):
    """Which table ErrorCode1 and ErrorCode2 follow."""

    OK = 0x00
    PNIORW = 0x80
    PNIO = 0x81


class ConnectFault(IntEnum):
    """ErrorCode1 under PNIO: the faulty block or the machine that refused."""

    AR_BLOCK = 0x01
    IOCR_BLOCK = 0x02
    EXPECTED_SUBMODULE_BLOCK = 0x03
    ALARM_CR_BLOCK = 0x04
    PRM_SERVER_BLOCK = 0x05
    MCR_BLOCK = 0x06
    AR_RPC_BLOCK = 0x07
    RECORD = 0x08
    IR_INFO_BLOCK = 0x09
    SR_INFO_BLOCK = 0x0A
    AR_FSU_BLOCK = 0x0B
    AR_VENDOR_BLOCK = 0x0C
    RS_INFO_BLOCK = 0x0D
    CONTROL_BLOCK = 0x14
    CONTROL_BLOCK_PLUG = 0x15
    IOX_CONTROL_BLOCK = 0x16
    IOX_CONTROL_BLOCK_PLUG = 0x17
    PRM_BEGIN_BLOCK = 0x18
    SUBMODULE_LIST_BLOCK = 0x19
    RELEASE_BLOCK = 0x28
    AR_BLOCK_RES = 0x32
    IOCR_BLOCK_RES = 0x33
    ALARM_CR_BLOCK_RES = 0x34
    MODULE_DIFF_BLOCK = 0x35
    AR_RPC_BLOCK_RES = 0x36
    AR_SERVER_BLOCK_RES = 0x37
    AR_VENDOR_BLOCK_RES = 0x38
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


class ArField(IntEnum):
    """ErrorCode2 of ARBlockReq."""

    BLOCK_TYPE = 0
    BLOCK_LENGTH = 1
    BLOCK_VERSION_HIGH = 2
    BLOCK_VERSION_LOW = 3
    AR_TYPE = 4
    AR_UUID = 5
    SESSION_KEY = 6
    CM_INITIATOR_MAC = 7
    CM_INITIATOR_OBJECT_UUID = 8
    AR_PROPERTIES = 9
    ACTIVITY_TIMEOUT_FACTOR = 10
    INITIATOR_UDP_RT_PORT = 11
    STATION_NAME_LENGTH = 12
    STATION_NAME = 13


class IocrField(IntEnum):
    """ErrorCode2 of IOCRBlockReq."""

    BLOCK_TYPE = 0
    BLOCK_LENGTH = 1
    BLOCK_VERSION_HIGH = 2
    BLOCK_VERSION_LOW = 3
    IOCR_TYPE = 4
    IOCR_REFERENCE = 5
    LT = 6
    IOCR_PROPERTIES = 7
    DATA_LENGTH = 8
    FRAME_ID = 9
    SEND_CLOCK_FACTOR = 10
    REDUCTION_RATIO = 11
    PHASE = 12
    SEQUENCE = 13
    FRAME_SEND_OFFSET = 14
    WATCHDOG_FACTOR = 15
    DATA_HOLD_FACTOR = 16
    IOCR_TAG_HEADER = 17
    MULTICAST_MAC = 18
    NUMBER_OF_APIS = 19
    API = 20
    NUMBER_OF_IO_DATA_OBJECTS = 21
    DATA_SLOT = 22
    DATA_SUBSLOT = 23
    DATA_FRAME_OFFSET = 24
    NUMBER_OF_IOCS = 25
    IOCS_SLOT = 26
    IOCS_SUBSLOT = 27
    IOCS_FRAME_OFFSET = 28


class ExpectedField(IntEnum):
    """ErrorCode2 of ExpectedSubmoduleBlockReq."""

    BLOCK_TYPE = 0
    BLOCK_LENGTH = 1
    BLOCK_VERSION_HIGH = 2
    BLOCK_VERSION_LOW = 3
    NUMBER_OF_APIS = 4
    API = 5
    SLOT = 6
    MODULE_IDENT = 7
    MODULE_PROPERTIES = 8
    NUMBER_OF_SUBMODULES = 9
    SUBSLOT = 10
    SUBMODULE_IDENT = 11
    SUBMODULE_PROPERTIES = 12
    DATA_DESCRIPTION = 13
    SUBMODULE_DATA_LENGTH = 14
    LENGTH_IOPS = 15
    LENGTH_IOCS = 16


class AlarmCrField(IntEnum):
    """ErrorCode2 of AlarmCRBlockReq."""

    BLOCK_TYPE = 0
    BLOCK_LENGTH = 1
    BLOCK_VERSION_HIGH = 2
    BLOCK_VERSION_LOW = 3
    ALARM_CR_TYPE = 4
    LT = 5
    ALARM_CR_PROPERTIES = 6
    RTA_TIMEOUT_FACTOR = 7
    RTA_RETRIES = 8
    LOCAL_ALARM_REFERENCE = 9
    MAX_ALARM_DATA_LENGTH = 10
    TAG_HEADER_HIGH = 11
    TAG_HEADER_LOW = 12


class ArRpcField(IntEnum):
    """ErrorCode2 of ARRPCBlockReq."""

    BLOCK_TYPE = 0
    BLOCK_LENGTH = 1
    BLOCK_VERSION_HIGH = 2
    BLOCK_VERSION_LOW = 3
    INITIATOR_RPC_SERVER_PORT = 4


class RecordField(IntEnum):
    """ErrorCode2 of a read or write header."""

    BLOCK_TYPE = 0
    BLOCK_LENGTH = 1
    BLOCK_VERSION_HIGH = 2
    BLOCK_VERSION_LOW = 3
    SEQUENCE_NUMBER = 4
    AR_UUID = 5
    API = 6
    SLOT = 7
    SUBSLOT = 8
    PADDING = 9
    INDEX = 10
    RECORD_DATA_LENGTH = 11
    TARGET_AR_UUID = 12


class ControlField(IntEnum):
    """ErrorCode2 of a control or release block."""

    BLOCK_TYPE = 0
    BLOCK_LENGTH = 1
    BLOCK_VERSION_HIGH = 2
    BLOCK_VERSION_LOW = 3
    PADDING = 4
    AR_UUID = 5
    SESSION_KEY = 6
    ALARM_SEQUENCE_NUMBER = 7
    CONTROL_COMMAND = 8
    CONTROL_BLOCK_PROPERTIES = 9


class SubmoduleListField(IntEnum):
    """ErrorCode2 of SubmoduleListBlock, in the order of the wire."""

    BLOCK_TYPE = 0
    BLOCK_LENGTH = 1
    BLOCK_VERSION_HIGH = 2
    BLOCK_VERSION_LOW = 3
    NUMBER_OF_ENTRIES = 4
    API = 5
    SLOT = 6
    SUBSLOT = 7


class AlarmAckError(IntEnum):
    """ErrorCode2 of AlarmAck: why an alarm was not accepted."""

    ALARM_TYPE_NOT_SUPPORTED = 0
    WRONG_SUBMODULE_STATE = 1
    BACKUP_ALARM_NOT_EXECUTED = 2


class CmdevError(IntEnum):
    """ErrorCode2 of CMDEV."""

    STATE_CONFLICT = 0
    RESOURCES = 1


class CmrpcError(IntEnum):
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


class AccessError(IntEnum):
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


class RtaError(IntEnum):
    """ErrorCode2 of RTA_ERR_CLS_PROTOCOL: why an AR was aborted."""

    SEQUENCE = 0x01
    INSTANCE_CLOSED = 0x02
    OUT_OF_MEMORY = 0x03
    ADD_PROVIDER_CONSUMER_FAILED = 0x04
    CONSUMER_DHT_EXPIRED = 0x05
    CMI_TIMEOUT = 0x06
    ALARM_OPEN_FAILED = 0x07
    ALARM_SEND_FAILED = 0x08
    ALARM_ACK_SEND_FAILED = 0x09
    ALARM_DATA_TOO_LONG = 0x0A
    ALARM_IND_ERROR = 0x0B
    RPC_CLIENT_CALL_FAILED = 0x0C
    ABORT_REQUEST = 0x0D
    RE_RUN_ABORTS_EXISTING = 0x0E
    RELEASE_RECEIVED = 0x0F
    DEVICE_DEACTIVATED = 0x10
    REMOVED = 0x11
    PROTOCOL_VIOLATION = 0x12
    NAME_RESOLUTION_ERROR = 0x13
    RPC_BIND_ERROR = 0x14
    RPC_CONNECT_ERROR = 0x15
    RPC_READ_ERROR = 0x16
    RPC_WRITE_ERROR = 0x17
    RPC_CONTROL_ERROR = 0x18
    FORBIDDEN_PULL_OR_PLUG = 0x19
    AP_REMOVED = 0x1A
    LINK_DOWN = 0x1B
    MULTICAST_REGISTER_FAILED = 0x1C
    NOT_SYNCHRONIZED = 0x1D
    WRONG_TOPOLOGY = 0x1E
    STATION_NAME_CHANGED = 0x1F
    RESET_TO_FACTORY = 0x20
    PDEV_PORT_SPEED = 0x24
    IP_SUITE_CHANGED = 0x25


_RTA_TEXTS = {
    RtaError.SEQUENCE: "alarm sequence numbers do not fit (RTA_ERR_CODE_SEQ)",
    RtaError.INSTANCE_CLOSED: "instance closed (RTA_ERR_ABORT)",
    RtaError.OUT_OF_MEMORY: "AR out of memory (RTA_ERR_ABORT)",
    RtaError.ADD_PROVIDER_CONSUMER_FAILED: "AR add provider or consumer failed (RTA_ERR_ABORT)",
    RtaError.CONSUMER_DHT_EXPIRED: "AR consumer DHT/WDT expired (RTA_ERR_ABORT)",
    RtaError.CMI_TIMEOUT: "AR CMI timeout (RTA_ERR_ABORT)",
    RtaError.ALARM_OPEN_FAILED: "AR alarm open failed (RTA_ERR_ABORT)",
    RtaError.ALARM_SEND_FAILED: "AR alarm send not confirmed (RTA_ERR_ABORT)",
    RtaError.ALARM_ACK_SEND_FAILED: "AR alarm acknowledgement not confirmed (RTA_ERR_ABORT)",
    RtaError.ALARM_DATA_TOO_LONG: "AR alarm data too long (RTA_ERR_ABORT)",
    RtaError.ALARM_IND_ERROR: "AR faulty alarm indication (RTA_ERR_ABORT)",
    RtaError.RPC_CLIENT_CALL_FAILED: "AR RPC client call failed (RTA_ERR_ABORT)",
    RtaError.ABORT_REQUEST: "AR abort requested (RTA_ERR_ABORT)",
    RtaError.RE_RUN_ABORTS_EXISTING: "AR re-run aborts the existing one (RTA_ERR_ABORT)",
    RtaError.RELEASE_RECEIVED: "AR release received (RTA_ERR_ABORT)",
    RtaError.DEVICE_DEACTIVATED: "AR device deactivated (RTA_ERR_ABORT)",
    RtaError.REMOVED: "AR removed (RTA_ERR_ABORT)",
    RtaError.PROTOCOL_VIOLATION: "AR protocol violation (RTA_ERR_ABORT)",
    RtaError.NAME_RESOLUTION_ERROR: "AR name resolution error (RTA_ERR_ABORT)",
    RtaError.RPC_BIND_ERROR: "AR RPC bind error (RTA_ERR_ABORT)",
    RtaError.RPC_CONNECT_ERROR: "AR RPC Connect error (RTA_ERR_ABORT)",
    RtaError.RPC_READ_ERROR: "AR RPC Read error (RTA_ERR_ABORT)",
    RtaError.RPC_WRITE_ERROR: "AR RPC Write error (RTA_ERR_ABORT)",
    RtaError.RPC_CONTROL_ERROR: "AR RPC Control error (RTA_ERR_ABORT)",
    RtaError.FORBIDDEN_PULL_OR_PLUG: "AR forbidden pull or plug (RTA_ERR_ABORT)",
    RtaError.AP_REMOVED: "AR application process removed (RTA_ERR_ABORT)",
    RtaError.LINK_DOWN: "AR link down (RTA_ERR_ABORT)",
    RtaError.MULTICAST_REGISTER_FAILED: "AR multicast address not registered (RTA_ERR_ABORT)",
    RtaError.NOT_SYNCHRONIZED: "not synchronised (RTA_ERR_ABORT)",
    RtaError.WRONG_TOPOLOGY: "wrong topology (RTA_ERR_ABORT)",
    RtaError.STATION_NAME_CHANGED: "DCP changed the station name (RTA_ERR_ABORT)",
    RtaError.RESET_TO_FACTORY: "DCP reset to factory settings (RTA_ERR_ABORT)",
    RtaError.PDEV_PORT_SPEED: "no port offers the required speed (RTA_ERR_ABORT)",
    RtaError.IP_SUITE_CHANGED: "IP suite changed (RTA_ERR_ABORT)",
}

_SERVICES: dict[int, str] = {
    ErrorCode.PNIO: "PNIO",
    ErrorCode.RTA_ERROR: "RTA error",
    ErrorCode.ALARM_ACK: "AlarmAck",
    ErrorCode.CONNECT: "IODConnectRes",
    ErrorCode.RELEASE: "IODReleaseRes",
    ErrorCode.CONTROL: "IODControlRes",
    ErrorCode.READ: "IODReadRes",
    ErrorCode.WRITE: "IODWriteRes",
}

_BLOCK_NAMES = {
    ConnectFault.AR_BLOCK: "ARBlockReq",
    ConnectFault.IOCR_BLOCK: "IOCRBlockReq",
    ConnectFault.EXPECTED_SUBMODULE_BLOCK: "ExpectedSubmoduleBlockReq",
    ConnectFault.ALARM_CR_BLOCK: "AlarmCRBlockReq",
    ConnectFault.PRM_SERVER_BLOCK: "PrmServerBlockReq",
    ConnectFault.MCR_BLOCK: "MCRBlockReq",
    ConnectFault.AR_RPC_BLOCK: "ARRPCBlockReq",
    ConnectFault.RECORD: "record header",
    ConnectFault.IR_INFO_BLOCK: "IRInfoBlock",
    ConnectFault.SR_INFO_BLOCK: "SRInfoBlock",
    ConnectFault.AR_FSU_BLOCK: "ARFSUBlock",
    ConnectFault.AR_VENDOR_BLOCK: "ARVendorBlockReq",
    ConnectFault.RS_INFO_BLOCK: "RSInfoBlock",
    ConnectFault.CONTROL_BLOCK: "IODControl block",
    ConnectFault.CONTROL_BLOCK_PLUG: "IODControl block after a plug alarm",
    ConnectFault.IOX_CONTROL_BLOCK: "IOXControl block",
    ConnectFault.IOX_CONTROL_BLOCK_PLUG: "IOXControl block after a plug alarm",
    ConnectFault.PRM_BEGIN_BLOCK: "PrmBegin block",
    ConnectFault.SUBMODULE_LIST_BLOCK: "SubmoduleListBlock",
    ConnectFault.RELEASE_BLOCK: "release block",
    ConnectFault.AR_BLOCK_RES: "ARBlockRes",
    ConnectFault.IOCR_BLOCK_RES: "IOCRBlockRes",
    ConnectFault.ALARM_CR_BLOCK_RES: "AlarmCRBlockRes",
    ConnectFault.MODULE_DIFF_BLOCK: "ModuleDiffBlock",
    ConnectFault.AR_RPC_BLOCK_RES: "ARRPCBlockRes",
    ConnectFault.AR_SERVER_BLOCK_RES: "ARServerBlockRes",
    ConnectFault.AR_VENDOR_BLOCK_RES: "ARVendorBlockRes",
}

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
    """Why a record handler refused; it becomes a PNIOStatus with the decode PNIORW.

    The two additional values are u16 and go into the response header.
    """

    error_code1: int
    error_code2: int = 0
    additional_value1: int = 0
    additional_value2: int = 0

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
    if code1 == ConnectFault.RTA_ERR_CLS_PROTOCOL and code2 in _RTA_TEXTS:
        return RtaError(code2).name.lower().replace("_", "-")
    return f"code-{code1:02x}-{code2:02x}"


def _text_of(enum: type[IntEnum], code: int) -> str:
    try:
        member = enum(code)
    except ValueError:
        return f"code {code}"
    if isinstance(member, RtaError):
        return _RTA_TEXTS[member]
    return member.name.lower().replace("_", " ")


def _pnio_text(code1: int, code2: int) -> str:
    table = _CODE2.get(code1)
    try:
        fault = ConnectFault(code1)
    except ValueError:
        return f"ErrorCode1 0x{code1:02X}, ErrorCode2 0x{code2:02X}"
    second = _text_of(table, code2) if table else f"code {code2}"
    block = _BLOCK_NAMES.get(fault)
    if block:
        return f"faulty {block}, {second}"
    return f"{fault.name}: {second}"


def describe_status(status: PnioStatus) -> str:
    """One line that an engineer reads, e.g. ``IODConnectRes: faulty IOCRBlockReq, reduction ratio (DB 81 02 0B)``."""
    if status.ok:
        return "OK"
    decode, code1 = status.error_decode, status.error_code1
    octets = int(status).to_bytes(4, "big").hex(" ").upper()
    service = _SERVICES.get(status.error_code, f"service 0x{status.error_code:02X}")
    if decode == ErrorDecode.PNIORW:
        reason = _text_of(AccessError, code1)
    elif decode == ErrorDecode.PNIO:
        reason = _pnio_text(code1, status.error_code2)
    else:
        reason = f"ErrorDecode 0x{decode:02X}"
    return f"{service}: {reason} ({octets})"
