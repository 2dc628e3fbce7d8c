"""The only place where impairments change cyclic frames."""

from __future__ import annotations

from typing import Any

from pnfarm.table.channel import IOXS_BAD, STATUS_RUN, STATUS_VALID
from pnfarm.table.compiled import compiled
from pnfarm.table.impairment import DATA_INVALID, IOPS_BAD, LOSS, PROVIDER_STOP

__all__ = ["impair_received", "impair_sent"]


@compiled
def _random32(row: Any) -> int:
    """xorshift64*: the next 32 random bits of this row's own sequence."""
    x = int(row.random) & 0x7FFFFFFFFFFFFFFF
    x ^= x >> 12
    x ^= (x << 25) & 0x7FFFFFFFFFFFFFFF
    x ^= x >> 27
    row.random = x
    return (x >> 16) & 0xFFFFFFFF


@compiled
def _activates(impairments: Any, row: Any, now: int) -> bool:
    """Whether this impairment acts on the present frame; counts the evidence."""
    if now < row.start_ns or (row.stop_ns != 0 and now >= row.stop_ns):
        return False
    if row.limit != 0:
        used = row.activations
        if row.shares > 0:
            used += impairments[row.shares - 1].activations
        if used >= row.limit:
            return False
    row.checks += 1
    if row.checks <= row.after:
        return False
    if row.threshold != 0xFFFFFFFF and _random32(row) >= row.threshold:
        return False
    if row.activations == 0:
        row.first_ns = now
    row.activations += 1
    row.last_ns = now
    return True


@compiled
def impair_received(impairments: Any, first: int, now: int) -> bool:
    """True when the frame is lost on its way in."""
    lost = False
    link = first
    while link > 0:
        row = impairments[link - 1]
        if row.kind == LOSS and _activates(impairments, row, now):
            lost = True
        link = row.next
    return lost


@compiled
def impair_sent(impairments: Any, provider: Any, frame: Any, now: int) -> bool:
    """Change ``frame`` in place; true when it must not leave."""
    lost = False
    link = provider.impairment
    while link > 0:
        row = impairments[link - 1]
        if _activates(impairments, row, now):
            status = provider.length - 2
            if row.kind == LOSS:
                lost = True
            elif row.kind == IOPS_BAD:
                for i in range(provider.iops_count):
                    frame[provider.iops_offset[i]] = IOXS_BAD
            elif row.kind == PROVIDER_STOP:
                frame[status] &= 0xFF ^ STATUS_RUN
            elif row.kind == DATA_INVALID:
                frame[status] &= 0xFF ^ STATUS_VALID
        link = row.next
    return lost
