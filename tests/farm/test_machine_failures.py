"""What goes wrong with the machine below a farm: its disk, its network card, its descriptors, its processor.

A farm and its controller run as processes on a cable of their own; the drives go on, or come back by themselves.
"""

from __future__ import annotations

import os
import resource
import subprocess
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from farm_programs import SECONDS, Program, stopped, two_programs

FILE = """
farm: machine
link: {{kind: macvlan, parent: stall0}}
api: 127.0.0.1:8702
state: {folder}
drives:
  - {{name: "axis-{{n:02}}", count: 2, model: akd-profinet, ip: 10.77.0.11/16}}
controller:
  {{name: plc, ip: 10.77.255.1/16, interface: stall1, cycle: 16ms, watchdog_factor: 16,
    program: {{kind: sine, acknowledge_after: 100ms}}}}
"""
#: Of both sides: 16 cycles of 16 ms.
WATCHDOG_SECONDS = 0.256
#: What asyncio says where it has no file for a connection.
NO_FILE = "socket.accept() out of system resource"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A file system of its own, of 1 MB."""
    if os.geteuid() != 0:
        pytest.skip("needs root to mount a file system and to make a network namespace")
    folder = tmp_path_factory.mktemp("memory")
    subprocess.run(["mount", "-t", "tmpfs", "-o", "size=1m", "pnfarm-test", str(folder)], check=True)
    yield folder
    subprocess.run(["umount", "--lazy", str(folder)], check=True)


@pytest.fixture(scope="module")
def both(folder, tmp_path_factory):
    """The processes of the farm and of its controller."""
    with two_programs(tmp_path_factory.mktemp("log"), FILE.format(folder=folder)) as programs:
        programs[0].wait("ar established", 2)
        yield programs


@pytest.fixture
def farm(both):
    """The farm, with both drives in operation; they are again when the test has ended."""
    running(both[0])
    yield both[0]
    running(both[0])


def until(holds: Callable[[], bool], farm: Program) -> None:
    """Wait for it, with the farm alive."""
    end = time.monotonic() + SECONDS
    while not holds():
        assert farm.process.poll() is None
        assert time.monotonic() < end, farm.log()
        # another process: it can only be asked again
        time.sleep(0.05)


def running(farm: Program) -> None:
    """Wait until both drives are in operation."""
    until(lambda: {drive["state"] for drive in farm.ask("GET", "drives")[1]["drives"]} == {"S4"}, farm)


def ended(farm: Program) -> list[dict]:
    """The connections that ended, but for those that this machine ended: it stood for nearly the whole watchdog."""
    return [entry for entry in farm.events("ar aborted") if entry["farm_late_seconds"] < WATCHDOG_SECONDS * 0.8]


def fill(folder: Path) -> Callable[[], None]:
    """No octet is free."""
    with (folder / "full").open("wb", buffering=0) as file:
        try:
            while file.write(b"\0" * 4096) == 4096:
                pass
        except OSError:
            pass
    return (folder / "full").unlink


def lock(folder: Path) -> Callable[[], None]:
    """Nothing can be written to the saved states."""
    states = str(folder / "states")
    subprocess.run(["mount", "--bind", states, states], check=True)
    subprocess.run(["mount", "-o", "remount,bind,ro", states], check=True)
    return lambda: subprocess.run(["umount", "--lazy", states], check=True)


@pytest.mark.parametrize("broken", [fill, lock])
def test_a_disk_that_takes_nothing_refuses_saves_in_words_and_stops_no_drive(farm, folder, broken):
    count = len(ended(farm))
    assert farm.ask("PUT", "states/before")[0] == 200
    mend = broken(folder)
    for name in ("later", "before"):
        status, answer = farm.ask("PUT", f"states/{name}")
        assert status == 503
        assert f"cannot write state {name} in {folder}" in answer["detail"]
    running(farm)
    assert len(ended(farm)) == count
    mend()
    assert farm.ask("PUT", "states/later")[0] == 200
    # the one that could not be written anew is as it was
    assert farm.ask("POST", "states/before/restore")[0] == 200


@pytest.mark.parametrize("card", ["stall0", "stall1"], ids=["of the farm", "of the controller"])
def test_drives_are_back_behind_a_network_card_that_was_down(farm, card):
    aborted, established = len(farm.events("ar aborted")), len(farm.events("ar established"))
    farm.shell(f"ip link set {card} down")
    farm.wait("ar aborted", aborted + 2)
    farm.shell(f"ip link set {card} up")
    farm.wait("ar established", established + 2)


def test_a_farm_without_descriptors_says_so_once_a_second_and_its_drives_go_on(farm):
    count, said = len(ended(farm)), len(farm.events(NO_FILE))
    process = farm.process.pid
    used = len(list(Path(f"/proc/{process}/fd").iterdir()))
    before = resource.prlimit(process, resource.RLIMIT_NOFILE)
    resource.prlimit(process, resource.RLIMIT_NOFILE, (used, before[1]))
    try:
        begin = time.monotonic()
        with farm.asking("drives"):
            farm.wait(NO_FILE, said + 2)
        seconds = time.monotonic() - begin
    finally:
        resource.prlimit(process, resource.RLIMIT_NOFILE, before)
    assert len(farm.events(NO_FILE)) - said <= 2 + seconds / 0.5
    running(farm)
    assert len(ended(farm)) == count


def test_a_farm_that_gets_a_third_of_a_processor_keeps_its_connections(farm):
    count = len(ended(farm))
    for _ in range(20):
        stopped(0.06, farm)
        time.sleep(0.03)
    running(farm)
    assert len(ended(farm)) == count


def test_a_farm_that_stood_for_two_seconds_takes_the_blame_and_has_its_drives_back(farm):
    aborted, established = len(farm.events("ar aborted")), len(farm.events("ar established"))
    stopped(2.0, farm)
    entries = farm.wait("ar aborted", aborted + 2)[aborted:]
    assert {entry["cause"] for entry in entries} == {"farm"}
    assert min(entry["farm_late_seconds"] for entry in entries[:2]) > 1.9
    farm.wait("ar established", established + 2)
