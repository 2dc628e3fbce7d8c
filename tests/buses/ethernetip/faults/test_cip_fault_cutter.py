"""A stream is cut into messages, however its octets come; and messages of the drive have a class."""

from hypothesis import given
from hypothesis import strategies as st

from pnfarm.buses.ethernetip.faults.messages import CLASSES, EncapsulationCutter, message_class
from pnfarm.protocols.enip.wire.encapsulation import EncapsulationPdu, emit_encapsulation

MESSAGES = st.lists(st.binary(max_size=70), max_size=6).map(
    lambda bodies: [emit_encapsulation(EncapsulationPdu(0x6F, body)) for body in bodies]
)


@given(MESSAGES, st.data())
def test_each_message_begins_once_however_it_comes(messages, data):
    whole = b"".join(messages)
    cutter, found, place = EncapsulationCutter(), [], 0
    while place < len(whole):
        size = data.draw(st.integers(1, len(whole) - place))
        for first, piece in cutter.pieces(whole[place : place + size]):
            assert piece
            if first:
                found.append(b"")
            found[-1] += piece
        place += size
    assert found == messages


@given(st.lists(st.binary(max_size=300), max_size=8))
def test_any_octets_pass_whole(chunks):
    cutter = EncapsulationCutter()
    for chunk in chunks:
        assert b"".join(piece for _, piece in cutter.pieces(chunk)) == chunk


@given(st.binary(max_size=200))
def test_any_octets_have_a_class(data):
    assert message_class(data) in CLASSES
    assert message_class(emit_encapsulation(EncapsulationPdu(0x6F, data))) in CLASSES
