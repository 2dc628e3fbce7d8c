"""The demo's last part: a scenario against the demo's own controller, its verdict, and the report for a browser."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pnfarm.buses.registry import fault_kinds
from pnfarm.scenario.definition.binding import bind_scenario
from pnfarm.scenario.definition.file import parse_scenario
from pnfarm.scenario.report.page import report_html

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pnfarm.farm.core import FarmCore
    from pnfarm.scenario.definition.binding import Binding

__all__ = ["demo_binding", "write_report"]

#: The watchdogs of the demo's drives expire after at most 512 ms without a frame, so a second ends the connection.
SCENARIO = """
scenario: cable-pulled
description: The cable of {axis} is pulled for a second; does the PLC bring the axis back?
steps:
  - parallel:
{others}
      - - fault: {{kind: link-down, on: {axis}, for: 1s}}
        - expect: {{drive: {axis}, that: not connected, within: 2s, name: the connection breaks}}
        - expect: {{drive: {axis}, that: connected, within: 10s, name: the PLC connects again}}
        - expect: {{drive: {axis}, that: state == S4, within: 10s, for: 1s, name: the PLC brings it back}}
"""
OTHERS = "      - expect: {{drive: [{names}], that: state == S4, for: 3s, name: the other drives run on}}"


def demo_binding(farm: FarmCore, axis: str, names: Sequence[str]) -> Binding:
    """The scenario, checked against the demo's drives; ``axis`` loses its cable."""
    others = [name for name in names if name != axis]
    line = OTHERS.format(names=", ".join(others)) if others else ""
    scenario = parse_scenario(SCENARIO.format(axis=axis, others=line))
    return bind_scenario(scenario, {station.configured_name: station.model for station in farm.axes}, fault_kinds())


def write_report(record: dict[str, Any], file: Path | None) -> Path:
    """The report's file: the given one, or one in a new folder for temporary files.  Raises :class:`OSError`."""
    if file is None:
        file = Path(tempfile.mkdtemp(prefix="pnfarm-demo-")) / "report.html"
    file.write_text(report_html(record), encoding="utf-8")
    return file.absolute()
