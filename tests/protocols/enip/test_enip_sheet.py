"""What an EDS file describes: the example file, and files that cannot be followed."""

import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pnfarm.errors import ConfigError, DecodeError
from pnfarm.protocols.enip.connection import ConnectionKind
from pnfarm.protocols.enip.eds.document import Limits
from pnfarm.protocols.enip.eds.reader import parse_sheet
from pnfarm.protocols.enip.wire.epath import ElectronicKey
from pnfarm.vocabulary.problem import Problem

EXAMPLE = Path(__file__).parents[3] / "configs" / "eds" / "Example-Weigher-20261128.eds"
OCTETS = EXAMPLE.read_bytes()
SHEET = parse_sheet(OCTETS)
DEVICE = b"[Device] VendCode = 1;\n"


def test_a_sheet_names_the_device_and_what_it_has_room_for():
    assert SHEET.key == ElectronicKey(65534, 43, 17, 2, 5)
    assert (SHEET.vendor, SHEET.product, SHEET.catalog) == ("Example", "EX-WGH Weigher", "EX-WGH-1")
    assert (SHEET.networks, SHEET.port, SHEET.io_connections, SHEET.explicit_connections) == (
        ("EtherNetIP",), "Port 1", 4, 6,
    )  # fmt: skip


def test_a_parameter_has_type_limits_unit_scale_and_names_of_values():
    weight, status, chosen = SHEET.parameters[1], SHEET.parameters[2], SHEET.parameters[5]
    assert (weight.name, weight.unit, weight.type.name, weight.scale) == ("Weight", "kg", "int32", 0.001)
    assert (weight.path.hex(), weight.read_only, weight.help) == ("206424013001", True, "What is on the cell")
    assert status.bit_names == {0: "Stable", 1: "Overload", 2: "Underload", 15: "Ready"}
    assert (chosen.minimum, chosen.maximum, chosen.default, chosen.bit_names) == (0, 2, 1, {})
    assert SHEET.parameters[11].default == 21.5
    assert (chosen.given("Slow"), chosen.given(0)) == (b"\2", b"\0")
    with pytest.raises(Problem, match="above 2"):
        chosen.given(3)
    with pytest.raises(Problem, match="did you mean"):
        chosen.given("slwo")
    assert SHEET.named("param6") is SHEET.named("window")


@pytest.mark.parametrize(
    ("code", "name"), [("0xC3", "int16"), ("0xC8", "uint32"), ("0xCB", "float64"), ("0xD4", "uint64")]
)
def test_a_parameter_without_a_size_has_that_of_its_type(code, name):
    sheet = parse_sheet(DEVICE + f"[Params]\nParam1 = 0,,,0,{code},,X;".encode())
    assert sheet.parameters[1].type.name == name


def test_an_assembly_has_its_members_where_their_sizes_put_them():
    outputs = SHEET.assemblies[101]
    places = {one.parameter.name: (one.place, one.bits) for one in outputs.members if one.parameter}
    assert places == {"Command": (0, 8), "Target": (32, 32), "Gate": (64, 1), "Recipe": (65, 3)}
    assert (outputs.instance, outputs.size.default) == (101, 9)
    assert SHEET.assemblies[100].size.default == 3
    assert SHEET.assemblies[103].size == Limits(16, 4, 64)
    nested = SHEET.assemblies[104]
    assert [(m.place, m.parameter.name) for m in nested.members if m.parameter][-2:] == [
        (64, "Temperature"), (96, "Weighings"),
    ]  # fmt: skip


def test_an_assembly_has_the_members_that_fit_into_its_size():
    sheet = parse_sheet(DEVICE + b"[Assembly]\nAssem1 = ,,3,,,,16,,16,;")
    assert (sheet.assemblies[1].size, len(sheet.assemblies[1].members)) == (Limits(3, 3, 3), 1)
    assert sheet.remarks == ("line 3: Assem1: its members have 32 bits, its size is 3 octets: it has those that fit",)


@pytest.mark.parametrize(
    ("inner", "outer", "place"),
    [
        ("4,0,,,", ",Assem1", 32),
        ("4,0,,,", "32,Assem1", 32),
        ("4,0,,,16,", ",Assem1", 32),
        ("4,0,,,16,", "24,Assem1", 24),
        (",0,,,16,", ",Assem1", 16),
    ],
)
def test_what_is_behind_an_assembly_within_another_comes_behind_all_its_octets(inner, outer, place):
    sheet = parse_sheet(DEVICE + f"[Assembly]\nAssem1 = ,,{inner};\nAssem2 = ,,,0,,,{outer},8,;".encode())
    assert (sheet.assemblies[2].members[-1].place, sheet.assemblies[2].members[-1].bits) == (place, 8)


