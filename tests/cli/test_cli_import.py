"""``pnfarm import``: the farm file that a capture of a plant becomes."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest
import yaml

from pnfarm.controller.line import VirtualLine
from pnfarm.farm.farm import model_of
from pnfarm.farm.file.reading import expand, parse_farm
from pnfarm.testing import Line

CAPTURES = Path(__file__).resolve().parents[3] / "shared" / "captures"
PLANT = """
farm: plant
link: {kind: memory}
drives:
  - {name: infeed, model: akd-profinet, ip: 10.77.0.11/24, gateway: 10.77.0.254}
  - {name: gripper, model: hiwin-e1, ip: 10.77.0.12/24, limits: lax}
  - {name: press, model: moog-msd, ip: 10.77.0.13/24, limits: lax, identity: {IDENTITY}}
  - {name: spare, model: hiwin-e1, ip: 10.77.0.14/24, limits: lax}
controller:
  name: plc
  ip: 10.77.0.1/24
  cycle: 16ms
"""
#: As a maker's own file could have it.
IDENTITY = (
    "{device: 0x456, dap: 0x77, dap_submodules: {1: 0x78, 0x8000: 0x79}, access_point: 0xFFFE, "
    "telegrams: {101: {module: 0x9065, submodule: 0x8065}}}"
)


@pytest.fixture(scope="module")
def capture(tmp_path_factory):
    """The start-up of a plant in virtual time, and the farm that made it."""
    file = tmp_path_factory.mktemp("plant") / "plant.pcapng"
    config = parse_farm(PLANT.replace("{IDENTITY}", "{}"))

    async def record():
        line = await VirtualLine.create(config, pcap=file, epoch_ns=0)
        assert line.world.run(5.0, until=lambda: line.plc.all_running)
        line.world.run(0.2)
        await line.close()

    asyncio.run(record())
    return file, config


def imported(pnfarm, file, *options):
    found = pnfarm("import", file, *options)
    assert (found.code, found.err) == (0, "")
    return found.out


def test_a_capture_becomes_a_farm_file_with_the_drives_as_they_were(pnfarm, capture):
    file, config = capture
    text = imported(pnfarm, file)
    made = {drive.name: drive for drive in expand(parse_farm(text))}
    for drive in expand(config):
        own = made[drive.name]
        assert (own.model, own.ip, own.mac, own.gateway) == (drive.model, drive.ip, drive.mac, drive.gateway)
        assert model_of(own).profidrive.identity == model_of(drive).profidrive.identity
    assert made["gripper"].strict is False
    assert made["infeed"].strict
    assert "# its cycle of 16 ms is not the manual's 4 ms and less: limits are lax" in text
    assert "# telegram 1 in slot 1" in text
    assert "connected by plc: cycle 16 ms, watchdog 3 cycles" in text.replace("\n  #  ", "")


def test_the_file_is_written_and_the_next_step_is_told(pnfarm, capture, tmp_path):
    file, _ = capture
    out = tmp_path / "line.pnfarm.yml"
    found = pnfarm("import", file, "-o", out, "--name", "line-7", "--parent", "enp3s0")
    assert (found.code, "next: pnfarm validate" in found.out) == (0, True)
    values = yaml.safe_load(out.read_text())
    assert (values["farm"], values["link"]) == ("line-7", {"kind": "macvlan", "parent": "enp3s0"})
    assert pnfarm("validate", out).code == 0
    again = pnfarm("import", file, "-o", out)
    assert (again.code, "--force" in again.err) == (2, True)
    assert pnfarm("import", file, "-o", out, "--force").code == 0


def test_a_capture_without_devices_is_refused(pnfarm, tmp_path):
    file = tmp_path / "nothing.pcap"
    file.write_bytes(bytes.fromhex("d4c3b2a1020004000000000000000000ffff000001000000"))
    found = pnfarm("import", file)
    assert (found.code, "shows no device" in found.err) == (2, True)
    assert pnfarm("import", tmp_path / "none.pcap").code == 2


@pytest.mark.parametrize(
    ("name", "words"),
    [("dacookie_connectrequest.pcap", ("io-devicexb15b32", "ET200SP", "cycle 2 ms", "15 start-up records")),
     ("drive_connect_api3a00.pcap", ("vendor 0x0080", "cycle 4 ms", "0x00000068 12/12")),
     ("pnio-rs_s7-1515_golden.pcap", ("rt-labs-dev", "172.16.2.10", "cycle 32 ms"))],
)  # fmt: skip
def test_devices_of_real_captures_are_listed_with_what_was_seen(pnfarm, name, words):
    if not (CAPTURES / name).exists():
        pytest.skip("the captures of real controllers are not here")
    text = " ".join(imported(pnfarm, CAPTURES / name).replace("#", " ").split())
    for word in words:
        assert word in text


def test_a_drive_under_other_idents_keeps_them_and_connects(pnfarm, tmp_path):
    # the vendor stays the same, by which a drive of an unknown device number is told
    text = PLANT.replace("{IDENTITY}", IDENTITY).replace("cycle: 16ms", "cycle: 16ms\n  telegram: 101")
    config = parse_farm("\n".join(line for line in text.splitlines() if "infeed" not in line and "hiwin" not in line))
    file = tmp_path / "plant.pcapng"

    async def record():
        line = await VirtualLine.create(config, pcap=file, epoch_ns=0)
        assert line.world.run(5.0, until=lambda: line.plc.all_running)
        await line.close()

    asyncio.run(record())
    text = imported(pnfarm, file)
    (made,) = [drive for drive in expand(parse_farm(text)) if drive.name == "press"]
    assert made.model == "moog-msd"
    own = model_of(made)
    assert (own.profidrive.identity.device_id, own.dap.ident) == (0x456, 0x77)
    assert own.profidrive.telegrams[101].module.ident == 0x9065
    assert [one.ident for one in own.profidrive.telegrams[101].module.submodules] == [0xFFFE, 0x8065]
    here = text.replace("{kind: macvlan, parent: eth1}", "{kind: memory}").replace("api: 127.0.0.1:8702\n", "")
    with Line.from_text(here + "controller: {name: plc, ip: 10.77.0.1/24, cycle: 16ms}\n") as line:
        line.wait_connected(5)
