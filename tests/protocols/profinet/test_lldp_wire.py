import struct
from ipaddress import IPv4Address
from uuid import UUID

import pytest
import scapy.contrib.lldp as oracle
from hypothesis import given
from hypothesis import strategies as st
from scapy.layers.l2 import Ether

from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.wire.lldp import tlvs as lldp
from pnfarm.protocols.profinet.wire.lldp.pdu import Lldpdu, emit_lldp, parse_lldp, peer_names
from pnfarm.protocols.profinet.wire.lldp.tlvs import (
    ChassisId,
    ChassisMac,
    MacPhyStatus,
    ManagementAddress,
    MauTypeExtension,
    MeasuredDelays,
    MrpInterconnectionPortStatus,
    MrpPortStatus,
    PortAlias,
    PortDescription,
    PortId,
    PortStatus,
    PtcpStatus,
    RawTlv,
    SystemCapabilities,
    SystemDescription,
    SystemName,
)

CHASSIS = ChassisId(7, b"axis-01")
PORT = PortId(7, b"port-001")

u8, u16, u32 = st.integers(0, 0xFF), st.integers(0, 0xFFFF), st.integers(0, 0xFFFFFFFF)
macs = st.binary(min_size=6, max_size=6)
texts = st.binary(max_size=255)
uuids = st.binary(min_size=16, max_size=16).map(lambda b: UUID(bytes=b))
identifiers = st.binary(min_size=1, max_size=255)
foreign_ouis = st.binary(min_size=3, max_size=3).filter(lambda o: o not in {lldp.OUI_PROFINET, lldp.OUI_IEEE_802_3})
tlvs = st.one_of(
    st.builds(PortDescription, texts),
    st.builds(SystemName, texts),
    st.builds(SystemDescription, texts),
    st.builds(SystemCapabilities, u16, u16),
    st.builds(ManagementAddress, u8, st.binary(min_size=1, max_size=31), u8, u32, st.binary(max_size=128)),
    st.builds(MacPhyStatus, u8, u16, u16),
    st.builds(MeasuredDelays, u32, u32, u32, u32, u32),
    st.builds(PortStatus, u16, u16),
    st.builds(PortAlias, texts),
    st.builds(MrpPortStatus, uuids, u16),
    st.builds(ChassisMac, macs),
    st.builds(PtcpStatus, macs, uuids, uuids, u32, u32, u32, u32),
    st.builds(MauTypeExtension, u16),
    st.builds(MrpInterconnectionPortStatus, u16, u16, u16),
    st.builds(RawTlv, st.integers(9, 126), st.binary(max_size=511)),
    st.builds(lambda oui, rest: RawTlv(127, oui + rest), foreign_ouis, st.binary(max_size=508)),
    st.builds(
        lambda subtype, rest: RawTlv(127, lldp.OUI_PROFINET + bytes([subtype]) + rest), st.integers(9, 255), texts
    ),
)
pdus = st.builds(
    Lldpdu,
    st.builds(ChassisId, u8, identifiers),
    st.builds(PortId, u8, identifiers),
    u16,
    st.lists(tlvs, max_size=6).map(tuple),
)


def tlv(kind, value=b""):
    return struct.pack(">H", kind << 9 | len(value)) + value


MANDATORY = tlv(1, b"\x07axis-01") + tlv(2, b"\x07port-001") + tlv(3, b"\0\x14")


@given(pdus)
def test_what_is_emitted_parses_to_the_same(pdu):
    octets = emit_lldp(pdu)
    assert parse_lldp(octets) == pdu
    assert parse_lldp(octets + bytes(20)) == pdu  # padding of the frame


@given(st.one_of(st.binary(max_size=400), st.binary(max_size=400).map(lambda rest: MANDATORY + rest)))
def test_any_octets_are_an_lldpdu_or_a_decode_error(data):
    try:
        pdu = parse_lldp(data)
    except DecodeError:
        return
    assert parse_lldp(emit_lldp(pdu)) == pdu


