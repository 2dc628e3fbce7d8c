"""pnfarm as a library, on real interfaces in a network namespace of the test's own."""

import pytest
from alone import run_alone

import pnfarm

SCRIPT = """
import anyio, pnfarm, sys

async def main():
    async with pnfarm.Farm.from_file(sys.argv[1], api="off") as farm, pnfarm.Plc.from_file(sys.argv[1]) as plc:
        assert await plc.wait_running(20)
        drive = farm.drive("axis-01")
        with anyio.fail_after(20):
            # held: else a busy machine may miss the moment until the program acknowledges it
            async with drive.fault("f702", hold=True):
                while not drive.snapshot()["fault"]:
                    # what a user writes who has only readings; within the 20 s above
                    await anyio.sleep(0.005)
                print(drive.snapshot()["fault"]["number"])
            while drive.snapshot()["state"] != "S4":
                await anyio.sleep(0.005)
            print(drive.snapshot()["state"])

anyio.run(main)
"""
FILE = """
farm: library
link: {kind: veth}
drives:
  - {name: "axis-{n:02}", count: 2, model: akd-profinet, ip: 10.77.0.11/24}
controller:
  ip: 10.77.0.1/24
  program: {kind: constant, speed_rpm: 60, acknowledge_after: 200ms}
"""


@pytest.mark.interop
def test_python_code_runs_a_farm_and_a_controller_and_breaks_a_drive(tmp_path):
    file = tmp_path / "library.pnfarm.yml"
    file.write_text(FILE)
    lines = run_alone(SCRIPT, file)
    assert [line for line in lines if line in {"702", "S4"}] == ["702", "S4"]


def test_a_wrong_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no attribute 'Form'"):
        pnfarm.Form  # noqa: B018 - the access is the test
