"""``isochronous: ignore``: a controller that asks for isochronous operation connects, and the drive runs in RT."""

from dataclasses import replace
from ipaddress import IPv4Interface

import pytest
from axes_line import AxesLine
from initiator import Initiator

from pnfarm.farm.file.reading import FarmFileError, parse_farm
from pnfarm.protocols.profinet.wire.cm.connect import ArType
from pnfarm.protocols.profinet.wire.cm.iocr import IocrBlockReq
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

SLOW = "controller: {name: plc, ip: 10.77.0.100/24, reconnect: {after: 1h}}"


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


def irt(blocks):
    """The CRs of a planned phase, as engineering gives them."""
    return [
        replace(block, properties=3, frame_id=0x0100 + block.iocr_type) if isinstance(block, IocrBlockReq) else block
        for block in blocks
    ]


@pytest.mark.parametrize("keys", ["", ", isochronous: ignore"])
@pytest.mark.parametrize(
    ("ar_type", "change", "begins"),
    [(ArType.IOCAR_SINGLE_RT_CLASS_3, None, "ARType 0x0010 is not supported"),
     (ArType.IOCAR_SINGLE, irt, "IOCR 1: RT class 3 is not supported")],
)  # fmt: skip
def test_rt_class_3_is_refused_and_the_log_says_what_to_change_in_the_project(keys, ar_type, change, begins):
    line = AxesLine(FARM.format(keys=keys, mode=MODE, sync=SYNC).partition("controller:")[0] + SLOW)
    tool = Initiator(line, 1, IPv4Interface("10.77.0.99/24"))
    assert tool.connect(line.farm.station("a"), ar_type=ar_type, change=change).status != 0
    (refused,) = [one for one in line.log.entries("a") if "refused" in one.event]
    assert refused.data["detail"] == (
        f"{begins}: the frames of IRT need ports that are synchronised in hardware; "
        "choose RT for this device in the project"
    )