@given(pdus, st.integers(0, 200))
def test_a_cut_lldpdu_is_refused_or_ends_between_two_tlvs(pdu, cut):
    octets = emit_lldp(pdu)[:-2]
    cut = min(cut, len(octets))
    try:
        short = parse_lldp(octets[: len(octets) - cut])
    except DecodeError:
        return
    assert short.tlvs == pdu.tlvs[: len(short.tlvs)]


def test_the_classic_names_are_read():
    assert peer_names(CHASSIS, PORT) == ("port-001", "axis-01")
    assert peer_names(ChassisId(4, bytes.fromhex("02aabbccddee")), PORT) == ("port-001", "02-AA-BB-CC-DD-EE")


def test_the_newer_names_are_read():
    described = ChassisId(7, b"SCALANCE X208            6GK5208")
    assert peer_names(described, PortId(7, b"port-003.switch.hall-1")) == ("port-003", "switch.hall-1")
    assert peer_names(described, PortId(7, b"port-003.00-0E-CF-01-02-03")) == ("port-003", "00-0E-CF-01-02-03")


def test_other_peoples_ids_are_readable():
    assert peer_names(ChassisId(4, bytes(range(6))), PortId(3, bytes.fromhex("0200000000ff"))) == (
        "02-00-00-00-00-FF",
        "00-01-02-03-04-05",
    )
    assert PortId(5, b"eth0\xff\0").text == "eth0\N{REPLACEMENT CHARACTER}"


@pytest.mark.parametrize(
    ("octets", "reason"),
    [
        (b"", "short"),
        (MANDATORY[:-1], "short"),
        (tlv(2, b"\x07port-001") + tlv(1, b"\x07axis-01") + tlv(3, b"\0\x14"), "bad-order"),
        (tlv(1, b"\x07axis-01") + tlv(3, b"\0\x14") + tlv(2, b"\x07port-001"), "bad-order"),
        (tlv(0), "bad-order"),
        (tlv(1, b"\x07") + MANDATORY[10:], "bad-length"),
        (tlv(1, b"\x07" + bytes(256)) + tlv(2, b"\x07p") + tlv(3, b"\0\x14"), "bad-length"),
        (MANDATORY[:-4] + tlv(3, b"\x14"), "bad-length"),
        (MANDATORY[:-4] + tlv(3, b"\0\x14\0"), "bad-length"),
        (MANDATORY + tlv(1, b"\x07axis-02"), "duplicate"),
        (MANDATORY + tlv(2, b"\x07port-002"), "duplicate"),
        (MANDATORY + tlv(4, b"x") + tlv(3, b"\0\0"), "duplicate"),
        (MANDATORY + tlv(0, b"x"), "bad-length"),
        (MANDATORY + tlv(5, b"name")[:-1], "short"),
    ],
)
def test_a_hostile_lldpdu_is_refused_with_its_reason(octets, reason):
    with pytest.raises(DecodeError) as caught:
        parse_lldp(octets)
    assert caught.value.reason == reason


def test_a_missing_end_is_forgiven():
    assert parse_lldp(MANDATORY) == Lldpdu(CHASSIS, PORT, 20)


@pytest.mark.parametrize(
    "value",
    [
        (7, b"\0\x80\0"),
        (8, b"\x01\x01\x02\0\0\0\x01\0"),
        (8, b"\x05\x01\x0a\x4d\0\x0b\x02\0\0\0\x01\x05\x2b"),
        (5, bytes(256)),
        (127, lldp.OUI_PROFINET),
        (127, lldp.OUI_PROFINET + b"\x05\x02\0\0\0\0"),
        (127, lldp.OUI_IEEE_802_3 + b"\x01\x03\x6c\0\0\x10\0"),
    ],
)
def test_a_tlv_of_the_wrong_shape_is_kept_and_hides_nothing(value):
    pdu = parse_lldp(MANDATORY + tlv(*value) + tlv(6, b"a drive") + tlv(0))
    assert pdu.tlvs == (RawTlv(*value), SystemDescription(b"a drive"))
    assert emit_lldp(pdu) == MANDATORY + tlv(*value) + tlv(6, b"a drive") + tlv(0)


