"""From a GSDML file and a choice of modules to a station: what is plugged where, and what the file does not allow."""

import time
from contextlib import nullcontext
from dataclasses import replace

import pytest
from gsdml_examples import ISLAND, SCANNER, example
from gsdml_kit import MINIATURE
from hypothesis import given
from hypothesis import strategies as st

from pnfarm.errors import ConfigError
from pnfarm.protocols.profinet.gsdml.document import DataItem, DataItems, ItemRef
from pnfarm.protocols.profinet.gsdml.reader import parse_gsdml
from pnfarm.protocols.profinet.gsdml.station import PlugError, plug_station
from pnfarm.protocols.profinet.gsdml.values import Numbers

ALL_MODULES = {1: "DI16", 2: "DO8", 3: "AI4", 4: "VALVES", 5: "SERIAL", 6: "FDI4", 7: "CARRIER", 8: "COUNTER2"}


def island(**choice):
    return plug_station(example(ISLAND), **{"access_point": "DAP 2", **choice})


# access points


@pytest.mark.parametrize("wanted", ["DAP 2", "EX-ISL-200", "ex-isl-200", 2, "0x00000002", "Island head, fast",
                                    "inselkopf, SCHNELL"])  # fmt: skip
def test_an_access_point_is_found_by_id_order_number_ident_and_name_in_any_language(wanted):
    assert island(access_point=wanted).dap.id == "DAP 2"


def test_an_access_point_may_be_left_out_where_the_file_has_one():
    station = plug_station(example(SCANNER))
    assert [(m.slot, m.id) for m in station.modules] == [(0, "SCANNER"), (1, "CONTROL"), (2, "RESULT")]
    with pytest.raises(PlugError, match=r"several access points, choose one of DAP 1 \(Island head\), DAP 2"):
        plug_station(example(ISLAND))


def test_the_station_says_who_it_is_and_how_it_connects():
    station = island()
    assert (station.vendor_id, station.device_id, station.vendor_name) == (0xFEED, 0x1517, "Example Works")
    assert (station.name, station.order_number, station.dap.dns_name) == (
        "Island head, fast", "EX-ISL-200", "example-island")  # fmt: skip
    assert (station.hardware_release, station.software_release) == ("2", "V1.4.2")
    assert (station.gsdml.main_family, station.product_family) == ("I/O", "Example Island")
    assert station.relations.startup_modes == ("Advanced",)
    assert (station.number_of_ars, station.min_device_interval) == (1, 8)
    assert list(station.send_clocks) == [8, 16, 32, 64, 128]
    assert (station.dcp_hello, station.dap.shared_device, station.dap.ioxs_required) == (True, False, False)
    other = island(access_point="DAP 1")
    assert (other.dcp_hello, other.dap.shared_device, other.number_of_ars) == (False, True, 2)
    assert other.relations.startup_modes == ("Legacy", "Advanced")
    assert max(other.reduction_ratios) == 512


# modules


@pytest.mark.parametrize("wanted", ["AI4", "EX-AI-4", "ex-ai-4", "4ai", "4AE", 0x30, "0x00000030", "48"])
def test_a_module_is_found_by_id_order_number_ident_and_name_in_any_language(wanted):
    module = island(modules={3: wanted}).module(3)
    assert (module.id, module.ident, module.info.order_number) == ("AI4", 0x30, "EX-AI-4")


def test_every_module_and_submodule_is_in_its_place():
    station = island(modules=ALL_MODULES, submodules={(7, 3): "EX-PL-IO8", (0, 2): "PLUG_STATE"})
    found = [(s.slot, s.subslot, s.ident, s.kind, s.input_octets, s.output_octets) for s in station.submodules]
    assert found == [
        (0, 1, 0x01, "virtual", 0, 0),
        (0, 0x8000, 0x100, "interface", 0, 0),
        (0, 0x8001, 0x200, "port", 0, 0),
        (0, 0x8002, 0x200, "port", 0, 0),
        (0, 2, 0x94, "pluggable", 12, 0),
        (1, 1, 0x11, "virtual", 2, 0),
        (2, 1, 0x21, "virtual", 0, 1),
        (3, 1, 0x31, "virtual", 8, 0),
        (4, 1, 0x41, "virtual", 6, 3),
        (5, 1, 0x51, "virtual", 32, 32),
        (6, 1, 0x61, "virtual", 5, 4),
        (7, 1, 0x71, "virtual", 1, 0),
        (7, 2, 0x91, "pluggable", 2, 0),  # the file uses it there
        (7, 3, 0x93, "pluggable", 8, 8),
        (8, 1, 0x81, "virtual", 5, 5),
        (8, 2, 0x81, "virtual", 5, 5),
        (33, 1, 0x7E, "virtual", 0, 0),  # fixed
    ]
    assert {s.module_ident for s in station.submodules if s.slot == 7} == {0x70}
    assert [s.slot for s in station.submodules if s.profisafe] == [6]
    assert list(station.submodule(0, 0x8000).writeable_im) == [1, 2, 3]
    assert station.submodule(9, 1) is None


