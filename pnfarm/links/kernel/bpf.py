"""Socket filters (classic BPF) that keep foreign frames out of the farm's sockets.

The kernel runs such a program on each frame before it is copied or queued, so a foreign frame
costs next to nothing.  A program is a list of :class:`Instruction` with symbolic jump targets
(:func:`assemble` lays them out); registers: ``A`` only.  Offsets count from the destination address.

Sources: linux/filter.h (ancillary loads), Documentation/networking/filter.rst.
"""

from __future__ import annotations

import ctypes
import socket
import struct
from dataclasses import dataclass
from enum import IntEnum
from typing import TYPE_CHECKING, NamedTuple

from pnfarm.wire.rtc import ALARM_FRAME_IDS, FIRST_ACYCLIC_FRAME_ID

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

__all__ = [
    "ACCEPT", "DROP", "IFINDEX", "OTHER_HOST", "PACKET_TYPE", "GroupReceiver", "Instruction", "Op", "acyclic_filter",
    "assemble", "attach", "cyclic_filter", "datagram_filter", "ethertype_filter", "join_fanout", "label", "runs_of",
]  # fmt: skip

SO_ATTACH_FILTER = 26
MAX_INSTRUCTIONS = 4096  # BPF_MAXINSNS


class Op(IntEnum):
    """Operation codes (linux/bpf_common.h): class | size or operation | mode or source."""

    LD_WORD = 0x20
    LD_HALF = 0x28
    LD_BYTE = 0x30
    LD_BYTE_INDEXED = 0x50
    LD_HALF_INDEXED = 0x48
    LDX_HEADER_LENGTH = 0xB1
    JUMP = 0x05
    JUMP_SET = 0x45
    JUMP_EQUAL = 0x15
    JUMP_GREATER = 0x25
    JUMP_GREATER_EQUAL = 0x35
    RETURN = 0x06


# linux/filter.h: loads at these negative offsets read the packet's meta data.
_ANCILLARY = 0x1_0000_0000 - 0x1000
PACKET_TYPE = _ANCILLARY + 4
IFINDEX = _ANCILLARY + 8
_ANCILLARY_MARK = _ANCILLARY + 20

# linux/if_packet.h: 0 host, 1 broadcast, 2 multicast, 3 other host, 4 outgoing.  A frame with a VLAN id other than 0 is
# another host's to the kernel, whatever its destination; a PROFINET controller may request such frames.
_LAST_PACKET_TYPE_FOR_US = 2
_BROADCAST, _MULTICAST, OTHER_HOST = 1, 2, 3

#: After destination, source and ethertype; priority tags (VLAN id 0) are gone when a socket sees the frame.
_FRAME_ID_OFFSET = 14

#: A fanout program sees a received frame from behind its EtherType on.
_FANOUT_FRAME_ID_OFFSET = 0

# linux/if_packet.h
_SOL_PACKET = 263
_PACKET_FANOUT = 18
_PACKET_FANOUT_DATA = 22
_FANOUT_CBPF = 6
_FANOUT_FLAG_UNIQUE_ID = 0x2000

#: Runs of interfaces that a filter leaves out.
MOST_RUNS = 32

_NEXT = ""
ACCEPT = "accept"
DROP = "drop"


class Instruction(NamedTuple):
    """One operation; a jump names where it goes if true and if false (empty: the next instruction).

    Without ``code`` it is the place of the label that ``if_true`` names.
    """

    code: int | None
    k: int = 0
    if_true: str = _NEXT
    if_false: str = _NEXT


def label(name: str) -> Instruction:
    """A name by which others jump to the next instruction."""
    return Instruction(None, 0, name)


@dataclass(frozen=True, slots=True)
class GroupReceiver:
    """The one interface that hears group-addressed frames for all that share a cable, whose copies are dropped.

    Without those that carry ``mark``: their sender hands them on itself.
    """

    index: int
    mark: int


def _load_word(offset: int) -> Instruction:
    return Instruction(Op.LD_WORD, offset)


def _load_half(offset: int) -> Instruction:
    return Instruction(Op.LD_HALF, offset)


