"""Sequences of requests to a PROFINET device: connections, records, controls, RPC and DCP, right and wrong ones."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from random import Random
from uuid import UUID

from pnfarm.protocols.profinet.gsdml.planning import PlannedDevice
from pnfarm.protocols.profinet.wire.block import BlockType
from pnfarm.protocols.profinet.wire.cm.control import ControlCommand
from pnfarm.protocols.profinet.wire.records.iod import IodReadReqHeader, IodWriteReqHeader, emit_write_request
from pnfarm.protocols.profinet.wire.rpc.pdu import (
    NIL_UUID,
    UUID_EPM,
    UUID_PNIO_CONTROLLER,
    Flags1,
    Opnum,
    PacketType,
    emit_rpc,
    object_uuid,
)
from tests.fuzz.malformed import deep_blocks
from tests.fuzz.mutate import mutated
from tests.fuzz.pnet.base import ROOM, Caller, Sent
from tests.fuzz.pnet.connects import wrong_connect
from tests.fuzz.pnet.dcp import dcp_sequence

__all__ = ["sequence"]

#: Records of a submodule, of the access point's port and interface, of slot, AR, API and device, and of nothing.
INDEXES = (
    123, 124, 125, 77, 0x7FFF, 0xAFF0, 0xAFF1, 0xAFF2, 0xAFF3, 0xAFF4, 0xAFF5, 0x8000, 0x8001, 0x800A, 0x800B, 0x800C,
    0x8010, 0x8011, 0x8012, 0x8013, 0x801E, 0x8028, 0x8029, 0x802A, 0x802B, 0x802F, 0x8030, 0x8070, 0x8080, 0x8090,
    0xC000, 0xC001, 0xC00A, 0xC00B, 0xC00C, 0xE000, 0xE001, 0xE00A, 0xE00B, 0xE00C, 0xE010, 0xE030, 0xE040, 0xF000,
    0xF00A, 0xF00B, 0xF00C, 0xF020, 0xF820, 0xF821, 0xF840, 0xF841, 0xF842, 0xFBFF, 0xFFFF,
)  # fmt: skip
PLACES = ((0, 1), (0, 0x8000), (0, 0x8001), (1, 1), (2, 1), (1, 2), (9, 1), (0, 0))
WRITTEN = (0, 1, 2, 4, 22, 60)
#: What the Read and Write of the wrong AR say.
OTHER = UUID(int=0x1234)


def _at(place: tuple[int, int], index: int) -> str:
    return f"0x{index:04X} of {place[0]}.{place[1]:X}"


def _read(rng: Random, caller: Caller, *, connected: bool) -> Sent:
    place, index = rng.choice(PLACES), rng.choice(INDEXES)
    implicit = not connected or rng.random() < 0.2
    header = IodReadReqHeader(1, NIL_UUID if implicit else caller.plan.ar_uuid, 0, *place, index, ROOM - 64)
    opnum = Opnum.READ_IMPLICIT if implicit else Opnum.READ
    name = "ReadImplicit" if implicit else "Read"
    asked = header.emit()
    header = replace(header, slot=0, subslot=1, index=0xAFF0)
    good = header.emit()
    wrong = (
        (f"{name} of API 1", replace(header, api=1).emit()),
        (f"{name} of API 0xFFFFFFFF", replace(header, api=0xFFFFFFFF).emit()),
        (f"{name} of another AR", replace(header, ar_uuid=OTHER).emit()),
        (f"{name} of nil", replace(header, ar_uuid=NIL_UUID).emit()),
        (f"{name} of a nil target", replace(header, ar_uuid=NIL_UUID, target_ar_uuid=NIL_UUID).emit()),
        (f"{name} with another target", replace(header, ar_uuid=NIL_UUID, target_ar_uuid=OTHER).emit()),
        (f"{name} of block version 2.0", replace(header, version=0x200).emit()),
        (f"{name} of length 0", replace(header, record_data_length=0).emit()),
        (f"{name} of length 10", replace(header, record_data_length=10).emit()),
        (f"{name} as a Write", b"\0\x08" + good[2:]),
        (f"{name} of BlockLength 59", good[:2] + b"\0\x3b" + good[4:]),
        (f"{name} of BlockLength 64", good[:2] + b"\0\x40" + good[4:]),
        (f"{name} that is cut off", good[:40]),
        (f"{name} of nothing", b""),
        (f"{name} with octets behind it", good + bytes(8)),
    )
    what, payload = (f"{name} of {_at(place, index)}", asked) if rng.random() < 0.7 else rng.choice(wrong)
    return caller.call(what, opnum, payload)


def _write(rng: Random, caller: Caller, *, connected: bool) -> Sent:
    place, index, length = rng.choice(PLACES), rng.choice(INDEXES), rng.choice(WRITTEN)
    if rng.random() < 0.3:
        place, index, length = (1, 1), rng.choice((123, 124)), 4
    header = IodWriteReqHeader(1, caller.plan.ar_uuid, 0, *place, index)
    parameter = replace(header, slot=1, subslot=1, index=123)
    if not connected:
        return caller.call("Write without AR", Opnum.WRITE, emit_write_request(parameter, bytes(4)))
    good = emit_write_request(parameter, bytes(4))
    inner = emit_write_request(parameter, bytes(4))
    several = replace(header, api=0xFFFFFFFF, slot=0xFFFF, subslot=0xFFFF, index=0xE040)
    wrong = (
        ("Write of another AR", emit_write_request(replace(parameter, ar_uuid=OTHER), bytes(4))),
        ("Write of nil", emit_write_request(replace(parameter, ar_uuid=NIL_UUID), bytes(4))),
        ("Write of API 1", emit_write_request(replace(parameter, api=1), bytes(4))),
        ("Write of block version 2.0", emit_write_request(replace(parameter, version=0x200), bytes(4))),
        ("Write as a Read", b"\0\x09" + good[2:]),
        ("Write of BlockLength 59", good[:2] + b"\0\x3b" + good[4:]),
        ("Write of more than is there", replace(parameter, record_data_length=100).emit() + bytes(4)),
        ("Write of less than is there", replace(parameter, record_data_length=4).emit() + bytes(12)),
        ("Write that is cut off", good[:40]),
        ("Write of nothing", b""),
        ("Write of two records", emit_write_request(several, inner + inner)),
        ("Write of no records", emit_write_request(several, b"")),
        (
            "Write of two records, one of another slot",
            emit_write_request(several, inner + emit_write_request(replace(parameter, slot=9), bytes(4))),
        ),
        ("Write of records that are cut off", emit_write_request(several, inner + inner[:40])),
    )
    if rng.random() < 0.6:
        payload = emit_write_request(header, bytes(length))
        return caller.call(f"Write of {length} octets to {_at(place, index)}", Opnum.WRITE, payload)
    what, payload = rng.choice(wrong)
    return caller.call(what, Opnum.WRITE, payload)


def _end(caller: Caller) -> Sent:
    return caller.call("PrmEnd", Opnum.CONTROL, caller.control(BlockType.PRM_END_REQ, ControlCommand.PRM_END))


def _control(rng: Random, caller: Caller, what: str) -> Sent:
    """A wrong one; ``what``: where in the connection it comes."""
    end = partial(caller.control, BlockType.PRM_END_REQ, ControlCommand.PRM_END)
    good = end()
    name, payload = rng.choice(
        (
            ("of another AR", end(ar_uuid=OTHER)),
            ("of another session", end(session_key=caller.plan.session_key ^ 1)),
            ("of no command", end(command=0)),
            ("of the command ApplicationReady", end(command=2)),
            ("of the command Release", end(command=4)),
            ("of the command Done", end(command=8)),
            ("of two commands", end(command=3)),
            ("of a reserved command", end(command=0x100)),
            ("with properties", end(properties=1)),
            ("of block version 2.0", end(version=0x200)),
            ("of ApplicationReady", caller.control(BlockType.APPLICATION_READY_REQ, 2)),
            ("of PrmEnd after a plug", caller.control(BlockType.PRM_END_PLUG_REQ, 1)),
            ("of the block Release", caller.control(BlockType.RELEASE_REQ, 4)),
            ("of a response", caller.control(BlockType.PRM_END_RES, 8)),
            ("of BlockLength 27", good[:2] + b"\0\x1b" + good[4:]),
            ("of BlockLength 30", good[:2] + b"\0\x1e" + good[4:]),
            ("that is cut off", good[:20]),
            ("of nothing", b""),
            ("of two blocks", good + good),
            ("with octets behind it", good + bytes(2)),
        )
    )
    return caller.call(f"Control {name} {what}", Opnum.CONTROL, payload)


def _releases(rng: Random, caller: Caller) -> list[Sent]:
    """Wrong ones, behind a good connection."""
    release = partial(caller.control, BlockType.RELEASE_REQ, ControlCommand.RELEASE)
    good = release()
    name, payload = rng.choice(
        (
            ("of another AR", release(ar_uuid=OTHER)),
            ("of another session", release(session_key=caller.plan.session_key ^ 1)),
            ("of the command PrmEnd", release(command=1)),
            ("of no command", release(command=0)),
            ("of two commands", release(command=5)),
            ("with properties", release(properties=1)),
            ("of block version 2.0", release(version=0x200)),
            ("of the block PrmEnd", caller.control(BlockType.PRM_END_REQ, 1)),
            ("of BlockLength 27", good[:2] + b"\0\x1b" + good[4:]),
            ("that is cut off", good[:20]),
            ("of nothing", b""),
            ("of two blocks", good + good),
        )
    )
    return [caller.call(f"Release {name}", Opnum.RELEASE, payload), caller.release("Release behind a wrong one")]


def _rpc(rng: Random, caller: Caller) -> list[Sent]:
    """About the call, not about its blocks: a ReadImplicit that is good otherwise."""
    payload = IodReadReqHeader(1, NIL_UUID, 0, 0, 1, 0xAFF0, ROOM - 64).emit()
    vendor, device = caller.plan.vendor_id, caller.plan.device_id
    read = partial(caller.pdu, Opnum.READ_IMPLICIT, payload)
    good = read()
    octets = emit_rpc(good)
    size = len(payload)

    def raw(what: str, place: int, value: bytes) -> Sent:
        return Sent(f"RPC {what}", octets[:place] + value + octets[place + len(value) :])

    def one(what: str, **changes) -> Sent:
        return Sent(f"RPC {what}", emit_rpc(replace(good, **changes)))

    def counted(what: str, **args: int) -> Sent:
        return Sent(f"NDR {what}", emit_rpc(read(args)))

    half = len(good.body) // 2
    fragment = replace(good, flags1=Flags1.FRAGMENT | Flags1.IDEMPOTENT, body=good.body[:half])
    ends = Flags1.FRAGMENT | Flags1.LAST_FRAGMENT | Flags1.IDEMPOTENT
    last = replace(good, flags1=ends, fragment_number=1, body=good.body[half:])
    pieces = {
        "in two fragments": [fragment, last],
        "in two fragments without FACK": [replace(fragment, flags1=fragment.flags1 | Flags1.NO_FACK), last],
        "with its second fragment twice": [fragment, last, last],
        "with its first fragment twice": [fragment, fragment, last],
        "with its fragments in the wrong order": [last, fragment],
        "with a fragment missing": [fragment, replace(last, fragment_number=2)],
        "with its second fragment of the other order": [fragment, replace(last, drep=b"\0\0\0")],
        "in one fragment": [replace(good, flags1=ends)],
    }
    if rng.random() < 0.25:
        name = rng.choice(list(pieces))
        return [Sent(f"RPC {name}, {number}", emit_rpc(pdu)) for number, pdu in enumerate(pieces[name], 1)]
    choices = (
        Sent("RPC big-endian", emit_rpc(read(little_endian=False))),
        raw("of integer format 2", 4, b"\x20"), raw("of EBCDIC", 4, b"\x11"), raw("of VAX floats", 5, b"\1"),
        raw("of version 5", 0, b"\5"), raw("of version 3", 0, b"\3"),
        raw("that is longer than its body", 74, (len(good.body) + 4).to_bytes(2, "little")),
        raw("that is shorter than its body", 74, (len(good.body) - 4).to_bytes(2, "little")),
        raw("without body", 74, b"\0\0"), raw("of 1500 octets", 74, (1500).to_bytes(2, "little")),
        Sent("RPC that is cut off", octets[:-8]), Sent("RPC header that is cut off", octets[:70]),
        Sent("RPC of nothing", b""), Sent("RPC with octets behind it", octets + bytes(8)),
        one("of authentication", auth_protocol=1), one("of flags2", flags2=2),
        one("of boot time 1", server_boot_time=1),
        one("of fragment 1, unfragmented", fragment_number=1), one("of serial 7", serial=7),
        one("of interface version 2", interface_version=2), one("of interface version 1.1", interface_version=0x10001),
        one("of an unknown interface", interface=OTHER),
        one("of the controller's interface", interface=UUID_PNIO_CONTROLLER),
        one("of a nil interface", interface=NIL_UUID), one("of the endpoint mapper", interface=UUID_EPM),
        one("of a nil object", object_uuid=NIL_UUID), one("of an unknown object", object_uuid=OTHER),
        one("of another device's object", object_uuid=object_uuid(1, device + 1, vendor)),
        one("of another vendor's object", object_uuid=object_uuid(1, device, vendor + 1)),
        one("of another instance's object", object_uuid=object_uuid(2, device, vendor)),
        one("of a nil activity", activity=NIL_UUID),
        *(one(f"of operation {opnum}", opnum=opnum) for opnum in (6, 7, 0xFF, 0xFFFF)),
        *(one(f"of packet type {kind}", packet_type=kind) for kind in (2, 3, 5, 6, 7, 9, 10, 11, 31)),
        one("of packet type 0x20", packet_type=0x20),
        Sent("RPC ping", emit_rpc(replace(good, packet_type=PacketType.PING, body=b""))),
        Sent("RPC cancel", emit_rpc(replace(good, packet_type=PacketType.CL_CANCEL, body=bytes(8)))),
        one("that wants no answer", flags1=Flags1.MAYBE), one("to all", flags1=Flags1.BROADCAST),
        one("that is not idempotent", flags1=0), one("of reserved flags", flags1=0x81),
        counted("ArgsLength above the payload", args_length=size + 8), counted("ArgsLength 0", args_length=0),
        counted("ActualCount above the payload", actual_count=size + 8), counted("ActualCount 0", actual_count=0),
        counted("ActualCount below the payload", actual_count=size - 4, args_length=size - 4),
        counted("offset 1", offset=1), counted("MaximumCount 0", maximum_count=0),
        counted("MaximumCount below ActualCount", maximum_count=size - 1),
        counted("MaximumCount other than ArgsMaximum", maximum_count=ROOM + 1),
        counted("ArgsMaximum 0", args_maximum=0), counted("ArgsMaximum 63", args_maximum=63),
        counted("ArgsMaximum 64", args_maximum=64), counted("ArgsMaximum 0xFFFFFFFF", args_maximum=0xFFFFFFFF),
        Sent("NDR arguments that are cut off", emit_rpc(replace(good, body=good.body[:12]))),
        Sent("NDR without arguments", emit_rpc(replace(good, body=b""))),
    )  # fmt: skip
    sent = rng.choice(choices)
    return [sent, Sent("RPC a second time", sent.octets)] if rng.random() < 0.1 else [sent]


def _connected(rng: Random, caller: Caller) -> list[Sent]:
    """A good connection, and what comes within it."""
    found = [caller.connect()]
    ended = False
    for _ in range(rng.randrange(1, 5)):
        kind = rng.randrange(8)
        if kind < 3:
            found.append(_read(rng, caller, connected=True))
        elif kind < 5:
            found.append(_write(rng, caller, connected=True))
        elif kind == 5:
            found.append(_control(rng, caller, "behind PrmEnd" if ended else "before PrmEnd"))
        elif kind == 6:
            found.append(replace(_end(caller), what="PrmEnd a second time") if ended else _end(caller))
            found += [] if ended else [Sent("ApplicationReady", b"", "ready")]
            ended = True
        else:
            found.append(caller.connect("a Connect of the same AR"))
    return [*found, *(_releases(rng, caller) if rng.random() < 0.2 else [caller.release("Release")])]


def _without(rng: Random, caller: Caller) -> list[Sent]:
    """What needs a connection, without one."""
    kind = rng.randrange(6)
    if kind < 3:
        return [_read(rng, caller, connected=False)]
    if kind == 3:
        header = IodReadReqHeader(1, caller.plan.ar_uuid, 0, 0, 1, 0xAFF0, ROOM - 64)
        return [caller.call("Read without AR", Opnum.READ, header.emit())]
    if kind == 4:
        return [_write(rng, caller, connected=False)]
    one = replace(_end(caller), what="PrmEnd without AR")
    return [rng.choice((one, _control(rng, caller, "without AR"), caller.release("Release without AR")))]


def _wrong_connect(rng: Random, caller: Caller) -> list[Sent]:
    name, payload = wrong_connect(rng, caller.blocks())
    wrong = caller.call(f"Connect, {name}", Opnum.CONNECT, payload)
    return [wrong, caller.release(f"Release behind Connect, {name}")]


def _changed(rng: Random, caller: Caller) -> list[Sent]:
    """A call that was good, with octets of its blocks wrong."""
    connect = b"".join(block.emit() for block in caller.blocks())
    read = IodReadReqHeader(1, NIL_UUID, 0, 0, 1, 0xAFF0, ROOM - 64).emit()
    if rng.random() < 0.7:
        # what is changed at any depth may still be good; the AR's own block stays, so that Release finds it
        head = 4 + int.from_bytes(connect[2:4], "big")
        payload = connect[:head] + deep_blocks(rng, connect[head:], [connect], rng.choice((5, 6)))[:1300]
        what, opnum = "a changed Connect", Opnum.CONNECT
    else:
        payload = mutated(rng, read, [read])[:1300]
        what, opnum = "a changed ReadImplicit", Opnum.READ_IMPLICIT
    sent = replace(caller.call(what, opnum, payload), coarse=True)
    return [sent, caller.release(f"Release behind {what}")]


def sequence(device: PlannedDevice, seed: object, number: int) -> list[Sent]:
    """Up to some ten messages; what they began is ended."""
    rng = Random(f"{seed}/{number}")
    caller = Caller(rng, device)
    kind = rng.randrange(10)
    if kind < 4:
        return _wrong_connect(rng, caller)
    if kind < 7:
        return _connected(rng, caller)
    if kind == 7:
        return [one for _ in range(3) for one in _without(rng, caller)]
    if kind == 8:
        return _rpc(rng, caller) if rng.random() < 0.7 else _changed(rng, caller)
    return dcp_sequence(rng)
