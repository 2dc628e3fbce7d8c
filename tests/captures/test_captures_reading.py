"""Files of captures as other programs write them."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING

from pnfarm.captures.reading import CapturedFrame, FrameReader
from pnfarm.links.capture.pcap import (
    IF_NAME,
    INTERFACE_DESCRIPTION,
    OPTION_END,
    option,
    packet_block,
    section_header,
)

if TYPE_CHECKING:
    from pathlib import Path

ETHERNET, COOKED = 1, 113
FRAME = bytes(12) + b"\x88\x92" + bytes(46)
_TSRESOL = 9


def section(name: str, ticks: int, *, digits: int = 9, link_type: int = ETHERNET) -> bytes:
    """A section with one interface, whose stamps have so many digits behind the second, and one packet."""
    options = option(IF_NAME, name.encode()) + option(_TSRESOL, bytes([digits])) + option(OPTION_END, b"")
    body = struct.pack("<HHI", link_type, 0, 0) + options
    length = struct.pack("<I", len(body) + 12)
    interface = struct.pack("<I", INTERFACE_DESCRIPTION) + length + body + length
    return section_header() + interface + packet_block(0, FRAME, ticks, "in")


def frames(path: Path, *sections: bytes) -> list[CapturedFrame]:
    path.write_bytes(b"".join(sections))
    return list(FrameReader(path))


def test_each_section_of_a_file_has_interfaces_of_its_own(tmp_path: Path) -> None:
    found = frames(tmp_path / "joined.pcapng", section("eth1", 10**18), section("eth2", 10**15 + 7, digits=6))
    assert [(one.interface, one.time_ns) for one in found] == [("eth1", 10**18), ("eth2", 10**18 + 7000)]


def test_frames_have_the_numbers_that_wireshark_gives_them(tmp_path: Path) -> None:
    sections = section("any", 1, link_type=COOKED), section("eth1", 2), section("eth1", 3)
    found = frames(tmp_path / "mixed.pcapng", *sections)
    assert [one.number for one in found] == [2, 3]
