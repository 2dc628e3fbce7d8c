"""The reader of GSDML files: what it finds, what it refuses, and that nothing else comes out of it."""

import contextlib
import re

import pytest
from gsdml_examples import ISLAND
from gsdml_kit import HEAD, MINIATURE
from gsdml_versions import VERSIONS, gsdml_of
from hypothesis import given
from hypothesis import strategies as st

from pnfarm.errors import ConfigError, DecodeError
from pnfarm.protocols.profinet.gsdml import safe_xml
from pnfarm.protocols.profinet.gsdml.planning import from_gsdml
from pnfarm.protocols.profinet.gsdml.reader import parse_gsdml
from pnfarm.protocols.profinet.gsdml.records import ParameterRecord, ParameterRef
from pnfarm.protocols.profinet.gsdml.texts import DescribedDiagnosis
from pnfarm.protocols.profinet.gsdml.values import Numbers, emit_octets, parse_octets
from pnfarm.protocols.profinet.gsdml.writer import emit_gsdml
from pnfarm.protocols.profinet.wire.alarms.notification import AlarmItem
from pnfarm.protocols.profinet.wire.alarms.texts import item_in_words


def read(text=MINIATURE):
    return parse_gsdml(text.encode())


def changed(old, new):
    assert old in MINIATURE
    return read(MINIATURE.replace(old, new, 1))


# what it finds


def test_identity_texts_and_version_are_found():
    gsdml = read()
    assert (gsdml.vendor_id, gsdml.device_id, gsdml.vendor_name) == (0xFEED, 0x0B0B, "Maker & Sons")
    assert (gsdml.info_text, gsdml.main_family, gsdml.product_family) == ("Remote block", "I/O", "Block")
    assert gsdml.schema_version == "V2.34"


def test_the_access_point_says_what_the_device_can():
    (dap,) = read().daps
    assert (dap.id, dap.ident, dap.slot, dap.instance, dap.min_device_interval) == ("D1", 0x10, 0, 2, 64)
    assert list(dap.physical_slots) == [0, 1, 2, 3, 4]
    assert (dap.multiple_write, dap.device_access, dap.device_access_ars, dap.lldp_nod) == (True, True, 1, True)
    assert (dap.shared_device, dap.ioxs_required, dap.max_record, dap.address_assignment) == (
        False,
        True,
        4068,
        ("DCP",),
    )
    assert list(dap.reset_modes) == [1, 2, 8]
    assert (dap.max_input, dap.max_output, dap.info.order_number) == (244, 200, "4711")
    assert list(dap.submodules[0].writeable_im) == [1, 2, 3]


def test_interface_and_port_carry_timings_start_up_and_mau_types():
    (dap,) = read().daps
    (interface,), (port,) = dap.interfaces, dap.ports
    assert (interface.subslot, interface.name, interface.protocols) == (0x8000, "Interface X1", ("SNMP", "LLDP"))
    assert (dap.relations.startup_modes, dap.relations.number_of_ars) == (("Advanced",), 2)
    assert (list(dap.relations.send_clocks), list(dap.relations.ratios)) == ([32, 64], [1, 2, 4, 8])
    assert (interface.rt_classes, interface.dcp_boundary, interface.ptp_boundary) == (
        ("RT_CLASS_1", "RT_CLASS_3"),
        True,
        False,
    )
    assert (port.subslot, list(port.mau_types), port.max_rx_delay) == (0x8001, [16, 30], 350)


def test_older_files_have_timings_at_the_access_point_and_mau_types_in_an_attribute():
    relations = MINIATURE[MINIATURE.index("<ApplicationRelations") : MINIATURE.index("</InterfaceSubmoduleItem>")]
    text = MINIATURE.replace(relations, "").replace("<UseableModules>", relations + "<UseableModules>")
    text = text.replace('<MAUTypeList><MAUTypeItem Value="16"/><MAUTypeItem Value="30"/></MAUTypeList>', "")
    text = text.replace('TextId="P1T"', 'TextId="P1T" MAUTypes="16"')
    (dap,) = read(text).daps
    assert dap.relations.startup_modes == ("Advanced",)
    assert list(dap.relations.send_clocks) == [32, 64]
    assert list(dap.ports[0].mau_types) == [16]


