"""Drives of all makers on three buses in one farm: one controller section, one scenario, the same metrics."""

import asyncio
from pathlib import Path

import pnfarm

CONFIGS = Path(__file__).resolve().parents[2] / "configs"


#: Scenario and the axis that its file names.
NAMED = {"cable-flap": "axis-02", "f702-recovery": "axis-03"}


def test_scenarios_break_drives_on_each_bus_and_all_others_run_on(tmp_path):
    paths = []
    for name, named in NAMED.items():
        text = (CONFIGS / "scenarios" / f"{name}.scenario.yml").read_text("utf-8")
        assert f"axis: {named}" in text
        # on PROFIBUS one of them: virtual time passes slower with polls
        polled = [named.replace("axis", "dp")] * (name == "cable-flap")
        for axis in (named.replace("axis", "eip"), *polled, named):
            paths.append(tmp_path / f"{name}-{axis}.scenario.yml")
            paths[-1].write_text(text.replace(f"axis: {named}", f"axis: {axis}"), "utf-8")

    async def work():
        async with pnfarm.Farm.from_file(CONFIGS / "mixed.pnfarm.yml", virtual=True) as farm:
            await farm.wait_running()
            return [await farm.run_scenario(path) for path in paths], await farm.metrics()

    verdicts, metrics = asyncio.run(work())
    assert [verdict.passed for verdict in verdicts] == [True] * len(paths)
    for axis in ("eip-02", "dp-02", "axis-02"):
        assert metrics.value("pnfarm_watchdog_expirations_total", drive=axis) >= 1
        assert metrics.value("pnfarm_ar_connects_total", drive=axis) >= 2
    buses = {bus: metrics.value("pnfarm_drive_info", bus=bus) for bus in ("profinet", "ethernetip", "profibus")}
    assert buses == {"profinet": 24, "ethernetip": 8, "profibus": 2}
