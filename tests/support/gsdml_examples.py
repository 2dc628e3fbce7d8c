"""The descriptions of the example cell's devices: an island with three heads, and a compact code reader."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from pnfarm.protocols.profinet.gsdml.document import Gsdml
from pnfarm.protocols.profinet.gsdml.reader import parse_gsdml

EXAMPLES = Path(__file__).resolve().parents[2] / "configs" / "gsdml"
ISLAND = EXAMPLES / "GSDML-V2.35-Example-Island-20261127.xml"
SCANNER = EXAMPLES / "GSDML-V2.43-Example-Scanner-20261127.xml"


@cache
def example(path: Path) -> Gsdml:
    return parse_gsdml(path.read_bytes(), path.name)