def test_modules_and_submodules_carry_idents_lengths_types_and_consistency():
    gsdml = read()
    (inputs,) = gsdml.module("DI").submodules
    assert (inputs.ident, inputs.input_octets, inputs.output_octets, inputs.api) == (0x21, 4, 0, 0)
    assert [(i.data_type, i.octets, i.use_as_bits) for i in inputs.inputs.items] == [
        ("Unsigned8", 1, True),
        ("OctetString", 3, False),
    ]
    assert inputs.may_issue_process_alarm
    assert not inputs.inputs.whole
    telegram = gsdml.submodule("T1")
    assert (telegram.api, telegram.input_octets, telegram.output_octets, telegram.inputs.whole) == (0x3A00, 4, 4, True)
    assert gsdml.submodule("SAFE").profisafe
    assert {s.id for s in gsdml.all_submodules()} == {"DS", "DI1", "PAP", "E1", "T1", "T9", "SAFE"}


def test_diagnoses_carry_their_texts_with_extended_ones_a_profiles_and_a_makers_own_form():
    gsdml = read()
    own, standard, profile = gsdml.diagnoses
    assert (own.error_type, own.name, own.help, own.api) == (256, "Too hot", "Cool", None)
    assert [(ext.error_type, ext.name) for ext in own.extended] == [(1, "Dust"), (2, "Fan")]
    assert (standard.error_type, standard.name) == (6, "")
    assert [(ext.error_type, ext.name) for ext in standard.extended] == [(1, "Dust")]
    assert (profile.error_type, profile.name, profile.api) == (0x900A, "Encoder", 0x3A00)
    assert [(ext.error_type, ext.name) for ext in profile.extended] == [(0x9000, "Line broken")]
    unit, profiles = gsdml.unit_diagnoses
    assert (unit.user_structure, unit.name, unit.help, unit.api) == (7, "State", "Cool", None)
    assert [(f.name, f.value(bytes.fromhex("1500fffeabcd"))) for f in unit.fields] == [
        ("Door", 1),
        ("Step", 5),
        ("Offset", -2),
        ("Tag", b"\xab\xcd"),
    ]
    assert (profiles.user_structure, profiles.name, profiles.api) == (4096, "Axis", 0x3A00)


@pytest.mark.parametrize(
    ("item", "words"),
    [
        (AlarmItem(0x8000, bytes.fromhex("800008000100")), "Too hot (fault, appears)"),
        (AlarmItem(0x8002, bytes.fromhex("8000080001000002") + bytes(4)), "Too hot: Fan (fault, appears)"),
        (AlarmItem(0x8002, bytes.fromhex("8000080001000009") + bytes(4)), "Too hot: 0x0009 (fault, appears)"),
        (AlarmItem(0x8002, bytes.fromhex("80000800900a9000") + bytes(4)), "Encoder: Line broken (fault, appears)"),
        (AlarmItem(0x8000, bytes.fromhex("800008000006")), "wire break (fault, appears)"),
        (AlarmItem(0x8002, bytes.fromhex("8000080000060001") + bytes(4)), "wire break: Dust (fault, appears)"),
        (AlarmItem(0x8000, bytes.fromhex("800008000101")), "error type 0x0101 (fault, appears)"),
        (AlarmItem(7, bytes.fromhex("1500fffeabcd")), "State (Door 1, Step 5, Offset -2, Tag ABCD)"),
        (AlarmItem(7, bytes.fromhex("15")), "State (Door 1, Step 5)"),
        (AlarmItem(4096, b"x"), "Axis"),
        (AlarmItem(8, b"xy"), "USI 0x0008 7879"),
    ],
)
def test_an_alarm_is_reported_with_the_texts_of_the_devices_file(item, words):
    gsdml = read()
    texts = DescribedDiagnosis(gsdml.diagnoses, gsdml.unit_diagnoses)
    assert item_in_words(item, 0x3A00, texts) == words


def test_a_text_that_the_list_has_not_shows_its_id():
    assert read().module("AX").info.name == "AXN"


# parameter records


def filter_record():
    return next(r for r in read().module("DI").submodules[0].records if r.index == 2)


def test_a_record_is_made_of_constants_and_defaults():
    # Bit 1 over 0xF0 -> 0xF2; bits 4..6 become 2 -> 0xA2
    assert filter_record().octets().hex() == "01a2" + "012c" + "3fc00000" + "fd"