def test_a_place_that_a_new_project_fills_may_be_left_empty():
    assert [m.id for m in island(access_point="DAP 3").modules] == ["DAP 3", "DI16", "DO8"]
    assert [m.id for m in island(access_point="DAP 3", modules={1: None}).modules] == ["DAP 3", "DO8"]
    bare = island(modules={7: "CARRIER"}, submodules={(7, 2): None})
    assert [s.subslot for s in bare.module(7).submodules] == [1]


def test_data_items_have_places_types_and_bits():
    station = island(modules=ALL_MODULES, submodules={(0, 2): "PLUG_STATE"})
    first, second = station.submodule(1, 1).inputs
    assert (first.octet, second.octet, second.use_as_bits) == (0, 1, True)
    assert first.bits[3] == (0, 3, "Input 3")
    assert second.bits[3] == (1, 3, "Input 11")
    state, pressure = station.submodule(4, 1).inputs
    # the second octet of a big-endian word has its bits 0 to 7
    assert state.bits == ((1, 0, "Supply low"), (1, 1, "Pressure low"), (0, 0, "Coil open"), (0, 7, "Ready"))
    assert (pressure.octet, pressure.octets, pressure.data_type) == (2, 4, "Float32")
    (coils,) = station.submodule(4, 1).outputs
    assert coils.bits[8] == (1, 0, "Valve 5 coil 14")
    assert len(coils.all_bits) == 24
    word, text = station.submodule(0, 2).inputs
    assert (word.bits, text.octets) == (((3, 0, "Sensor supply"), (0, 7, "Load supply")), 8)


def test_f_parameters_are_a_record_with_the_files_defaults():
    submodule = island(modules={6: "FDI4"}).submodule(6, 1)
    record = submodule.f_parameters
    assert (record.index, record.length, submodule.record(4)) == (4, 10, record)
    # F_SIL 3; F_Par_Version 1; source 1; destination 1; 150 ms; CRC
    assert record.defaults().hex() == "0840" + "0001" + "0001" + "0096" + "d06c"
    assert str(record.complaint(bytes.fromhex("0840000107d00096d06c"))) == (
        "record 4, F_Dest_Add: 2000 is written, allowed is 1..1022"
    )


# what the file does not allow


@pytest.mark.parametrize(
    ("choice", "sentence"),
    [
        ({"access_point": "DAP 9"},
         r"no access point 'DAP 9', it has DAP 1 \(Island head\), .*\), did you mean DAP 3\?"),
        ({"modules": {3: "16DJ"}}, r"slot 3 takes no module '16DJ', it takes DI16 \(16DI\), .*, did you mean 16DI\?"),
        ({"access_point": "DAP 3", "modules": {1: "AI4"}},
         r"slot 1 takes no module 'AI4', it takes DI16 \(16DI\), DO8 \(8DO\); AI4 goes into slots 3\.\.4"),
        ({"access_point": "DAP 3", "modules": {3: "VALVES"}}, r"; it is for access point DAP 1 \(Island head\), DAP 2"),
        ({"modules": {40: "DI16"}}, r"slot 40 takes no module 'DI16', it takes none at all; DI16 goes into slots 1"),
        ({"modules": {33: None}}, "slot 33 cannot be empty, END is fixed there"),
        ({"modules": {0: "DI16"}}, "slot 0 is the access point's, modules are in other slots"),
        ({"modules": {7: "CARRIER"}, "submodules": {(7, 4): "PLUG_IO8"}},
         r"slot 7, subslot 4 takes no submodule 'PLUG_IO8', it takes .*; PLUG_IO8 goes into subslots 2\.\.3"),
        ({"modules": {7: "CARRIER"}, "submodules": {(7, 4): "PLUG_STATE"}}, "; another module takes it"),
        ({"submodules": {(9, 2): "PLUG_IN2"}}, "slot 9 has no module, submodules need one"),
        ({"access_point": "DAP 3", "modules": {3: "AI4", 4: "AI4"}},
         "the modules have 22 octets of inputs with their status, access point DAP 3 takes up to 16"),
        ({"modules": {1: ""}}, "slot 1 takes no module ''"),
    ],
)  # fmt: skip
def test_what_the_file_does_not_allow_is_refused_with_what_it_does(choice, sentence):
    with pytest.raises(PlugError, match=sentence) as caught:
        island(**choice)
    assert isinstance(caught.value, ConfigError)