def _for_these_ports(
    lowest: int, highest: int, last: int = _LAST_PACKET_TYPE_FOR_US, group_receiver: GroupReceiver | None = None
) -> list[Instruction]:
    """Frames that came in at one of the farm's interfaces, of packet types up to ``last``; all else is dropped."""
    once = (
        [
            Instruction(Op.JUMP_EQUAL, _BROADCAST, "group", _NEXT),
            Instruction(Op.JUMP_EQUAL, _MULTICAST, "group", "heard"),
            label("group"),
            Instruction(Op.LD_WORD, IFINDEX),
            Instruction(Op.JUMP_EQUAL, group_receiver.index, _NEXT, DROP),
            _load_word(_ANCILLARY_MARK),
            Instruction(Op.JUMP_EQUAL, group_receiver.mark, DROP, _NEXT),
            label("heard"),
            Instruction(Op.LD_WORD, PACKET_TYPE),
        ]
        if group_receiver is not None
        else []
    )
    return [
        _load_word(IFINDEX),
        Instruction(Op.JUMP_GREATER_EQUAL, lowest, _NEXT, DROP),
        Instruction(Op.JUMP_GREATER, highest, DROP, _NEXT),
        _load_word(PACKET_TYPE),
        Instruction(Op.JUMP_GREATER, last, DROP, _NEXT),
        *once,
    ]


def datagram_filter(lowest: int, highest: int, service: int) -> bytes:
    """For an IPv4 socket: whole UDP datagrams to the port ``service`` that came in for these interfaces."""
    return assemble(
        [
            *_for_these_ports(lowest, highest),
            Instruction(Op.LD_BYTE, 14 + 9),
            Instruction(Op.JUMP_EQUAL, socket.IPPROTO_UDP, _NEXT, DROP),
            _load_half(14 + 6),
            # more fragments, or a fragment's offset
            Instruction(Op.JUMP_SET, 0x3FFF, DROP, _NEXT),
            Instruction(Op.LDX_HEADER_LENGTH, 14),
            Instruction(Op.LD_HALF_INDEXED, 14 + 2),
            Instruction(Op.JUMP_EQUAL, service, ACCEPT, DROP),
        ]
    )


def runs_of(indexes: Collection[int], among: Collection[int]) -> list[tuple[int, int]]:
    """First and last of the runs of ``indexes`` that no other of ``among`` interrupts."""
    runs: list[tuple[int, int]] = []
    follows = False
    for index in sorted(among):
        if index not in indexes:
            follows = False
        elif follows:
            runs[-1] = (runs[-1][0], index)
        else:
            runs.append((index, index))
            follows = True
    return runs


def ethertype_filter(
    lowest: int,
    highest: int,
    *,
    mark: int = 0,
    without: Sequence[tuple[int, int]] = (),
    group_receiver: GroupReceiver | None = None,
) -> bytes:
    """For a socket of one ethertype: all frames that came in for interfaces ``lowest`` to ``highest``.

    Without those of the runs of interfaces ``without``, in order; at most :data:`MOST_RUNS` are considered, the reader
    checks again.  Or without those that carry ``mark`` (SO_MARK of the sending socket, which a veth and a bridge of one
    namespace keep).
    """
    instructions = _for_these_ports(lowest, highest, group_receiver=group_receiver)
    if without and not mark:
        instructions.append(_load_word(IFINDEX))
        for first, last in without[:MOST_RUNS]:
            # in front of this run and after the one before: in none
            instructions.append(Instruction(Op.JUMP_GREATER_EQUAL, first, _NEXT, ACCEPT))
            instructions.append(Instruction(Op.JUMP_GREATER, last, _NEXT, DROP))
    if mark:
        instructions += [_load_word(_ANCILLARY_MARK), Instruction(Op.JUMP_EQUAL, mark, DROP, ACCEPT)]
    return assemble(instructions)


def acyclic_filter(lowest: int, highest: int, group_receiver: GroupReceiver | None = None) -> bytes:
    """For a 0x8892 socket: alarms and DCP (frame id from 0xFC00).  A frame too short for a frame id is dropped.

    Alarms pass with any VLAN id: the reader checks the destination address.
    """
    return assemble(
        [
            *_for_these_ports(lowest, highest, OTHER_HOST, group_receiver),
            _load_half(_FRAME_ID_OFFSET),
            Instruction(Op.JUMP_GREATER_EQUAL, FIRST_ACYCLIC_FRAME_ID, _NEXT, DROP),
            _load_word(PACKET_TYPE),
            Instruction(Op.JUMP_EQUAL, OTHER_HOST, _NEXT, ACCEPT),
            _load_half(_FRAME_ID_OFFSET),
            *(Instruction(Op.JUMP_EQUAL, frame_id, ACCEPT, _NEXT) for frame_id in ALARM_FRAME_IDS[:-1]),
            Instruction(Op.JUMP_EQUAL, ALARM_FRAME_IDS[-1], ACCEPT, DROP),
        ]
    )