def test_a_record_takes_values_by_name():
    record = filter_record()
    assert record.octets({"Filter time": 5000, "Mode": "5", "On": 0})[1:4].hex() == "d01388"


@pytest.mark.parametrize(
    ("values", "sentence"),
    [
        ({"Filter time": 1001}, r"record 2, Filter time: '1001' is given, allowed is 1\.\.1000 5000"),
        ({"Gain": 3}, r"allowed is -2\.5\.\.2\.5"),
        ({"Mode": 6}, r"allowed is 0\.\.5"),
        ({"On": 2}, r"a number from 0 to 1"),
        ({"Offset": 128}, r"what Integer8 holds"),
        ({"Offset": "1.5"}, r"what Integer8 holds"),
        ({"Offset": "nan"}, r"what Integer8 holds"),
        ({"Offset": "x"}, r"a number"),
        ({"Speed": 1}, r"record 2 has no value 'Speed', it has On, Mode, Filter time, Gain, Offset"),
    ],
)
def test_a_value_that_the_file_does_not_allow_is_refused_with_a_sentence(values, sentence):
    with pytest.raises(ConfigError, match=sentence):
        filter_record().octets(values)


def test_strings_are_filled_up_and_bit_areas_that_leave_their_octet_are_refused():
    strings = ParameterRecord(
        1,
        6,
        refs=(
            ParameterRef("VisibleString", 0, length=3, default="ab", name="V"),
            ParameterRef("OctetString", 3, length=3, default="0x01", name="O"),
        ),
    )
    assert strings.octets() == b"ab\0\x01\0\0"
    with pytest.raises(ConfigError, match="an ASCII text"):
        strings.octets({"V": "ä"})
    with pytest.raises(ConfigError, match="at most 3 octets"):
        strings.octets({"O": "1,2,3,4"})
    wide = ParameterRecord(1, 2, refs=(ParameterRef("BitArea", 0, 4, 8, default="255"),))
    with pytest.raises(ConfigError, match="inside one octet"):
        wide.octets()
    with pytest.raises(ConfigError, match="another type than Date"):
        ParameterRecord(1, 7, refs=(ParameterRef("Date", 0, length=7, default="1"),)).octets()


# what it refuses


