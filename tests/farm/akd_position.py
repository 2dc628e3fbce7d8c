"""An AKD of edition M in position mode: its control and status bits, MDI words, and writes of parameters."""

from __future__ import annotations

from hand_line import HandLine
from record_line import access, changing
from virtual_line import VirtualLine

from pnfarm.drives.profiles.profidrive.base_mode import (
    parse_response,
)

#: Position mode: operation enabled, nothing rejected, no intermediate stop.
READY, START, HOME = 0x043F, 0x047F, 0x0C3F
IN_RANGE, REACHED, HOMED, ACKNOWLEDGED, STOPPED, ACTIVE = (
    0x0100, 0x0400, 0x0800, 0x1000, 0x2000, 0x4000,
)  # fmt: skip
BYTE, WORD, DWORD = 0x41, 0x42, 0x43
#: 600 rpm and 30,000 rpm/s in MDI_VELOCITY, MDI_ACC and MDI_DEC.
MDI = {"SATZANW": 0x8000, "MDI_VELOCITY": 2**32 // 20, "MDI_ACC": 39, "MDI_DEC": 39, "MDI_MOD": 1}
COUNTS = 65536


def write(line: VirtualLine, pnu: int, form: int, value: int) -> None:
    """A parameter over the wire, as a PLC writes it."""
    answer = access(line, changing(pnu, form, value & 0xFFFFFFFF if form == DWORD else value & 0xFFFF))
    assert answer is not None
    assert not parse_response(answer).negative, pnu


def position_line(telegram: int = 7, *, homed: bool = True, **options) -> HandLine:
    """In position mode and in operation."""
    line = HandLine(telegram=telegram, params="{DRV.OPMODE: 2}", **options)
    line.enable_axis(READY)
    if homed:
        assert line.send(HOME) & HOMED
        assert line.send(READY) & (HOMED | STOPPED) == HOMED | STOPPED
    return line