def test_a_refusal_names_its_place():
    with pytest.raises(PlugError) as caught:
        island(modules={7: "CARRIER"}, submodules={(7, 9): "PLUG_IN2"})
    assert (caught.value.slot, caught.value.subslot) == (7, 9)
    with pytest.raises(PlugError) as caught:
        island(modules={40: "DI16"})
    assert (caught.value.slot, caught.value.subslot) == (40, None)


def test_a_name_that_several_have_asks_for_an_id():
    gsdml = example(ISLAND)
    twins = tuple(replace(m, info=replace(m.info, name="16DI", order_number="")) if m.id == "DO8" else m
                  for m in gsdml.modules)  # fmt: skip
    with pytest.raises(PlugError, match="slot 1 takes several modules called '16DI', choose one of DI16, DO8 by its"):
        plug_station(replace(gsdml, modules=twins), access_point="DAP 1", modules={1: "16DI"})


def test_an_integer_is_an_ident_first_and_else_a_name():
    gsdml = example(ISLAND)
    named = tuple(replace(m, info=replace(m.info, order_number="6001")) if m.id == "DO8" else m for m in gsdml.modules)
    changed = replace(gsdml, modules=named)
    assert plug_station(changed, access_point="DAP 1", modules={1: 6001}).module(1).id == "DO8"
    assert plug_station(changed, access_point="DAP 1", modules={1: 0x10}).module(1).id == "DI16"


# bad files


def test_a_subslot_that_is_taken_twice_is_refused_with_its_line():
    gsdml = example(ISLAND)
    carrier = gsdml.module("CARRIER")
    wrong = replace(carrier, useable=(ItemRef("PLUG_IN2", fixed=Numbers.of([1]), line=7),), physical_subslots=Numbers())
    modules = tuple(wrong if m.id == "CARRIER" else m for m in gsdml.modules)
    with pytest.raises(PlugError, match=r"line \d+: slot 7, subslot 0x0001 is taken twice, one submodule fits there"):
        plug_station(replace(gsdml, modules=modules), access_point="DAP 1", modules={7: "CARRIER"})


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('AllowedInSlots="1..3" UsedInSlots="1"', 'FixedInSlots="1..65535"'),
        ('ID="DS" SubmoduleIdentNumber="0x11"', 'ID="DS" SubmoduleIdentNumber="0x11" FixedInSubslots="1..32767"'),
        ('AllowedInSubslots="2 3"/>', 'AllowedInSubslots="2 3" FixedInSubslots="4..40959"/>'),
        ('Index="1" Length="2"', 'Index="1" Length="65536"'),
    ],
)
def test_a_file_with_a_billion_places_is_refused_or_plugged_in_a_moment(old, new):
    text = MINIATURE.replace(old, new)
    assert text != MINIATURE
    gsdml = parse_gsdml(text.encode())
    begin = time.process_time()
    with pytest.raises(PlugError, match=r"can be planned|more records") if "Index" not in new else nullcontext():
        plug_station(gsdml, modules={2: "AX"})
    assert time.process_time() - begin < 1


def test_submodules_with_more_data_than_a_frame_are_refused_by_the_access_points_limit():
    gsdml = example(ISLAND)
    module = gsdml.module("DI16")
    (virtual,) = module.submodules
    wide = replace(virtual, inputs=DataItems((DataItem("OctetString", 1439),)))
    modules = tuple(replace(m, submodules=(wide,)) if m.id == "DI16" else m for m in gsdml.modules)
    changed = replace(gsdml, modules=modules)
    plug_station(changed, access_point="DAP 2", modules={1: "DI16"})
    with pytest.raises(PlugError, match=r"the modules have 2880 octets of inputs with their status, .* up to 1440"):
        plug_station(changed, access_point="DAP 2", modules={1: "DI16", 2: "DI16"})


@given(
    st.dictionaries(
        st.integers(-1, 40), st.sampled_from([*ALL_MODULES.values(), "END", None, "", "8DA", 0x30, "0x7F"]), max_size=9
    ),
    st.sampled_from(["DAP 1", "DAP 2", "DAP 3"]),
)
def test_any_choice_is_plugged_or_refused(modules, access_point):
    try:
        station = plug_station(example(ISLAND), access_point=access_point, modules=modules)
    except PlugError:
        return
    places = [(s.slot, s.subslot) for s in station.submodules]
    assert len(set(places)) == len(places)
    assert {slot for slot, wanted in modules.items() if wanted is not None} <= {slot for slot, _ in places}
    assert station.input_octets <= station.dap.max_input
    assert station.output_octets <= station.dap.max_output
