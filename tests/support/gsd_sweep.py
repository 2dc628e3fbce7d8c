"""A GSD file with every module plugged, and compared with what a few patterns find in its text."""

from __future__ import annotations

import re
import time
from collections import Counter
from typing import TYPE_CHECKING

from pnfarm.errors import DecodeError
from pnfarm.protocols.profibus.gsd.reader import parse_gsd_file
from pnfarm.protocols.profibus.gsd.station import plug_slave
from pnfarm.protocols.profibus.gsd.values import PlugError
from pnfarm.protocols.profibus.wire.dp import parse_identifiers

if TYPE_CHECKING:
    from pathlib import Path

    from pnfarm.protocols.profibus.gsd.document import ModuleItem

__all__ = ["Sweep", "gsd_files"]

_MODULE = re.compile(rb'^[ \t]*Module[ \t]*=[ \t]*"[^"]*"([^;\r\n\\]*)', re.IGNORECASE | re.MULTILINE)
_IDENT = re.compile(rb"^[ \t]*Ident_Number[ \t]*=[ \t]*0x([0-9A-F]+)", re.IGNORECASE | re.MULTILINE)


def gsd_files(folder: Path) -> list[Path]:
    """By the endings of all languages."""
    return sorted(path for path in folder.rglob("*") if re.fullmatch(r"\.gs[a-z]", path.suffix.lower()))


class Sweep:
    """``findings``: what is not as it should be; ``counts``: modules, files, warnings; ``seconds`` of reading."""

    def __init__(self, path: Path) -> None:
        self.findings: list[str] = []
        self.counts: Counter[str] = Counter(files=1)
        data = path.read_bytes()
        began = time.perf_counter()
        try:
            self.gsd = parse_gsd_file(data)
        except DecodeError as exc:
            self.findings.append(str(exc))
            self.seconds = 0.0
            return
        self.seconds = time.perf_counter() - began
        self.counts.update(modules=len(self.gsd.modules), warnings=len(self.gsd.warnings))
        ident = _IDENT.search(data)
        if ident is not None and int(ident[1], 16) != self.gsd.ident:
            self.findings.append(f"ident number {self.gsd.ident:04X}, the text has {ident[1].decode()}")
        texts = [bytes(int(one, 0) for one in found[1].split(b",") if one.strip()) for found in _MODULE.finditer(data)]
        own = [module.identifiers[: len(text)] for module, text in zip(self.gsd.modules, texts, strict=False)]
        if texts != own:
            self.findings.append(f"{len(own)} modules, the text has {len(texts)}, or other identifiers")
        for module in self.gsd.modules:
            self._plug(module)

    def _plug(self, module: ModuleItem) -> None:
        """In the first slot that takes it, alone."""
        wanted = module.name if module.number is None else module.number
        empty: dict[int, str | int | None] = dict.fromkeys(range(1, self.gsd.most_modules + 1))
        last = ""
        for slot in range(1, self.gsd.most_modules + 1):
            try:
                slave = plug_slave(self.gsd, empty | {slot: wanted})
            except PlugError as exc:
                last = str(exc)
                continue
            (plugged,) = slave.modules
            parts = parse_identifiers(module.identifiers)
            if (slave.inputs, slave.outputs) != (sum(one.inputs for one in parts), sum(one.outputs for one in parts)):
                self.findings.append(f"{module.name}: {slave.inputs} octets of inputs, {slave.outputs} of outputs")
            if len(plugged.user) != plugged.item.parameters.octets or not slave.takes(slave.identifiers):
                self.findings.append(f"{module.name}: {len(plugged.user)} octets of parameters")
            if (wrong := slave.complaint(slave.user)) is not None:
                self.findings.append(f"{module.name}: by its defaults {wrong}")
            return
        self.findings.append(f"{module.name}: {last}")
