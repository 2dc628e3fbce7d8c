"""An EDS file with every connection opened, and compared with what a few patterns find in its text."""

from __future__ import annotations

import asyncio
import re
import time
from collections import Counter
from typing import TYPE_CHECKING

from device_cell import HEAD

from pnfarm.buses.controller import ControllerHost
from pnfarm.buses.ethernetip.config.controller import EthernetIpController
from pnfarm.buses.ethernetip.controller.core import EthernetIpCore
from pnfarm.buses.ethernetip.controller.plan import plan_controller
from pnfarm.controller.line import VirtualLine
from pnfarm.errors import DecodeError
from pnfarm.farm.file.reading import FarmFileError, expand_devices, parse_farm
from pnfarm.links.base import PortSpec
from pnfarm.protocols.enip.connection import ConnectionKind
from pnfarm.protocols.enip.eds.reader import parse_sheet
from pnfarm.station.event_log import EventLog

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from pnfarm.farm.file.reading import FarmConfig
    from pnfarm.protocols.enip.eds.document import Connection

__all__ = ["Sweep", "eds_files"]

#: Longer than any file may take to read, s.
_LONGEST = 1.0
_PATIENCE = 20.0
_IDENTITY = ("VendCode", "ProdType", "ProdCode", "MajRev", "MinRev")
_COMMENT = re.compile(rb'"(?:[^"\\]|\\.)*"|\$[^\r\n]*')
_FIELD = re.compile(r'((?:"(?:[^"\\]|\\.)*"|[^,"])*)(?:,|$)')
_CLASS = re.compile(r"20 04 |21 (?:00 )?04 00 ")
_POINT = re.compile(r"(?:2[4C] ([0-9A-F]{2})|2[5D] (?:00 )?([0-9A-F]{2} [0-9A-F]{2}))(?: |$)")
_DEVICE = "  - {{name: device-{0}, eds: '{1}', ip: 10.77.0.{0}/23, connection: {2}{3}}}\n"
_PLC = "controller: {{name: plc, ip: 10.77.1.250/23, multicast: {}, reconnect: {{after: 300ms}}}}\n"
_SECOND = "controller:\n  interface: eth9\n  ip: 10.77.1.251/23\n  keying: compatible\n  devices:\n"
_LISTENING = ", multicast: true, configuration: '{}'"


def eds_files(folder: Path) -> list[Path]:
    return sorted(path for path in folder.rglob("*") if path.suffix.lower() == ".eds")


class Sweep:
    """``findings``: what is wrong; ``counts``; ``sentences`` of what was taken; ``seconds`` of CPU to read."""

    def __init__(self, path: Path) -> None:
        self.findings: list[str] = []
        self.counts: Counter[str] = Counter()
        self.sentences: list[str] = []
        self.vendor_id, self.vendor = 0, ""
        self._path = path
        data = path.read_bytes()
        began = time.process_time()
        try:
            self.sheet = parse_sheet(data)
        except DecodeError as exc:
            self.findings.append(str(exc))
            self.seconds = 0.0
            return
        self.seconds = time.process_time() - began
        if self.seconds > _LONGEST:
            self.findings.append(f"it took {self.seconds:.1f} s to read")
        self.vendor_id, self.vendor = self.sheet.key.vendor_id, self.sheet.vendor
        self._compare(_Text(data))
        self._connect()

    def _compare(self, text: _Text) -> None:
        key = self.sheet.key
        own = (key.vendor_id, key.device_type, key.product_code, key.major_revision, key.minor_revision)
        if (other := text.identity()) != own:
            self.findings.append(f"identity {own}, the text has {other}")
        if (names := text.connections()) != {one.keyword for one in self.sheet.connections}:
            self.findings.append(f"connections {[one.keyword for one in self.sheet.connections]}, not {sorted(names)}")
        for one in self.sheet.connections:
            sizes = one.outputs.size.default, one.inputs.size.default
            if (found := text.sizes(one.keyword)) != sizes:
                self.findings.append(f"{one.keyword}: {sizes} octets, the text has {found}")
            if (points := text.points(one.keyword)) not in {None, one.points}:
                self.findings.append(f"{one.keyword}: points {one.points}, the text has {points}")
            self.counts["connections"] += 1

    def _connect(self) -> None:
        """Each connection with a device of its own; listeners beside an owner of the same data."""
        offered = [one for one in self.sheet.connections if one.is_class_1 and not one.unsupported]
        owners = [one for one in offered if one.kind is not ConnectionKind.LISTEN_ONLY]
        self.counts["not offered"] += len(self.sheet.connections) - len(offered)
        self._run(owners, [], multicast="false")
        listeners = []
        for one in offered:
            if one.kind is ConnectionKind.LISTEN_ONLY:
                same = [own for own in owners if own.points[-1] == one.points[-1] and own.multicast]
                same.sort(key=lambda own: own.inputs.size.default != one.inputs.size.default)
                if same:
                    listeners.append((same[0], one))
                else:
                    self.counts["listeners without an owner"] += 1
        self._run([own for own, _ in listeners], [one for _, one in listeners], multicast="true")

    def _run(self, owners: Sequence[Connection], listeners: Sequence[Connection], multicast: str) -> None:
        if not owners:
            return
        file = str(self._path.resolve()).replace("'", "''")
        numbers = range(11, 11 + len(owners))
        rows = [_DEVICE.format(at, file, one.keyword, "") for at, one in zip(numbers, owners, strict=True)]
        try:
            config = parse_farm(f"{HEAD}devices:\n{''.join(rows)}{_PLC.format(multicast)}", self._path)
        except FarmFileError as exc:
            self.findings.append(str(exc))
            return
        if not self.sentences:
            self.sentences = expand_devices(config)[0].described.sentences()  # type: ignore[attr-defined]  # of EDS
        line = asyncio.run(VirtualLine.create(config, log=EventLog(quiet=True)))
        self._wait(line, line.plc)
        if listeners:
            rows = [
                _DEVICE.format(at, file, one.keyword, _LISTENING.format(bytes(one.configuration.size.default).hex()))
                for at, one in zip(numbers, listeners, strict=True)
            ]
            self._wait(line, _scanner(line, parse_farm(_SECOND + "".join(rows), self._path)))

    def _wait(self, line: VirtualLine, plc: EthernetIpCore) -> None:
        line.world.run(_PATIENCE, until=lambda: plc.all_connected)
        line.world.run(0.5)
        for row in plc.snapshot():
            self.counts["connected"] += row["state"] == "DATA"
            if row["state"] != "DATA" or row["losses"]:
                self.findings.append(f"{row['name']}: {row['state']}, {row['losses']} losses, {row['last_reason']}")
            found = row["identification"]["name"]
            if found != self.sheet.product[:32]:
                self.findings.append(f"{row['name']} says that it is {found!r}")


