"""What ``pnfarm doctor FILE`` says of the lines of a farm file: measured times, and what to do."""

from __future__ import annotations

import os
import threading

import pytest

from pnfarm.cli.main import main
from pnfarm.farm.doctor import lines
from pnfarm.farm.doctor.lines import examine_lines
from pnfarm.farm.file.reading import parse_farm
from pnfarm.links.serial import probe
from pnfarm.links.serial.probe import ReplyTime


@pytest.fixture
def measured(monkeypatch):
    """A machine that answers within 0.3 ms."""
    monkeypatch.setattr(probe, "floor", lambda: ReplyTime(100_000, 300_000))


def text(link: str) -> str:
    return f"farm: x\nlink: {link}\ndrives:\n  - {{name: one, model: moog-msd-dp, address: 1}}\n"


def findings(link: str):
    return examine_lines(parse_farm(text(link)))


@pytest.fixture
def plug(tmp_path):
    """A port whose far end sends back what it hears."""
    near, far = os.openpty()
    path = tmp_path / "ttyUSB0"
    path.symlink_to(os.ttyname(far))

    def echo():
        while True:
            try:
                os.write(near, os.read(near, 256))
            except OSError:
                return

    thread = threading.Thread(target=echo, daemon=True)
    thread.start()
    yield path
    os.close(far)
    thread.join()
    os.close(near)


def test_the_floor_is_measured_on_a_pty():
    found = probe.floor(50)
    assert 1_000 < found.median_ns <= found.slow_ns < 1_000_000_000


def test_a_pty_in_time_is_fine_and_one_that_is_late_is_told(measured):
    machine, line = findings("{kind: serial, pty: auto, baud: 19200}")
    assert (machine.ok, machine.detail) == (True, "a pty is answered within 0.30 ms (99 of 100; half within 0.10 ms)")
    assert line.ok is True
    assert line.detail.endswith("on this machine; a master waits 3.12 ms at 19200 bit/s (max T_SDR)")
    _, line = findings("{kind: veth, lines: {profibus: {pty: auto, baud: 500000}}}")
    assert line.ok is None
    assert "a master waits 0.2 ms at 500000 bit/s (max T_SDR) unless it is set to wait longer" in line.detail
    assert line.remedy == "a longer slot time in the master, and as `latest_answer` of the line"


def test_a_port_with_a_plug_is_measured_itself(measured, plug):
    _, line = findings(f"{{kind: serial, port: {plug}, baud: 19200}}")
    # on a busy machine it may be late, and is told to be
    assert line.ok is not False
    assert f"on {plug}; a master waits" in line.detail


def test_a_port_that_is_not_there_is_missing(measured):
    _, line = findings("{kind: serial, port: /dev/ttyNone3}")
    assert (line.ok, "does not exist" in line.detail) == (False, True)
    assert line.remedy


def test_a_driver_that_collects_octets_is_told_with_its_remedy(measured, monkeypatch, plug):
    monkeypatch.setattr(lines.probe, "latency_timer_ms", lambda _: 16)
    _, line = findings(f"{{kind: serial, port: {plug}}}")
    assert line.ok is None
    assert "collects octets for 16 ms" in line.detail
    assert line.remedy.startswith("echo 1 | sudo tee /sys/class/tty/")


def test_a_farm_without_lines_has_nothing_to_measure():
    file = "farm: x\nlink: {kind: memory}\ndrives:\n  - {name: one, model: akd-profinet, ip: 10.0.0.2/24}\n"
    assert examine_lines(parse_farm(file)) == []


def test_the_command_takes_a_farm_file(measured, monkeypatch, tmp_path, capsys):
    monkeypatch.setattr("pnfarm.farm.doctor.machine.examine", list)
    file = tmp_path / "x.pnfarm.yml"
    file.write_text(text("{kind: serial, pty: auto, baud: 19200}"), encoding="utf-8")
    assert main(["doctor", str(file)]) == 0
    assert "line of profibus" in capsys.readouterr().out
