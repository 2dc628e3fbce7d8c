"""The log book of a device: LogData (IEC 61158-6-10, LogBook)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from pnfarm.protocols.profinet.wire.block import (
    VERSION_1_0,
    BlockType,
    RawBlock,
    check_type,
    emit_raw_block,
    read_uuid,
    write_uuid,
)
from pnfarm.protocols.profinet.wire.rpc.pdu import PnioStatus
from pnfarm.wire.octets import Writer

if TYPE_CHECKING:
    from uuid import UUID

__all__ = ["LogData", "LogEntry", "emit_log_data", "parse_log_data"]


@dataclass(frozen=True, slots=True)
class LogEntry:
    """``time_stamp`` counts on the device's own clock, as :attr:`LogData.time_stamp` does."""

    time_stamp: int
    ar_uuid: UUID
    status: PnioStatus
    detail: int = 0


@dataclass(frozen=True, slots=True)
class LogData:
    """0x0019.  ``time_stamp`` is the local time now, u64; the entries are the oldest first."""

    time_stamp: int
    entries: tuple[LogEntry, ...]
    version: int = VERSION_1_0


def parse_log_data(block: RawBlock) -> LogData:
    r = check_type(block, BlockType.LOG_DATA)
    now, count = r.u64(), r.u16()
    entries = tuple(LogEntry(r.u64(), read_uuid(r), PnioStatus.from_int(r.u32()), r.u32()) for _ in range(count))
    r.expect_end()
    return LogData(now, entries, block.version)


def emit_log_data(value: LogData) -> bytes:
    w = Writer().u64(value.time_stamp).u16(len(value.entries))
    for entry in value.entries:
        write_uuid(w.u64(entry.time_stamp), entry.ar_uuid).u32(int(entry.status)).u32(entry.detail)
    return emit_raw_block(RawBlock(BlockType.LOG_DATA, w.getvalue(), value.version))
