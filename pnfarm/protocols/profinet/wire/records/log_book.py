"""The log book of a device: LogData (IEC 61158-6-10, LogBook)."""

from pnfarm.protocols.profinet.wire.block import VERSION_1_0, Block, BlockType
from pnfarm.protocols.profinet.wire.rpc.pdu import PnioStatus
from pnfarm.wire.layout import List16, Outside, Structure, UInt32, UInt64, Uuid

__all__ = ["LogData", "LogEntry"]


class LogEntry(Structure):
    """``time_stamp`` counts on the device's own clock, as :attr:`LogData.time_stamp` does."""

    time_stamp: UInt64
    ar_uuid: Uuid
    status: PnioStatus
    detail: UInt32 = 0


class LogData(Block, types=BlockType.LOG_DATA):
    """0x0019.  ``time_stamp`` is the local time now, u64; the entries are the oldest first."""

    time_stamp: UInt64
    entries: List16[LogEntry]
    version: Outside[int] = VERSION_1_0