def _scanner(line: VirtualLine, config: FarmConfig) -> EthernetIpCore:
    """A second scanner in the same world, which knows its devices by their file alone."""
    assert isinstance(config.controller, EthernetIpController)
    link = line.world.link()
    (port,) = asyncio.run(link.open([PortSpec("second", bytes.fromhex("02000000fe01"))]))
    host = ControllerHost(link, port, EventLog(quiet=True), seed=b"2")
    core = EthernetIpCore(plan_controller(config.controller, [], [], None), host)
    line.world.join(core, [port])
    core.start(line.world.now)
    return core


class _Text:
    """Numbers by patterns, without the grammar: no groups, no second file of a name."""

    def __init__(self, data: bytes) -> None:
        plain = _COMMENT.sub(lambda found: found[0] if found[0].startswith(b'"') else b"", data)
        self._text = plain.decode("latin-1")

    def _section(self, name: str) -> str:
        found = re.search(rf"^\s*\[{name}\](.*?)(?=^\s*\[|\Z)", self._text, re.IGNORECASE | re.MULTILINE | re.DOTALL)
        return found[1] if found else ""

    def _entry(self, section: str, keyword: str) -> list[str]:
        text = self._section(section)
        found = re.search(rf'\b{keyword}\s*=((?:"(?:[^"\\]|\\.)*"|[^;"])*);', text, re.IGNORECASE)
        if found is None:
            return []
        return [one.strip() for one in _FIELD.findall(found[1])]

    def identity(self) -> tuple[int, ...]:
        fields = [self._entry("Device", name) for name in _IDENTITY]
        return tuple(int(one[0], 0) if one else 0 for one in fields)

    def connections(self) -> set[str]:
        return set(re.findall(r"\b(Connection[0-9]+)\s*=", self._section("Connection Manager")))

    def sizes(self, keyword: str) -> tuple[int, int]:
        fields = self._entry("Connection Manager", keyword)
        return self._size(fields[3], fields[4]), self._size(fields[6], fields[7])

    def _size(self, size: str, form: str) -> int:
        if size.lower().startswith("param"):
            return int(self._entry("Params", size)[11], 0)
        if size:
            return int(size, 0)
        if not form:
            return 0
        if form.lower().startswith("param"):
            return int(self._entry("Params", form)[5], 0)
        fields = self._entry("Assembly", form)
        return self._size(fields[2], "") or -(-sum(int(bits or "0", 0) for bits in fields[6::2]) // 8)

    def points(self, keyword: str) -> tuple[int, ...] | None:
        """None where parameters complete the path."""
        path = self._entry("Connection Manager", keyword)[14].strip('"').upper()
        if "PARAM" in path:
            return None
        found = [one or two for one, two in _POINT.findall(_CLASS.sub("", path))]
        return tuple(int.from_bytes(bytes.fromhex(one), "little") for one in found)