def test_an_assembly_whose_only_member_is_itself_has_data_without_meaning():
    sheet = parse_sheet(DEVICE + b'[Assembly]\nAssem1 = "In","20 04 24 6F 30 03",4,0,,,32,Assem1;')
    assert sheet.assemblies[1].size == Limits(4, 4, 4)
    assert [(one.place, one.bits, one.parameter) for one in sheet.assemblies[1].members] == [(0, 32, None)]


@pytest.mark.parametrize(
    "path", ["20 04 24 01 2C 02 2D 00 2C 01", "20 04 24 01 2C 02 2D 2C 01", "21 04 00 25 01 00 2D 02 00 2D 2C 01"]
)
def test_a_path_may_lack_the_octets_that_messages_have_before_long_numbers(path):
    text = b'[Connection Manager]\nConnection1 = 0x84010002,0x44640405,,2,,,2,,,,,,"C","",'
    (found,) = parse_sheet(DEVICE + text + f'"{path}";'.encode()).connections
    assert found.points == (1, 2, 300)


def test_members_keep_their_bits_and_their_sign():
    recipe = SHEET.assemblies[101].members[4]
    data = bytearray(b"\xff" * 9)
    recipe.put(data, b"\2")
    assert data[8] == 0b11110101
    assert recipe.take(bytes(data)) == b"\2"


def test_connections_are_what_their_words_say():
    owner, inputs, listener, log, counter, _ = SHEET.connections
    assert [one.kind for one in SHEET.connections[:3]] == [
        ConnectionKind.EXCLUSIVE_OWNER, ConnectionKind.INPUT_ONLY, ConnectionKind.LISTEN_ONLY,
    ]  # fmt: skip
    assert (owner.points, owner.triggers, owner.output_header, owner.input_header) == (
        (100, 101, 102),
        {0, 1},
        True,
        False,
    )
    assert (owner.outputs.size.default, owner.inputs.size.default, owner.configuration.size.default) == (9, 12, 3)
    assert owner.outputs.rpi == Limits(10_000, 2_000, 1_000_000)
    assert (inputs.outputs.size.default, inputs.output_header) == (0, False)
    assert (listener.multicast, listener.point_to_point) == (True, False)
    assert (log.points, log.inputs.size, log.input_sizes, log.input_header) == (
        (195, 103), Limits(16, 4, 64), {False, True}, True,
    )  # fmt: skip
    assert counter.points == (100, 101, 104)
    assert [bool(one.unsupported) for one in SHEET.connections] == [False] * 5 + [True]
    assert "real-time format 1" in SHEET.connections[5].unsupported


@pytest.mark.parametrize(
    ("field", "limits"),
    [
        (b"5000", Limits(5000, 5000, 5000)),
        (b"Param1", Limits(30000, 20000, 0xFFFFFFFF)),
        (b"Param2", Limits(30000, 0, 0xFFFFFFFF)),
    ],
)
def test_a_packet_interval_has_the_bounds_that_its_parameter_has(field, limits):
    text = b"[Params]Param1=0,,,0,0xC8,4,,,,20000,,30000;Param2=0,,,0,0xC8,4,,,,,,30000;[Connection Manager]"
    text += b'Connection1 = 0x84010002,0x44640405,%s,4,,,4,,,,,,"C","","20 04 2C 02 2C 03";' % field
    (found,) = parse_sheet(DEVICE + text).connections
    assert found.intervals == (limits,)


def test_a_connection_without_a_trigger_is_cyclic():
    text = b'[Connection Manager]Connection1 = 0x84000002,0x44640405,,4,,,4,,,,,,"C","","20 04 2C 02 2C 03";'
    assert parse_sheet(DEVICE + text).connections[0].triggers == {0}


