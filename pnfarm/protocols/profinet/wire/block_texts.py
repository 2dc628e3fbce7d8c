"""A record's blocks by the names of their fields: as plain JSON values, or shortened to one line."""

from __future__ import annotations

from dataclasses import asdict
from ipaddress import IPv4Address
from typing import TYPE_CHECKING, Any
from uuid import UUID

from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.wire.any_block import parse_block, parse_blocks
from pnfarm.protocols.profinet.wire.block import RawBlock
from pnfarm.protocols.profinet.wire.records.pdev import MultipleBlock

if TYPE_CHECKING:
    from pnfarm.protocols.profinet.wire.block import Block

__all__ = ["blocks_in_line", "blocks_in_words", "number_text"]

#: Letters of one line; the rest is left out.
LINE = 240
#: Fields that say how a block is written, not what is in it.
_FORM = frozenset({"block_type", "version"})


def blocks_in_words(data: bytes) -> list[dict[str, Any]]:
    """The record's blocks by their fields; empty when it is not made of blocks that are known."""
    try:
        blocks = parse_blocks(data)
    except DecodeError:
        return []
    if not blocks or all(isinstance(block, RawBlock) for block in blocks):
        return []
    return [_block(block) for block in blocks]


def _block(block: Block) -> dict[str, Any]:
    found = {"block": type(block).__name__, **_plain(asdict(block))}
    if isinstance(block, MultipleBlock):
        found["blocks"] = [_block(_known(inner)) for inner in block.blocks]
    return found


def _known(block: RawBlock) -> Block:
    try:
        return parse_block(block)
    except DecodeError:
        return block


def _plain(value: Any) -> Any:
    """Plain JSON: text where octets are printable, hexadecimal elsewhere."""
    match value:
        case dict():
            return {key: _plain(part) for key, part in value.items()}
        case list() | tuple():
            return [_plain(part) for part in value]
        case bytes():
            text = value.rstrip(b"\0 ")
            printable = all(0x20 <= octet < 0x7F for octet in text)
            return text.decode("ascii") if printable else value.hex(" ")
        case UUID() | IPv4Address():
            return str(value)
        case int() if not isinstance(value, bool):
            return int(value)
    return value


def number_text(value: int) -> str:
    """``261 (0x105)``: some numbers are usually read in decimal, others in hexadecimal."""
    return f"{value} (0x{value:X})" if value >= 0 else str(value)


def blocks_in_line(data: bytes) -> str:
    """E.g. ``Im0 vendor_id 261 (0x105), order_id AKD-P00306``; empty when the blocks are not known."""
    line = "; ".join(_line(block) for block in blocks_in_words(data))
    if len(line) <= LINE:
        return line
    return f"{line[:LINE].rpartition(',')[0] or line[:LINE]} ..."


def _line(block: dict[str, Any]) -> str:
    fields = {key: value for key, value in block.items() if key not in _FORM and key != "block"}
    return f"{block['block']} {_in_line(fields)}".rstrip()


def _in_line(value: Any) -> str:
    match value:
        case {"block": _}:
            return _line(value)
        case dict():
            return ", ".join(f"{key} {_nested(part)}" for key, part in value.items() if key not in _FORM)
        case list():
            return ", ".join(_nested(part) for part in value)
        case int() if not isinstance(value, bool):
            return str(value) if 0 <= value < 10 else number_text(value)
        case "":
            return "-"
        case _:
            return str(value)


def _nested(value: Any) -> str:
    return f"({_in_line(value)})" if isinstance(value, (dict, list)) else _in_line(value)
