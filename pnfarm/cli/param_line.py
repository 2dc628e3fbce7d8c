"""``pnfarm param --line``: a parameter of a station on a serial line, asked for by this process."""

from __future__ import annotations

import asyncio
from typing import Any

from pnfarm.buses import registry
from pnfarm.buses.line_parameters import LineQuestion
from pnfarm.cli.serial_line import RFC2217, line_way, run_on_line
from pnfarm.controller.line_door import ask_controller
from pnfarm.errors import ConfigError, RemoteError
from pnfarm.farm.lines import line_bus, make_line

__all__ = ["ask"]


def ask(
    line: str, station: str, parameter: str, value: int | None, *, baud: int, own: int, model: str | None
) -> dict[str, Any]:
    """The parameter as the API shows one.

    Raises :class:`ConfigError`, :class:`EnvironmentError_` for a line that cannot be opened, and what
    :meth:`pnfarm.buses.line_parameters.LineAsker.result` raises.
    """
    bus = registry.line_parameter_bus()
    if not station.isascii() or not station.isdecimal():
        raise ConfigError(f"{station!r} is not a station address; with --line a drive is named by its number")
    if baud not in bus.baud_rates:
        raise ConfigError(f"--baud {baud} is none of the line's rates: {', '.join(map(str, bus.baud_rates))}")
    question = LineQuestion(int(station), parameter, value, own, model, baud)
    if (found := ask_controller(line.removeprefix(RFC2217), question)) is not None:
        return found
    link = make_line(line_way(line, baud), line_bus(bus.name))
    work = run_on_line(link, bus.name, "param", lambda port: bus.parameter_asker(link, port, question))
    asker = asyncio.run(work)
    try:
        return asker.result()
    except RemoteError as exc:
        if link.dropped.total():
            text = f"{exc}; the octets received are not telegrams: is {baud} the line's rate?"
            raise RemoteError(text) from exc
        raise