@pytest.mark.parametrize(
    ("old", "new", "reason", "sentence"),
    [
        ('VendorID="0xFEED"', "", "bad-value", r"DeviceIdentity/@VendorID is missing, allowed is a number from 0 to"),
        ('VendorID="0xFEED"', 'VendorID="0x1FEED"', "bad-value", r"@VendorID is '0x1FEED'"),
        ('MinDeviceInterval="64"', 'MinDeviceInterval="fast"', "bad-value", r"line \d+: .*Interval is 'fast'"),
        ('MinDeviceInterval="64"', "", "bad-value", r"@MinDeviceInterval is missing"),
        ('MultipleWriteSupported="true"', 'MultipleWriteSupported="yes"', "bad-value", r"allowed is true or false"),
        ('PhysicalSlots="0..4"', 'PhysicalSlots="4..0"', "bad-value", r"rising ranges, such as 0\.\.4 7 9"),
        ('PhysicalSlots="0..4"', 'PhysicalSlots="0..70000"', "bad-value", r"@PhysicalSlots"),
        ('ID="DI" ', "", "bad-value", r"ModuleItem/@ID is missing, allowed is a text"),
        ('DataType="OctetString" Length="3"', 'DataType="OctetString"', "bad-value", r"DataItem/@Length is missing"),
        ('"OctetString" Length="3"', '"OctetString" Length="1500"', "bad-value", r"Input has 1501 octets"),
        ('Data="0xAA,0x55"', 'Data="0xAA,0x155"', "bad-value", r"octets such as 0x01,0xFF"),
        ('Data="0xAA,0x55"', 'Data="0xAA,0x55,0"', "bad-value", r"record's length of 2"),
        ('"Float32" ByteOffset="4"', '"Float32" ByteOffset="6"', "bad-value", r"inside the record's 9"),
        ('Index="1" Length="2"', 'Index="1" Length="0"', "bad-value", r"a record has octets"),
        ('Index="1" Length="2"', 'Index="70000" Length="2"', "bad-value", r"@Index is '70000'"),
        ("<DeviceIdentity", "<Identity", "not-xml", r"mismatched tag"),
        ("</ISO15745Profile>", "", "not-xml", r"no element found"),
        ("<ProfileBody>", "<Body>", "not-xml", r"allowed is well-formed XML"),
        ("utf-8", "no-such-code", "not-xml|encoding", r"unknown encoding"),
    ],
)  # fmt: skip
def test_what_is_missing_or_wrong_is_reported_with_line_element_and_what_is_allowed(old, new, reason, sentence):
    with pytest.raises(DecodeError, match=sentence) as caught:
        changed(old, new)
    assert caught.value.reason in reason.split("|")


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ('<ModuleItem ID="AX"', '<ModuleItem ID="DI"',
         r"line 61: ModuleItem/@ID is 'DI', as that of the ModuleItem in line 39; each has its own"),
        ('<SubmoduleItem ID="T9"', '<SubmoduleItem ID="T1"',
         r"SubmoduleItem/@ID is 'T1', as that of the SubmoduleItem in line \d+"),
        ('ModuleItemTarget="END"', 'ModuleItemTarget="FIN"',
         r"line 18: ModuleItemRef/@ModuleItemTarget is 'FIN', the ID of none that the file describes"),
        ('SubmoduleItemTarget="T9"', 'SubmoduleItemTarget="DI1"',
         r"SubmoduleItemRef/@SubmoduleItemTarget is 'DI1', the ID of none"),
        ('SubslotNumber="32769"', 'SubslotNumber="32768"',
         r"line 32: PortSubmoduleItem is in subslot 0x8000, as the InterfaceSubmoduleItem in line 26; one"),
        ('SubmoduleIdentNumber="0x11"', 'SubmoduleIdentNumber="0x11" FixedInSubslots="1 32769"',
         r"line 32: PortSubmoduleItem is in subslot 0x8001, as the VirtualSubmoduleItem in line 21"),
        ('Index="1" Length="2"', 'Index="2" Length="2"', r"line 55: record 2 is there already, each is once"),
        ("<RecordDataList>", '<RecordDataList><ParameterRecordDataRef RecordDataTarget="R"/>',
         r"ParameterRecordDataRef/@RecordDataTarget is 'R', the ID of none"),
    ],
)  # fmt: skip
def test_what_is_there_twice_or_leads_nowhere_is_reported_with_its_line(old, new, sentence):
    with pytest.raises(DecodeError, match=sentence) as caught:
        changed(old, new)
    assert caught.value.reason == "bad-value"


def test_ids_that_nothing_refers_to_may_be_there_twice():
    """Makers' files have them: those of virtual submodules, interfaces and ports."""
    text = MINIATURE.replace('ID="DI1"', 'ID="DS"').replace('ID="P1"', 'ID="IF"').replace('ID="E1" ', "")
    assert [submodule.id for submodule in read(text).all_submodules()].count("DS") == 2


@pytest.mark.parametrize(("kind", "octets"), [("TimeStamp", 12), ("Unsigned16_S", 2), ("OctetString2+Unsigned8", 3)])
def test_types_that_tools_know_by_their_name_need_no_length(kind, octets):
    (inputs,) = changed('DataType="OctetString" Length="3"', f'DataType="{kind}"').module("DI").submodules
    assert inputs.input_octets == 1 + octets


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("<!DOCTYPE html><html></html>", "line 1: the file is a web page"),
        ("<html/>", "root is html, that of a GSDML file is ISO15745Profile"),
        (HEAD + "</ISO15745Profile>", "ISO15745Profile has no ProfileBody"),
        (HEAD + "<ProfileBody/></ISO15745Profile>", "ProfileBody has no ApplicationProcess"),
        (
            HEAD + "<ProfileBody><DeviceIdentity/><ApplicationProcess/></ProfileBody></ISO15745Profile>",
            "there is no DeviceAccessPointItem",
        ),
        ("", "not-xml"),
    ],
)
def test_other_files_are_refused(text, sentence):
    with pytest.raises(DecodeError, match=sentence):
        read(text)


# hostile input


