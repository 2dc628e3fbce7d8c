"""Devices by GSD files on a PROFIBUS line with a master from PyPI, pyprofibus, over a pty: it reads the same files.

The constructs are those of its own examples: a compact slave of two identifiers, a modular one with a fixed
module, parameters of the station and of modules; beside them the example island with DP-V1.
"""

from __future__ import annotations

import asyncio
import json
import os
from contextlib import asynccontextmanager
from pathlib import Path

import pytest
from line_peer import peer

from pnfarm.farm.farm import Farm
from pnfarm.farm.file.reading import parse_farm
from pnfarm.protocols.profibus.wire.dp import DpState
from pnfarm.station.event_log import EventLog

pytest.importorskip("pyprofibus", reason="needs the package pyprofibus")
pytestmark = pytest.mark.asyncio

ISLAND = Path(__file__).parents[2] / "configs" / "gsd" / "EXMP1D01.gsd"
HEAD = """
#Profibus_DP
GSD_Revision = 1
Vendor_Name = "Example Maker"
Protocol_Ident = 0
Station_Type = 0
Fail_Safe = 1
DPV1_Slave = 1
1.5M_supp = 1
MaxTsdr_1.5M = 150
Min_Slave_Intervall = 10
Max_Diag_Data_Len = 32
PrmText = 1
Text(0) = "disabled"
Text(1) = "enabled"
EndPrmText
ExtUserPrmData = 1 "Feature"
Bit(2) 0 0-1
Prm_Text_Ref = 1
EndExtUserPrmData
User_Prm_Data_Len = 4
User_Prm_Data = 0x00,0x00,0x00,0x42
Max_User_Prm_Data_Len = 16
Ext_User_Prm_Data_Const(0) = 0x00,0x00,0x00,0x42
Ext_User_Prm_Data_Ref(3) = 1
Unit_Diag_Bit(3) = "Door is open"
"""
COMPACT = f"""{HEAD}
Ident_Number = 0x1D03
Model_Name = "Compact"
Modular_Station = 0
Module = "Inputs and outputs" 0x10,0x21
EndModule
"""
MODULAR = f"""{HEAD}
Ident_Number = 0x1D04
Model_Name = "Modular"
Modular_Station = 1
Modul_Offset = 1
Max_Module = 8
FixPresetModules = 1
Max_Input_Len = 16
Max_Output_Len = 16
Max_Data_Len = 32
Module = "Head" 0x00
Preset = 1
EndModule
Module = "Inputs" 0x12
Ext_Module_Prm_Data_Len = 2
Ext_User_Prm_Data_Const(0) = 0x12,0x34
EndModule
Module = "Both" 0xC0,0x00,0x41
EndModule
"""
FARM = """
farm: pyprofibus{number}
link: {{kind: serial, pty: '{path}', baud: 1500000}}
api: off
devices:
  - {{name: compact, gsd: {folder}/compact.gsd, address: 5}}
  - {{name: modular, gsd: {folder}/modular.gsd, address: 6, slots: {{2: Inputs, 3: {modular}}}}}
  - {{name: island, gsd: {island}, address: 7, slots: {{1: 16DI, 2: 8DO}}}}
"""


@asynccontextmanager
async def farm(folder: Path, modular: str = "Both"):
    (folder / "compact.gsd").write_text(COMPACT)
    (folder / "modular.gsd").write_text(MODULAR)
    text = FARM.format(number=os.getpid(), path=folder / "line", folder=folder, island=ISLAND, modular=modular)
    async with Farm(parse_farm(text), log=EventLog(quiet=True)) as running:
        yield running


def slaves(folder: Path, **changes: dict) -> str:
    """What the master is told of each slave: octets to it and from it."""
    each = {
        "compact": {"address": 5, "gsd": f"{folder}/compact.gsd", "modules": [], "octets": [2, 1], "data": "81 02"},
        "modular": {
            "address": 6, "gsd": f"{folder}/modular.gsd", "modules": ["Inputs", "Both"], "octets": [1, 7], "data": "40",
        },
        "island": {"address": 7, "gsd": str(ISLAND), "modules": ["16DI", "8DO"], "octets": [1, 2], "data": "05"},
    }  # fmt: skip
    return json.dumps([one | changes.get(name, {}) for name, one in each.items()])


