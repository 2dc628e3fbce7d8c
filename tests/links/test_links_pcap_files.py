"""The file, or the ring of files, of a capture."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from scapy.utils import RawPcapNgReader

from pnfarm.errors import EnvironmentError_
from pnfarm.links.capture.files import CaptureFiles
from pnfarm.links.capture.pcap import interface_description, interface_statistics, packet_block, section_header

HEAD = section_header("pnfarm farm line-1") + interface_description("axis-01", "interface pf0", b"\x02\0\0\0\0\x01")
START = 1_700_000_000_000_000_000


def frame(number: int) -> bytes:
    return number.to_bytes(4, "big") + bytes(1000)


def numbers(path: Path) -> list[int]:
    with RawPcapNgReader(str(path)) as reader:
        return [int.from_bytes(data[:4], "big") for data, _ in reader]


def write(files: CaptureFiles, count: int) -> None:
    for number in range(count):
        files.write(packet_block(0, frame(number), START + number, "in"))


def test_one_file_has_the_name_that_was_given(tmp_path):
    files = CaptureFiles(tmp_path / "out.pcapng", HEAD)
    write(files, 20)
    files.close()
    files.close()
    assert [path.name for path in tmp_path.iterdir()] == ["out.pcapng"]
    assert numbers(tmp_path / "out.pcapng") == list(range(20))


def test_a_file_that_is_being_written_holds_whole_packets(tmp_path):
    files = CaptureFiles(tmp_path / "out.pcapng", HEAD)
    for count in range(1, 5):
        files.write(packet_block(0, frame(count), START, "out"))
        assert numbers(files.current) == list(range(1, count + 1))
    files.close()


def test_a_ring_loses_no_frame_and_keeps_its_size(tmp_path):
    size = 200_000
    files = CaptureFiles(tmp_path / "out.pcapng", HEAD, size=size)
    files.tail = lambda: interface_statistics(0, START, written=7, lost=3)
    write(files, 1000)
    files.close()
    paths = sorted(tmp_path.iterdir())
    assert len(paths) > 3
    assert all(re.fullmatch(r"out_0000\d_\d{14}\.pcapng", path.name) for path in paths)
    assert all(path.stat().st_size <= size for path in paths)
    assert [number for path in paths for number in numbers(path)] == list(range(1000))


def test_a_ring_keeps_the_newest_files(tmp_path):
    (tmp_path / "out_00001_20200101000000.pcapng").write_bytes(b"of an earlier run")
    files = CaptureFiles(tmp_path / "out.pcapng", HEAD, size=200_000, files=2)
    write(files, 1000)
    files.close()
    earlier, *paths = sorted(tmp_path.iterdir())
    assert earlier.read_bytes() == b"of an earlier run"
    assert len(paths) == 2
    assert numbers(paths[-1])[-1] == 999
    assert numbers(paths[0])[-1] + 1 == numbers(paths[1])[0]


def test_what_is_added_to_the_head_stands_in_every_file(tmp_path):
    files = CaptureFiles(tmp_path / "out.pcapng", section_header(), size=200_000)
    files.extend_head(interface_description("axis-07"))
    write(files, 400)
    files.close()
    for path in tmp_path.iterdir():
        with RawPcapNgReader(str(path)) as reader:
            assert {meta.ifname for _, meta in reader} == {b"axis-07"}


@pytest.mark.parametrize("where", ["nowhere/out.pcapng", "."])
def test_what_cannot_be_written_is_refused_at_once(tmp_path, where):
    with pytest.raises(EnvironmentError_, match="cannot be written"):
        CaptureFiles(tmp_path / where, HEAD)


def test_a_full_disk_is_told():
    with pytest.raises(EnvironmentError_, match="/dev/full cannot be written: No space left"):
        CaptureFiles(Path("/dev/full"), HEAD)


def test_a_disk_that_fills_up_leaves_a_whole_capture(tmp_path):
    import resource

    files = CaptureFiles(tmp_path / "out.pcapng", HEAD)
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (10_000, limits[1]))
    try:
        with pytest.raises(EnvironmentError_, match="cannot be written: File too large"):
            write(files, 100)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    files.abandon()
    assert numbers(tmp_path / "out.pcapng") == list(range(9))
