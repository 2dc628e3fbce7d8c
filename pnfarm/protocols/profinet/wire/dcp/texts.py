"""Texts for the codes of DCP (IEC 61158-6-10, coding of Option, Suboption and BlockError)."""

from __future__ import annotations

from pnfarm.protocols.profinet.wire.dcp.blocks import (
    OPTION_ALL,
    OPTION_CONTROL,
    OPTION_DEVICE,
    OPTION_DHCP,
    OPTION_INITIATIVE,
    OPTION_IP,
    BlockError,
    OptionId,
)
from pnfarm.wire.code import words_of

__all__ = ["describe_block_error", "describe_option"]

_SUBOPTIONS: dict[tuple[int, int], str] = {
    (OPTION_IP, 1): "MAC address",
    (OPTION_IP, 2): "IP parameter",
    (OPTION_IP, 3): "full IP suite",
    (OPTION_DEVICE, 1): "type of station",
    (OPTION_DEVICE, 2): "name of station",
    (OPTION_DEVICE, 3): "device ID",
    (OPTION_DEVICE, 4): "device role",
    (OPTION_DEVICE, 5): "device options",
    (OPTION_DEVICE, 6): "alias name",
    (OPTION_DEVICE, 7): "device instance",
    (OPTION_DEVICE, 8): "OEM device ID",
    (OPTION_DEVICE, 9): "standard gateway",
    (OPTION_DEVICE, 10): "RSI properties",
    (OPTION_CONTROL, 1): "start transaction",
    (OPTION_CONTROL, 2): "end transaction",
    (OPTION_CONTROL, 3): "signal",
    (OPTION_CONTROL, 4): "response",
    (OPTION_CONTROL, 5): "reset of factory settings",
    (OPTION_CONTROL, 6): "reset to factory",
    (OPTION_INITIATIVE, 1): "device initiative",
    (OPTION_ALL, 0xFF): "all selector",
}
_FIRST_OF_MANUFACTURERS, _LAST_OF_MANUFACTURERS = 0x80, 0xFE


def describe_option(option_id: OptionId) -> str:
    """What a block is called and its two numbers: ``name of station (2/2)``."""
    option, suboption = option_id
    word = _SUBOPTIONS.get((option, suboption))
    if word is None and option == OPTION_DHCP:
        word = "DHCP"
    elif word is None and _FIRST_OF_MANUFACTURERS <= option <= _LAST_OF_MANUFACTURERS:
        word = "manufacturer's option"
    return f"{word or 'option'} ({option}/{suboption})"


def describe_block_error(error: int) -> str:
    """The text of a BlockError, its number where there is none."""
    return words_of(BlockError, error, f"error {error}") if error else "error 0"