async def test_pyprofibus_exchanges_data_with_compact_and_modular_slaves_by_their_files(tmp_path):
    async with farm(tmp_path) as running:
        station = running.core.station
        station("compact").signals.set({"slot1_in_0_7": True})
        station("modular").signals.set({"slot2_in_2_0": True})
        station("island").signals.set({"slot1_in_0_3": True})
        seen = await peer("peer_pyprofibus_devices.py", tmp_path / "line", 20, slaves(tmp_path))
        for name, address, inputs in (
            ("compact", 5, "80"),
            ("modular", 6, "00 00 01 00 00 00 00"),
            ("island", 7, "08 00"),
        ):
            told, device = seen[str(address)], station(name).device
            assert told["connected"]
            assert told["inputs"] == inputs
            assert (device.slave.state, device.slave.master) == (DpState.DATA_EXCH, 2)
        compact, modular, island = (station(name).signals for name in ("compact", "modular", "island"))
        assert [compact.get(name) for name in ("slot1_out_0_0", "slot1_out_0_7", "slot1_out_1_1")] == [True] * 3
        assert (modular.get("slot3_out_0_6"), modular.good("slot3_out_0_6")) == (True, True)
        assert (island.get("slot2_out_0_0"), island.get("slot2_out_0_2")) == (True, True)
        assert station("modular").device.details()["parameters"] == "00 00 00 42 12 34"


async def test_a_diagnosis_that_is_raised_is_read_by_pyprofibus_and_data_go_on(tmp_path):
    async with farm(tmp_path) as running:
        waiting = {name: {"diagnoses": 1} for name in ("modular", "island")}
        asked = asyncio.create_task(
            peer("peer_pyprofibus_devices.py", tmp_path / "line", 20, slaves(tmp_path, **waiting))
        )
        async with asyncio.timeout(15):
            while not all(one.device.connected for one in running.core.stations):  # noqa: ASYNC110  # a device has no event for it
                await asyncio.sleep(0.02)
        running.inject({"kind": "diagnosis-request", "on": "modular", "params": {"code": "Door is open"}})
        where = {"code": "line break", "slot": 1, "channel": 2}
        running.inject({"kind": "diagnosis-request", "on": "island", "params": where})
        seen = await asked
        modular, island = (seen[address]["diagnoses"][-1] for address in ("6", "7"))
        # ready, extended diagnosis; watchdog on; master 2; ident number; identifier of bit 3 of the station's octets
        assert modular == "08 0c 00 02 1d 04 02 08"
        assert island.startswith("08 0c 00 02 1d 01")
        # channel 2 of the identifier of slot 1, an input of a byte, line break
        assert "80 42 26" in island
        assert all(told["connected"] for told in seen.values())
        assert seen["5"]["diagnoses"][-1] == "00 0c 00 02 1d 03"


async def test_a_wrong_configuration_and_wrong_parameters_are_refused_and_the_other_slave_runs(tmp_path):
    async with farm(tmp_path) as running:
        # 2 is no filter that the file allows
        right, wrong = (f"Ext_Module_Prm_Data_Len = 1\nExt_User_Prm_Data_Const(0) = 0x0{one}" for one in (0, 2))
        (tmp_path / "wrong.gsd").write_text(ISLAND.read_text().replace(right, wrong))
        changes = {"modular": {"modules": ["Inputs"]}, "island": {"gsd": f"{tmp_path}/wrong.gsd"}}
        seen = await peer("peer_pyprofibus_devices.py", tmp_path / "line", 4, slaves(tmp_path, **changes))
        assert seen["5"]["connected"]
        for address, flag in (("6", 0x04), ("7", 0x40)):
            told = seen[address]
            assert (told["connected"], told["answers"]) == (False, 0)
            assert any(int(one[:2], 16) & flag for one in told["diagnoses"])
        assert [running.core.station(name).device.connected for name in ("modular", "island")] == [False, False]
