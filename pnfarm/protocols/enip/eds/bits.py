"""Bits of a connection's fields in an electronic data sheet (CIP volume 1, 7-3.6.9), and what they are beside it."""

from __future__ import annotations

from typing import Final

from pnfarm.protocols.enip.connection import ConnectionKind

__all__ = [
    "CLASS_1", "FIRST_TRIGGER", "FIXED_INPUTS", "FIXED_OUTPUTS", "HEADER", "HEARTBEAT", "INPUT_FORMAT",
    "INPUT_MULTICAST", "INPUT_POINT_TO_POINT", "KINDS", "MODELESS", "OUTPUT_FORMAT", "OUTPUT_POINT_TO_POINT",
    "PRIORITIES", "REDUNDANT_OWNER",
]  # fmt: skip

# Trigger and transport: class 1; the place of the first production trigger; the application's types.
CLASS_1: Final = 1 << 1
FIRST_TRIGGER: Final = 16
KINDS: Final = {
    ConnectionKind.EXCLUSIVE_OWNER: 1 << 26,
    ConnectionKind.INPUT_ONLY: 1 << 25,
    ConnectionKind.LISTEN_ONLY: 1 << 24,
}
REDUNDANT_OWNER: Final = 1 << 27

# Connection parameters: fixed sizes, each with variable ones in the next bit; places of the real-time formats, and the
# formats; types; priorities low, high and scheduled of both directions.
FIXED_OUTPUTS: Final = 1 << 0
FIXED_INPUTS: Final = 1 << 2
OUTPUT_FORMAT, INPUT_FORMAT = 8, 12
MODELESS, HEARTBEAT, HEADER = 0, 3, 4
OUTPUT_POINT_TO_POINT: Final = 1 << 18
INPUT_MULTICAST: Final = 1 << 21
INPUT_POINT_TO_POINT: Final = 1 << 22
PRIORITIES: Final = 7 << 24 | 7 << 28
