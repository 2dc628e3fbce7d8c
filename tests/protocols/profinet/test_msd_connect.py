"""The Moog MSD at a controller: its modules, its submodules, and a real controller's start-up."""

from __future__ import annotations

from dataclasses import replace

import pytest
from cm_support import Bench, ExpectedApi, Plan, connect_request

from pnfarm.buses.profinet.binding import describe_device
from pnfarm.drives.catalogue import model
from pnfarm.drives.description.identity import with_identity
from pnfarm.protocols.profinet.cm.device.events import ArConnected
from pnfarm.protocols.profinet.wire.any_block import parse_blocks
from pnfarm.protocols.profinet.wire.cm.expected import (
    DataDescription,
    ExpectedSubmodule,
    ExpectedSubmoduleBlockReq,
    ModuleDiffBlock,
)
from pnfarm.protocols.profinet.wire.cm.iocr import FrameSlot, IocrApi

MSD = model("moog-msd")
MAC = bytes.fromhex("020000000077")
MODULES = [module.ident for telegram in MSD.profidrive.telegrams.values() for module in telegram.modules]


def device(drive=MSD, **options):
    return describe_device(drive, MAC, **{"strict": True, **options})


def test_the_head_is_that_of_table_7_1() -> None:
    head = device().dap
    assert head.module_ident == 2
    assert [(s.subslot, s.submodule_ident, s.api) for s in head.submodules] == [
        (1, 1, 0),
        (32768, 2, 0),
        (32769, 3, 0),
        (32770, 3, 0),
    ]
    assert device().vendor_id == 0x017C


def test_there_are_rt_irt_and_profile_modules() -> None:
    known = {module.module_ident for module in device().modules}
    assert known == set(MODULES)
    assert sum(ident < 0x100 for ident in known) == 4 + 21
    assert sum(0x101 <= ident <= 0x179 for ident in known) == 4 + 21
    assert sum(0x1001 <= ident <= 0x1079 for ident in known) == 14


@pytest.mark.parametrize("ident", MODULES, ids=hex)
def test_slot_1_takes_every_module(ident: int) -> None:
    telegram = MSD.profidrive.telegram_by_module(ident)
    assert telegram is not None
    data = telegram.module.submodules[1]
    inputs, outputs = data.input_bytes, data.output_bytes
    expected = ExpectedApi(
        0x3A00, 1, ident,
        (
            ExpectedSubmodule(1, 0xFFFF, 0, (DataDescription(1, 0),)),
            ExpectedSubmodule(2, telegram.number, 3, (DataDescription(1, inputs), DataDescription(2, outputs))),
        ),
    )  # fmt: skip
    plan = Plan(drive=expected)
    length = max(40, max(inputs, outputs) + 8)
    head = tuple(FrameSlot(0, subslot, place) for place, subslot in enumerate((1, 0x8000, 0x8001, 0x8002)))
    to_controller = (
        IocrApi(0, head),
        IocrApi(0x3A00, (FrameSlot(1, 1, 4), FrameSlot(1, 2, 5)), (FrameSlot(1, 2, 6 + inputs),)),
    )
    to_drive = (
        IocrApi(0, (), head),
        IocrApi(0x3A00, (FrameSlot(1, 2, 6),), (FrameSlot(1, 1, 4), FrameSlot(1, 2, 5))),
    )
    bench = Bench(device())
    status, answer = bench.connect(
        replace(
            plan,
            inputs=replace(plan.inputs, data_length=length, apis=to_controller),
            outputs=replace(plan.outputs, data_length=length, apis=to_drive),
        )
    )
    assert status.ok, bench.events()
    assert not [block for block in parse_blocks(answer) if isinstance(block, ModuleDiffBlock)]
    (event,) = (e for e in bench.events() if isinstance(e, ArConnected))
    assert event.unusable == frozenset()
    module = bench.plugged.module(1)
    assert module is not None
    assert module.module_ident == ident


def test_a_captured_start_up_of_such_a_drive_fits_under_its_identity() -> None:
    """The captured device has this head and these submodules; its module, 0x100, carries telegram 104's six words."""
    payload = connect_request("drive_connect_api3a00")
    blocks = parse_blocks(payload)
    drive = with_identity(MSD, {"telegrams": {104: 0x100}})
    bench = Bench(device(drive, strict=False))
    status, answer = bench.call(0, payload, room=712)
    assert status.ok, bench.events()
    assert not [block for block in parse_blocks(answer) if isinstance(block, ModuleDiffBlock)]
    (event,) = (e for e in bench.events() if isinstance(e, ArConnected))
    assert event.unusable == frozenset()
    wanted = [api for block in blocks if isinstance(block, ExpectedSubmoduleBlockReq) for api in block.apis]
    for api in wanted:
        module = bench.plugged.module(api.slot)
        assert module is not None
        assert module.module_ident == api.module_ident
        assert [(s.subslot, s.submodule_ident) for s in module.submodules] == [
            (s.subslot, s.submodule_ident) for s in api.submodules
        ]


def test_the_same_start_up_gets_a_wrong_module_without_that_identity() -> None:
    bench = Bench(device(strict=False))
    status, answer = bench.call(0, connect_request("drive_connect_api3a00"), room=712)
    assert status.ok
    (diff,) = (block for block in parse_blocks(answer) if isinstance(block, ModuleDiffBlock))
    assert [(m.slot, m.module_ident) for api in diff.apis for m in api.modules] == [(1, 0x1001)]


@pytest.mark.parametrize(("factor", "ratio", "accepted"), [(32, 1, True), (16, 1, False), (16, 2, True)])
def test_the_fastest_cycle_is_1_ms(factor: int, ratio: int, accepted: bool) -> None:
    payload = Plan()
    plan = replace(
        payload,
        inputs=replace(payload.inputs, send_clock_factor=factor, reduction_ratio=ratio),
        outputs=replace(payload.outputs, send_clock_factor=factor, reduction_ratio=ratio),
    )
    drive = with_identity(MSD, {"telegrams": {104: 0x100}})
    assert Bench(device(drive)).connect(plan)[0].ok is accepted
