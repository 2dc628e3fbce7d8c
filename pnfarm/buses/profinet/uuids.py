"""UUIDs of calls and connections: reproducible, and never the same twice."""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING
from uuid import UUID

if TYPE_CHECKING:
    from collections.abc import Callable

__all__ = ["uuid_source"]


def uuid_source(seed: bytes) -> Callable[[], UUID]:
    """UUIDs that differ from each other, and from those of any other seed: version 8, digest of seed and count."""
    count = 0

    def new() -> UUID:
        nonlocal count
        count += 1
        digest = bytearray(hashlib.sha256(seed + count.to_bytes(8, "big")).digest()[:16])
        digest[6] = digest[6] & 0x0F | 0x80
        digest[8] = digest[8] & 0x3F | 0x80
        return UUID(bytes=bytes(digest))

    return new
