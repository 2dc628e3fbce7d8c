"""A serial line that a command uses by itself: where it is, and what is done on it."""

from __future__ import annotations

import asyncio
import re
import time
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, TypeVar

from pnfarm.buses import registry
from pnfarm.buses.bus import port_spec
from pnfarm.buses.line_parameters import LineWork
from pnfarm.config.links import LineWay
from pnfarm.errors import ConfigError, EnvironmentError_

if TYPE_CHECKING:
    from collections.abc import Callable

    from pnfarm.links.serial.link import SerialLink

__all__ = ["RFC2217", "is_place", "line_way", "run_on_line"]

#: How long it may take until the far end is connected.
OPEN_SECONDS: Final = 6.0
#: The longest sleep between two checks of the work.
_LOOK_SECONDS: Final = 0.02
_PLACE: Final = re.compile(r"(?:\[[0-9A-Fa-f:.]+\]|[A-Za-z0-9._-]+):[0-9]{1,5}")
RFC2217: Final = "rfc2217://"


Work = TypeVar("Work", bound=LineWork)


def is_place(text: str) -> bool:
    """Whether it is like HOST:PORT."""
    return _PLACE.fullmatch(text.removeprefix(RFC2217)) is not None


def line_way(line: str, baud: int, option: str = "--line") -> LineWay:
    """What the words stand for; a file that is there is one, whatever its name.  Raises :class:`ConfigError`."""
    if line.startswith(RFC2217):
        place, key = line.removeprefix(RFC2217), "rfc2217"
    elif is_place(line) and not Path(line).exists():
        place, key = line, "connect"
    else:
        return LineWay(port=line, baud=baud)
    port = place.rpartition(":")[2]
    if not _PLACE.fullmatch(place) or not 1 <= int(port) <= 0xFFFF:
        raise ConfigError(f"{option} {line!r} is not like HOST:PORT with a port from 1 to 65535")
    return LineWay(rfc2217=place, baud=baud) if key == "rfc2217" else LineWay(connect=place, baud=baud)


async def run_on_line(link: SerialLink, bus: str, station: str, make: Callable[[Any], Work]) -> Work:
    """``make(port)`` is the work, which is returned once it is done.

    Raises :class:`EnvironmentError_` where the line's far end is not connected.
    """
    (port,) = await link.open([port_spec(registry.bus(bus), station, b"")])
    try:
        work = make(port)
        with suppress(TimeoutError):
            async with asyncio.timeout(OPEN_SECONDS):
                while not link.is_up:  # noqa: ASYNC110 - the ways to a line have no event for it
                    await asyncio.sleep(_LOOK_SECONDS)
        if not link.is_up:
            raise EnvironmentError_(f"no station answers on the line {link.where}")
        work.start(time.monotonic_ns())
        while not work.done:
            due = work.next_deadline()
            left = _LOOK_SECONDS if due is None else (due - time.monotonic_ns()) / 1e9
            # what came in is taken at the next check, at the latest when it is due
            await asyncio.sleep(min(max(left, 0), _LOOK_SECONDS))
            work.service(time.monotonic_ns())
        return work
    finally:
        await link.close()
