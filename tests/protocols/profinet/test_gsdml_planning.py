"""From a GSDML file to what a controller expects of another maker's device."""

from __future__ import annotations

from dataclasses import replace

import pytest
from cmctl_pair import device_fit_for, pair_of
from cmctl_peers import make_plan
from gsdml_kit import MINIATURE

from pnfarm.errors import ConfigError
from pnfarm.protocols.profinet.cm.controller.events import ArEstablished
from pnfarm.protocols.profinet.gsdml.document import Gsdml, ItemRef
from pnfarm.protocols.profinet.gsdml.planning import from_gsdml
from pnfarm.protocols.profinet.gsdml.reader import parse_gsdml
from pnfarm.protocols.profinet.gsdml.records import ParameterRecord
from pnfarm.protocols.profinet.gsdml.values import Numbers
from pnfarm.protocols.profinet.wire.cm.expected import SubmoduleProperties


@pytest.fixture(scope="module")
def gsdml() -> Gsdml:
    return parse_gsdml(MINIATURE.encode())


def places(device):
    return {(s.slot, s.subslot): (s.module_ident, s.submodule_ident, s.api, s.input_bytes, s.output_bytes)
            for s in device.submodules}  # fmt: skip


def planned_with(gsdml, send_clocks, ratios):
    """The device as if its file named these, at every cycle from 31.25 us on."""
    (dap,) = gsdml.daps
    relations = replace(dap.relations, send_clocks=Numbers.of(send_clocks), ratios=Numbers.of(ratios))
    interface = replace(dap.interfaces[0], relations=relations)
    return from_gsdml(replace(gsdml, daps=(replace(dap, min_device_interval=1, interfaces=(interface,)),)))


def test_a_new_project_has_what_is_fixed_and_what_the_file_puts_into_it(gsdml):
    device = from_gsdml(gsdml)
    assert (device.vendor_id, device.device_id, device.instance, device.multiple_write) == (0xFEED, 0x0B0B, 2, True)
    assert places(device) == {
        (0, 1): (0x10, 0x11, 0, 0, 0),
        (0, 0x8000): (0x10, 0x8000, 0, 0, 0),
        (0, 0x8001): (0x10, 0x8001, 0, 0, 0),
        (1, 1): (0x20, 0x21, 0, 4, 0),
        (4, 1): (0x40, 0x41, 0, 0, 0),
    }


def test_modules_and_submodules_go_where_they_are_put(gsdml):
    device = from_gsdml(gsdml, modules={1: None, 2: "AX", 3: "DI"}, submodules={(2, 3): "T9"})
    found = places(device)
    assert (1, 1) not in found
    assert found[2, 1] == (0x30, 0xFFFF, 0x3A00, 0, 0)
    assert found[2, 2] == (0x30, 0x101, 0x3A00, 4, 4)  # the file uses it there
    assert found[2, 3] == (0x30, 0x109, 0x3A00, 0, 4)
    assert found[3, 1] == (0x20, 0x21, 0, 4, 0)
    bare = from_gsdml(gsdml, modules={2: "AX"}, submodules={(2, 2): None})
    assert (2, 2) not in places(bare)


@pytest.mark.parametrize("required", [True, False])
def test_submodules_without_data_have_no_status_octets_where_the_file_says_that_none_are_required(gsdml, required):
    (dap,) = gsdml.daps
    device = from_gsdml(replace(gsdml, daps=(replace(dap, ioxs_required=required),)), modules={2: "AX"})
    discarding = {(s.slot, s.subslot) for s in device.submodules if s.discards_ioxs}
    without = {(s.slot, s.subslot) for s in device.submodules if not s.input_bytes and not s.output_bytes}
    assert without
    assert discarding == (set() if required else without)
    assert all(s.properties in {0, SubmoduleProperties.DISCARD_IOXS} for s in device.submodules)


def test_records_come_in_the_order_of_their_transfer_sequence(gsdml):
    first, second = from_gsdml(gsdml).records
    assert (first.slot, first.subslot, first.index, first.data.hex()) == (1, 1, 1, "aa55")
    assert (second.index, second.data.hex()) == (2, "01a2012c3fc00000fd")


def test_records_are_changed_as_a_whole_or_by_the_names_of_their_values(gsdml):
    changes = {(1, 1, 1): b"\x01\x02", (1, 1, 2): {"Filter time": 7}}
    first, second = from_gsdml(gsdml, parameters=changes).records
    assert first.data == b"\x01\x02"
    assert second.data[2:4] == b"\x00\x07"


