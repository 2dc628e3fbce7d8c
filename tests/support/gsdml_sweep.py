"""One GSDML file plugged with every access point, every module and every submodule, against another reader.

The other reader is that of profinet-py (PyPI).  It has no length for some types: submodules with such are compared
without their lengths.
"""

from __future__ import annotations

import asyncio
import json
import time
from collections import Counter
from pathlib import Path
from typing import Any

from device_cell import HEAD
from profinet import gsdml as independent

from pnfarm.buses.profinet.file_signals import file_signals
from pnfarm.controller.line import VirtualLine
from pnfarm.errors import ConfigError
from pnfarm.farm.file.reading import parse_farm
from pnfarm.protocols.profinet.gsdml.diagnosis import DiagnosisCatalogue
from pnfarm.protocols.profinet.gsdml.document import Gsdml, ItemRef
from pnfarm.protocols.profinet.gsdml.reader import parse_gsdml
from pnfarm.protocols.profinet.gsdml.station import (
    PlugError,
    PluggedModule,
    PluggedStation,
    PluggedSubmodule,
    plug_station,
)
from pnfarm.station.event_log import EventLog

#: Devices of one farm, and how long they may take to connect, s.
_TOGETHER, _PATIENCE = 60, 15.0
_PLC = "controller: {name: plc, ip: 10.77.250.1/16, cycle: 64ms, reconnect: {after: 300ms}}\n"
#: Types of which the other reader knows the length; it and PI's table differ about TimeStamp.
_COMPARED = {name for name, size in independent.GSDML_TYPE_SIZES.items() if size or name.endswith("String")} - {
    "TimeStamp"
}


