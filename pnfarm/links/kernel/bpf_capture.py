"""The socket filter of a capture: which interfaces, which kinds of frames.  It runs in the kernel, before any copy.

Kinds are keywords of the command line.  Sent frames may still carry their VLAN tag where received ones lost it, so
every test is made twice, for a frame with and without a tag.
"""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING, NamedTuple

from pnfarm.links.kernel.bpf import MAX_INSTRUCTIONS
from pnfarm.wire.ethernet import ETHERTYPE_ARP, ETHERTYPE_IPV4, ETHERTYPE_LLDP, ETHERTYPE_PROFINET, ETHERTYPE_VLAN
from pnfarm.wire.rtc import ALARM_FRAME_IDS, FIRST_ACYCLIC_FRAME_ID, FIRST_CYCLIC_FRAME_ID

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable

__all__ = ["ATOMS", "KINDS", "atoms_of", "capture_filter"]

#: Kinds that a frame can be, each exactly one; but ``cip`` is inside of ``enip``, where a filter of frames cannot look.
ATOMS = ("cyclic", "dcp", "alarm", "rpc", "snmp", "enip", "cip", "arp", "icmp", "lldp", "ptcp", "other")
#: Keywords of the command line: the kinds, and ``acyclic`` for all of them but ``cyclic``.
KINDS: dict[str, frozenset[str]] = {
    **{atom: frozenset({atom}) for atom in ATOMS},
    "acyclic": frozenset(ATOMS) - {"cyclic"},
}

# Operation codes (linux/bpf_common.h).
_LD_WORD, _LD_HALF, _LD_BYTE = 0x20, 0x28, 0x30
_LD_HALF_INDEXED, _LD_BYTE_INDEXED, _LDX_HEADER_LENGTH = 0x48, 0x50, 0xB1
_JUMP, _JUMP_EQUAL, _JUMP_GREATER, _JUMP_GREATER_EQUAL, _JUMP_SET = 0x05, 0x15, 0x25, 0x35, 0x45
_RETURN = 0x06
_ANCILLARY = 0x1_0000_0000 - 0x1000
_PACKET_TYPE, _IFINDEX = _ANCILLARY + 4, _ANCILLARY + 8
_OTHER_HOST = 3
_WHOLE_FRAME = 0x40000

_FIRST_DCP, _LAST_DCP = 0xFEFC, 0xFEFF
#: Frame ids of PTCP (IEC 61158-6-10): sync below those of cyclic data, the rest behind DCP's.
_SYNCS = (0x0020, 0x0021, 0x0080, 0x0081)
_CLOCKS = (0xFF00, 0xFF01, 0xFF20, 0xFF21, 0xFF40, 0xFF41, 0xFF42, 0xFF43)
_ICMP, _TCP, _UDP = 1, 6, 17
#: Ports of EtherNet/IP (IANA): explicit messages over TCP and UDP, implicit messages over UDP.
_ENIP_PORT, _IO_PORT = 44818, 2222
_SNMP_PORTS = (161, 162)
_UDP_HEAD, _RPC_VERSION = 8, 4
_OFFSET_MASK = 0x1FFF
#: Most runs of interface indexes that are distinguished; a farm's interfaces are made in a row.
_MAXIMUM_RUNS = 900


class _Op(NamedTuple):
    """An instruction, or (``code`` None) the place of a label; jumps name labels, empty is the next instruction."""

    code: int | None
    k: int = 0
    if_true: str = ""
    if_false: str = ""


def atoms_of(kinds: Iterable[str]) -> frozenset[str]:
    """The kinds that these keywords mean; all kinds for an empty list; :class:`KeyError` for an unknown word."""
    found = frozenset[str]().union(*(KINDS[kind] for kind in kinds))
    return found or frozenset(ATOMS)


def _runs(indexes: Collection[int]) -> list[tuple[int, int]]:
    runs: list[tuple[int, int]] = []
    for index in sorted(set(indexes)):
        if runs and index == runs[-1][1] + 1:
            runs[-1] = (runs[-1][0], index)
        else:
            runs.append((index, index))
    return runs if len(runs) <= _MAXIMUM_RUNS else [(runs[0][0], runs[-1][1])]


def capture_filter(indexes: Collection[int], atoms: Collection[str], *, others: bool = False) -> bytes:
    """Frames at the interfaces ``indexes`` of the kinds ``atoms``, in both directions.

    ``others`` keeps frames for other hosts too.  Where the indexes are too scattered, all interfaces between
    the first and the last pass.  A frame too short for its kind is dropped.
    """
    program = [_Op(_LD_WORD, _IFINDEX)]
    for number, (lowest, highest) in enumerate(_runs(indexes)):
        program += [
            _Op(_JUMP_GREATER, highest, f"run {number}"),
            _Op(_JUMP_GREATER_EQUAL, lowest, "", f"below {number}"),
            _Op(_JUMP, 0, "ours"),
            _Op(None, 0, f"below {number}"),
            _Op(_JUMP, 0, "drop"),
            _Op(None, 0, f"run {number}"),
        ]
    program += [_Op(_JUMP, 0, "drop"), _Op(None, 0, "ours")]
    if not others:
        program += [_Op(_LD_WORD, _PACKET_TYPE), _Op(_JUMP_EQUAL, _OTHER_HOST, "no")]
    if set(atoms) < set(ATOMS):
        program += [_Op(_LD_HALF, 12), _Op(_JUMP_EQUAL, ETHERTYPE_VLAN, "tagged")]
        program += _kinds("", 12, atoms)
        program += [_Op(None, 0, "tagged"), *_kinds("tagged ", 16, atoms)]
    program += [_Op(None, 0, "yes"), _Op(_RETURN, _WHOLE_FRAME)]
    program += [_Op(None, 0, "no"), _Op(None, 0, "drop"), _Op(_RETURN, 0)]
    return _assemble(program)


