"""Anything that the codecs of EtherNet/IP can build, for property tests."""

from hypothesis import strategies as st

from pnfarm.protocols.enip.wire import cpf, epath
from pnfarm.protocols.enip.wire import forward_open as fo
from pnfarm.protocols.enip.wire.identity import IdentityItem, ServiceItem
from pnfarm.protocols.enip.wire.message import MessageReply, MessageRequest

u8, u16, u32 = (st.integers(0, 2**bits - 1) for bits in (8, 16, 32))
octets = st.binary(max_size=64)
words = st.binary(max_size=32).map(lambda data: data * 2)
addresses = st.ip_addresses(v=4)

identities = st.builds(
    IdentityItem, addresses, u16, u16, u16, st.tuples(u8, u8), u16, u32, st.binary(max_size=255), u8, u16, u16, u16
)
services = st.builds(ServiceItem, u16, u16, st.binary(min_size=16, max_size=16))
items = st.one_of(
    st.just(cpf.NullAddress()),
    st.builds(cpf.ConnectedAddress, u32),
    st.builds(cpf.SequencedAddress, u32, u32),
    st.builds(cpf.ConnectedData, octets),
    st.builds(cpf.UnconnectedData, octets),
    st.builds(cpf.SocketAddress, st.booleans(), u16, addresses, u16, st.binary(min_size=8, max_size=8)),
    identities,
    services,
    st.builds(cpf.UnknownItem, u16.filter(lambda number: number not in {int(t) for t in cpf.ItemType}), octets),
)
packets = st.builds(cpf.CommonPacket, st.lists(items, max_size=5).map(tuple), u32, u16)

logical = st.sampled_from([0, 1, 2, 3, 4]).flatmap(
    lambda kind: st.one_of(
        st.builds(epath.LogicalSegment, st.just(kind), u8, st.just(1)),
        st.builds(epath.LogicalSegment, st.just(kind), u16, st.just(2)),
        st.builds(epath.LogicalSegment, st.just(kind), u32, st.just(4)),
    )
)
segments = st.one_of(
    logical,
    st.builds(epath.ElectronicKey, u16, u16, u16, st.integers(0, 127), u8, st.booleans()),
    st.builds(epath.PortSegment, st.integers(1, 0xFFFF), st.binary(min_size=1, max_size=20)),
    st.builds(epath.NetworkSegment, st.integers(0, 15), st.binary(min_size=1, max_size=1)),
    st.builds(epath.NetworkSegment, st.integers(16, 31), words),
    st.builds(epath.SymbolSegment, st.binary(max_size=255)),
    st.builds(epath.SymbolSegment, st.binary(min_size=1, max_size=31), st.just(value=False)),
    st.builds(epath.DataSegment, words),
)
paths = st.lists(segments, max_size=6).map(tuple)
encoded_paths = st.lists(segments, max_size=3).map(epath.emit_epath)

requests = st.builds(MessageRequest, st.integers(0, 127), encoded_paths, octets)
replies = st.builds(MessageReply, st.integers(0, 127), u8, st.lists(u16, max_size=4).map(tuple), octets)

triads = st.builds(fo.Triad, u16, u16, u32)
transports = st.builds(fo.TransportClass, st.integers(0, 15), st.integers(0, 7), st.booleans())


def network_parameters(large):
    reserved = st.sampled_from([0, 1, 0x1000, 0x11FF]) if large else st.sampled_from([0, 0x1000])
    return st.builds(
        fo.NetworkParameters, st.integers(0, 0xFFFF if large else 0x1FF), st.integers(0, 3), st.integers(0, 3),
        st.booleans(), st.booleans(), reserved,
    )  # fmt: skip


forward_opens = st.booleans().flatmap(
    lambda large: st.builds(
        fo.ForwardOpen, triads, u32, u32, u32, network_parameters(large), u32, network_parameters(large), transports,
        encoded_paths, u8, u8, u8, st.just(large),
    )
)  # fmt: skip
forward_open_replies = st.builds(fo.ForwardOpenReply, u32, u32, triads, u32, u32, words)
forward_refusals = st.builds(fo.ForwardRefusal, triads, u8)
forward_closes = st.builds(fo.ForwardClose, triads, encoded_paths, u8, u8)
forward_close_replies = st.builds(fo.ForwardCloseReply, triads, words)
unconnected_sends = st.builds(fo.UnconnectedSend, octets, encoded_paths, u8, u8)
