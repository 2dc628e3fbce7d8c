"""What a drive shows: each object's type as its MIB has it, the rows' indexes, texts and numbers at their limits."""

from dataclasses import replace

import pytest
from snmp_support import NEIGHBOUR, VIEW, Manager

from pnfarm.protocols.profinet.snmp.mib_system import PROFINET_OBJECT_ID
from pnfarm.protocols.profinet.snmp.view import (
    InterfaceView,
    SystemView,
    capability_bits,
    system_description,
)
from pnfarm.protocols.profinet.wire.lldp.tlvs import (
    ChassisId,
    MacPhyStatus,
    ManagementAddress,
    MeasuredDelays,
    PortDescription,
    PortStatus,
    SystemName,
)
from pnfarm.protocols.profinet.wire.snmp.message import (
    COUNTER32,
    COUNTER64,
    GAUGE32,
    INTEGER,
    NO_SUCH_INSTANCE,
    OBJECT_IDENTIFIER,
    OCTET_STRING,
    TIME_TICKS,
)

MIB_2 = (1, 3, 6, 1, 2, 1)
LLDP = (1, 0, 8802, 1, 1, 2, 1)
DOT3, PNO = (*LLDP, 5, 4623, 1), (*LLDP, 5, 3791, 1)
#: I INTEGER, S OCTET STRING, O OBJECT IDENTIFIER, C Counter32, G Gauge32 or Unsigned32, T TimeTicks, H Counter64.
LETTERS = {
    "I": INTEGER,
    "S": OCTET_STRING,
    "O": OBJECT_IDENTIFIER,
    "C": COUNTER32,
    "G": GAUGE32,
    "T": TIME_TICKS,
    "H": COUNTER64,
}
#: The SYNTAX clauses of the MIBs from the first arc that is accessible: RFC 3418, RFC 1213, RFC 2863, IEEE 802.1AB-2005
#: (LLDP-MIB, LLDP-EXT-DOT3-MIB), IEC 61158-6-10 (LLDP-EXT-PNO-MIB).  A dot is an arc that is not there.
SYNTAX = {
    ("system", (*MIB_2, 1), 1): "SOTSSSI",
    ("ifNumber", (*MIB_2, 2), 1): "I",
    ("ifEntry", (*MIB_2, 2, 2, 1), 1): "ISIIGSIITCCCCCCCCCCCGO",
    ("snmp", (*MIB_2, 11), 1): "CCCCCC.CCCCCCCCCCCCCCC.CCCCCCICC",
    ("ifXEntry", (*MIB_2, 31, 1, 1, 1), 1): "SCCCCHHHHHHHHIGIIST",
    ("lldpConfiguration", (*LLDP, 1), 1): "IIIII",
    ("lldpPortConfigEntry", (*LLDP, 1, 6, 1), 2): "IIS",
    ("lldpConfigManAddrEntry", (*LLDP, 1, 7, 1), 1): "S",
    ("lldpStatistics", (*LLDP, 2), 1): "TGGGG",
    ("lldpStatsTxPortEntry", (*LLDP, 2, 6, 1), 2): "C",
    ("lldpStatsRxPortEntry", (*LLDP, 2, 7, 1), 2): "CCCCCG",
    ("lldpLocalSystemData", (*LLDP, 3), 1): "ISSSSS",
    ("lldpLocPortEntry", (*LLDP, 3, 7, 1), 2): "ISS",
    ("lldpLocManAddrEntry", (*LLDP, 3, 8, 1), 3): "IIIO",
    ("lldpRemEntry", (*LLDP, 4, 1, 1), 4): "ISISSSSSS",
    ("lldpRemManAddrEntry", (*LLDP, 4, 2, 1), 3): "IIO",
    ("lldpXPnoLocEntry", (*PNO, 2, 1, 1), 1): "GGGIIS",
    ("lldpXPnoRemEntry", (*PNO, 3, 1, 1), 1): "GGGIIS",
    ("lldpXdot3LocPortEntry", (*DOT3, 2, 1, 1), 1): "IISI",
    ("lldpXdot3RemPortEntry", (*DOT3, 3, 1, 1), 1): "IISI",
}
#: lldpRemTimeMark (hundredths of a second), lldpRemLocalPortNum, lldpRemIndex.
ROW = (1234, 1, 3)
ADDRESS_OF_PLC = (1, 4, 10, 77, 0, 9)


