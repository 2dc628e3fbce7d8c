"""The cycles that a model's GSDML file names and those that its device takes, with several limits."""

from dataclasses import replace
from itertools import product

import pytest
from cm_support import Bench
from gsdml_models import MAC, MS, connected, described, plan_of

from pnfarm.buses.profinet.binding import describe_device
from pnfarm.drives.catalogue import model
from pnfarm.errors import ConfigError
from pnfarm.protocols.profinet.cm.controller.frames import plan_frames
from pnfarm.protocols.profinet.cm.controller.request import connect_payload
from pnfarm.protocols.profinet.cm.device.check import FRAME_ID_RANGES, RefusedError, check_connect, parse_connect
from pnfarm.protocols.profinet.gsdml.planning import from_gsdml
from pnfarm.protocols.profinet.wire.cm.expected import SubmoduleProperties
from pnfarm.protocols.profinet.wire.cm.iocr import RtClass

# timing


def slowest(drive_model):
    """In 31.25 us; a file cannot say it."""
    return (drive_model.limits.max_cycle_ns or 512 * MS) // 31_250


#: Send clock factors: those there are, and some that there are not.
CLOCKS = (0, 1, 2, 3, 4, 8, 16, 24, 32, 48, 64, 96, 127, 128, 129)


def test_the_device_takes_the_pairs_of_clock_and_ratio_that_its_file_names_and_no_other(limited):
    """Save those that make too slow a cycle: a file names clocks and ratios, not what goes with what."""
    gsdml, device = described(limited)
    (dap,) = gsdml.daps
    (interface,) = dap.interfaces
    plan = plan_of(gsdml)
    request = parse_connect(connect_payload(plan, *plan_frames(plan)), device)
    whole = request.iocrs
    for clock, ratio in product(CLOCKS, range(514)):
        timed = {"send_clock_factor": clock, "reduction_ratio": ratio, "phase": 1, "data_hold_factor": 3}
        request.iocrs = [replace(cr, **timed) for cr in whole]
        codes = None
        if clock not in interface.relations.send_clocks:
            codes = (0xDB, 0x81, 2, 10)
        elif ratio not in interface.relations.ratios or not dap.min_device_interval <= clock * ratio <= slowest(
            limited
        ):
            codes = (0xDB, 0x81, 2, 11)
        try:
            check_connect(request, device)
        except RefusedError as refused:
            status = refused.status
            found = (status.error_code, status.error_decode, status.error_code1, status.error_code2)
            assert found == codes, (clock, ratio)
        else:
            assert codes is None, (clock, ratio)


@pytest.mark.parametrize("pair", [(1, 1), (1, 512), (4, 3), (32, 17), (128, 1), (128, 255)])
def test_with_lax_limits_it_takes_every_clock_and_ratio_of_the_standard(drive_model, pair):
    plan = plan_of(described(drive_model)[0])
    lax = describe_device(drive_model, MAC, strict=False)
    request = parse_connect(connect_payload(plan, *plan_frames(plan)), lax)
    timed = {"send_clock_factor": pair[0], "reduction_ratio": pair[1], "phase": 1, "data_hold_factor": 1}
    request.iocrs = [replace(cr, **timed) for cr in request.iocrs]
    assert check_connect(request, lax)


def test_the_e1_names_the_send_clocks_of_its_manual_and_is_reached_at_each_of_its_cycles():
    gsdml, device = described(model("hiwin-e1"))
    (interface,) = gsdml.daps[0].interfaces
    assert (list(interface.relations.send_clocks), list(interface.relations.ratios)) == (
        [16, 32, 64, 128],
        [1, 2, 4, 8],
    )
    planned = from_gsdml(gsdml)
    assert [planned.clock(*usual) for usual in ((16, 1), (32, 1), (32, 2), (32, 4))] == [
        (16, 1),
        (32, 1),
        (32, 2),
        (32, 4),
    ]
    for clock, ratio in ((64, 2), (32, 4), (16, 8)):
        assert connected(plan_of(gsdml, clock=(clock, ratio)), device).ok
    for clock, ratio in ((8, 2), (2, 16)):
        assert connected(plan_of(gsdml, clock=(clock, ratio)), device).error_code2 == 10


def test_the_device_takes_every_cycle_of_the_file_and_none_below_its_minimum(limited):
    gsdml, device = described(limited)
    (dap,) = gsdml.daps
    (interface,) = dap.interfaces
    assert 32 in interface.relations.send_clocks
    planned = from_gsdml(gsdml)
    taken = set()
    for factor in interface.relations.send_clocks:
        for ratio in interface.relations.ratios:
            if factor * ratio > 128 * 128:
                continue  # no device may take those
            accepted = connected(plan_of(gsdml, clock=(factor, ratio)), device).ok
            fast, slow = factor * ratio < dap.min_device_interval, factor * ratio > slowest(limited)
            assert accepted == (not fast and not slow), (factor, ratio)
            if accepted:
                planned.check_clock(factor, ratio)
                taken.add(factor * ratio * 31_250)
            elif fast:
                with pytest.raises(ConfigError, match="too fast for the device"):
                    planned.check_clock(factor, ratio)
    limits = limited.limits
    assert min(taken) == limits.min_cycle_ns == planned.min_cycle_ns
    assert max(taken) == (limits.max_cycle_ns or 512 * MS)


def test_every_cycle_that_the_device_takes_can_be_had_by_the_file(limited):
    gsdml, device = described(limited)
    (interface,) = gsdml.daps[0].interfaces
    in_file = {f * r for f in interface.relations.send_clocks for r in interface.relations.ratios}
    for exponent in range(3, 15):  # cycles from 250 us, the fastest that this format knows for RT class 1
        factor, ratio = min(1 << exponent, 32), max(1, (1 << exponent) // 32)
        if connected(plan_of(gsdml, clock=(factor, ratio)), device).ok:
            assert factor * ratio in in_file


def test_every_send_clock_that_the_format_knows_and_the_device_takes_is_in_the_file(limited):
    gsdml, device = described(limited)
    fastest = limited.limits.min_cycle_ns // 31_250
    taken = [
        factor
        for factor in (8, 16, 32, 64, 128)
        if connected(plan_of(gsdml, clock=(factor, max(1, fastest // factor))), device).ok
    ]
    assert list(gsdml.daps[0].relations.send_clocks) == taken


def test_rt_class_1_is_taken_with_both_of_its_frame_ids_and_rt_class_3_is_not(drive_model):
    gsdml, device = described(drive_model)
    assert gsdml.daps[0].interfaces[0].rt_classes == ("RT_CLASS_1",)
    plan = plan_of(gsdml)
    assert connected(plan, device).ok
    legacy = replace(plan, rt_class=RtClass.CLASS_1, input_frame_id=FRAME_ID_RANGES[RtClass.CLASS_1][1])
    assert connected(legacy, device).ok
    assert not connected(replace(plan, rt_class=3), device).ok


def test_the_device_has_status_octets_as_the_file_says_and_takes_a_controller_that_discards_them(drive_model):
    gsdml, device = described(drive_model)
    assert gsdml.daps[0].ioxs_required
    plan = plan_of(gsdml)
    assert not any(s.properties for s in plan.submodules)
    without = replace(
        plan, submodules=tuple(replace(s, properties=SubmoduleProperties.DISCARD_IOXS) for s in plan.submodules)
    )
    for wanted in (plan, without):
        status, _ = Bench(device).call(0, connect_payload(wanted, *plan_frames(wanted)))
        assert status.ok
