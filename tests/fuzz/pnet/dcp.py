"""DCP requests with a thing about them wrong or not.  Each Set is followed by those of the usual name and address."""

from __future__ import annotations

from dataclasses import replace
from ipaddress import IPv4Address
from random import Random

from pnfarm.protocols.profinet.wire.dcp.blocks import (
    Block,
    DeviceIdBlock,
    DeviceRoleBlock,
    IpParameterBlock,
    NameBlock,
    OptionId,
    StationTypeBlock,
    UnknownBlock,
)
from pnfarm.protocols.profinet.wire.dcp.pdu import (
    SERVICE_GET,
    SERVICE_HELLO,
    SERVICE_IDENTIFY,
    SERVICE_SET,
    DcpPdu,
    emit_dcp,
    frame_id_of,
)
from tests.fuzz.mutate import mutated
from tests.fuzz.pnet.base import ADDRESS, NAME, Sent

__all__ = ["dcp_sequence", "set_address"]

MASK = IPv4Address("255.255.255.0")
#: Those of IEC 61158-6-10, and some that no standard has.
OPTIONS = (
    *((1, sub) for sub in range(1, 4)), *((2, sub) for sub in range(1, 9)), (3, 12), (3, 61), (3, 255),
    *((5, sub) for sub in range(1, 7)), (6, 1), (0x80, 1), (4, 1), (7, 7), (255, 255), (255, 1), (0, 0),
)  # fmt: skip
#: As IEC 61158-6-10 does not let a name be.
WRONG_NAMES = ("Not_A_Name", "-first", "last-", "a..b", "x" * 64, "x" * 241, "1.2.3.4", "port-001", "", "a b")


def _pdu(service: int, *blocks: Block, requested=(), delay: int = 0, **more) -> bytes:
    fields = {"frame_id": frame_id_of(service, 0), "service_type": 0, **more}
    return emit_dcp(
        DcpPdu(service_id=service, xid=0, blocks=blocks, requested=requested, response_delay_factor=delay, **fields)
    )


def set_address(info: int = 1) -> Sent:
    block = IpParameterBlock(IPv4Address(ADDRESS), MASK, IPv4Address(0), info)
    return Sent("DCP Set of the IP parameter", _pdu(SERVICE_SET, block), "dcp")


def _set_name(info: int = 1) -> Sent:
    return Sent("DCP Set of the name", _pdu(SERVICE_SET, NameBlock(NAME, info)), "dcp")


def _get(rng: Random) -> Sent:
    def one(*options: tuple[int, int]) -> Sent:
        what = " and ".join(f"{option}/{suboption}" for option, suboption in options)
        requested = tuple(OptionId(*option) for option in options)
        return Sent(f"DCP Get of {what or 'nothing'}", _pdu(SERVICE_GET, requested=requested), "dcp")

    good = _pdu(SERVICE_GET, requested=(OptionId(2, 2),))
    return rng.choice(
        (
            *[one(rng.choice(OPTIONS))] * 6,
            one(*rng.sample(OPTIONS, 2)),
            one(),
            Sent("DCP Get of an option without suboption", good[:8] + b"\0\0\0\1\2", "dcp"),
            Sent("DCP Get that is longer than its frame", good[:8] + b"\0\0\0\xff" + good[12:], "dcp"),
            Sent("DCP Get as a response", good[:3] + b"\1" + good[4:], "dcp"),
            Sent("DCP Get of service type 4", good[:3] + b"\4" + good[4:], "dcp"),
            Sent("DCP Get of frame id 0xFEFE", b"\xfe\xfe" + good[2:], "dcp"),
            Sent("DCP Get that is cut off", good[:9], "dcp"),
            Sent("DCP of an unknown service", good[:2] + bytes([rng.choice((0, 1, 2, 7, 9))]) + good[3:], "dcp"),
            Sent("DCP Hello", _pdu(SERVICE_HELLO, NameBlock(NAME, 0)), "dcp"),
        )
    )


