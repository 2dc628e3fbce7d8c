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
from typing import TYPE_CHECKING

from pnfarm.wire.rtc import ALARM_FRAME_IDS, FIRST_ACYCLIC_FRAME_ID

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

__all__ = [
    "GroupReceiver",
    "Instruction",
    "acyclic_filter",
    "assemble",
    "attach",
    "cyclic_filter",
    "datagram_filter",
    "ethertype_filter",
    "join_fanout",
    "runs_of",
]

SO_ATTACH_FILTER = 26
MAX_INSTRUCTIONS = 4096  # BPF_MAXINSNS

# Operation codes (linux/bpf_common.h): class | size or operation | mode or source.
_LD_WORD_ABS = 0x20
_LD_HALF_ABS = 0x28
_LD_BYTE_ABS = 0x30
_LD_HALF_INDEX = 0x48
_LDX_HEADER_LENGTH = 0xB1
_JUMP_SET = 0x45
_JUMP_EQUAL = 0x15
_JUMP_GREATER = 0x25
_JUMP_GREATER_EQUAL = 0x35
_RETURN = 0x06

# linux/filter.h: loads at these negative offsets read the packet's meta data.
_ANCILLARY = 0x1_0000_0000 - 0x1000
_ANCILLARY_PACKET_TYPE = _ANCILLARY + 4
_ANCILLARY_IFINDEX = _ANCILLARY + 8
_ANCILLARY_MARK = _ANCILLARY + 20

# linux/if_packet.h: 0 host, 1 broadcast, 2 multicast, 3 other host, 4 outgoing.  A frame with a VLAN id other than 0 is
# another host's to the kernel, whatever its destination; a PROFINET controller may request such frames.
_LAST_PACKET_TYPE_FOR_US = 2
_BROADCAST, _MULTICAST, _OTHER_HOST = 1, 2, 3

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
_ACCEPT = "accept"
_DROP = "drop"


@dataclass(frozen=True, slots=True)
class Instruction:
    """One operation; a jump names where it goes if true and if false (empty: the next instruction).

    ``label`` is a name by which others jump here.
    """

    code: int
    k: int
    if_true: str = _NEXT
    if_false: str = _NEXT
    label: str = ""


@dataclass(frozen=True, slots=True)
class GroupReceiver:
    """The one interface that hears group-addressed frames for all that share a cable, whose copies are dropped.

    Without those that carry ``mark``: their sender hands them on itself.
    """

    index: int
    mark: int


def _load_word(offset: int) -> Instruction:
    return Instruction(_LD_WORD_ABS, offset)


def _load_half(offset: int) -> Instruction:
    return Instruction(_LD_HALF_ABS, offset)


def _for_these_ports(
    lowest: int, highest: int, last: int = _LAST_PACKET_TYPE_FOR_US, group_receiver: GroupReceiver | None = None
) -> list[Instruction]:
    """Frames that came in at one of the farm's interfaces, of packet types up to ``last``; all else is dropped."""
    once = (
        [
            Instruction(_JUMP_EQUAL, _BROADCAST, "group", _NEXT),
            Instruction(_JUMP_EQUAL, _MULTICAST, "group", "heard"),
            Instruction(_LD_WORD_ABS, _ANCILLARY_IFINDEX, label="group"),
            Instruction(_JUMP_EQUAL, group_receiver.index, _NEXT, _DROP),
            _load_word(_ANCILLARY_MARK),
            Instruction(_JUMP_EQUAL, group_receiver.mark, _DROP, _NEXT),
            Instruction(_LD_WORD_ABS, _ANCILLARY_PACKET_TYPE, label="heard"),
        ]
        if group_receiver is not None
        else []
    )
    return [
        _load_word(_ANCILLARY_IFINDEX),
        Instruction(_JUMP_GREATER_EQUAL, lowest, _NEXT, _DROP),
        Instruction(_JUMP_GREATER, highest, _DROP, _NEXT),
        _load_word(_ANCILLARY_PACKET_TYPE),
        Instruction(_JUMP_GREATER, last, _DROP, _NEXT),
        *once,
    ]