@pytest.mark.parametrize(
    "text",
    [
        '<!DOCTYPE a [<!ENTITY b "bb"><!ENTITY c "&b;&b;&b;">]><a x="&c;"/>',
        '<!DOCTYPE a SYSTEM "file:///etc/passwd"><a/>',
        '<!DOCTYPE a [<!ENTITY b SYSTEM "file:///etc/passwd">]><a>&b;</a>',
        "<!DOCTYPE a><a/>",
    ],
)
def test_a_document_type_is_refused_before_anything_of_it_is_used(text):
    with pytest.raises(DecodeError) as caught:
        read(text)
    assert caught.value.reason == "doctype"


def test_a_document_type_in_another_encoding_is_refused_too():
    with pytest.raises(DecodeError) as caught:
        parse_gsdml('<!DOCTYPE a [<!ENTITY b "x">]><a/>'.encode("utf-16"))
    assert caught.value.reason == "doctype"


def test_octets_elements_depth_and_attributes_are_bounded(monkeypatch):
    with pytest.raises(DecodeError, match="more than 40 deep"):
        read("<a>" * 50 + "</a>" * 50)
    with pytest.raises(DecodeError, match="more than 200 attributes"):
        read("<a " + " ".join(f'a{n}="1"' for n in range(300)) + "/>")
    monkeypatch.setattr(safe_xml, "MAX_ELEMENTS", 10)
    with pytest.raises(DecodeError, match="more than 10 elements"):
        read()
    monkeypatch.setattr(safe_xml, "MAX_OCTETS", 100)
    with pytest.raises(DecodeError, match="at most 100"):
        read()


def test_a_range_of_all_numbers_costs_nothing():
    wide = Numbers.parse("0..65535 3 70", 65535)
    assert (wide.ranges, len(wide), 4711 in wide) == (((0, 65535),), 65536, True)
    with pytest.raises(ValueError, match="at most 4096"):
        Numbers.parse("1 " * 5000, 65535)


def use(data):
    """Read octets, make every record and plan each access point; what comes out must be a value or one of the two
    errors, each a sentence."""
    try:
        gsdml = parse_gsdml(data)
    except DecodeError as exc:
        sentence, reason = exc.detail, exc.reason
    else:
        for submodule in gsdml.all_submodules():
            for record in submodule.records:
                with contextlib.suppress(ConfigError):
                    assert len(record.octets()) == record.length
        for dap in gsdml.daps:
            with contextlib.suppress(ConfigError):
                assert from_gsdml(gsdml, dap=dap.id).submodules is not None
        return
    assert reason
    assert "\n" not in sentence


@given(st.binary(max_size=300))
def test_any_octets_are_a_description_or_a_decode_error(data):
    with pytest.raises(DecodeError):
        parse_gsdml(data)


FILES = [MINIATURE, *map(gsdml_of, VERSIONS)]


@given(st.sampled_from(FILES), st.floats(0, 1), st.integers(0, 40), st.binary(max_size=12))
def test_a_bent_file_is_a_description_or_a_decode_error(text, part, cut, put):
    data = text.encode()
    place = int(part * len(data))
    use(data[:place] + put + data[place + cut :])


@given(st.sampled_from(FILES), st.data())
def test_a_file_without_some_of_its_attributes_is_a_description_or_a_decode_error(text, data):
    found = list(re.finditer(r' [A-Za-z_]+="[^"]*"', text[text.index("<ProfileBody>") :]))
    for one in data.draw(st.lists(st.sampled_from(found), min_size=1, max_size=6)):
        text = text.replace(one[0], "", data.draw(st.integers(1, 3)))
    use(text.encode())


ATTRIBUTES = [
    *("VendorID", "MinDeviceInterval", "PhysicalSlots", "SendClock", "DataType", "TextId"),
    *("Index", "Length", "ByteOffset", "BitLength", "DefaultValue", "AllowedValues", "Data"),
]


@given(st.sampled_from(ATTRIBUTES), st.text(max_size=20))
def test_any_text_in_an_attribute_is_a_value_or_a_decode_error(attribute, value):
    start = MINIATURE.index(f'{attribute}="') + len(attribute) + 2
    end = MINIATURE.index('"', start)
    text = MINIATURE[:start] + safe_xml.quoted(value)[1:-1] + MINIATURE[end:]
    use(text.encode("utf-8", "surrogatepass"))


