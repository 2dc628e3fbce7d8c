"""``pnfarm param --line``: a parameter of a station on a serial line, asked for by this process."""

from __future__ import annotations

import asyncio
import re
import time
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from pnfarm.buses import registry
from pnfarm.buses.bus import port_spec
from pnfarm.buses.line_parameters import LineQuestion
from pnfarm.config.links import LineWay
from pnfarm.controller.line_door import ask_controller
from pnfarm.errors import ConfigError, EnvironmentError_, RemoteError
from pnfarm.farm.lines import line_bus, make_line

if TYPE_CHECKING:
    from pnfarm.links.serial.link import SerialLink

__all__ = ["ask", "line_way"]

#: How long a way may take until somebody is at its other end.
OPEN_SECONDS: Final = 6.0
#: The longest sleep between two looks at the question.
_LOOK_SECONDS: Final = 0.02
_PLACE: Final = re.compile(r"(?:\[[0-9A-Fa-f:.]+\]|[A-Za-z0-9._-]+):[0-9]{1,5}")
_RFC2217: Final = "rfc2217://"


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
    if (found := ask_controller(line.removeprefix(_RFC2217), question)) is not None:
        return found
    link = make_line(line_way(line, baud), line_bus(bus.name))
    return asyncio.run(_asked(link, question))


def line_way(line: str, baud: int) -> LineWay:
    """What `--line` stands for; a file that is there is one, whatever its name.  Raises :class:`ConfigError`."""
    if line.startswith(_RFC2217):
        place, key = line.removeprefix(_RFC2217), "rfc2217"
    elif _PLACE.fullmatch(line) and not Path(line).exists():
        place, key = line, "connect"
    else:
        return LineWay(port=line, baud=baud)
    port = place.rpartition(":")[2]
    if not _PLACE.fullmatch(place) or not 1 <= int(port) <= 0xFFFF:
        raise ConfigError(f"--line {line!r} is not like HOST:PORT with a port from 1 to 65535")
    return LineWay(rfc2217=place, baud=baud) if key == "rfc2217" else LineWay(connect=place, baud=baud)


async def _asked(link: SerialLink, question: LineQuestion) -> dict[str, Any]:
    bus = registry.line_parameter_bus()
    (port,) = await link.open([port_spec(registry.bus(bus.name), "param", b"")])
    try:
        asker = bus.parameter_asker(link, port, question)
        with suppress(TimeoutError):
            async with asyncio.timeout(OPEN_SECONDS):
                while not link.is_up:  # noqa: ASYNC110 - the ways to a line have no event for it
                    await asyncio.sleep(_LOOK_SECONDS)
        if not link.is_up:
            raise EnvironmentError_(f"no station answers on the line {link.where}")
        asker.start(time.monotonic_ns())
        while not asker.done:
            due = asker.next_deadline()
            left = _LOOK_SECONDS if due is None else (due - time.monotonic_ns()) / 1e9
            await asyncio.sleep(min(max(left, 0), _LOOK_SECONDS))
            asker.service(time.monotonic_ns())
        try:
            return asker.result()
        except RemoteError as exc:
            if link.dropped.total():
                text = f"{exc}; the octets received are not telegrams: is {question.baud} the line's rate?"
                raise RemoteError(text) from exc
            raise
    finally:
        await link.close()
