"""Can this machine answer on the lines of a farm file in time?  Measured, with the remedy."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from pnfarm.errors import EnvironmentError_
from pnfarm.farm.doctor.machine import Finding
from pnfarm.farm.lines import line_bus, line_ways
from pnfarm.links.serial import probe

if TYPE_CHECKING:
    from pnfarm.buses.bus import LineBus
    from pnfarm.config.links import LineWay
    from pnfarm.farm.file.reading import FarmConfig
    from pnfarm.links.serial.probe import ReplyTime

__all__ = ["examine_lines"]

#: A driver that collects octets for longer makes every answer late.
MOST_LATENCY_MS = 1


def examine_lines(config: FarmConfig) -> list[Finding]:
    """A finding for the machine and one for each line of the file; none where it has no lines."""
    ways = line_ways(config)
    if not ways:
        return []
    try:
        measured = probe.floor()
    except EnvironmentError_ as exc:
        return [Finding("serial line", False, str(exc), "sudo mount -t devpts devpts /dev/pts")]
    found = [Finding("serial line", True, f"a pty is answered within {_told(measured)}")]
    folder = config.path.parent if config.path is not None else Path()
    for name, way in ways.items():
        found += _line(name, way, line_bus(name), measured, folder)
    return found


def _line(name: str, way: LineWay, bus: LineBus, measured: ReplyTime, folder: Path) -> list[Finding]:
    baud = way.rate
    label = f"line of {name}"
    where = "this machine"
    if way.port is not None:
        where = port = str(folder / way.port)
        try:
            echoed = probe.loop_back(port, baud)
        except EnvironmentError_ as exc:
            return [Finding(label, False, str(exc), "ls -l /dev/serial/by-id")]
        timer = probe.latency_timer_ms(port)
        if timer is not None and timer > MOST_LATENCY_MS:
            file = f"/sys/class/tty/{Path(port).resolve().name}/device/latency_timer"
            what = f"the driver of {port} collects octets for {timer} ms before it hands them on"
            return [Finding(label, None, what, f"echo {MOST_LATENCY_MS} | sudo tee {file}")]
        if echoed is not None:
            measured = echoed
        else:
            where = f"this machine at best ({port} received no echo: join its transmitter and receiver to measure it)"
    longest = bus.longest_reply_ns(baud)
    limit = f"{longest / 1e6:.3g} ms at {baud} bit/s (max T_SDR)"
    detail = f"answers within {_told(measured)} on {where}; a master waits {limit}"
    if measured.slow_ns <= longest:
        return [Finding(label, True, detail)]
    remedy = "a longer slot time in the master, and as `latest_answer` of the line"
    return [Finding(label, None, f"{detail} unless it is set to wait longer", remedy)]


def _told(measured: ReplyTime) -> str:
    return f"{measured.slow_ns / 1e6:.2f} ms (99 of 100; half within {measured.median_ns / 1e6:.2f} ms)"