def _set(rng: Random) -> list[Sent]:
    """A Set, and what gives back what it may have changed."""

    def one(what: str, *blocks: Block) -> Sent:
        return Sent(f"DCP Set of {what}", _pdu(SERVICE_SET, *blocks), "dcp")

    def address(what: str, address: str, mask: str, gateway: str = "0.0.0.0", info: int = 0) -> Sent:
        return one(what, IpParameterBlock(*(IPv4Address(text) for text in (address, mask, gateway)), info))

    name = rng.choice(WRONG_NAMES)
    option = rng.choice([one for one in OPTIONS if one not in {(1, 2), (1, 3), (2, 2), (5, 5), (5, 6)}])
    good, temporary = NameBlock(NAME, 1), NameBlock("another", 0)
    octets = _pdu(SERVICE_SET, good)
    sent = rng.choice(
        (
            _set_name(), _set_name(0), set_address(), set_address(0), one("another name", temporary),
            one(f"the name {name!r}" if len(name) <= 12 else f"a name of {len(name)}", NameBlock(name, 1)),
            address("an address in the net's place", "10.77.0.0", "255.255.255.0"),
            address("a broadcast address", "10.77.0.255", "255.255.255.0"),
            address("a multicast address", "224.0.0.1", "255.255.255.0"),
            address("a loopback address", "127.0.0.1", "255.0.0.0"),
            address("a mask with a hole", ADDRESS, "255.0.255.0"),
            address("no mask", ADDRESS, "0.0.0.0"),
            address("a gateway of another net", ADDRESS, "255.255.255.0", "10.99.0.1"),
            address("an address of class E", "240.0.0.1", "255.255.255.0"),
            one("an IP parameter that is short", UnknownBlock(1, 2, bytes(11), 1)),
            one("an IP parameter that is long", UnknownBlock(1, 2, bytes(13), 1)),
            one("a name and the signal", good, UnknownBlock(5, 3, b"\1\0", 0)),
            one("an unknown option and a name", UnknownBlock(7, 7, b"", 0), good),
            one("a name twice", good, good),
            one("the signal", UnknownBlock(5, 3, b"\1\0", 0)),
            one("the signal with another value", UnknownBlock(5, 3, b"\2\0", 0)),
            one("the signal of one octet", UnknownBlock(5, 3, b"\1", 0)),
            one("start", UnknownBlock(5, 1, b"", 0)), one("stop", UnknownBlock(5, 2, b"", 0)),
            one("response", UnknownBlock(5, 4, b"\2\2", 0)),
            one("a reset of mode 0", UnknownBlock(5, 6, b"", 0)),
            one(f"{option[0]}/{option[1]}", UnknownBlock(*option, rng.choice((b"", b"\0\0")), 0)),
            one("nothing"),
            Sent("DCP Set that is longer than its frame", octets[:8] + b"\0\0\0\xff" + octets[12:], "dcp"),
            Sent("DCP Set of a block that is longer than the PDU", octets[:14] + b"\0\xff" + octets[16:], "dcp"),
            Sent("DCP Set of a block without qualifier", _pdu(SERVICE_SET, undecoded=b"\2\2\0\0"), "dcp"),
        )
    )  # fmt: skip
    return [sent, _set_name(), set_address()]


def _identify(rng: Random) -> Sent:
    def one(what: str, *blocks: Block, delay: int = 1) -> Sent:
        return Sent(f"DCP Identify by {what}", _pdu(SERVICE_IDENTIFY, *blocks, delay=delay), "identify")

    every = UnknownBlock(255, 255, b"", None)
    return rng.choice(
        (
            one("nothing wrong", every), one("the name", UnknownBlock(2, 2, NAME.encode(), None)),
            one("the name and 255/255", UnknownBlock(2, 2, NAME.encode(), None), every),
            one("another name", UnknownBlock(2, 2, b"another", None)),
            one("a part of the name", UnknownBlock(2, 2, NAME[:4].encode(), None)),
            one("the name in capitals", UnknownBlock(2, 2, NAME.upper().encode(), None)),
            one("an empty name", UnknownBlock(2, 2, b"", None)),
            one("an alias", UnknownBlock(2, 6, b"port-001.other", None)),
            one("the ids", UnknownBlock(*DeviceIdBlock.ID, bytes.fromhex("04930002"), None)),
            one("another vendor", UnknownBlock(*DeviceIdBlock.ID, bytes.fromhex("00010002"), None)),
            one("ids that are short", UnknownBlock(*DeviceIdBlock.ID, b"\4\x93", None)),
            one("the role", UnknownBlock(*DeviceRoleBlock.ID, b"\1\0", None)),
            one("another role", UnknownBlock(*DeviceRoleBlock.ID, b"\2\0", None)),
            one("another type of station", UnknownBlock(*StationTypeBlock.ID, b"nobody", None)),
            one("the IP parameter", UnknownBlock(1, 2, IPv4Address(ADDRESS).packed + MASK.packed + bytes(4), None)),
            one("another IP parameter", UnknownBlock(1, 2, bytes(12), None)),
            one("an unknown option", UnknownBlock(7, 7, b"", None)),
            one("an unknown option and 255/255", UnknownBlock(7, 7, b"", None), every),
            one("no filter"), one("255/255 with a value", UnknownBlock(255, 255, b"\0\0", None)),
            one("255/255 without delay", every, delay=0),
            one("DHCP", UnknownBlock(3, 61, b"\0", None)),
            Sent("DCP Identify for the device alone", _pdu(SERVICE_IDENTIFY, every, delay=1), "dcp"),
        )
    )  # fmt: skip


def dcp_sequence(rng: Random) -> list[Sent]:
    found: list[Sent] = []
    for _ in range(rng.randrange(1, 4)):
        kind = rng.randrange(4)
        if kind == 3:
            good = [_pdu(SERVICE_GET, requested=(OptionId(2, 2), OptionId(1, 2))), _get(rng).octets]
            octets = mutated(rng, rng.choice(good), good)[:400]
            # a changed service is another one that may reset the device, or moves its answer to another moment
            found.append(Sent("a changed DCP Get", good[0][:3] + octets[3:], "dcp", coarse=True))
        else:
            found += [_get(rng)] if kind == 0 else _set(rng) if kind == 1 else [_identify(rng)]
    # by its number each knows its answer
    return [
        replace(one, octets=one.octets[:4] + number.to_bytes(4, "big") + one.octets[8:])
        for number, one in enumerate(found, 1)
    ]
