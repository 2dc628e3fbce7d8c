"""``isochronous: ignore``: a controller that asks for isochronous operation connects, and the drive runs in RT."""

from __future__ import annotations

import pytest

from pnfarm.farm.file.reading import FarmFileError, parse_farm
from pnfarm.testing import Line

#: IsochronousModeData of the telegram's submodule, and PDSyncData of the interface: blocks with zeros inside.
MODE, SYNC = "02040006010000000000", "02030006010000000000"
FARM = """
farm: x
link: {{kind: memory}}
drives:
  - {{name: a, model: profidrive, ip: 10.77.0.1/24, telegram: 105{keys}}}
controller:
  name: plc
  ip: 10.77.0.100/24
  reconnect: {{after: 300ms}}
  records:
    - {{api: 0x3A00, slot: 1, subslot: 2, index: 0x8030, data: "{mode}"}}
    - {{api: 0, slot: 0, subslot: 0x8000, index: 0x802D, data: "{sync}"}}
"""


def line_of(keys="", mode=MODE, sync=SYNC):
    return Line.from_text(FARM.format(keys=keys, mode=mode, sync=sync))


def indexes(line):
    return [entry.data["index"] for entry in line.events("isochronous operation ignored")]


def test_the_records_are_taken_and_the_drive_says_that_it_ignores_them():
    with line_of(", isochronous: ignore") as line:
        line.wait_connected(5)
        device = line.core.axis("a").device
        assert device.connection().exchanging
        assert indexes(line) == [0x8030, 0x802D]
        assert device.details()["ignored_records"] == ["0x802D", "0x8030"]
        assert "connect failed" not in str(line.controller_events())


def test_without_the_key_they_are_refused_as_records_that_are_not_there():
    with line_of() as line:
        line.run(2)
        device = line.core.axis("a").device
        assert device.connection() is None or not device.connection().exchanging
        assert indexes(line) == []
        assert "ignored_records" not in device.details()
        assert "IODWriteRes: invalid index" in str(line.controller_events()[1])


def test_octets_that_are_no_block_are_refused():
    with line_of(", isochronous: ignore", mode="0204") as line:
        line.run(2)
        assert indexes(line) == []
        assert "IODWriteRes: write length error" in str(line.controller_events()[1])


def test_another_word_is_refused_with_a_sentence():
    with pytest.raises(FarmFileError, match="isochronous"):
        parse_farm(FARM.format(keys=", isochronous: run", mode=MODE, sync=SYNC))
