"""Asynchronous code with types: `pnfarm.Farm` in virtual time; `mypy --strict` accepts this file."""

import asyncio
from pathlib import Path

import pnfarm

FARM = Path(__file__).with_name("line.pnfarm.yml")


async def recovery(farm: pnfarm.Farm, name: str) -> float:
    """Seconds from the acknowledgement of a fault until the axis runs again."""
    axis = farm.drive(name)
    async with axis.fault("f702", count=1) as fault:
        await axis.wait_for("fault == 702", within=0.1)
    assert fault.evidence.activations == 1
    cleared = await axis.wait_for("fault == 0", within=5)
    return await axis.wait_for("state == S4", within=5) - cleared


def test_a_fault_now_and_then_is_soon_over() -> None:
    async def observed() -> list[float]:
        async with pnfarm.Farm.from_file(FARM, virtual=True) as farm:
            await farm.wait_running()
            found = []
            for _ in range(3):
                await farm.run("2min")
                found.append(await recovery(farm, "axis-01"))
            return found

    assert max(asyncio.run(observed())) < 1