def content(*name, view=VIEW):
    (varbind,) = Manager(view).get(name).varbinds
    return varbind.value.content


def types():
    """Each object type with its tag."""
    for (group, base, first), letters in SYNTAX.items():
        for arc, letter in enumerate(letters, first):
            if letter != ".":
                yield pytest.param((*base, arc), LETTERS[letter], id=f"{group}.{arc}")


@pytest.mark.parametrize(("name", "tag"), list(types()))
def test_an_object_has_the_type_of_its_mib_in_every_row(name, tag):
    found = [varbind for varbind in Manager().walk(start=name, repetitions=50) if varbind.name[: len(name)] == name]
    assert found
    assert {varbind.value.tag for varbind in found} == {tag}


def test_there_are_no_objects_but_those_of_the_mibs():
    known = {parameter.values[0] for parameter in types()}
    for varbind in Manager().walk():
        assert any(varbind.name[: len(name)] == name for name in known), varbind.name


def test_every_interface_has_a_row_with_all_columns():
    names = [varbind.name for varbind in Manager().walk(start=(*MIB_2, 2, 2))]
    rows = {name[-1] for name in names if name[:-2] == (*MIB_2, 2, 2, 1)}
    assert rows == {1, 2, 3}
    assert content(*MIB_2, 2, 1, 0) == 3
    assert [content(*MIB_2, 2, 2, 1, 8, row) for row in (1, 2, 3)] == [1, 2, 1]
    assert [content(*MIB_2, 31, 1, 1, 1, 15, row) for row in (1, 2, 3)] == [100] * 3


def test_counters_of_32_bits_wrap_where_those_of_64_go_on():
    # 2**32 - 5 octets, 2**32 - 4 frames, 2**32 - 3 + 2**32 - 2 to groups
    assert content(*MIB_2, 2, 2, 1, 10, 1) == 2**32 - 5
    assert content(*MIB_2, 2, 2, 1, 12, 1) == 2**32 - 5
    assert content(*MIB_2, 2, 2, 1, 16, 1) == 2
    assert content(*MIB_2, 31, 1, 1, 1, 10, 1) == 2**32 + 2


def test_a_neighbours_row_is_named_by_time_port_and_index():
    assert content(*LLDP, 4, 1, 1, 5, *ROW) == b"plc"
    assert content(*LLDP, 4, 1, 1, 5, 1234, 1, 4) == b"other"
    assert content(*LLDP, 4, 1, 1, 8, *ROW) == b"X1 P2"
    assert content(*DOT3, 3, 1, 1, 4, *ROW) == 30
    assert [content(*PNO, 3, 1, 1, arc, *ROW) for arc in (1, 2, 3, 6)] == [120, 300, 310, b"plc"]


def test_a_neighbour_without_extensions_has_no_rows_in_their_tables():
    for name in ((*DOT3, 3, 1, 1, 4, 1234, 1, 4), (*PNO, 3, 1, 1, 6, 1234, 1, 4)):
        (varbind,) = Manager().get(name).varbinds
        assert varbind.value.tag == NO_SUCH_INSTANCE


def test_an_address_in_an_index_has_its_length_before_it():
    assert content(*LLDP, 3, 8, 1, 5, 1, 4, 10, 77, 0, 11) == 3
    assert content(*LLDP, 3, 8, 1, 3, 1, 4, 10, 77, 0, 11) == 5  # subtype and four octets
    assert content(*LLDP, 4, 2, 1, 4, *ROW, *ADDRESS_OF_PLC) == 7
    system = replace(VIEW.lldp.system, address=None, interface_number=1)
    view = replace(VIEW, lldp=replace(VIEW.lldp, system=system))
    assert content(*LLDP, 3, 8, 1, 5, 6, 6, 2, 0, 0, 0, 0, 1, view=view) == 1


