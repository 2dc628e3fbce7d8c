"""Connect requests of which one thing is wrong, or unusual: a name, and the blocks' octets."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from random import Random
from typing import Any
from uuid import UUID

from pnfarm.protocols.profinet.wire.block import Block, RawBlock, split_blocks
from pnfarm.protocols.profinet.wire.cm.connect import AlarmCrBlockReq, ArBlockReq
from pnfarm.protocols.profinet.wire.cm.expected import DataDescription, ExpectedApi, ExpectedSubmoduleBlockReq
from pnfarm.protocols.profinet.wire.cm.iocr import FrameSlot, IocrApi, IocrBlockReq

__all__ = ["wrong_connect"]

Change = Callable[[list[Block]], Sequence[Block]]

#: Fields of the blocks, and values that are not good, or not usual.
AR: dict[str, tuple[Any, ...]] = {
    "ar_type": (0, 2, 6, 0x10, 0x20, 0xFFFF),
    "ar_uuid": (UUID(int=0),),
    "session_key": (0, 0xFFFF),
    "initiator_mac": (bytes(6), b"\xff" * 6, bytes.fromhex("010ecf000001")),
    "initiator_object_uuid": (UUID(int=0), UUID(int=0xFFFF)),
    "properties": (0, 0x10, 0x12, 0x01, 0x31, 0x51, 0x91, 0x111, 0x211, 0x811, 0x1011, 0x40000011, 0x80000011, 0x19),
    "activity_timeout_factor": (0, 1, 1000, 1001, 0xFFFF),
    "udp_rt_port": (0, 0x8894, 0xFFFF),
    "station_name": (b"", b"-", b"Not A Name", b"a" * 63, b"a" * 64, b"a" * 240, b"a" * 241, b"1.2.3.4"),
    "version": (0x0000, 0x0101, 0x0200),
}
IOCR: dict[str, tuple[Any, ...]] = {
    "iocr_type": (0, 1, 2, 3, 4, 5, 0xFFFF),
    "iocr_reference": (0, 1, 2, 0xFFFF),
    "lt": (0, 0x0800, 0x8894),
    "properties": (0, 1, 3, 4, 5, 0x12, 0x80000002, 0xFFFFFFF2),
    "data_length": (0, 1, 39, 41, 60, 1440, 1441, 0xFFFF),
    "frame_id": (0, 0x0100, 0x7FFF, 0x8001, 0xBBFF, 0xBC00, 0xC000, 0xC001, 0xF7FF, 0xFBFF, 0xFC01, 0xFFFF),
    "send_clock_factor": (0, 1, 3, 31, 128, 129, 0xFFFF),
    "reduction_ratio": (0, 3, 512, 513, 0xFFFF),
    "phase": (0, 2, 64, 65, 0xFFFF),
    "sequence": (1, 0xFFFF),
    "frame_send_offset": (0, 1, 1_000_000, 0xFFFFFFFE),
    "watchdog_factor": (0, 1, 31, 0x1E00, 0x1E01, 0xFFFF),
    "data_hold_factor": (0, 31, 0x1E00, 0x1E01, 0xFFFF),
    "tag_header": (0, 0x8000, 0xA000, 0xC001, 0xE000),
    "multicast_mac": (b"\xff" * 6, bytes.fromhex("010ecf000201"), bytes.fromhex("020000000001")),
    "version": (0x0000, 0x0101, 0x0200),
}
ALARM: dict[str, tuple[Any, ...]] = {
    "alarm_cr_type": (0, 2, 0xFFFF),
    "lt": (0, 0x0800, 0x8894),
    "properties": (1, 2, 3, 4, 0x80000000),
    "rta_timeout_factor": (0, 2, 100, 101, 0xFFFF),
    "rta_retries": (0, 2, 15, 16, 0xFFFF),
    "local_alarm_reference": (0, 0xFFFF),
    "max_alarm_data_length": (0, 199, 201, 1432, 1433, 0xFFFF),
    "tag_header_high": (0, 0xA000, 0xC001, 0xE000),
    "tag_header_low": (0, 0x8000, 0xA001, 0xC000),
    "version": (0x0000, 0x0101, 0x0200),
}
SUBMODULE: dict[str, tuple[Any, ...]] = {
    "subslot": (0, 2, 99, 0x8000, 0x9000, 0xFFFF),
    "submodule_ident": (0, 0x131, 0x9999),
    "properties": (0, 1, 2, 4, 8, 0x10, 0x20, 0x40, 0xFFFC),
}
DATA: dict[str, tuple[Any, ...]] = {
    "direction": (0, 1, 2, 3, 0xFFFF),
    "data_length": (0, 1, 2, 3, 255, 1440, 0xFFFF),
    "iocs_length": (0, 2, 255),
    "iops_length": (0, 2, 255),
}
API: dict[str, tuple[Any, ...]] = {
    "api": (1, 0x3A00, 0xFFFFFFFF),
    "slot": (0, 3, 4, 5, 77, 0x7FFF, 0x8000, 0xFFFF),
    "module_ident": (0, 0x30, 0x32, 0x40, 0x9999, 0xFFFFFFFF),
    "module_properties": (1, 0xFFFF),
}


def _shown(value: object) -> str:
    if isinstance(value, int):
        return f"0x{value:X}"
    if isinstance(value, bytes):
        return value.hex() if len(value) == 6 else f"of {len(value)}" if len(value) > 12 else repr(value.decode())
    return str(value)


def _nth(kind: type[Block], number: int, change: Callable[[Any], Block]) -> Change:
    """Another block in place of one."""

    def changed(blocks: list[Block]) -> list[Block]:
        places = [place for place, block in enumerate(blocks) if isinstance(block, kind)]
        blocks[places[number]] = change(blocks[places[number]])
        return blocks

    return changed


def _fields(
    what: str, kind: type[Block], number: int, fields: dict[str, tuple[Any, ...]]
) -> Iterator[tuple[str, Change]]:
    for name, values in fields.items():
        for value in values:
            yield f"{what} {name} {_shown(value)}", _nth(kind, number, lambda b, n=name, v=value: replace(b, **{n: v}))


def _slots(change: Callable[[ExpectedApi], Sequence[ExpectedApi]], number: int) -> Change:
    """Other slots in place of one of the expected block."""

    def changed(block: ExpectedSubmoduleBlockReq) -> Block:
        apis = list(block.apis)
        apis[number : number + 1] = change(apis[number])
        return replace(block, apis=tuple(apis))

    return _nth(ExpectedSubmoduleBlockReq, 0, changed)


def _submodule(number: int, **fields: Any) -> Change:
    return _slots(
        lambda slot: [replace(slot, submodules=(replace(slot.submodules[0], **fields), *slot.submodules[1:]))], number
    )


def _expected() -> Iterator[tuple[str, Change]]:
    """Of slot 0, the access point, slot 1, inputs and outputs, and slot 2."""
    for number in (0, 1, 2):
        for name, values in API.items():
            for value in values:
                yield (
                    f"slot {number} {name} {_shown(value)}",
                    _slots(lambda slot, n=name, v=value: [replace(slot, **{n: v})], number),
                )
        for name, values in SUBMODULE.items():
            for value in values:
                yield f"slot {number} {name} {_shown(value)}", _submodule(number, **{name: value})
        for name, values in DATA.items():
            for value in values:

                def described(slot: ExpectedApi, name: str = name, value: int = value) -> list[ExpectedApi]:
                    first, *others = slot.submodules
                    data: tuple[DataDescription, ...] = (replace(first.data[0], **{name: value}), *first.data[1:])
                    return [replace(slot, submodules=(replace(first, data=data), *others))]

                yield f"slot {number} {name} {_shown(value)}", _slots(described, number)
        yield f"slot {number} missing", _slots(lambda slot: [], number)
        yield f"slot {number} twice", _slots(lambda slot: [slot, slot], number)
        yield f"slot {number} without submodules", _slots(lambda slot: [replace(slot, submodules=())], number)
        yield (
            f"slot {number} with its first submodule twice",
            _slots(lambda slot: [replace(slot, submodules=(slot.submodules[0], *slot.submodules))], number),
        )


def _frames() -> Iterator[tuple[str, Change]]:
    """What an IOCR says of its frame."""

    def api(number: int, change: Callable[[IocrApi], Sequence[IocrApi]]) -> Change:
        return _nth(IocrBlockReq, number, lambda block: replace(block, apis=(*change(block.apis[0]), *block.apis[1:])))

    def first(slots: tuple[FrameSlot, ...], **fields: int) -> tuple[FrameSlot, ...]:
        return (replace(slots[0], **fields), *slots[1:])

    for number, what in ((0, "input"), (1, "output")):
        changes: dict[str, Callable[[IocrApi], Sequence[IocrApi]]] = {
            "without APIs": lambda one: [],
            "with its API twice": lambda one: [one, one],
            "of API 0x1": lambda one: [replace(one, api=1)],
            "without objects": lambda one: [replace(one, data_objects=())],
            "without IOCS": lambda one: [replace(one, iocs=())],
            "with an object missing": lambda one: [replace(one, data_objects=one.data_objects[1:])],
            "with an IOCS missing": lambda one: [replace(one, iocs=one.iocs[1:])],
            "with an object twice": lambda one: [replace(one, data_objects=(one.data_objects[0], *one.data_objects))],
            "with an IOCS twice": lambda one: [replace(one, iocs=(one.iocs[0], *one.iocs))],
            "with an object of slot 0x4D": lambda one: [replace(one, data_objects=first(one.data_objects, slot=77))],
            "with an object of subslot 0x63": lambda one: [
                replace(one, data_objects=first(one.data_objects, subslot=99))
            ],
            "with an IOCS of slot 0x4D": lambda one: [replace(one, iocs=first(one.iocs, slot=77))],
            "with an object behind the frame": lambda one: [
                replace(one, data_objects=first(one.data_objects, frame_offset=1439))
            ],
            "with an IOCS behind the frame": lambda one: [replace(one, iocs=first(one.iocs, frame_offset=0xFFFF))],
            "with an object over another": lambda one: [
                replace(one, data_objects=first(one.data_objects, frame_offset=one.data_objects[-1].frame_offset))
            ],
            "with an IOCS over an object": lambda one: [
                replace(one, iocs=first(one.iocs, frame_offset=one.data_objects[0].frame_offset))
            ],
        }
        for name, change in changes.items():
            yield f"{what} CR {name}", api(number, change)


def _whole() -> Iterator[tuple[str, Change]]:
    """Blocks that are missing, doubled, in another order, or of another kind."""
    names = ("AR", "input CR", "output CR", "expected", "alarm CR")
    for place, name in enumerate(names):
        yield f"no {name} block", lambda blocks, p=place: blocks[:p] + blocks[p + 1 :]
        yield f"two {name} blocks", lambda blocks, p=place: [*blocks[: p + 1], *blocks[p:]]
        yield f"the {name} block last", lambda blocks, p=place: [*blocks[:p], *blocks[p + 1 :], blocks[p]]
    yield "no blocks", lambda blocks: []
    yield "the AR block alone", lambda blocks: blocks[:1]
    yield "no CR blocks", lambda blocks: [blocks[0], *blocks[3:]]
    for kind in (0x0000, 0x0105, 0x0106, 0x0107, 0x0108, 0x0110, 0x0120, 0x0FFF, 0x7FFF, 0x8101):
        yield f"a block 0x{kind:04X} more", lambda blocks, k=kind: [*blocks, RawBlock(k, bytes(28))]
        yield f"a block 0x{kind:04X} first", lambda blocks, k=kind: [RawBlock(k, bytes(28)), *blocks]


def _octets(blocks: Sequence[Block]) -> bytes:
    return b"".join(block.emit() for block in blocks)


def _lengths(payload: bytes) -> Iterator[tuple[str, bytes]]:
    """A BlockLength of another value, and blocks whose end is elsewhere."""
    names = ("AR", "input CR", "output CR", "expected", "alarm CR")
    place = 0
    for name, block in zip(names, split_blocks(payload), strict=True):
        for change in (-block.length, -2, -1, 1, 2, 0x1000):
            length = (block.length + change).to_bytes(2, "big")
            yield f"{name} BlockLength {change:+}", payload[: place + 2] + length + payload[place + 4 :]
        cut = RawBlock(block.block_type, block.body[:-2], block.version).emit()
        grown = RawBlock(block.block_type, block.body + b"\0\0", block.version).emit()
        end = place + 4 + block.length
        yield f"{name} block two octets short", payload[:place] + cut + payload[end:]
        yield f"{name} block two octets long", payload[:place] + grown + payload[end:]
        place = end
    yield "two octets behind the blocks", payload + b"\0\0"
    yield "a block header behind the blocks", payload + b"\1\3\0\x16\1\0"
    yield "the last octet missing", payload[:-1]


TABLE: tuple[tuple[str, Change], ...] = (
    *_fields("AR", ArBlockReq, 0, AR), *_fields("input CR", IocrBlockReq, 0, IOCR),
    *_fields("output CR", IocrBlockReq, 1, IOCR), *_fields("alarm CR", AlarmCrBlockReq, 0, ALARM),
    *_expected(), *_frames(), *_whole(),
)  # fmt: skip


def wrong_connect(rng: Random, good: list[Block]) -> tuple[str, bytes]:
    """One of them."""
    if rng.random() < 0.1:
        return rng.choice(list(_lengths(_octets(good))))
    name, change = rng.choice(TABLE)
    return name, _octets(change(good))
