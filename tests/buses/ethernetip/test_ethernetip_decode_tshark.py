"""What the decoder says of EtherNet/IP, beside what Wireshark reads in the same frames."""

from __future__ import annotations

import struct

import pytest
from cip_tape import IDS, MANAGER, Tape, command, connect, forward_open, known
from recorded import write_frames
from wireshark import tshark_fields

from pnfarm.protocols.enip.status import Service
from pnfarm.protocols.enip.wire import forward_open as fo
from pnfarm.protocols.enip.wire.encapsulation import Command
from pnfarm.protocols.enip.wire.epath import logical_path
from pnfarm.protocols.enip.wire.message import emit_multiple_service
from pnfarm.protocols.enip.wire.message import message_request as request

pytestmark = pytest.mark.interop

GET, SET = Service.GET_ATTRIBUTE_SINGLE, Service.SET_ATTRIBUTE_SINGLE
#: Name of a service -> its number.
SERVICES = {
    "Get_Attribute_Single": 0x0E, "Set_Attribute_Single": 0x10, "Get_Attributes_All": 0x01, "Forward_Open": 0x54,
    "Large_Forward_Open": 0x5B, "Forward_Close": 0x4E, "Multiple_Service_Packet": 0x0A, "Unconnected_Send": 0x52,
}  # fmt: skip
COMMANDS = {"ListIdentity": 0x63, "RegisterSession": 0x65, "UnRegisterSession": 0x66}


def recorded() -> Tape:
    """A session with messages of every kind, cut and joined segments, two connections and their data."""
    tape = known(Tape())
    tape.encapsulated(0, Command.REGISTER_SESSION, b"\1\0\0\0", session=0)
    tape.encapsulated(1, Command.REGISTER_SESSION, b"\1\0\0\0")
    tape.ask(request(Service.GET_ATTRIBUTES_ALL, logical_path(1, 1)))
    tape.answer(Service.GET_ATTRIBUTES_ALL, struct.pack("<HHHBBHI", 452, 16, 1, 1, 13, 0, 9) + b"\3AKD")
    singles = [request(GET, logical_path(0x0F, number, 1)) for number in (1, 300, 8192)]
    packed = b"".join(tape.packed(0, one.emit()) for one in singles)
    for part in (packed[:70], packed[70:100], packed[100:]):
        tape.segment(0, part)
    for status in (0, 0x14, 0):
        tape.answer(GET, b"" if status else bytes(4), status)
    tape.ask(request(SET, logical_path(0x25, 1, 3), b"\1"))
    tape.answer(SET, status=0x0C)
    inner = [one.emit() for one in singles[:2]]
    tape.ask(request(Service.MULTIPLE_SERVICE_PACKET, logical_path(2, 1), emit_multiple_service(inner)))
    sent = fo.UnconnectedSend(inner[0], b"\1\0").emit()
    tape.ask(request(Service.UNCONNECTED_SEND, MANAGER, sent))
    tape.answer(GET, bytes(4))
    multicast = fo.NetworkParameters(66, fo.ConnectionType.MULTICAST)
    connect(tape, forward_open(), api_us=20_000)
    for number in range(1, 4):
        tape.io(0, IDS[0], number, command(0x80), header=number % 2)
        tape.io(1, IDS[1], number + 5, bytes(64))
    other = forward_open(triad=fo.Triad(8, 1, 2), large=True, t_to_o=multicast, t_to_o_id=0x330003)
    tape.ask(request(Service.LARGE_FORWARD_OPEN, MANAGER, fo.emit_forward_open(other)))
    refusal = fo.ForwardRefusal(other.triad).emit()
    tape.answer(Service.LARGE_FORWARD_OPEN, refusal, 1, (0x0128, 64))
    closing = fo.ForwardClose(fo.Triad(7, 4660, 0x5678), forward_open().path)
    tape.ask(request(Service.FORWARD_CLOSE, MANAGER, closing.emit()))
    tape.answer(Service.FORWARD_CLOSE, fo.ForwardCloseReply(fo.Triad(7, 4660, 0x5678)).emit())
    tape.encapsulated(0, Command.UNREGISTER_SESSION)
    return tape


@pytest.fixture(scope="module")
def both(tmp_path_factory):
    """Our lines, and a function that gives Wireshark's fields by frame."""
    tape = recorded()
    path = tmp_path_factory.mktemp("decode") / "enip.pcapng"
    write_frames(path, zip(tape.frames, tape.times, strict=True))

    def fields(*names: str, where: str) -> dict[int, tuple[list[int | str], ...]]:
        rows = tshark_fields(path, "frame.number", *names, where=where, options=("-E", "aggregator=,"))
        return {int(row[0]): tuple(_numbers(cell) for cell in row[1:]) for row in rows}

    return tape.decoded()[1], fields


