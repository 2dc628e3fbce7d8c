"""Sequences of EtherNet/IP messages, each for a connection of its own, and the class of each answer."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from random import Random

from enip_bench import MANAGER, explicit_request, io_request

from pnfarm.protocols.enip.wire import cpf, message
from pnfarm.protocols.enip.wire import forward_open as fo
from pnfarm.protocols.enip.wire.encapsulation import Command, EncapsulationPdu, emit_encapsulation
from pnfarm.protocols.enip.wire.epath import ElectronicKey, logical_path
from tests.fuzz.mutate import mutated
from tests.interop.enip_talk import HEADER_OCTETS

__all__ = ["OWN", "POINTS", "Sent", "answer_class", "sequence"]

#: Vendor, device type, product code and revision of the other implementation's sample; ours takes them, for keys.
OWN = (1, 12, 65001, (2, 3))
#: Configuration, output and input assembly of the sample, each way 32 octets.
POINTS = (151, 150, 100)
#: A real-time format with a header of four octets, and the sequence count.
O_TO_T, T_TO_O = 32 + 6, 32 + 2
SERVICES = (0x01, 0x03, 0x04, 0x0E, 0x0E, 0x0E, 0x10, 0x33, 0x4B, 0x11, 0x16, 0x18)
CLASSES = (1, 2, 4, 6, 0xF5, 0xF6, 0x99, 0x1234)


@dataclass(frozen=True)
class Sent:
    """One message: what it is, and its octets; ``live``: with the session's handle in place of theirs."""

    what: str
    octets: bytes
    live: bool = True


def _request(octets: bytes, *, count: int | None = None) -> bytes:
    packet = cpf.CommonPacket((cpf.NullAddress(), cpf.UnconnectedData(octets))).emit()
    if count is not None:
        packet = packet[:6] + struct.pack("<H", count) + packet[8:]
    return emit_encapsulation(EncapsulationPdu(Command.SEND_RR_DATA, packet))


def _encapsulated(rng: Random) -> Sent:
    """A message of the encapsulation itself, with one thing about it wrong or not."""
    good = _request(message.message_request(0x0E, logical_path(1, 1, 1)).emit())
    cut = good[24 : rng.randrange(25, 40)]
    emit = emit_encapsulation
    return rng.choice(
        (
            Sent("ListServices", emit(EncapsulationPdu(Command.LIST_SERVICES))),
            Sent("ListIdentity", emit(EncapsulationPdu(Command.LIST_IDENTITY))),
            Sent("ListInterfaces", emit(EncapsulationPdu(Command.LIST_INTERFACES))),
            Sent("NOP", emit(EncapsulationPdu(Command.NOP, bytes(rng.randrange(9))))),
            Sent("a second RegisterSession", emit(EncapsulationPdu(Command.REGISTER_SESSION, b"\1\0\0\0"))),
            Sent("RegisterSession of version 2", emit(EncapsulationPdu(Command.REGISTER_SESSION, b"\2\0\0\0"))),
            Sent("RegisterSession with options", emit(EncapsulationPdu(Command.REGISTER_SESSION, b"\1\0\1\0"))),
            Sent("a long RegisterSession", emit(EncapsulationPdu(Command.REGISTER_SESSION, b"\1\0\0\0\0\0"))),
            Sent("UnregisterSession", emit(EncapsulationPdu(Command.UNREGISTER_SESSION))),
            Sent("an unknown command", emit(EncapsulationPdu(rng.choice((0x01, 0x65A, 0x6E, 0xFFFF))))),
            Sent("a request of another session", good[:4] + b"\xfe\xff\xff\x7f" + good[8:], live=False),
            Sent("a request with a status", good[:8] + b"\1\0\0\0" + good[12:]),
            Sent("a request with options", good[:20] + b"\1\0\0\0" + good[24:]),
            Sent("a request for another interface", good[:24] + b"\1\0\0\0" + good[28:]),
            Sent("a request of one item", _request(b"\x0e\x03\x20\1\x24\1\x30\1", count=1)),
            Sent("a request without items", emit(EncapsulationPdu(Command.SEND_RR_DATA, bytes(8)))),
            Sent("a request that is cut off", emit(EncapsulationPdu(Command.SEND_RR_DATA, cut))),
            Sent("SendUnitData without a connection", emit(EncapsulationPdu(Command.SEND_UNIT_DATA, good[24:]))),
        )
    )  # fmt: skip


