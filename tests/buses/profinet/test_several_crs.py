"""Devices with several CRs in each direction of a connection, with the built-in controller in virtual time."""

from __future__ import annotations

import pytest
from device_cell import Cell
from wide_device import wide_file, wide_group

from pnfarm.errors import ConfigError


class WideCell(Cell):
    usual = "wide"

    def __init__(self, folder, slots, more="", controller="", inputs=1, outputs=1):
        super().__init__(wide_group(wide_file(folder, inputs, outputs), slots, more), controller)

    @property
    def rows(self):
        """Rows of the device's open providers and consumers."""
        return self.device().channel_rows

    def octets(self, seed):
        """The next octets of each direction, from the controller and from the device."""
        outputs, inputs = self.plc.plain["wide"][0], self.device().kind.inputs
        for place, data in ((outputs, seed), (inputs, seed + 7)):
            place.write({0: bytes((number * 31 + data) % 251 for number in range(place.octets))})

    def arrived(self):
        return self.device().kind.outputs.read() == self.plc.plain["wide"][0].read() and (
            self.plc.plain["wide"][1].read() == self.device().kind.inputs.read()
        )

    def channels(self):
        """(direction, frame id, octets, ms) of each CR as the API shows it."""
        (connection,) = self.device().details()["connections"]
        return [
            (one["direction"], int(one["id"], 16), one["octets"], one["cycle_seconds"] * 1e3)
            for one in connection["channels"]
        ]


@pytest.mark.parametrize(
    ("slots", "octets", "frames"),
    [
        ({1: "1436_1436"}, 1436, [1440]),
        ({1: "720_720", 2: "720_720"}, 1440, [725, 721]),
        ({1: "700_700", 2: "700_700", 3: "700_700", 4: "700_700"}, 2800, [1408, 1402]),
    ],
)
@pytest.mark.parametrize("startup", ["legacy", "advanced"])
def test_a_device_whose_data_need_several_frames_gets_as_many_and_each_octet_arrives(
    tmp_path, slots, octets, frames, startup
):
    cell = WideCell(tmp_path, slots, controller=f", startup: {startup}")
    cell.connect()
    assert (cell.plc.plain["wide"][0].octets, cell.device().kind.inputs.octets) == (octets, octets)
    assert [length for way, _, length, _ in cell.channels() if way == "sent"] == frames
    for seed in range(5):
        cell.octets(seed)
        cell.world.run(0.5)
        assert cell.arrived()
    (row,) = cell.plc.snapshot()
    assert (row["state"], row["losses"]) == ("DATA", 0)
    assert cell.device().losses() == {}