@pytest.mark.parametrize(
    "pdu",
    [
        Lldpdu(ChassisId(7, b""), PORT, 20),
        Lldpdu(CHASSIS, PortId(7, bytes(256)), 20),
        Lldpdu(CHASSIS, PORT, 0x10000),
        Lldpdu(CHASSIS, PORT, 20, (SystemName(bytes(256)),)),
        Lldpdu(CHASSIS, PORT, 20, (ManagementAddress(1, b""),)),
        Lldpdu(CHASSIS, PORT, 20, (ChassisMac(bytes(5)),)),
        Lldpdu(CHASSIS, PORT, 20, (RawTlv(3, b"\0\0"),)),
        Lldpdu(CHASSIS, PORT, 20, (RawTlv(9, bytes(512)),)),
    ],
)
def test_what_does_not_fit_is_our_own_mistake(pdu):
    with pytest.raises(ValueError, match=r"\S"):
        emit_lldp(pdu)


# -- an independent decoder


def test_scapy_reads_what_we_send():
    pdu = Lldpdu(
        CHASSIS,
        PORT,
        20,
        (
            PortStatus(),
            MacPhyStatus(3, 0x6C00, 16),
            lldp.ipv4_management(IPv4Address("10.77.0.11"), 1),
            PortDescription(b"X11"),
            SystemName(b"axis-01"),
            SystemDescription(b"AKD"),
            SystemCapabilities(0x0080, 0x0080),
        ),
    )
    seen = oracle.LLDPDU(emit_lldp(pdu))
    assert (seen[oracle.LLDPDUChassisID].subtype, seen[oracle.LLDPDUChassisID].id) == (7, b"axis-01")
    assert (seen[oracle.LLDPDUPortID].subtype, seen[oracle.LLDPDUPortID].id) == (7, b"port-001")
    assert seen[oracle.LLDPDUTimeToLive].ttl == 20
    assert seen[oracle.LLDPDUPortDescription].description == b"X11"
    assert seen[oracle.LLDPDUSystemName].system_name == b"axis-01"
    assert seen[oracle.LLDPDUSystemDescription].description == b"AKD"
    assert seen[oracle.LLDPDUSystemCapabilities].station_only_enabled == 1
    address = seen[oracle.LLDPDUManagementAddress]
    assert bytes(address.management_address) == bytes([10, 77, 0, 11])
    assert address.interface_number == 1
    organisations = []
    layer = seen
    while layer := layer.payload.getlayer(oracle.LLDPDUGenericOrganisationSpecific):
        organisations.append((layer.org_code, layer.subtype, bytes(layer.data)))
    assert organisations == [(0x000ECF, 2, bytes(4)), (0x00120F, 1, bytes.fromhex("036c000010"))]
    assert seen.haslayer(oracle.LLDPDUEndOfLLDPDU)


def test_we_read_what_scapy_sends():
    frame = (
        Ether(dst="01:80:c2:00:00:0e", src="02:00:00:00:00:01")
        / oracle.LLDPDUChassisID(subtype=4, id="02:00:00:00:00:01")
        / oracle.LLDPDUPortID(subtype=5, id=b"swp1")
        / oracle.LLDPDUTimeToLive(ttl=120)
        / oracle.LLDPDUPortDescription(description=b"uplink")
        / oracle.LLDPDUSystemName(system_name=b"switch")
        / oracle.LLDPDUSystemCapabilities(mac_bridge_available=1, mac_bridge_enabled=1)
        / oracle.LLDPDUManagementAddress(
            management_address_subtype=1, management_address=bytes([10, 0, 0, 1]), interface_numbering_subtype=2,
            interface_number=7,
        )
        / oracle.LLDPDUGenericOrganisationSpecific(org_code=0x000ECF, subtype=5, data=bytes(range(6)))
        / oracle.LLDPDUEndOfLLDPDU()
    )  # fmt: skip
    pdu = parse_lldp(bytes(frame)[14:])
    assert pdu == Lldpdu(
        ChassisId(4, bytes.fromhex("020000000001")),
        PortId(5, b"swp1"),
        120,
        (
            PortDescription(b"uplink"),
            SystemName(b"switch"),
            SystemCapabilities(4, 4),
            ManagementAddress(1, bytes([10, 0, 0, 1]), 2, 7),
            ChassisMac(bytes(range(6))),
        ),
    )