def _service(rng: Random) -> Sent:
    """A service of an object, which may not be there."""
    service, class_id = rng.choice(SERVICES), rng.choice(CLASSES)
    instance = rng.choice((0, 1, 1, 1, 2, 100, 150, 999))
    attribute = rng.choice((None, 1, 2, 3, 4, 5, 6, 7, 99))
    data = rng.choice((b"", b"", b"\1\0", bytes(4), bytes(32), rng.randbytes(5)))
    path = logical_path(class_id, instance) if attribute is None else logical_path(class_id, instance, attribute)
    octets = message.message_request(service, path, data).emit()
    what = f"service 0x{service:02X} of class 0x{class_id:02X}, instance {min(instance, 2)}"
    return Sent(what + ("" if attribute is None else ", an attribute"), _request(octets))


def _changed(rng: Random) -> Sent:
    """A request that was good, with octets wrong; what would reset the device stays out."""
    good = [message.message_request(0x0E, logical_path(c, 1, 1)).emit() for c in (1, 0xF5, 0xF6)]
    octets = mutated(rng, rng.choice(good), good)[:400]
    if octets[:1] == b"\x05":
        octets = b"\x0e" + octets[1:]
    return Sent("a changed request", _request(octets))


def _opening(rng: Random, serial: int) -> list[Sent]:
    """A Forward_Open with a thing about it wrong or not, and its Forward_Close."""
    base = {"points": POINTS, "o_to_t": O_TO_T, "t_to_o": T_TO_O, "kind": fo.ConnectionType.POINT_TO_POINT}
    name, more = rng.choice(
        (
            ("a Forward_Open", {}),
            ("a Forward_Open with a key", {"key": ElectronicKey(OWN[0], OWN[1], OWN[2], OWN[3][0], OWN[3][1])}),
            ("a Forward_Open with another vendor's key", {"key": ElectronicKey(99)}),
            ("a Forward_Open with another product's key", {"key": ElectronicKey(OWN[0], OWN[1], 7)}),
            ("a Forward_Open of another size to the target", {"o_to_t": O_TO_T + 2}),
            ("a Forward_Open of another size to the originator", {"t_to_o": T_TO_O + 2}),
            ("a Forward_Open of another output", {"points": (POINTS[0], 77, POINTS[2])}),
            ("a Forward_Open of another input", {"points": (POINTS[0], POINTS[1], 77)}),
            ("a Forward_Open of another class", {"class_id": 0x99}),
            ("a Forward_Open of transport class 2", {"transport": fo.TransportClass(2)}),
            ("a Forward_Open with a multiplier of 8", {"timeout_multiplier": 8}),
            ("a Forward_Open of 0 us", {"o_to_t_rpi_us": 0}),
            ("a Forward_Open of an explicit connection", None),
        )
    )
    one = explicit_request(serial) if more is None else io_request(serial, **(base | more))
    opened = message.message_request(0x5B if one.large else 0x54, MANAGER, fo.emit_forward_open(one)).emit()
    closed = message.message_request(0x4E, MANAGER, fo.ForwardClose(one.triad, one.path).emit()).emit()
    sent = [Sent(name, _request(opened))]
    if rng.random() < 0.3:
        sent.append(Sent(f"{name}, a second time", _request(opened)))
    sent.append(Sent(f"Forward_Close after {name}", _request(closed)))
    if rng.random() < 0.3:
        sent.append(Sent("Forward_Close of no connection", _request(closed)))
    return sent


def sequence(seed: object, number: int) -> list[Sent]:
    """Up to six messages behind RegisterSession."""
    rng = Random(f"{seed}/{number}")
    found: list[Sent] = []
    for place in range(rng.randrange(1, 7)):
        kind = rng.randrange(6)
        if kind == 0:
            found.append(_encapsulated(rng))
        elif kind == 1:
            found += _opening(rng, (number * 8 + place) & 0xFFFF)
        else:
            found.append(_changed(rng) if kind == 2 else _service(rng))
    return found


def answer_class(octets: bytes) -> str:
    """Command and status; of a request its general status, how many words more, and whether data follow."""
    command, _, _, status = struct.unpack_from("<HHII", octets)
    text = f"0x{command:02X} status {status}"
    data = octets[HEADER_OCTETS:]
    if command != Command.SEND_RR_DATA or status or len(data) < 20:
        return text
    reply = data[16:]
    extended = struct.unpack_from(f"<{reply[3]}H", reply, 4)
    words = "".join(f" 0x{word:04X}" for word in extended[:1])
    with_data = " with data" if len(reply) > 4 + 2 * reply[3] and not reply[2] else ""
    return f"{text}, general status 0x{reply[2]:02X}{words}{with_data}"