def test_a_connection_is_found_by_number_keyword_or_name():
    for wanted in (4, "Connection4", "log", "LOG"):
        assert SHEET.connection(wanted).name == "Log"
    assert SHEET.connection().name == "Exclusive owner"
    with pytest.raises(ConfigError, match=r"no connection 'Logs'.*Connection4 \(Log\)"):
        SHEET.connection("Logs")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (b"[File]\n", "no section Device"),
        (b"[Device]\nVendCode = x;", "line 2: VendCode: its number 'x' is not a number"),
        (b"[Device]\nVendCode = 65536;", "line 2: VendCode: its number is 65536, not 0 to 65535"),
        (DEVICE + b"[Params]\nParam1 = 0,,,0,0xC6,1,,,,,,300;", "line 3: Param1: its value 300 is outside of uint8"),
        (DEVICE + b"[Params]\nParam1 = 0,,,0,0xCA,4,,,,,,nan;", "'nan' is not a number of float32"),
        (DEVICE + b"[Params]\nParam1 = 0,,,0,0xC6,501,,,,,,;", "its data size is 501"),
        (DEVICE + b'[Params]\nParam1 = 0,,"2G",0,0xC6,1,,,,,,;', "line 3: Param1: its path '2G' is not octets alone"),
        (DEVICE + b"[Params]\nEnum1 = 0, x;", "line 3: Enum1: field 2, 'x', is neither a number nor a text"),
    ],
)
def test_a_file_that_contradicts_itself_is_refused_with_line_and_reason(text, words):
    with pytest.raises(DecodeError) as told:
        parse_sheet(text)
    assert words in str(told.value)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (b"Assem1 = ,,,,,,8,Param7;", "line 3: Assem1: there is no Param7"),
        (b"Assem1 = ,,,,,,,Assem1;", "line 3: Assem1: it holds itself"),
        (b"Assem1 = ,,,,,,8,Assem2;\nAssem2 = ,,,,,,8,Assem1;", "it holds itself"),
        (b"Assem1 = ,,1401,,,;", "1401 octets of data do not fit into a frame"),
        (b"Assem1 = ,,Param9,,,;", "the size 'Param9' is not a number"),
        (b'Assem1 = ,"FF FF",,,,;', "its path 'FF FF' cannot be read"),
        (b"Assem1 = ,,,,,," + b"1,," * 5000 + b";", "more than 4096 members"),
    ],
)
def test_an_assembly_that_cannot_be_followed_leaves_the_others_and_takes_its_connections_along(text, words):
    text += b'Assem7 = "In","20 04 24 70 30 03",4,,,;[Connection Manager]'
    text += b'Connection1 = 0x84010002,0x44640405,,4,Assem1,,4,,,,,,"C","","20 04 24 01 2C 02 2C 70";'
    text += b'Connection2 = 0x84010002,0x44640405,,4,Assem7,,4,,,,,,"D","","20 04 24 01 2C 02 2C 70";'
    sheet = parse_sheet(DEVICE + b"[Assembly]\n" + text)
    assert 7 in sheet.assemblies
    assert words in sheet.remarks[0]
    assert [one.name for one in sheet.connections] == ["D"]
    with pytest.raises(ConfigError, match=re.escape(words)):
        sheet.connection("Connection1")


@pytest.mark.parametrize("repeated", ["Assem{} = ,,,0,,,,Assem1;", "[Connection Manager] Connection{} = 2,0,,,Assem1;"])
def test_a_file_whose_assemblies_multiply_is_refused_before_it_fills_the_memory(repeated):
    first = f"[Assembly]\nAssem1 = ,,,0,,,{','.join(['2,'] * 4000)};\n"
    begin, _, entry = repeated.rpartition("] ")
    text = first + begin + "]" * bool(begin) + "\n" + "\n".join(entry.format(number) for number in range(2, 300))
    with pytest.raises(DecodeError, match="have more than 524288 members"):
        parse_sheet(DEVICE + text.encode())


@pytest.mark.parametrize(
    "text",
    ['[Params] Param1 = 0,,"{}";', "[Params] Param1 = 0,,,0,{};", '[Params] Param1 = 0 "{}";', '"{}"'],
)
def test_a_message_about_a_wrong_entry_is_one_line_however_long_the_entry_is(text):
    with pytest.raises(DecodeError) as refused:
        parse_sheet(DEVICE + text.format("Pa" * 100_000).encode())
    assert len(str(refused.value)) < 200


def test_a_parameter_with_a_number_that_no_instance_has_is_refused():
    with pytest.raises(DecodeError, match="line 3: Param70000: its number is above 65535"):
        parse_sheet(DEVICE + b"[Params]\nParam70000 = 0,,,0,0xC7,2,X;")


def test_a_path_that_no_message_has_room_for_is_refused():
    text = '[Params]\nParam1 = 0,,,0,0xD0,500,"X";\nParam2 = 0,,"Param1 Param1";'
    with pytest.raises(DecodeError, match="line 4: Param2: its path 'Param1 Param1' is longer than 255 octets"):
        parse_sheet(DEVICE + text.encode())


def test_a_connection_that_cannot_be_followed_leaves_the_others():
    text = OCTETS.replace(b"Param9, , Assem102,     $", b"Param9, , Assem99,     $")
    sheet = parse_sheet(text)
    assert len(sheet.connections) == 5
    with pytest.raises(ConfigError, match=r"line \d+: Connection1: there is no Assem99"):
        sheet.connection(1)
    assert sheet.connection().name == "Exclusive owner with counter"


@given(st.data())
def test_any_change_of_the_example_is_read_or_refused(data):
    text = bytearray(OCTETS)
    for _ in range(data.draw(st.integers(1, 4))):
        place = data.draw(st.integers(0, len(text) - 1))
        text[place : place + data.draw(st.integers(0, 3))] = data.draw(
            st.sampled_from([b"", b",", b";", b"9", b'"', b"Param10", b"x"])
        )
    try:
        sheet = parse_sheet(bytes(text))
    except DecodeError:
        return
    for one in sheet.connections:
        assert 0 <= one.inputs.size.least <= one.inputs.size.most <= 1400
        for member in one.inputs.members:
            if member.parameter is not None:
                member.put(bytearray(one.inputs.size.most), member.parameter.encode(member.parameter.default))
