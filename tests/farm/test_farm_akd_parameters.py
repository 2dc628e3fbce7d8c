"""The AKD of manual edition M over frames, records and DCP: what parameters show of hardware, address and signals."""

from __future__ import annotations

import pytest
from akd_position import (
    ACKNOWLEDGED,
    BYTE,
    COUNTS,
    DWORD,
    HOME,
    HOMED,
    MDI,
    REACHED,
    READY,
    START,
    WORD,
    position_line,
    write,
)
from dcp_tool import Tool, address
from hand_line import HandLine
from record_line import access, changing, value_of

from pnfarm.drives.parameters.memory import VolatileMemory
from pnfarm.drives.profiles.profidrive.base_mode import parse_response

#: PNUs.
DISSOURCES, HWENABLE, VBUS_VALUE, IP_MODE, HOME_MODE, HOME_DIST, NVSAVE = 2120, 2527, 2403, 2606, 2203, 2198, 2469


def value(line, pnu: int) -> int:
    (found,) = value_of(line, pnu)
    return found


def faults_of(line):
    faults = line.farm.injections

    def add(kind: str, **given):
        return faults.inject({"kind": kind, "on": "all", **given}, line.world.now)

    return faults, add


# 5.8.1


@pytest.mark.parametrize(("missing", "reason"), [("enable", 0x04), ("supply", 0x08)])
def test_5_8_1_what_not_ready_takes_away_is_shown_by_its_parameters(missing, reason):
    line = HandLine()
    faults, add = faults_of(line)
    line.enable_axis(0x047F)
    assert (value(line, DISSOURCES), value(line, HWENABLE), value(line, 106)) == (0, 1, 0x40)
    fault = add("not-ready", params={"missing": missing})
    line.run(0.1)
    assert line.zsw1 & 0x0047 == 0x0040, "S1"
    assert value(line, DISSOURCES) == 0x01 | reason
    assert value(line, HWENABLE) == (0 if missing == "enable" else 1)
    assert value(line, 106) == (0x50 if missing == "enable" else 0x40)
    line.run(5.0)
    assert value(line, VBUS_VALUE) == (560_000 if missing == "enable" else 0)
    faults.clear(fault.id, line.world.now)
    line.run(0.1)
    assert (value(line, DISSOURCES), value(line, HWENABLE), value(line, 106)) == (0x01, 1, 0x40)
    assert value(line, VBUS_VALUE) == 560_000
    line.enable_axis(0x047F)


def test_5_8_1_a_stop_input_stops_the_axis_along_cs_dec_and_shows_in_bit_5():
    line = HandLine(params="{DIN3.MODE: 13, CS.DEC: 5000000}")
    faults, add = faults_of(line)
    line.enable_axis(0x047F)
    line.send(0x047F, NSOLL_A=1638, frames=30)
    fault = add("digital-input", params={"input": 2})
    line.run(0.06)
    assert line.axis.motor.velocity == pytest.approx(300.0, abs=40.0)
    assert (value(line, 106), value(line, DISSOURCES)) == (0x60, 0x20)
    line.run(0.2)
    assert line.zsw1 & 0x0047 == 0x0040
    faults.clear(fault.id, line.world.now)
    line.enable_axis(0x047F)


# 5.6: FAULTx.ACTION


def test_5_6_a_fault_that_its_action_ignores_is_never_seen_and_the_injection_says_so():
    line = HandLine(params="{FAULT139.ACTION: 1}")
    _, add = faults_of(line)
    line.enable_axis(0x047F)
    ignored = add("drive-fault", params={"fault": 139})
    line.run(0.5)
    assert line.zsw1 & 0x000F == 0x0007
    assert (ignored.state, ignored.evidence().confirmed) == ("ended", False)
    write(line, 2797, BYTE, 0)
    raised = add("drive-fault", params={"fault": 139})
    line.run(0.5)
    assert line.zsw1 & 0x0008
    assert raised.evidence().confirmed


# 3.4.1


