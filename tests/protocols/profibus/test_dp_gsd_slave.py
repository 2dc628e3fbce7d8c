"""What GSD files say of slaves, and slaves as they are plugged: identifiers, octets of Set_Prm, lengths."""

import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pnfarm.errors import ConfigError, DecodeError
from pnfarm.protocols.profibus.gsd.reader import parse_gsd_file
from pnfarm.protocols.profibus.gsd.station import plug_slave

CONFIGS = Path(__file__).parents[3] / "configs" / "gsd"
ISLAND = (CONFIGS / "EXMP1D01.gsd").read_bytes()
VALVE = (CONFIGS / "EXMP1D02.gsd").read_bytes()
HEAD = b"#Profibus_DP\nIdent_Number = 7\n"


def island(modules, parameters=None, data=ISLAND):
    return plug_slave(parse_gsd_file(data), modules, parameters)


def test_a_file_says_who_the_slave_is_and_what_it_can():
    gsd = parse_gsd_file(ISLAND)
    assert (gsd.vendor, gsd.model, gsd.revision, gsd.ident) == ("Example Maker", "Island DP", "2026-11-27", 0x1D01)
    assert (gsd.hardware, gsd.software, gsd.order_number, gsd.family) == ("V1.2", "V3.4.5", "EX-ISL-DP", 3)
    assert dict(gsd.rates) == {9_600: 60, 93_750: 60, 500_000: 100, 1_500_000: 150, 12_000_000: 800}
    assert (gsd.freeze, gsd.sync, gsd.fail_safe, gsd.address_changes, gsd.modular) == (True, True, True, False, True)
    assert (gsd.most_modules, gsd.most_inputs, gsd.most_outputs, gsd.most_data) == (8, 64, 32, 96)
    assert (gsd.v1, gsd.class_one, gsd.class_two, gsd.connections, gsd.interval_ns) == (True, 64, 64, 2, 600_000)
    assert gsd.unit_diagnoses[9] == "Bus of the island is disturbed"
    assert gsd.channel_errors == {17: "Valve is worn"}
    assert gsd.warnings == ()


def test_a_file_that_counts_more_modules_than_a_chk_cfg_has_room_for_has_all_of_these_slots():
    data = HEAD + b'Modular_Station=1\nMax_Module=255\nModule="a" 0x10\n1\nEndModule\n'
    assert parse_gsd_file(data).warnings == ()
    assert len(island({244: "a"}, data=data).identifiers) == 244
    with pytest.raises(ConfigError, match="slot 245 is given, the station has slots 1 to 244"):
        island({245: "a"}, data=data)


def test_a_compact_slave_has_its_module_and_the_octets_of_older_files():
    slave = plug_slave(parse_gsd_file(VALVE), {})
    assert (slave.identifiers, slave.user) == (b"\x11\x20", b"\x01\x02")
    assert (slave.inputs, slave.outputs) == (2, 1)
    assert not slave.gsd.v1


def test_identifiers_and_parameters_are_those_of_the_modules_in_the_order_of_their_slots():
    slave = island({4: "counter", 1: "16DI", 2: 2})
    assert slave.identifiers == bytes.fromhex("11 20 00 c1 81 85 01")
    assert slave.user == bytes.fromhex("00 00 00 01 00 64  03 00 00000001")
    assert [(one.slot, one.inputs, one.outputs) for one in slave.modules] == [(1, 2, 0), (2, 0, 1), (4, 6, 2)]


@pytest.mark.parametrize(
    ("slot", "parameters", "octets"),
    [
        (0, {"Diagnosis": "off", "start-up delay": 258}, "00 00 00 00 01 02"),
        (1, {"Input filter": 10}, "0a"),
        (2, {"Substitute": "HOLD"}, "01"),
        (3, {"0/Lower limit": -2}, "ff fe"),
        (4, {"Serial word": "0xDEADBEEF"}, "de ad be ef"),
    ],
)
def test_parameters_are_set_by_their_names_with_numbers_or_texts(slot, parameters, octets):
    slave = island({1: 1, 2: 2, 3: 3, 4: 4}, {slot: parameters})
    found = {0: slave.station_user} | {one.slot: one.user for one in slave.modules}
    assert found[slot] == bytes.fromhex(octets)


