"""The socket filter of a capture: which interfaces, which kinds of frames.  It runs in the kernel, before any copy.

Kinds are keywords of the command line.  Sent frames may still carry their VLAN tag where received ones lost it, so
every test is made twice, for a frame with and without a tag.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.links.kernel.bpf import ACCEPT, DROP, IFINDEX, OTHER_HOST, PACKET_TYPE, Instruction, Op, assemble, label
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

_WHOLE_FRAME = 0x40000

_FIRST_DCP, _LAST_DCP = 0xFEFC, 0xFEFF
#: Frame ids of PTCP (IEC 61158-6-10): sync below those of cyclic data, the rest after DCP's.
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
    program = [Instruction(Op.LD_WORD, IFINDEX)]
    for number, (lowest, highest) in enumerate(_runs(indexes)):
        program += [
            Instruction(Op.JUMP_GREATER, highest, f"run {number}"),
            Instruction(Op.JUMP_GREATER_EQUAL, lowest, "", f"below {number}"),
            Instruction(Op.JUMP, 0, "ours"),
            label(f"below {number}"),
            Instruction(Op.JUMP, 0, DROP),
            label(f"run {number}"),
        ]
    program += [Instruction(Op.JUMP, 0, DROP), label("ours")]
    if not others:
        program += [Instruction(Op.LD_WORD, PACKET_TYPE), Instruction(Op.JUMP_EQUAL, OTHER_HOST, DROP)]
    if set(atoms) < set(ATOMS):
        program += [Instruction(Op.LD_HALF, 12), Instruction(Op.JUMP_EQUAL, ETHERTYPE_VLAN, "tagged")]
        program += _kinds("", 12, atoms)
        program += [label("tagged"), *_kinds("tagged ", 16, atoms)]
    return assemble(program, _WHOLE_FRAME)


def _kinds(name: str, base: int, atoms: Collection[str]) -> list[Instruction]:
    """The decision for a frame whose EtherType is at offset ``base``."""
    to = {atom: ACCEPT if atom in atoms else DROP for atom in ATOMS}
    enip = ACCEPT if {"enip", "cip"} & set(atoms) else DROP
    network = base + 2
    return [
        Instruction(Op.LD_HALF, base),
        Instruction(Op.JUMP_EQUAL, ETHERTYPE_PROFINET, f"{name}pn"),
        Instruction(Op.JUMP_EQUAL, ETHERTYPE_ARP, to["arp"]),
        Instruction(Op.JUMP_EQUAL, ETHERTYPE_LLDP, to["lldp"]),
        Instruction(Op.JUMP_EQUAL, ETHERTYPE_IPV4, f"{name}ip", to["other"]),
        label(f"{name}pn"),
        Instruction(Op.LD_HALF, network),
        Instruction(Op.JUMP_GREATER_EQUAL, FIRST_ACYCLIC_FRAME_ID, f"{name}acyclic"),
        Instruction(Op.JUMP_GREATER_EQUAL, FIRST_CYCLIC_FRAME_ID, to["cyclic"]),
        *(Instruction(Op.JUMP_EQUAL, frame_id, to["ptcp"]) for frame_id in _SYNCS),
        Instruction(Op.JUMP, 0, to["other"]),
        label(f"{name}acyclic"),
        *(Instruction(Op.JUMP_EQUAL, frame_id, to["alarm"]) for frame_id in ALARM_FRAME_IDS),
        *(Instruction(Op.JUMP_EQUAL, frame_id, to["ptcp"]) for frame_id in _CLOCKS),
        Instruction(Op.JUMP_GREATER_EQUAL, _FIRST_DCP, "", to["other"]),
        Instruction(Op.JUMP_GREATER, _LAST_DCP, to["other"], to["dcp"]),
        label(f"{name}ip"),
        Instruction(Op.LD_BYTE, network + 9),
        Instruction(Op.JUMP_EQUAL, _ICMP, to["icmp"]),
        Instruction(Op.JUMP_EQUAL, _UDP, f"{name}udp"),
        Instruction(Op.JUMP_EQUAL, _TCP, "", to["other"]),
        Instruction(Op.LD_HALF, network + 6),
        Instruction(Op.JUMP_SET, _OFFSET_MASK, to["other"]),
        Instruction(Op.LDX_HEADER_LENGTH, network),
        Instruction(Op.LD_HALF_INDEXED, network),
        Instruction(Op.JUMP_EQUAL, _ENIP_PORT, enip),
        Instruction(Op.LD_HALF_INDEXED, network + 2),
        Instruction(Op.JUMP_EQUAL, _ENIP_PORT, enip, to["other"]),
        label(f"{name}udp"),
        # a further fragment has no ports; only calls are longer than a frame
        Instruction(Op.LD_HALF, network + 6),
        Instruction(Op.JUMP_SET, _OFFSET_MASK, to["rpc"]),
        Instruction(Op.LDX_HEADER_LENGTH, network),
        Instruction(Op.LD_HALF_INDEXED, network),
        *(Instruction(Op.JUMP_EQUAL, port, to["snmp"]) for port in _SNMP_PORTS),
        Instruction(Op.JUMP_EQUAL, _ENIP_PORT, enip),
        Instruction(Op.LD_HALF_INDEXED, network + 2),
        *(Instruction(Op.JUMP_EQUAL, port, to["snmp"]) for port in _SNMP_PORTS),
        Instruction(Op.JUMP_EQUAL, _ENIP_PORT, enip),
        Instruction(Op.JUMP_EQUAL, _IO_PORT, to["cyclic"]),
        # calls use any port; each begins with the protocol's version
        Instruction(Op.LD_BYTE_INDEXED, network + _UDP_HEAD),
        Instruction(Op.JUMP_EQUAL, _RPC_VERSION, to["rpc"], to["other"]),
    ]