def _numbers(cell: str) -> list[int | str]:
    words = [word for word in cell.split(",") if word]
    return [int(word, 0) if word[0].isdigit() else word for word in words]


def test_both_see_the_same_services_in_the_same_frames(both):
    lines, fields = both
    ours: dict[int, list[int]] = {}
    for line in lines:
        name = line.description.what.rpartition(".")[0]
        if line.family == "cip":
            ours.setdefault(line.number, []).append(SERVICES[name])
    theirs = {number: sorted(cells[0]) for number, cells in fields("cip.sc", where="cip.sc").items()}
    assert {number: sorted(found) for number, found in ours.items()} == theirs
    assert sum(map(len, ours.values())) > 20


def test_both_see_the_same_commands(both):
    lines, fields = both
    ours = {
        (line.number, COMMANDS[name])
        for line in lines
        if line.family == "enip" and (name := line.description.what.partition(".")[0]) in COMMANDS
    }
    found = fields("enip.command", where="enip.command").items()
    assert {(number, one) for number, cells in found for one in cells[0] if one in COMMANDS.values()} == ours


def test_both_see_the_same_status(both):
    lines, fields = both
    ours = {
        (line.number, line.description.details["status"])
        for line in lines
        if line.description.details.get("status") and line.family == "cip"
    }
    theirs = fields("cip.genstat", "cip.cm.ext_status", where="cip.genstat != 0")
    assert {(number, one) for number, cells in theirs.items() for one in cells[0] if one} == ours
    (refused,) = [line for line in lines if "refused" in line.description.counts]
    assert theirs[refused.number][1] == refused.description.details["extended_status"][:1]


def test_both_read_a_forward_open_alike(both):
    lines, fields = both
    names = (
        "cip.cm.ot_connid", "cip.cm.to_connid", "cip.cm.otrpi", "cip.cm.torpi", "cip.cm.conn_serial_num",
        "cip.cm.vendor", "cip.cm.orig_serial_num", "cip.cm.fwo.consize", "cip.cm.fwo.transport",
    )  # fmt: skip
    theirs = fields(*names, where="cip.cm.otrpi")
    asked = [line for line in lines if line.description.what.endswith("Forward_Open.req")]
    assert len(asked) == 2
    for line in asked:
        d = line.description.details
        ot, to, ot_rpi, to_rpi, serial, vendor, originator, sizes, transport = theirs[line.number]
        assert (ot, to) == ([d["o_to_t"]["connection_id"]], [d["t_to_o"]["connection_id"]])
        assert ot_rpi[0] == int(d["o_to_t"]["rpi_seconds"] * 1e6)
        assert to_rpi[0] == int(d["t_to_o"]["rpi_seconds"] * 1e6)
        assert (serial, originator) == ([d["connection_serial"]], [d["originator_serial"]])
        assert vendor == [d["originator_vendor"]]
        assert sizes == [d["o_to_t"]["size"], d["t_to_o"]["size"]]
        assert transport == [d["transport_class"]]
    answered = fields("cip.cm.otapi", "cip.cm.toapi", where="cip.cm.otapi")
    (line,) = [x for x in lines if x.description.what == "Forward_Open.res"]
    d = line.description.details
    assert answered[line.number] == (
        [int(d["o_to_t"]["api_seconds"] * 1e6)],
        [int(d["t_to_o"]["api_seconds"] * 1e6)],
    )


def test_both_know_the_paths(both):
    lines, fields = both
    theirs = fields("cip.class", "cip.instance", "cip.attribute", where="cip.sc == 0x10 && cip.rr == 0")
    (line,) = [x for x in lines if x.description.what == "Set_Attribute_Single.req"]
    d = line.description.details
    assert theirs[line.number] == ([d["class"]], [d["instance"]], [d["attribute"]])
    singles = fields("cip.instance", where="cip.sc == 0x0e && cip.rr == 0 && !(cip.sc == 0x0a) && !(cip.sc == 0x52)")
    ours = [
        x.description.details["instance"]
        for x in lines
        if x.description.what == "Get_Attribute_Single.req" and x.number in singles
    ]
    assert [one for cells in singles.values() for one in cells[0]] == ours


def test_both_take_the_same_frames_for_cyclic_data(both):
    lines, fields = both
    begin = {line.number for line in lines if line.description.what == "cyclic data begin"}
    theirs = fields("enip.cpf.sai.connid", where="udp.port == 2222")
    assert len(begin) == 2
    ids = {line.description.details["connection_id"] for line in lines if line.number in begin}
    assert {one for cells in theirs.values() for one in cells[0]} == ids