@pytest.mark.parametrize(
    ("modules", "parameters", "reason"),
    [
        ({9: 1}, {}, "slot 9 is given, the station has slots 1 to 8"),
        ({1: "16DX"}, {}, "no module '16DX'; it has '16DI', '8DO', '4AI', 'Counter', 'Gap', did you mean 16DI"),
        ({1: 1}, {2: {"Substitute": 1}}, "slot 2 has parameters and no module"),
        ({2: 2}, {2: {"Substitut": 1}}, "slot 2: there is no parameter 'Substitut', .* did you mean Substitute"),
        ({2: 2}, {2: {"Substitute": "never"}}, "'never' is given, the file allows zero, hold, substitute"),
        ({1: 1}, {1: {"Input filter": 2}}, "the file allows 0, 1, 3, 10"),
        ({1: 1}, {0: {"Start-up delay": 10_001}}, "the file allows 0 to 10000"),
        (dict.fromkeys(range(1, 9), "4AI"), {}, None),
    ],
)
def test_what_the_file_does_not_allow_is_refused_with_what_it_does(modules, parameters, reason):
    if reason is None:
        assert island(modules, parameters).inputs == 64
        with pytest.raises(ConfigError, match="64 octets of inputs, the station has room for 63"):
            island(modules, parameters, ISLAND.replace(b"Max_Input_Len   = 64", b"Max_Input_Len = 63"))
        return
    with pytest.raises(ConfigError, match=reason):
        island(modules, parameters)


def test_a_slot_definition_fixes_which_modules_go_where_and_what_is_there_at_first():
    data = ISLAND + b'SlotDefinition\nSlot(1) = "Head" 1 1-2\nSlot(2) = "any" 0 2,3\nEndSlotDefinition\n'
    assert island({}, data=data).identifiers == b"\x11"
    assert island({1: "8DO", 2: "4AI"}, data=data).identifiers == b"\x20\x53"
    with pytest.raises(ConfigError, match="slot 2 takes no module '16DI'; it takes '8DO', '4AI'"):
        island({2: "16DI"}, data=data)


def test_preset_modules_are_there_unless_their_slot_is_named():
    data = (
        HEAD
        + b'Modular_Station=1\nMax_Module=3\nModule="a" 0x10\n1\nPreset=1\nEndModule\nModule="b" 0x20\n2\nEndModule\n'
    )
    assert island({}, data=data).identifiers == b"\x10"
    assert island({2: "b"}, data=data).identifiers == b"\x10\x20"
    assert island({1: None, 3: "b"}, data=data).identifiers == b"\0\0\x20"


def test_modules_with_one_name_are_chosen_by_number():
    data = HEAD + b'Modular_Station=1\nMax_Module=3\nModule="a" 0x10\n1\nEndModule\nModule="A" 0x20\n2\nEndModule\n'
    assert island({1: 2}, data=data).identifiers == b"\x20"
    with pytest.raises(ConfigError, match="2 modules 'a', choose one by its number: 1, 2"):
        island({1: "a"}, data=data)