def test_3_4_1_an_address_by_dcp_sets_ip_mode_to_1_for_good():
    memory = VolatileMemory()
    line = HandLine(memory=memory)
    station = line.farm.axes[0]
    assert value(line, IP_MODE) == 1, "the farm file gave an address"
    write(line, IP_MODE, WORD, 0)
    line.plc.release(line.world.now)
    line.run(0.5)
    assert not station.device.ars
    assert Tool(line).set(address("10.77.0.99", permanent=False)) == [0]
    assert station.store.read(IP_MODE) == [1]
    station.store.set("IP.MODE", 0)
    station.station.power_cycle(line.world.now)
    assert station.store.read(IP_MODE) == [1], "it is kept without DRV.NVSAVE"
    station.store.set("IP.MODE", 2)
    station.store.set("DRV.NVSAVE", 1)
    line.farm.settle(station.station, line.world.now)
    station.station.power_cycle(line.world.now)
    assert station.store.read(IP_MODE) == [2], "until it is set to something else"


# 5.8, 5.11.8


@pytest.mark.parametrize("how", ["released", "lost", "stop"])
def test_5_8_home_mode_and_home_dist_stay_as_telegram_353_brought_them(how):
    line = position_line(353, homed=False)
    faults, _ = faults_of(line)
    write(line, HOME_MODE, WORD, 4)
    line.send(READY, HOME_MODE=7, HOME_DIST=-COUNTS // 2)
    assert (value(line, HOME_MODE), value(line, HOME_DIST)) == (7, 2**32 - COUNTS // 2)
    if how == "stop":
        line.plc.columns.ppm[0].data_status &= ~0x10 & 0xFF
        line.run(0.1)
    elif how == "lost":
        faults.inject({"kind": "ar-abort", "on": "all"}, line.world.now)
        line.run(0.1)
        assert not line.farm.axes[0].device.ars
    else:
        line.plc.release(line.world.now)
        line.run(0.5)
        assert not line.farm.axes[0].device.ars
    store = line.farm.axes[0].store
    assert (store.get("HOME.MODE"), store.get("HOME.DIST")) == (7, -COUNTS // 2)
    if how != "stop":
        store.set("HOME.MODE", 1)
        assert store.get("HOME.MODE") == 1, "nothing brings it now"


def test_5_8_drv_nvsave_keeps_what_a_signal_made_of_home_mode():
    memory = VolatileMemory()
    line = position_line(353, homed=False, memory=memory)
    line.send(READY, HOME_MODE=7)
    write(line, NVSAVE, BYTE, 1)
    again = HandLine(telegram=7, memory=memory)
    assert value(again, HOME_MODE) == 7


def test_5_8_a_home_mode_that_the_parameter_does_not_take_changes_it_not():
    line = position_line(353, homed=False)
    line.send(READY, HOME_MODE=99)
    line.plc.release(line.world.now)
    line.run(0.5)
    assert line.farm.axes[0].store.get("HOME.MODE") == 0


# 5.11.7


def test_5_11_7_word_8_of_telegram_352_is_the_acceleration_and_pnu_36_counts_where_it_is_0():
    line = position_line(352)
    assert line.send(START, MDI_TARPOS=COUNTS, **MDI, frames=10) & ACKNOWLEDGED, "no acyclic write is needed"
    assert line.axis.profile.acceleration == 39 * 763
    line.until(REACHED)
    line.send(READY, MDI_TARPOS=2 * COUNTS, MDI_ACC=0)
    assert not line.send(START, frames=10) & ACKNOWLEDGED
    line.send(READY)
    write(line, 36, WORD, 20)
    assert line.send(START, frames=10) & ACKNOWLEDGED
    assert line.axis.profile.acceleration == 20 * 763
    assert value(line, 36) == 20
    line.send(READY, MDI_ACC=30)
    assert value(line, 36) == 30, "the telegram's word goes before"


# 6.3


def test_6_3_pn_stw1_is_refused_while_the_controller_sends_it():
    line = HandLine()
    answer = access(line, changing(1, WORD, 0x0476))
    assert answer is not None
    assert parse_response(answer).negative


# 6.2 and 5.12.2


def test_6_2_a_motion_task_and_a_target_by_mdi_have_the_same_numbers():
    line = position_line(9)
    line.send(START, MDI_TARPOS=3 * COUNTS, **MDI, frames=6)
    line.send(READY)
    line.until(REACHED)
    line.run(0.5)
    assert value(line, 2294) == pytest.approx(3 * COUNTS, abs=20), "PL.FB"
    assert line.actual("XIST_A") == pytest.approx(3 * COUNTS, abs=20)
    write(line, 2205, DWORD, COUNTS)
    assert line.send(HOME) & HOMED
    line.send(READY)
    assert line.place == pytest.approx(1.0, abs=1e-3), "HOME.P"