def _kinds(name: str, base: int, atoms: Collection[str]) -> list[_Op]:
    """The decision for a frame whose EtherType is at offset ``base``."""
    to = {atom: "yes" if atom in atoms else "no" for atom in ATOMS}
    enip = "yes" if {"enip", "cip"} & set(atoms) else "no"
    network = base + 2
    return [
        _Op(_LD_HALF, base),
        _Op(_JUMP_EQUAL, ETHERTYPE_PROFINET, f"{name}pn"),
        _Op(_JUMP_EQUAL, ETHERTYPE_ARP, to["arp"]),
        _Op(_JUMP_EQUAL, ETHERTYPE_LLDP, to["lldp"]),
        _Op(_JUMP_EQUAL, ETHERTYPE_IPV4, f"{name}ip", to["other"]),
        _Op(None, 0, f"{name}pn"),
        _Op(_LD_HALF, network),
        _Op(_JUMP_GREATER_EQUAL, FIRST_ACYCLIC_FRAME_ID, f"{name}acyclic"),
        _Op(_JUMP_GREATER_EQUAL, FIRST_CYCLIC_FRAME_ID, to["cyclic"]),
        *(_Op(_JUMP_EQUAL, frame_id, to["ptcp"]) for frame_id in _SYNCS),
        _Op(_JUMP, 0, to["other"]),
        _Op(None, 0, f"{name}acyclic"),
        *(_Op(_JUMP_EQUAL, frame_id, to["alarm"]) for frame_id in ALARM_FRAME_IDS),
        *(_Op(_JUMP_EQUAL, frame_id, to["ptcp"]) for frame_id in _CLOCKS),
        _Op(_JUMP_GREATER_EQUAL, _FIRST_DCP, "", to["other"]),
        _Op(_JUMP_GREATER, _LAST_DCP, to["other"], to["dcp"]),
        _Op(None, 0, f"{name}ip"),
        _Op(_LD_BYTE, network + 9),
        _Op(_JUMP_EQUAL, _ICMP, to["icmp"]),
        _Op(_JUMP_EQUAL, _UDP, f"{name}udp"),
        _Op(_JUMP_EQUAL, _TCP, "", to["other"]),
        _Op(_LD_HALF, network + 6),
        _Op(_JUMP_SET, _OFFSET_MASK, to["other"]),
        _Op(_LDX_HEADER_LENGTH, network),
        _Op(_LD_HALF_INDEXED, network),
        _Op(_JUMP_EQUAL, _ENIP_PORT, enip),
        _Op(_LD_HALF_INDEXED, network + 2),
        _Op(_JUMP_EQUAL, _ENIP_PORT, enip, to["other"]),
        _Op(None, 0, f"{name}udp"),
        # a further fragment has no ports; only calls are longer than a frame
        _Op(_LD_HALF, network + 6),
        _Op(_JUMP_SET, _OFFSET_MASK, to["rpc"]),
        _Op(_LDX_HEADER_LENGTH, network),
        _Op(_LD_HALF_INDEXED, network),
        *(_Op(_JUMP_EQUAL, port, to["snmp"]) for port in _SNMP_PORTS),
        _Op(_JUMP_EQUAL, _ENIP_PORT, enip),
        _Op(_LD_HALF_INDEXED, network + 2),
        *(_Op(_JUMP_EQUAL, port, to["snmp"]) for port in _SNMP_PORTS),
        _Op(_JUMP_EQUAL, _ENIP_PORT, enip),
        _Op(_JUMP_EQUAL, _IO_PORT, to["cyclic"]),
        # calls use any port; each begins with the protocol's version
        _Op(_LD_BYTE_INDEXED, network + _UDP_HEAD),
        _Op(_JUMP_EQUAL, _RPC_VERSION, to["rpc"], to["other"]),
    ]


def _assemble(program: list[_Op]) -> bytes:
    places: dict[str, int] = {}
    instructions: list[_Op] = []
    for op in program:
        if op.code is None:
            places[op.if_true] = len(instructions)
        else:
            instructions.append(op)
    if len(instructions) > MAX_INSTRUCTIONS:
        raise ValueError(f"{len(instructions)} instructions are more than a socket filter may have")
    code = bytearray()
    for place, op in enumerate(instructions):
        # no name: the next instruction
        far, near = (places[target] - place - 1 if target else 0 for target in (op.if_true, op.if_false))
        if op.code == _JUMP:
            code += struct.pack("=HBBI", _JUMP, 0, 0, far)
        elif max(far, near) > 0xFF:
            raise ValueError(f"instruction {place} jumps over more than 255 others")
        else:
            code += struct.pack("=HBBI", op.code or 0, far, near, op.k)
    return bytes(code)
