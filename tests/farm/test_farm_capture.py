"""What a capture of a farm is asked for, and what it does with a farm's interfaces."""

from __future__ import annotations

import contextlib
import socket
import time
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scapy.utils import RawPcapNgReader

from pnfarm.errors import ConfigError, EnvironmentError_
from pnfarm.farm.capture import CaptureSettings, FarmCapture, parse_size
from pnfarm.links.base import Port

NAMES = ["axis-01", "axis-02", "pump-01"]


@pytest.mark.parametrize(
    ("text", "octets"),
    [("100MB", 100_000_000), ("64MiB", 64 * 1024**2), ("2G", 2_000_000_000), ("1.5 GB", 1_500_000_000),
     ("5000k", 5_000_000), ("1000000", 1_000_000)],
)  # fmt: skip
def test_sizes_as_people_write_them(text, octets):
    assert parse_size(text) == octets


@pytest.mark.parametrize("text", ["", "much", "-1MB", "1XB", "MB", "1e9", "1MBs", "9" * 400])
def test_a_wrong_size_is_reported(text):
    with pytest.raises(ConfigError, match="is not a size; give for example 100MB"):
        parse_size(text)


def test_too_small_a_file_is_reported():
    with pytest.raises(ConfigError, match="a file of 10kB is too small for a capture; give at least 1MB"):
        parse_size("10kB")


@given(st.text())
def test_any_text_is_a_size_or_an_error(text):
    with contextlib.suppress(ConfigError):
        assert parse_size(text) >= 1_000_000


@pytest.mark.parametrize(
    ("globs", "places"),
    [((), [0, 1, 2]), (("axis-*",), [0, 1]), (("pump-01", "axis-02"), [1, 2]), (("*-01",), [0, 2])],
)
def test_drives_are_chosen_by_globs(globs, places):
    assert CaptureSettings(Path("x"), drives=globs).chosen(NAMES) == places


def test_a_glob_without_a_drive_is_reported():
    with pytest.raises(ConfigError, match="no drive of the farm is called 'axes-\\*'"):
        CaptureSettings(Path("x"), drives=("axis-*", "axes-*")).chosen(NAMES)


def test_an_unknown_kind_is_reported():
    with pytest.raises(ConfigError, match="unknown kind of frame 'cyclical', allowed are cyclic, dcp"):
        CaptureSettings(Path("x"), only=("cyclical",))


def test_a_ring_without_files_is_reported():
    with pytest.raises(ConfigError, match="a ring of 0 files holds nothing"):
        CaptureSettings(Path("x"), files=0)


@pytest.mark.parametrize(
    ("size", "files", "ring"),
    [(None, None, (None, None)), (5_000_000, None, (5_000_000, 10)), (None, 3, (100_000_000, 3))],
)
def test_size_and_number_of_files_complete_each_other(size, files, ring):
    assert CaptureSettings(Path("x"), size=size, files=files).ring == ring


def test_a_file_that_cannot_be_written_is_reported_before_anything_starts(tmp_path):
    settings = CaptureSettings(tmp_path / "nowhere" / "out.pcapng")
    with pytest.raises(EnvironmentError_, match="cannot be written: No such file"):
        FarmCapture(settings, "line-1", NAMES, note=lambda event: None)


def loopback(settings: CaptureSettings) -> tuple[FarmCapture, list]:
    """A capture of the loopback interface, as if it were the first drive's."""
    told: list = []
    capture = FarmCapture(
        settings, "line-1", ["axis-01"], note=lambda event: told.append((event.text, event.details()))
    )
    try:
        capture.start([Port("lo", socket.if_nametoindex("lo"), bytes(6))])
    except EnvironmentError_ as exc:
        capture.stop()
        pytest.skip(str(exc))
    return capture, told


def ask(count: int) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        for number in range(count):
            sock.sendto(b"\x04" + number.to_bytes(4, "big") + bytes(500), ("127.0.0.1", 0x8894))


def test_a_capture_writes_what_came_before_it_was_stopped(tmp_path):
    capture, told = loopback(CaptureSettings(tmp_path / "out.pcapng", only=("rpc",)))
    ask(100)
    capture.stop()
    capture.stop()
    with RawPcapNgReader(str(tmp_path / "out.pcapng")) as reader:
        payloads = [data[42:47] for data, meta in reader if meta.direction == 2]
    assert payloads == [b"\x04" + number.to_bytes(4, "big") for number in range(100)]
    assert told == [("capture ended", {"file": str(tmp_path / "out.pcapng"), "frames": capture.frames, "lost": 0})]


def test_a_disk_that_fills_up_ends_the_capture_with_a_reason(tmp_path):
    import resource

    path = tmp_path / "out.pcapng"
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, limits[1]))
    try:
        capture, told = loopback(CaptureSettings(path, only=("rpc",)))
        ask(10)
        for _ in range(1000):
            if path.stat().st_size > 10_000:
                break
            time.sleep(0.01)
        ask(200)
        capture.stop()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert isinstance(capture.failed, EnvironmentError_)
    ((event, data),) = told
    assert event == "capture failed"
    assert data["reason"].endswith("cannot be written: File too large")
    with RawPcapNgReader(str(path)) as reader:
        kept = [(meta.ifname, data[42:47]) for data, meta in reader if meta.direction == 2]
    assert kept == [(b"axis-01", b"\x04" + number.to_bytes(4, "big")) for number in range(len(kept))]
    assert len(kept) >= 10