def test_a_list_of_ports_has_the_first_one_in_the_highest_bit():
    name = (*LLDP, 1, 7, 1, 1, 1, 4, 10, 77, 0, 11)
    assert content(*name) == b"\xc0"
    ports = tuple(replace(VIEW.lldp.ports[0], number=number) for number in (1, 8, 9))
    assert content(*name, view=replace(VIEW, lldp=replace(VIEW.lldp, ports=ports))) == b"\x81\x80"


def test_what_a_neighbour_says_can_be_shown_whatever_it_is():
    """Its numbers have 32 bits without sign; two neighbours may even have one index; nothing of it stops a walk."""
    says = replace(
        NEIGHBOUR.neighbour,
        chassis=ChassisId(7, "ü".encode() * 127),
        tlvs=(
            PortDescription("ä".encode() * 127),
            SystemName(b"\xed\xa0\x80"),
            ManagementAddress(1, b"\n", 2, 2**32 - 1),
            ManagementAddress(255, bytes(31), 255, 0, b"\xff"),
            MacPhyStatus(0xFF, 0xFFFF, 0xFFFF),
            MeasuredDelays(cable_local=2**32 - 1),
            PortStatus(0xFFFF, 0xFFFF),
        ),
    )
    hostile = replace(NEIGHBOUR, time_mark_ns=2**70, neighbour=says)
    view = replace(VIEW, lldp=replace(VIEW.lldp, neighbours=(hostile, hostile)))
    row = (2**70 // 10**7 % 2**32, 1, 3)
    walked = {varbind.name: varbind.value.content for varbind in Manager(view).walk()}
    assert walked[(*LLDP, 4, 2, 1, 4, *row, 1, 1, 10)] == 2**31 - 1
    assert walked[(*LLDP, 4, 2, 1, 5, *row, 255, 31, *bytes(31))] == (0, 0)
    assert walked[(*LLDP, 4, 1, 1, 8, *row)] == ("ä" * 127).encode()
    assert walked[(*LLDP, 4, 1, 1, 9, *row)] == SystemName(b"\xed\xa0\x80").text.encode()
    assert walked[(*PNO, 3, 1, 1, 6, *row)] == b"?" * 127
    assert [walked[(*PNO, 3, 1, 1, arc, *row)] for arc in (4, 5)] == [3, 7]


def test_texts_are_cut_and_made_ascii():
    view = replace(VIEW, system=SystemView("d" * 300, 0, contact="Jürgen"))
    assert content(*MIB_2, 1, 1, 0, view=view) == b"d" * 255
    assert content(*MIB_2, 1, 4, 0, view=view) == b"J?rgen"
    assert content(*MIB_2, 1, 2, 0, view=view) == PROFINET_OBJECT_ID


def test_a_fast_interface_shows_the_largest_speed_that_a_gauge_has():
    fast = InterfaceView(1, "port", "port", bytes(6), speed=10_000_000_000)
    view = replace(VIEW, interfaces=(fast,))
    assert content(*MIB_2, 2, 2, 1, 5, 1, view=view) == 2**32 - 1
    assert content(*MIB_2, 31, 1, 1, 1, 15, 1, view=view) == 10_000


def test_capabilities_of_a_frame_are_turned_to_the_order_of_bits():
    assert capability_bits(0x0080) == b"\x01"  # station only, bit 7
    assert capability_bits(0x0014) == b"\x28"  # bridge and router, bits 2 and 4
    assert capability_bits(0x0700) == b"\x00"  # bits that the MIB does not know


def test_the_system_description_has_fields_of_fixed_width():
    text = system_description("AKD", "AKD-P00306-NBPN-0000", "PNF020000000001", 1, "V", (1, 17, 0))
    assert text == "AKD                       AKD-P00306-NBPN-0000 PNF020000000001      1 V  1 17  0"
    assert len(text) == 25 + 1 + 20 + 1 + 16 + 1 + 5 + 1 + 1 + 9
    longest = system_description("T" * 99, "O" * 99, "S" * 99, 65535, "V", (255, 255, 255))
    assert longest == f"{'T' * 25} {'O' * 20} {'S' * 16} 65535 V255255255"
