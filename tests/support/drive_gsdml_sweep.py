"""A profile drive under a maker's GSDML file: each access point with each telegram that it has, connected in memory."""

from __future__ import annotations

import asyncio
import json
from collections import Counter
from typing import TYPE_CHECKING

from device_cell import HEAD

from pnfarm.buses.profinet.maker_identity import identity_of
from pnfarm.controller.line import VirtualLine
from pnfarm.drives.catalogue import model
from pnfarm.errors import ConfigError
from pnfarm.farm.file.reading import parse_farm
from pnfarm.station.event_log import EventLog

if TYPE_CHECKING:
    from pathlib import Path

    from pnfarm.protocols.profinet.gsdml.document import Gsdml

#: How long the drives of one farm may take to connect, s.
_PATIENCE = 15.0
_PLC = "controller: {name: plc, ip: 10.77.250.1/16, cycle: 16ms, reconnect: {after: 300ms}}\n"
_API = 0x3A00


class DriveSweep:
    """``counts``, and ``findings`` as sentences; both are empty for a file without PROFIdrive."""

    def __init__(self, path: Path, gsdml: Gsdml) -> None:
        self.counts: Counter[str] = Counter()
        self.findings: list[str] = []
        self._path = path
        if not any(one.api == _API and one.output_octets for one in gsdml.all_submodules()):
            return
        for dap in gsdml.daps:
            found = identity_of(gsdml, model("profidrive"), dap.id)
            drives = [{"telegram": number} for number in found.overrides.get("telegrams", {})]
            for number in found.overrides.get("supplements", {}):
                drives += [one | {"supplementary": number} for one in drives if "supplementary" not in one]
            if drives:
                self.counts["drives' access points"] += 1
                self._connect(dap.id, drives)

    def _connect(self, dap: str, drives: list[dict[str, int]]) -> None:
        rows = [
            {"name": f"d-{number}", "model": "profidrive", "gsdml": str(self._path.resolve()), "access_point": dap,
             "ip": f"10.77.1.{number}/16", "limits": "lax", **one}
            for number, one in enumerate(drives, 1)
        ]  # fmt: skip
        try:
            config = parse_farm(f"{HEAD}drives: {json.dumps(rows)}\n{_PLC}", self._path)
            line = asyncio.run(VirtualLine.create(config, log=EventLog(quiet=True)))
        except ConfigError as exc:
            self.findings.append(str(exc))
            return
        line.world.run(_PATIENCE, until=lambda: line.plc.all_connected)
        line.world.run(0.5)
        for row, one, axis in zip(line.plc.snapshot(), drives, line.farm.axes, strict=True):
            self.counts["telegrams connected"] += row["state"] == "DATA"
            differs = [ar.module_diff for ar in axis.device.cm.ars if ar.module_diff is not None]
            if row["state"] != "DATA" or differs or axis.store.telegram_number != one["telegram"]:
                self.findings.append(f"{dap}, {one}: {row['state']}, {row['last_reason']}, {differs}")