def cyclic_filter(lowest: int, highest: int) -> bytes:
    """For the engine's 0x8892 socket: the other half, frame ids below 0xFC00.

    With any VLAN id: the engine checks the destination address.
    """
    return assemble(
        [
            *_for_these_ports(lowest, highest, OTHER_HOST),
            _load_half(_FRAME_ID_OFFSET),
            Instruction(Op.JUMP_GREATER_EQUAL, FIRST_ACYCLIC_FRAME_ID, DROP, ACCEPT),
        ]
    )


def join_fanout(acyclic: socket.socket, cyclic: socket.socket) -> None:
    """Let the kernel hand each 0x8892 frame to one of the two sockets instead of offering it to both.

    Two sockets of one ethertype cost a copy of every frame's descriptor; a fanout group of both costs none.  Both are
    bound alike.  ``acyclic`` joins first and is number 0.  Raises :class:`OSError`.
    """
    group = acyclic.getsockopt(_SOL_PACKET, _PACKET_FANOUT)
    if not group:
        acyclic.setsockopt(_SOL_PACKET, _PACKET_FANOUT, (_FANOUT_CBPF | _FANOUT_FLAG_UNIQUE_ID) << 16)
        group = acyclic.getsockopt(_SOL_PACKET, _PACKET_FANOUT)
        program = assemble_choice(
            [
                _load_half(_FANOUT_FRAME_ID_OFFSET),
                Instruction(Op.JUMP_GREATER_EQUAL, FIRST_ACYCLIC_FRAME_ID, DROP, ACCEPT),
            ]
        )
        buffer = ctypes.create_string_buffer(program, len(program))
        fprog = struct.pack("HP", len(program) // 8, ctypes.addressof(buffer))
        acyclic.setsockopt(_SOL_PACKET, _PACKET_FANOUT_DATA, fprog)
    cyclic.setsockopt(_SOL_PACKET, _PACKET_FANOUT, group & 0xFFFF | _FANOUT_CBPF << 16)


def assemble_choice(instructions: Sequence[Instruction]) -> bytes:
    """Like :func:`assemble`, but *accept* answers 1 and *drop* answers 0: the number of a socket."""
    ends = struct.pack("=HBBI", Op.RETURN, 0, 0, 1) + struct.pack("=HBBI", Op.RETURN, 0, 0, 0)
    return assemble(instructions)[: -len(ends)] + ends


def assemble(instructions: Sequence[Instruction], whole: int = 0xFFFF) -> bytes:
    """Lay out as an array of ``struct sock_filter``; ends with *accept*, of ``whole`` octets, and *drop*.

    Falling off the end accepts.  Raises :class:`ValueError` for a jump that a program cannot express.
    """
    places: dict[str, int] = {}
    laid_out: list[Instruction] = []
    for instruction in instructions:
        if instruction.code is None:
            places[instruction.if_true] = len(laid_out)
        else:
            laid_out.append(instruction)
    places |= {ACCEPT: len(laid_out), DROP: len(laid_out) + 1}
    if len(laid_out) + 2 > MAX_INSTRUCTIONS:
        raise ValueError(f"{len(laid_out)} instructions are more than a socket filter may have")
    code = bytearray()
    for place, (operation, k, *targets) in enumerate(laid_out):
        jumps = [places[target] - place - 1 if target else 0 for target in targets]
        if operation == Op.JUMP:
            # the only one that reaches everywhere
            k, jumps = jumps[0], [0, 0]
        elif max(jumps) > 0xFF:
            raise ValueError(f"instruction {place} jumps over more than 255 others")
        code += struct.pack("=HBBI", operation, *jumps, k)
    code += struct.pack("=HBBI", Op.RETURN, 0, 0, whole)
    code += struct.pack("=HBBI", Op.RETURN, 0, 0, 0)
    return bytes(code)


def attach(sock: socket.socket, code: bytes) -> None:
    """Attach an assembled program to a socket; the kernel checks it and copies it.  Raises :class:`OSError`."""
    buffer = ctypes.create_string_buffer(code, len(code))
    fprog = struct.pack("HP", len(code) // 8, ctypes.addressof(buffer))
    sock.setsockopt(socket.SOL_SOCKET, SO_ATTACH_FILTER, fprog)