def test_chk_cfg_may_name_empty_slots_behind_the_last_module_and_nothing_else():
    slave = island({1: "16DI", 3: "8DO"})
    wanted = b"\x11\0\x20"
    assert all(slave.takes(wanted + bytes(more)) for more in range(6))
    assert not any(map(slave.takes, (b"", b"\x11\x20", wanted[:-1], wanted + b"\x10", b"\0" + wanted, b"\x11\0\x21")))


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda user: user, None),
        (lambda user: user + bytes(20), None),
        (lambda user: user[:-1], "6 octets of parameters instead of 7"),
        (lambda user: user + bytes(60), "67 octets of parameters, the file allows 64"),
        (lambda user: user[:-1] + b"\x02", "slot 1, Input filter is 2, the file allows 0, 1, 3, 10"),
        (lambda user: user[:4] + b"\xff\xff" + user[6:], "Start-up delay is 65535, the file allows 0 to 10000"),
    ],
)
def test_octets_of_set_prm_are_judged_by_the_file(change, reason):
    slave = island({1: "16DI"})
    assert slave.complaint(change(slave.user)) == reason


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (b"", "no line is #Profibus_DP"),
        (b"#Profibus_DP\n", "no Ident_Number"),
        (b"#Profibus_DP\n\nIdent_Number=0\n", "line 3: no Ident_Number from 1 to 0xFFFF"),
        (HEAD + b"Station_Type=1\n", "line 3: Station_Type is not that of a slave"),
        (HEAD + b"Protocol_Ident = 16\n", "line 3: Protocol_Ident is not that of PROFIBUS DP"),
        (HEAD + b'Module = "x" 1\nEndModule\n' * 8193, "line 16387: more than 8192 blocks Module"),
        (HEAD + b'Unit_Diag_Bit(1) = "x"\n' * 65_537, "line 65539: more than 65536 texts"),
    ],
)  # fmt: skip
def test_what_is_no_file_of_a_slave_is_refused_with_the_line(data, reason):
    with pytest.raises(DecodeError, match=re.escape(reason)):
        parse_gsd_file(data)


def test_odd_lines_are_left_out_with_their_numbers():
    gsd = parse_gsd_file(
        HEAD + b'Max_Module = many\nModular_Station = 1\nExt_User_Prm_Data_Ref(0) = 9\nModule = "x"\nEndModule\n'
        b"Ext_User_Prm_Data_Const(999) = 1\n"
    )  # fmt: skip
    assert [(one.line, one.text.partition(" ")[0]) for one in gsd.warnings] == [
        (3, "Max_Module"), (5, "Ext_User_Prm_Data_Ref"), (8, "Ext_User_Prm_Data_Const(999)"), (6, "the"),
    ]  # fmt: skip
    assert (gsd.most_modules, gsd.modules) == (1, ())


@pytest.mark.parametrize("code", ["ascii", "utf-8-sig", "cp1252", "cp850", "utf-16"])
def test_names_are_read_in_any_code_page_of_the_tools(code):
    name = "Ventil" if code == "ascii" else "Größe Ü"
    data = HEAD.decode().replace("\n", "\r\n") + f'Model_Name = "{name}"\r\n'
    assert parse_gsd_file(data.encode(code)).model == name


PIECES = st.sampled_from(
    [*ISLAND.splitlines(keepends=True), b"Module = ", b'"', b"\\\n", b"EndModule\n", b"Bit(9) 1\n", b"BitArea(7-0) 1\n",
     b"Ext_User_Prm_Data_Ref(9999) = 1\n", b"Ext_User_Prm_Data_Const(300) = 1\n", b"Unsigned32 -1 0\n", b"\xff\n",
     b"Ext_User_Prm_Data_Ref(236) = 6\n", b"Ext_Module_Prm_Data_Len = 237\n", b"SlotDefinition\n",
     b'Slot(1) = "" 1 9-1\n']
)  # fmt: skip


@given(st.lists(PIECES, max_size=40), st.binary(max_size=60))
def test_any_file_is_read_or_refused(pieces, tail):
    try:
        gsd = parse_gsd_file(HEAD + b"".join(pieces) + tail)
        slave = plug_slave(gsd, {1: gsd.modules[0].name} if gsd.modules else {})
    except (DecodeError, ConfigError):
        return
    assert len(slave.user) <= 237
    assert slave.takes(slave.identifiers)
    assert len(slave.user) == len(slave.station_user) + sum(len(one.user) for one in slave.modules)