@given(st.lists(st.tuples(st.integers(0, 500), st.integers(0, 500)).map(sorted).map(tuple)))
def test_value_lists_are_sets_whatever_their_order(ranges):
    numbers = Numbers.join(ranges)
    assert Numbers.parse(numbers.emit(), 65535) == numbers
    assert set(numbers) == {n for first, last in ranges for n in range(first, last + 1)}
    assert len(numbers) == len(set(numbers))


@given(st.binary(max_size=30))
def test_octet_lists_are_written_and_read_back(data):
    assert parse_octets(emit_octets(data)) == data


def test_the_miniature_is_written_and_read_back():
    gsdml = read()
    assert parse_gsdml(emit_gsdml(gsdml).encode()) == gsdml


# texts of values, other languages, F parameters


def island_with(old, new):
    text = ISLAND.read_text(encoding="utf-8")
    assert old in text
    return parse_gsdml(text.replace(old, new, 1).encode())


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ('ValueItemTarget="V_DELAY"', 'ValueItemTarget="V_NONE"',
         r"line \d+: Ref/@ValueItemTarget is 'V_NONE', the ID of none that the file describes"),
        ('<ValueItem ID="V_RANGE">', '<ValueItem ID="V_DELAY">',
         r"line \d+: ValueItem/@ID is 'V_DELAY', as that of the ValueItem in line \d+; each has its own"),
        ('Content="0"', 'Content=""', r"line \d+: Assign/@Content is '', allowed is a text that is not empty"),
        ('BitOffset="0"', 'BitOffset="x"', r"line \d+: BitDataItem/@BitOffset is 'x', allowed is a number"),
        ('F_SIL DefaultValue="SIL3"', 'F_SIL DefaultValue="SIL4"',
         r"line \d+: F_SIL/@DefaultValue is 'SIL4', allowed is SIL1, SIL2, SIL3, NoSIL"),
        ('F_Block_ID DefaultValue="0"', 'F_Block_ID DefaultValue="9"',
         r"line \d+: F_Block_ID/@DefaultValue is '9', allowed is a number from 0 to 7"),
        ('F_WD_Time DefaultValue="150" AllowedValues="10..10000"', 'F_WD_Time AllowedValues="10..70000"',
         r"line \d+: F_WD_Time/@AllowedValues is '10..70000', allowed is numbers up to 65535"),
        ('F_ParamDescCRC="4711" Index="4"', 'F_ParamDescCRC="4711"', r"F_ParameterRecordDataItem/@Index is missing"),
        ("</Language>", "</Language>" + '<Language xml:lang="x{}"/>' * 101, r"line \d+: more than 100 languages"),
    ],
)  # fmt: skip
def test_what_is_wrong_in_them_is_reported_with_its_line(old, new, sentence):
    if "{}" in new:
        new = new.format(*range(101))
    with pytest.raises(DecodeError, match=sentence):
        island_with(old, new)


def test_other_languages_are_found_by_the_text_of_the_primary_one():
    languages = parse_gsdml(ISLAND.read_bytes()).languages
    assert list(languages.texts) == ["de"]
    assert languages.translated("Serial gateway", "de") == "Serielles Gateway"
    assert languages.translated("Serial gateway", "fr") == languages.translated("Serial gateway", "en") == (
        "Serial gateway")  # fmt: skip
    assert list(languages.wordings("Serial gateway")) == ["Serial gateway", "Serielles Gateway"]
    assert list(read().languages.wordings("Too hot")) == ["Too hot"]


def test_all_f_parameters_are_in_their_places():
    gsdml = island_with(
        '<F_WD_Time DefaultValue="150" AllowedValues="10..10000"/>',
        '<F_WD_Time DefaultValue="150"/><F_WD_Time_2 DefaultValue="300"/>',
    )
    (submodule,) = gsdml.module("FDI4").submodules
    record = submodule.f_parameters
    assert (record.length, record.defaults().hex()) == (12, "0840" + "0001" * 2 + "0096" + "012c" + "d06c")
    gsdml = island_with("<F_Par_CRC", '<F_iPar_CRC DefaultValue="0x01020304"/><F_Par_CRC')
    (submodule,) = gsdml.module("FDI4").submodules
    record = submodule.f_parameters
    assert (record.length, record.defaults().hex()) == (14, "0840" + "0001" * 2 + "0096" + "01020304" + "d06c")
    assert [dict(ref.texts)[str(ref.value(record.defaults()))] for ref in record.refs[:2]] == ["NoCheck", "SIL3"]
