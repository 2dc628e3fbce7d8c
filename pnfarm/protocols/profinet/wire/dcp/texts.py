"""Texts for the codes of DCP (IEC 61158-6-10, coding of Option, Suboption and BlockError)."""

from __future__ import annotations

from pnfarm.protocols.profinet.wire.dcp.blocks import (
    OPTION_DHCP,
    Block,
    BlockError,
    OptionId,
)
from pnfarm.wire.code import words_of

__all__ = ["describe_block_error", "describe_option"]

_FIRST_OF_MANUFACTURERS, _LAST_OF_MANUFACTURERS = 0x80, 0xFE


def describe_option(option_id: OptionId) -> str:
    """What a block is called and its two numbers: ``name of station (2/2)``."""
    option, suboption = option_id
    kind = Block.KINDS.get(option_id)
    word = None if kind is None else kind.CALLED
    if option == OPTION_DHCP:
        word = "DHCP"
    elif word is None and _FIRST_OF_MANUFACTURERS <= option <= _LAST_OF_MANUFACTURERS:
        word = "manufacturer's option"
    return f"{word or 'option'} ({option}/{suboption})"


def describe_block_error(error: int) -> str:
    """The text of a BlockError, its number where there is none."""
    return words_of(BlockError, error, f"error {error}") if error else "error 0"
