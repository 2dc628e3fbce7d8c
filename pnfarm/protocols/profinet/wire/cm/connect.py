"""Blocks of the Connect service but for the IOCR and the expected submodules: AR, alarm CR, parameter
server, multicast CR, AR RPC, AR server, AR vendor (IEC 61158-6-10, IODConnectReq and IODConnectRes)."""

from enum import IntEnum

from pnfarm.protocols.profinet.wire.block import VERSION_1_0, Block, BlockType
from pnfarm.wire.layout import Mac, Octets16, Outside, Rest, UInt16, UInt32, Uuid

__all__ = [
    "ALARM_TAG_HEADER_HIGH",
    "ALARM_TAG_HEADER_LOW",
    "CM_INITIATOR_OBJECT_UUID_PREFIX",
    "STARTUP_ADVANCED",
    "STARTUP_LEGACY",
    "AlarmCrBlockReq",
    "AlarmCrBlockRes",
    "ArBlockReq",
    "ArBlockRes",
    "ArProperties",
    "ArRpcBlockReq",
    "ArRpcBlockRes",
    "ArServerBlock",
    "ArType",
    "ArVendorBlockReq",
    "ArVendorBlockRes",
    "McrBlockReq",
    "PrmServerBlockReq",
    "PrmServerBlockRes",
]


class ArType(IntEnum):
    """Coding of the field ARType."""

    IOCAR_SINGLE = 0x0001
    IOSAR = 0x0006
    IOCAR_SINGLE_RT_CLASS_3 = 0x0010
    IOCAR_SR = 0x0020


class ArProperties:
    """Bits of the field ARProperties (u32)."""

    STATE_MASK = 0x00000007
    STATE_ACTIVE = 0x00000001
    SUPERVISOR_TAKEOVER_ALLOWED = 1 << 3
    #: 1: the CM initiator parametrises; 0: an external parameter server does.
    PARAMETRIZATION_BY_INITIATOR = 1 << 4
    DEVICE_ACCESS = 1 << 8
    COMPANION_AR_MASK = 3 << 9
    ACKNOWLEDGE_COMPANION_AR = 1 << 11
    COMBINED_OBJECT_CONTAINER = 1 << 29
    STARTUP_MODE_ADVANCED = 1 << 30
    PULL_MODULE_ALARM_ALLOWED = 1 << 31


#: The two start-ups seen in the captures of real controllers.
STARTUP_LEGACY = 0x00000011
STARTUP_ADVANCED = 0x40000011

#: First ten octets of every CMInitiatorObjectUUID; instance, device and vendor follow.
CM_INITIATOR_OBJECT_UUID_PREFIX = bytes.fromhex("dea000006c9711d18271")

#: AlarmCRTagHeaderHigh / Low: user priority << 13 | VLAN identifier 0.
ALARM_TAG_HEADER_HIGH = 0xC000
ALARM_TAG_HEADER_LOW = 0xA000


class ArBlockReq(Block, types=BlockType.AR_REQ):
    """0x0101.  ``activity_timeout_factor`` counts 100 ms; ``station_name`` is the controller's, as octets."""

    ar_type: UInt16
    ar_uuid: Uuid
    session_key: UInt16
    initiator_mac: Mac
    initiator_object_uuid: Uuid
    properties: UInt32
    activity_timeout_factor: UInt16
    udp_rt_port: UInt16
    station_name: Octets16
    version: Outside[int] = VERSION_1_0

    @property
    def device_access(self) -> bool:
        """Acyclic only: no CRs, no parametrisation phase."""
        return bool(self.properties & ArProperties.DEVICE_ACCESS)

    @property
    def supervisor(self) -> bool:
        """A supervisor's AR with CRs: it controls submodules as a controller does."""
        return self.ar_type == ArType.IOSAR and not self.device_access


class ArBlockRes(Block, types=BlockType.AR_RES):
    """0x8101."""

    ar_type: UInt16
    ar_uuid: Uuid
    session_key: UInt16
    responder_mac: Mac
    udp_rt_port: UInt16 = 0x8892
    version: Outside[int] = VERSION_1_0


class AlarmCrBlockReq(Block, types=BlockType.ALARM_CR_REQ):
    """0x0103.  ``rta_timeout_factor`` counts 100 ms; ``max_alarm_data_length`` octets."""

    alarm_cr_type: UInt16 = 1
    lt: UInt16 = 0x8892
    properties: UInt32 = 0
    rta_timeout_factor: UInt16 = 1
    rta_retries: UInt16 = 3
    local_alarm_reference: UInt16 = 0
    max_alarm_data_length: UInt16 = 200
    tag_header_high: UInt16 = ALARM_TAG_HEADER_HIGH
    tag_header_low: UInt16 = ALARM_TAG_HEADER_LOW
    version: Outside[int] = VERSION_1_0


class AlarmCrBlockRes(Block, types=BlockType.ALARM_CR_RES):
    """0x8103."""

    alarm_cr_type: UInt16
    local_alarm_reference: UInt16
    max_alarm_data_length: UInt16
    version: Outside[int] = VERSION_1_0


class PrmServerBlockReq(Block, types=BlockType.PRM_SERVER_REQ):
    """0x0105: an external parameter server."""

    object_uuid: Uuid
    properties: UInt32
    activity_timeout_factor: UInt16
    station_name: Octets16
    version: Outside[int] = VERSION_1_0


class PrmServerBlockRes(Block, types=BlockType.PRM_SERVER_RES):
    """0x8105: a header alone."""

    version: Outside[int] = VERSION_1_0


class McrBlockReq(Block, types=BlockType.MCR_REQ, padded=True):
    """0x0106: a multicast provider to subscribe to."""

    iocr_reference: UInt16
    address_resolution_properties: UInt32
    mci_timeout_factor: UInt16
    station_name: Octets16
    version: Outside[int] = VERSION_1_0


class ArRpcBlockReq(Block, types=BlockType.AR_RPC_REQ):
    """0x0107: the UDP port on which the initiator serves RPC."""

    server_port: UInt16
    version: Outside[int] = VERSION_1_0


class ArRpcBlockRes(Block, types=BlockType.AR_RPC_RES):
    """0x8107: the UDP port on which the responder serves RPC."""

    server_port: UInt16
    version: Outside[int] = VERSION_1_0


class ArServerBlock(Block, types=BlockType.AR_SERVER_RES, padded=True):
    """0x8106: the device's station name."""

    station_name: Octets16
    version: Outside[int] = VERSION_1_0


class ArVendorBlockReq(Block, types=BlockType.AR_VENDOR_REQ):
    """0x0108."""

    ap_structure_identifier: UInt16
    api: UInt32
    data: Rest = b""
    version: Outside[int] = VERSION_1_0


class ArVendorBlockRes(Block, types=BlockType.AR_VENDOR_RES):
    """0x8108."""

    ap_structure_identifier: UInt16
    api: UInt32
    data: Rest = b""
    version: Outside[int] = VERSION_1_0
