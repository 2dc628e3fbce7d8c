"""What must hold of a running farm whatever it is sent: counters that only grow, tables with a bound, flat memory."""

from __future__ import annotations

import gc
import json
from collections import Counter, deque
from collections.abc import Mapping
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pnfarm.farm.views.snapshot import discards as all_discards
from pnfarm.farm.views.snapshot import drive_snapshot, engine_snapshot

if TYPE_CHECKING:
    from virtual_line import VirtualLine

    from pnfarm.station.station import Station

__all__ = ["FailureFoundError", "Memory", "Monotonic", "holdings", "resident"]

PAGE = 4096
#: What the acyclic machines of one station may hold, in entries of containers and in octets. The largest honest
#: holders are the RPC server (512 KiB of fragments and kept answers) and the IP reassembly.
MOST_ENTRIES, MOST_OCTETS = 20_000, 1024 * 1024


class FailureFoundError(Exception):
    """A target did what it must not."""


def resident() -> int:
    """Octets of memory that this process holds now."""
    return int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1]) * PAGE


_LEAVES = (int, float, str, bool, type(None), Enum, np.ndarray, np.generic, type)


def holdings(roots: object) -> tuple[int, int]:
    """(entries, octets) of every container reachable from ``roots``, through the project's own objects alone."""
    entries = octets = 0
    seen: set[int] = set()
    waiting = [roots]
    while waiting:
        item = waiting.pop()
        if isinstance(item, _LEAVES) or id(item) in seen:
            continue
        seen.add(id(item))
        if isinstance(item, (bytes, bytearray)):
            octets += len(item)
        elif isinstance(item, Mapping):
            entries += len(item)
            waiting += [*item.keys(), *item.values()]
        elif isinstance(item, (list, tuple, set, frozenset, deque)):
            entries += len(item)
            waiting += item
        elif type(item).__module__.startswith("pnfarm."):
            waiting += getattr(item, "__dict__", {}).values()
            slots = [name for kind in type(item).__mro__ for name in getattr(kind, "__slots__", ())]
            waiting += [getattr(item, name, None) for name in slots]
    return entries, octets


def machines_of(station: Station) -> list[object]:
    device = station.device
    return [
        device.dcp, device.ip, device.rpc, device.client, device.neighbours.lldp, device.snmp, device.cm.alarms,
        device.cm.diagnosis, device.cm.ars, device.dropped, device._pump._calls, device.records.log_book,
        device.records.im.texts, device.neighbours.pdev.written, station.fault_counts, device.aborts,
    ]  # fmt: skip


class Monotonic:
    """Every counter of farm and controller; ``look`` raises when one went back."""

    def __init__(self, line: VirtualLine) -> None:
        self.line = line
        self.before: Counter[str] = Counter()
        self.look()

    def _counters(self) -> Counter[str]:
        line = self.line
        found: Counter[str] = Counter()
        for station in line.farm.axes:
            name = station.configured_name
            for reason, count in all_discards(line.farm, station).items():
                found[f"{name} dropped {reason}"] = count
            found[f"{name} connects"] = station.device.connects
            found[f"{name} watchdog"] = station.device.watchdog_expirations
            for reason, count in (*station.device.losses().items(), *station.fault_counts.items()):
                found[f"{name} aborts or faults {reason}"] = count
            if station.powered:
                counters = station.device.traffic.counters(station.device.discards())
                for field in type(counters).__dataclass_fields__:
                    # those of SNMP start again at power-on
                    found[f"{name} boot {station.station.booted_ns} {field}"] = getattr(counters, field)
        for side, node in (("farm", line.farm), ("plc", line.plc)):
            found[f"{side} sent"] = node.link.counters.sent
            found[f"{side} received"] = node.link.counters.received
            engine = node.columns.engine[0]
            for field in ("received", "unknown", "malformed", "sent", "cycles"):
                found[f"{side} engine {field}"] = int(engine[field])
        for reason, count in line.plc.dropped.items():
            found[f"plc dropped {reason}"] = count
        for machine in line.plc._machines:
            for reason, count in machine.dropped.items():
                found[f"plc {type(machine).__name__} dropped {reason}"] = count
        for session in line.plc.sessions:
            found[f"plc {session.plan.name} connects"] = session.measures.connects
            found[f"plc {session.plan.name} alarms"] = session.measures.alarms_received
        return found

    def look(self) -> None:
        now = self._counters()
        back = [f"{name}: {count} -> {now[name]}" for name, count in self.before.items() if now[name] < count]
        # what SNMP counted in an earlier life of the drive is over
        back = [line for line in back if " boot " not in line]
        if back:
            raise FailureFoundError(f"counters went back: {'; '.join(back[:5])}")
        self.before = now


class Memory:
    """What the farm holds: ``look`` measures, and raises beyond a bound."""

    def __init__(self, line: VirtualLine) -> None:
        self.line = line
        self.most_entries = self.most_octets = 0
        self.largest = ""
        self.curve: list[tuple[int, int]] = []

    def look(self) -> None:
        """During an attack, when the tables are full."""
        line = self.line
        owners = [(station.configured_name, machines_of(station)) for station in line.farm.axes]
        owners.append(("plc", [*line.plc._machines, line.plc.dropped, line.plc.life.by_call, line.plc.records]))
        for name, machines in owners:
            entries, octets = holdings(machines)
            if entries > self.most_entries:
                self.most_entries = entries
                self.largest = f"{name}, {max(machines, key=lambda m: holdings([m])[0]).__class__.__name__}"
            self.most_octets = max(self.most_octets, octets)
            if entries > MOST_ENTRIES or octets > MOST_OCTETS:
                sizes = sorted(((*holdings([m]), type(m).__name__) for m in machines), reverse=True)[:4]
                raise FailureFoundError(f"{name} holds {entries} entries, {octets} octets: {sizes}")

    def mark(self, inputs: int) -> None:
        gc.collect()
        self.curve.append((inputs, resident()))

    def check(self, slack: int) -> None:
        """Flat: the second half of the curve stays within ``slack`` octets of the first one's end."""
        if len(self.curve) < 4:
            return
        middle = len(self.curve) // 2
        before = max(octets for _, octets in self.curve[: middle + 1])
        after = self.curve[-1][1]
        if after - before > slack:
            raise FailureFoundError(f"memory grew from {before >> 10} to {after >> 10} KiB in the second half")


def look_at_snapshots(line: VirtualLine, names: list[str]) -> None:
    """Whatever was sent, everything that is known can be shown."""
    now = line.world.now
    json.dumps(engine_snapshot(line.farm))
    for station in line.farm.axes:
        json.dumps(drive_snapshot(line.farm, station, now))
    json.dumps(line.plc.snapshot())
    for name in names:
        json.dumps([entry.as_dict() for entry in line.log.entries(name)])