def datagram_filter(lowest: int, highest: int, service: int) -> bytes:
    """For an IPv4 socket: whole UDP datagrams to the port ``service`` that came in for these interfaces."""
    return assemble(
        [
            *_for_these_ports(lowest, highest),
            Instruction(_LD_BYTE_ABS, 14 + 9),
            Instruction(_JUMP_EQUAL, socket.IPPROTO_UDP, _NEXT, _DROP),
            _load_half(14 + 6),
            # more fragments, or a fragment's offset
            Instruction(_JUMP_SET, 0x3FFF, _DROP, _NEXT),
            Instruction(_LDX_HEADER_LENGTH, 14),
            Instruction(_LD_HALF_INDEX, 14 + 2),
            Instruction(_JUMP_EQUAL, service, _ACCEPT, _DROP),
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
        instructions.append(_load_word(_ANCILLARY_IFINDEX))
        for first, last in without[:MOST_RUNS]:
            # in front of this run and behind the one before: in none
            instructions.append(Instruction(_JUMP_GREATER_EQUAL, first, _NEXT, _ACCEPT))
            instructions.append(Instruction(_JUMP_GREATER, last, _NEXT, _DROP))
    if mark:
        instructions += [_load_word(_ANCILLARY_MARK), Instruction(_JUMP_EQUAL, mark, _DROP, _ACCEPT)]
    return assemble(instructions)


def acyclic_filter(lowest: int, highest: int, group_receiver: GroupReceiver | None = None) -> bytes:
    """For a 0x8892 socket: alarms and DCP (frame id from 0xFC00).  A frame too short for a frame id is dropped.

    Alarms pass with any VLAN id: the reader checks the destination address.
    """
    return assemble(
        [
            *_for_these_ports(lowest, highest, _OTHER_HOST, group_receiver),
            _load_half(_FRAME_ID_OFFSET),
            Instruction(_JUMP_GREATER_EQUAL, FIRST_ACYCLIC_FRAME_ID, _NEXT, _DROP),
            _load_word(_ANCILLARY_PACKET_TYPE),
            Instruction(_JUMP_EQUAL, _OTHER_HOST, _NEXT, _ACCEPT),
            _load_half(_FRAME_ID_OFFSET),
            *(Instruction(_JUMP_EQUAL, frame_id, _ACCEPT, _NEXT) for frame_id in ALARM_FRAME_IDS[:-1]),
            Instruction(_JUMP_EQUAL, ALARM_FRAME_IDS[-1], _ACCEPT, _DROP),
        ]
    )


def cyclic_filter(lowest: int, highest: int) -> bytes:
    """For the engine's 0x8892 socket: the other half, frame ids below 0xFC00.

    With any VLAN id: the engine checks the destination address.
    """
    return assemble(
        [
            *_for_these_ports(lowest, highest, _OTHER_HOST),
            _load_half(_FRAME_ID_OFFSET),
            Instruction(_JUMP_GREATER_EQUAL, FIRST_ACYCLIC_FRAME_ID, _DROP, _ACCEPT),
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
                Instruction(_JUMP_GREATER_EQUAL, FIRST_ACYCLIC_FRAME_ID, _DROP, _ACCEPT),
            ]
        )
        buffer = ctypes.create_string_buffer(program, len(program))
        fprog = struct.pack("HP", len(program) // 8, ctypes.addressof(buffer))
        acyclic.setsockopt(_SOL_PACKET, _PACKET_FANOUT_DATA, fprog)
    cyclic.setsockopt(_SOL_PACKET, _PACKET_FANOUT, group & 0xFFFF | _FANOUT_CBPF << 16)


def assemble_choice(instructions: Sequence[Instruction]) -> bytes:
    """Like :func:`assemble`, but *accept* answers 1 and *drop* answers 0: the number of a socket."""
    ends = struct.pack("=HBBI", _RETURN, 0, 0, 1) + struct.pack("=HBBI", _RETURN, 0, 0, 0)
    return assemble(instructions)[: -len(ends)] + ends


def assemble(instructions: Sequence[Instruction]) -> bytes:
    """Lay out as an array of ``struct sock_filter``; ends with *accept whole frame* and *drop*.

    Falling off the end accepts.  Raises :class:`ValueError` for a jump that a program cannot express.
    """
    places = {_ACCEPT: len(instructions), _DROP: len(instructions) + 1}
    places |= {instruction.label: place for place, instruction in enumerate(instructions) if instruction.label}
    if len(instructions) + 2 > MAX_INSTRUCTIONS:
        raise ValueError(f"{len(instructions)} instructions are more than a socket filter may have")
    code = bytearray()
    for place, instruction in enumerate(instructions):
        jumps = [places.get(target, place + 1) - place - 1 for target in (instruction.if_true, instruction.if_false)]
        if max(jumps) > 0xFF:
            raise ValueError(f"instruction {place} jumps over more than 255 others")
        code += struct.pack("=HBBI", instruction.code, *jumps, instruction.k)
    code += struct.pack("=HBBI", _RETURN, 0, 0, 0xFFFF)
    code += struct.pack("=HBBI", _RETURN, 0, 0, 0)
    return bytes(code)


def attach(sock: socket.socket, code: bytes) -> None:
    """Attach an assembled program to a socket; the kernel checks it and copies it.  Raises :class:`OSError`."""
    buffer = ctypes.create_string_buffer(code, len(code))
    fprog = struct.pack("HP", len(code) // 8, ctypes.addressof(buffer))
    sock.setsockopt(socket.SOL_SOCKET, SO_ATTACH_FILTER, fprog)
