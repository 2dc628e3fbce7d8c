"""Names of the bits of the position controller's words, bit 0 first (AKD EtherNet/IP manual 6.2.2.2, 6.2.3.2, 3)."""

from __future__ import annotations

__all__ = ["CONTROL_BITS", "STATUS_1_BITS", "STATUS_2_BITS"]

CONTROL_BITS = (
    "load_start", "start_block", "relative", "direction", "smooth_stop", "hard_stop", "", "enable",
)  # fmt: skip
STATUS_1_BITS = (
    "in_motion", "block_in_execution", "in_position", "general_fault", "current_direction", "homed", "", "enable_state",
)  # fmt: skip
STATUS_2_BITS = (
    "", "positive_hw_limit", "negative_hw_limit", "positive_sw_limit", "negative_sw_limit", "", "", "load_complete",
)  # fmt: skip