@pytest.mark.parametrize(
    ("choice", "sentence"),
    [
        ({"dap": "D9"}, "the file has no access point 'D9', it has D1"),
        ({"modules": {1: "AX"}}, "slot 1 takes no module 'AX', it takes DI"),
        ({"modules": {1: "XX"}}, "slot 1 takes no module 'XX', it takes DI"),
        ({"modules": {9: "DI"}}, "slot 9 takes no module 'DI', it takes none at all"),
        ({"modules": {0: "DI"}}, "slot 0 is the access point's"),
        ({"modules": {4: None}}, "slot 4 cannot be empty, END is fixed there"),
        ({"submodules": {(2, 2): "T1"}}, "slot 2 has no module, submodules need one"),
        ({"modules": {2: "AX"}, "submodules": {(2, 3): "T1"}}, "subslot 3 takes no submodule 'T1', it takes T9"),
        ({"modules": {2: "AX"}, "submodules": {(2, 3): "SAFE"}}, r"line \d+: SAFE is fail-safe, this controller"),
        ({"parameters": {(1, 1, 7): b""}}, "slot 1, subslot 0x0001 has no record 7 in the file"),
        ({"parameters": {(1, 1, 1): b"\1"}}, "record 1 of slot 1, subslot 0x0001 is given 1 octets, it has 2"),
        ({"parameters": {(1, 1, 2): {"Filter time": 0}}}, r"record 2, Filter time: '0' is given, allowed is 1\.\.1000"),
    ],
)  # fmt: skip
def test_what_the_file_does_not_allow_is_refused_with_what_it_does(gsdml, choice, sentence):
    with pytest.raises(ConfigError, match=sentence):
        from_gsdml(gsdml, **choice)


def test_an_access_point_has_to_be_chosen_where_there_are_several(gsdml):
    (dap,) = gsdml.daps
    two = replace(gsdml, daps=(dap, replace(dap, id="D2", ident=0x12)))
    with pytest.raises(ConfigError, match="choose one of D1, D2"):
        from_gsdml(two)
    assert from_gsdml(two, dap="D2").submodules[0].module_ident == 0x12


def test_a_module_that_the_file_names_and_does_not_describe_is_reported(gsdml):
    with pytest.raises(ConfigError, match="names module 'END' for slot 4 and does not describe it"):
        from_gsdml(replace(gsdml, modules=gsdml.modules[:2]))


def test_a_file_that_fixes_something_everywhere_is_refused(gsdml):
    (dap,) = gsdml.daps
    everywhere = ItemRef("END", fixed=Numbers(((1, 65535),)))
    with pytest.raises(ConfigError, match="at most 4096 can be planned"):
        from_gsdml(replace(gsdml, daps=(replace(dap, modules=(everywhere,)),)))


def test_a_file_with_more_submodules_or_records_than_a_device_can_have_is_refused(gsdml):
    (dap,) = gsdml.daps
    everywhere = replace(dap.submodules[0], fixed=Numbers(((1, 0x7FFF),)))
    with pytest.raises(ConfigError, match="slot 0 has more submodules than fit, at most 4096"):
        from_gsdml(replace(gsdml, daps=(replace(dap, submodules=(everywhere,)),)))
    endless = replace(dap.submodules[0], records=tuple(ParameterRecord(index, 0x10000) for index in range(100)))
    with pytest.raises(ConfigError, match="slot 0 has more records than can be written, at most 4194304 octets"):
        from_gsdml(replace(gsdml, daps=(replace(dap, submodules=(endless,)),)))


def test_cycles_are_held_against_the_file(gsdml):
    device = from_gsdml(gsdml)
    assert device.min_cycle_ns == 2_000_000
    device.check_clock(32, 2)
    device.check_clock(64, 8)
    with pytest.raises(ConfigError, match="a cycle of 1 ms is too fast for the device; its file names 2 ms"):
        device.check_clock(32, 1)
    with pytest.raises(ConfigError, match="not support send clock factor 16; its file names 32 64"):
        device.check_clock(16, 4)
    with pytest.raises(ConfigError, match=r"not support reduction ratio 16; its file names 1\.\.2 4 8"):
        device.check_clock(32, 16)


def test_a_cycle_is_made_of_what_the_file_names_with_the_send_clock_next_to_1_ms(gsdml):
    device = planned_with(gsdml, send_clocks=[16, 32, 64, 128], ratios=[1])
    assert [device.clock(*pair) for pair in ((32, 1), (32, 2), (32, 4))] == [(32, 1), (64, 1), (128, 1)]
    device = planned_with(gsdml, send_clocks=[16, 32, 64, 128], ratios=[1, 2, 4])
    assert [device.clock(*pair) for pair in ((32, 4), (32, 8), (64, 2))] == [(32, 4), (64, 4), (64, 2)]
    assert device.clock(32, 32) == (32, 32)
    with pytest.raises(ConfigError, match=r"not support reduction ratio 32; its file names 1\.\.2 4"):
        device.check_clock(*device.clock(32, 32))


def test_the_start_up_is_one_that_the_device_knows(gsdml):
    device = from_gsdml(gsdml)
    assert device.startup() == "advanced"
    assert device.startup("advanced") == "advanced"
    with pytest.raises(ConfigError, match="does not support start-up legacy; its file names advanced"):
        device.startup("legacy")
    (dap,) = gsdml.daps
    assert replace(device, dap=replace(dap, interfaces=())).startup() == "legacy"


@pytest.mark.parametrize("modules", [{}, {1: None}, {2: "AX", 3: "DI"}])
def test_a_device_made_after_the_file_takes_the_connection(gsdml, modules):
    device = from_gsdml(gsdml, modules=modules)
    plan = make_plan(
        vendor_id=device.vendor_id,
        device_id=device.device_id,
        instance=device.instance,
        submodules=device.submodules,
        records=device.records,
        multiple_write=device.multiple_write,
        startup=device.startup(),
        reduction_ratio=2,
    )
    both = pair_of(plan, device_fit_for(plan))
    both.start()
    assert any(isinstance(e, ArEstablished) for e in both.events)
    assert both.records.kept == {(r.api, r.slot, r.subslot, r.index): r.data for r in device.records}