class Sweep:
    """What one file's sweep found: ``counts``, and ``findings`` as sentences; :meth:`connect` finds more."""

    def __init__(self, path: Path) -> None:
        self.counts: Counter[str] = Counter()
        self.findings: list[str] = []
        self._devices: list[dict[str, Any]] = []
        self._path = path
        begin = time.perf_counter()
        self.gsdml: Gsdml = parse_gsdml(path.read_bytes(), path.name)
        self.seconds = time.perf_counter() - begin
        self._other = independent.load_gsdml(path)
        self._device()

    def _device(self) -> None:
        self._same("device", (self.gsdml.vendor_id, self.gsdml.device_id),
                   (self._other.vendor_id, self._other.device_id))  # fmt: skip
        DiagnosisCatalogue(self.gsdml)
        modules = {module.id: module for module in self.gsdml.modules}
        others = {dap.id: dap for dap in self._other.daps}
        for dap in self.gsdml.daps:
            self.counts["access points"] += 1
            other = others[dap.id]
            station = self._plug(dap.id, f"access point {dap.id}")
            if station is not None:
                self._compare(station.modules[0], other)
                found = {(s.subslot, s.ident) for s in station.modules[0].submodules if s.kind in {"interface", "port"}}
                self._same(dap.id, found, {(s.subslot_number, s.submodule_ident) for s in other.system_submodules})
            for ref in dap.modules:
                slot = _first(ref)
                if slot is None:
                    self.findings.append(f"access point {dap.id}: {ref.target} has no slot")
                    continue
                self.counts["modules"] += 1
                station = self._plug(dap.id, f"access point {dap.id}, {ref.target}", {slot: ref.target})
                if station is not None:
                    self._compare(station.module(slot), self._other.modules[ref.target])
                for item in modules[ref.target].useable:
                    self._submodule(dap.id, slot, ref.target, item)
            for item in dap.useable:
                self._submodule(dap.id, dap.slot, "", item)

    def _submodule(self, dap: str, slot: int, module: str, item: ItemRef) -> None:
        subslot = _first(item)
        if subslot is None:
            self.findings.append(f"access point {dap}, {module}: {item.target} has no subslot")
            return
        self.counts["submodules"] += 1
        modules = {slot: module} if module else {}
        what = f"access point {dap}, {module}, {item.target}"
        station = self._plug(dap, what, modules, {(slot, subslot): item.target})
        other = self._other.submodule_catalog.get(item.target)
        if station is None or other is None:
            return
        one = station.submodule(slot, subslot)
        self._same(what, (one.ident, one.api), (other.submodule_ident, other.api))
        if _comparable(one):
            self._same(what, (one.input_octets, one.output_octets), (other.input_length, other.output_length))

    def connect(self) -> None:
        """Every station that was plugged, as a device of a farm, with the controller in memory."""
        for begin in range(0, len(self._devices), _TOGETHER):
            batch = self._devices[begin : begin + _TOGETHER]
            rows = [
                json.dumps(
                    {"name": f"d-{number}", "gsdml": str(self._path.resolve()), "ip": f"10.77.1.{number}/16"} | one
                )
                for number, one in enumerate(batch, 1)
            ]
            try:
                config = parse_farm(f"{HEAD}devices: [{', '.join(rows)}]\n{_PLC}", self._path)
                line = asyncio.run(VirtualLine.create(config, log=EventLog(quiet=True)))
            except ConfigError as exc:
                self.findings.append(str(exc))
                continue
            line.world.run(_PATIENCE, until=lambda plc=line.plc: plc.all_connected)
            line.world.run(0.5)
            for row, one in zip(line.plc.snapshot(), batch, strict=True):
                self.counts["connected"] += row["state"] == "DATA"
                if row["state"] != "DATA" or row["losses"]:
                    self.findings.append(f"{one}: {row['state']}, {row['losses']} losses, {row['last_reason']}")

    def _plug(self, dap: str, what: str, modules=None, submodules=None) -> PluggedStation | None:
        try:
            station = plug_station(self.gsdml, access_point=dap, modules=modules, submodules=submodules)
        except PlugError as error:
            self.findings.append(f"{what}: {error}")
            return None
        self.counts["stations"] += 1
        slots: dict[int, dict[str, Any]] = {slot: {"module": one} for slot, one in (modules or {}).items()}
        for (slot, subslot), one in (submodules or {}).items():
            slots.setdefault(slot, {})["submodules"] = {subslot: one}
        # as near to 64 ms as the file allows at a send clock of 1 ms
        cycles = [
            1 << n for n in range(10) if 32 << n >= station.min_device_interval and 1 << n in station.reduction_ratios
        ]
        cycle = min(cycles, key=lambda one: abs(one - 64), default=64)
        self._devices.append({"access_point": dap, "slots": slots, "cycle": f"{cycle}ms"})
        names = [signal.name for signal in file_signals(station)]
        if len(set(names)) < len(names):
            self.findings.append(f"{what}: two signals have one name")
        for submodule in station.submodules:
            for record in submodule.records:
                self.counts["records"] += 1
                if complaint := record.complaint(record.defaults()):
                    self.findings.append(f"{what}: default of {complaint}")
        return station

    def _compare(self, module: PluggedModule, other: independent.GSDMLModule | independent.GSDMLDAP) -> None:
        self._same(module.id, module.ident, other.module_ident)
        virtual = [one for one in module.submodules if one.kind == "virtual"]
        self._same(
            module.id, {(s.ident, s.api) for s in virtual}, {(s.submodule_ident, s.api) for s in other.submodules}
        )
        for one in filter(_comparable, virtual):
            lengths = {(s.input_length, s.output_length) for s in other.submodules if s.submodule_ident == one.ident}
            self.counts["lengths compared"] += 1
            if (one.input_octets, one.output_octets) not in lengths:
                self.findings.append(
                    f"{module.id}, {one.id}: {one.input_octets} and {one.output_octets} octets, not {lengths}"
                )

    def _same(self, what: str, ours: object, theirs: object) -> None:
        self.counts["comparisons"] += 1
        if ours != theirs:
            self.findings.append(f"{what}: {ours}, the other reader has {theirs}")


def _first(ref: ItemRef) -> int | None:
    return next((place for places in (ref.fixed, ref.used, ref.allowed) for place in places), None)


def _comparable(submodule: PluggedSubmodule) -> bool:
    return all(item.data_type in _COMPARED for item in (*submodule.inputs, *submodule.outputs))
