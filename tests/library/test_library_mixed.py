"""Drives of all makers on both buses in one farm: one controller section, one scenario, the same metrics."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pnfarm

CONFIGS = Path(__file__).resolve().parents[2] / "configs"


def test_one_scenario_breaks_drives_on_either_bus_and_all_others_run_on(tmp_path):
    text = (CONFIGS / "scenarios" / "cable-flap.scenario.yml").read_text("utf-8")
    assert "axis: axis-02" in text
    paths = []
    for axis in ("eip-02", "axis-02"):
        paths.append(tmp_path / f"{axis}.scenario.yml")
        paths[-1].write_text(text.replace("axis: axis-02", f"axis: {axis}"), "utf-8")

    async def work():
        async with pnfarm.Farm.from_file(CONFIGS / "mixed.pnfarm.yml", virtual=True) as farm:
            await farm.wait_running()
            return [await farm.run_scenario(path) for path in paths], await farm.metrics()

    verdicts, metrics = asyncio.run(work())
    assert [verdict.passed for verdict in verdicts] == [True, True]
    for axis in ("eip-02", "axis-02"):
        assert metrics.value("pnfarm_watchdog_expirations_total", drive=axis) >= 1
        assert metrics.value("pnfarm_ar_connects_total", drive=axis) >= 2
    buses = {bus: metrics.value("pnfarm_drive_info", bus=bus) for bus in ("profinet", "ethernetip")}
    assert buses == {"profinet": 24, "ethernetip": 8}
