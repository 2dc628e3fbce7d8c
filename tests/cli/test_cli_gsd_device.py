"""Commands on a farm with a device by its GSD file, against its API in virtual time."""

import httpx
from api_client import Farm
from api_world import Served
from slave_cell import ONE, SlaveCell


def test_a_device_on_a_serial_line_is_written_and_inspected(pnfarm, monkeypatch):
    cell = SlaveCell(ONE)
    cell.connect()
    monkeypatch.setattr(httpx, "Client", Farm(Served(cell)).client)
    done = pnfarm("io", "island.part_present=on", "island.count=258")
    assert (done.code, done.out.splitlines()) == (0, ["island.part_present = true", "island.count = 258"])
    cell.sent(b"\x01\0\0")
    assert cell.inputs() == (bytes.fromhex("0800000001020000"), True)
    assert pnfarm("io", "island.clamp").out == "island.clamp = true\n"
    lines = [" ".join(line.split()) for line in pnfarm("inspect", "island").out.splitlines()]
    assert {"ident number 7425", "address station 5", "parameters 80 00 00 00 00 64 03 01 00 00 00 01"} <= set(lines)
    assert any("16DI" in line for line in lines)
