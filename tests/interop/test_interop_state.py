"""A farm's state in real time: a save disturbs no exchange, a restore is followed by a new connection."""

import pytest
from alone import run_alone

SCRIPT = """
import anyio, sys, pnfarm
from pnfarm.farm.farm import Farm

async def main():
    farm = Farm.from_file(sys.argv[1], api="off", state=sys.argv[1] + ".state")
    async with farm, pnfarm.Plc.from_file(sys.argv[1]) as plc:
        assert await plc.wait_running(20)
        axes = farm.core.axes
        for number in range(20):
            await farm.states.save("mid")
            await anyio.sleep(0.05)
        print("expired", sum(axis.device.watchdog_expirations for axis in axes))
        saved = float(axes[0].handle.axis.motor.position)
        await anyio.sleep(2)
        moved = float(axes[0].handle.axis.motor.position)
        notes = await farm.states.restore("mid")
        back = float(axes[0].handle.axis.motor.position)
        print("back", moved - saved > 1, abs(back - saved) < 0.5, len(notes))
        with anyio.fail_after(20):
            while not all(int(axis.handle.axis.drive.state) == 4 for axis in axes):
                await anyio.sleep(0.01)
        print("running", [int(axis.handle.axis.faults.counter) for axis in axes])

anyio.run(main)
"""
FILE = """
farm: restored
link: {kind: veth}
drives:
  - {name: "axis-{n:02}", count: 4, model: akd-profinet, ip: 10.77.0.11/24}
controller:
  ip: 10.77.0.1/24
  cycle: 16ms
  watchdog_factor: 6
  program: {kind: constant, speed_rpm: 60, acknowledge_after: 200ms}
"""


@pytest.mark.interop
def test_a_save_expires_no_watchdog_and_a_restored_drive_comes_back_to_operation(tmp_path):
    file = tmp_path / "restored.pnfarm.yml"
    file.write_text(FILE)
    lines = run_alone(SCRIPT, file)
    wanted = ["expired 0", "back True True 8", "running [0, 0, 0, 0]"]
    assert [line for line in lines if line.split()[0] in {"expired", "back", "running"}] == wanted
