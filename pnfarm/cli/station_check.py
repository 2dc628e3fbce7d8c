"""``pnfarm import --check``: a plant that runs, station by station, beside a farm file; nothing is written to it."""

from __future__ import annotations

import asyncio
import socket
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import anyio

from pnfarm.buses import registry
from pnfarm.buses.bus import LineBus, line_of
from pnfarm.buses.checking import CheckQuestion, compare
from pnfarm.cli.farm_file import counted, read
from pnfarm.cli.file_stations import foreign_stations, stations_of
from pnfarm.cli.serial_line import RFC2217, is_place, line_way, run_on_line
from pnfarm.errors import ConfigError
from pnfarm.farm.lines import line_bus, make_line
from pnfarm.terminal.output import print_json, print_line, print_table
from pnfarm.terminal.working import working

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from pnfarm.buses.checking import CheckAnswer, CheckingBus, StationCheck, StationFacts
    from pnfarm.farm.file.reading import FarmConfig

__all__ = ["STATES", "check_stations", "rows_of"]

STATES: Final = {
    "equal": "equal",
    "differs": "differs",
    "unread": "not read",
    "missing": "missing",
    "extra": "not in the file",
}


def check_stations(file: Path, places: Sequence[str], *, seconds: float, baud: int, own: int, as_json: bool) -> bool:
    """Compare, print, and return whether all is equal.

    ``places``: interfaces of this machine, and serial lines as ``pnfarm param --line`` takes them, which ``baud`` and
    the ``own`` address are for.  Raises :class:`ConfigError`, :class:`~pnfarm.errors.EnvironmentError_`.
    """
    config = read(file)
    expected: dict[str, list[StationFacts]] = {}
    for one in (*stations_of(config), *foreign_stations(config)):
        expected.setdefault(one.bus, []).append(one.facts)
    answers: dict[str, list[CheckAnswer]] = {}
    for where in dict.fromkeys(places):
        for name, bus in _buses_at(where, expected, file):
            with working(f"asking the {bus.title} stations at {where}"):
                answer = _ask(bus, where, expected[name], seconds, baud, own)
            answers.setdefault(name, []).append(answer)
    checks = {
        name: list(_compared(config, registry.checking()[name], expected[name], answers[name])) for name in answers
    }
    remarks = [remark for each in answers.values() for answer in each for remark in answer.remarks]
    remarks += [
        f"the {bus.title} stations of the file were not read: give --check {_wanted(bus)} as well"
        for name, bus in registry.checking().items()
        if name in expected.keys() - answers.keys()
    ]
    equal = expected.keys() == answers.keys() and all(one.state == "equal" for each in checks.values() for one in each)
    _show(file, checks, remarks, equal=equal, as_json=as_json)
    return equal


def _wanted(bus: CheckingBus) -> str:
    return "LINE" if line_of(bus) else "INTERFACE"


def _buses_at(where: str, expected: dict[str, list[StationFacts]], file: Path) -> list[tuple[str, CheckingBus]]:
    """The buses of the file's stations that may be there."""
    interfaces = [name for _, name in socket.if_nameindex()]
    is_interface = where in interfaces
    if not is_interface and not where.startswith(RFC2217) and not is_place(where) and not Path(where).exists():
        raise ConfigError(
            f"--check {where!r} is no interface of this machine ({', '.join(interfaces)}), and no serial line: "
            "path of a port or pty, HOST:PORT, rfc2217://HOST:PORT"
        )
    found = [
        (name, bus)
        for name, bus in registry.checking().items()
        if name in expected and bool(line_of(bus)) != is_interface
    ]
    if not found:
        kind = "a network" if is_interface else "a serial line"
        raise ConfigError(f"{file} has no station that could be on {kind}, such as {where}")
    return found


def _ask(
    bus: CheckingBus, where: str, expected: Sequence[StationFacts], seconds: float, baud: int, own: int
) -> CheckAnswer:
    if not isinstance(bus, LineBus):
        return anyio.run(bus.read_stations, CheckQuestion(where, seconds, expected))
    if baud not in bus.baud_rates:
        raise ConfigError(f"--baud {baud} is none of the line's rates: {', '.join(map(str, bus.baud_rates))}")
    link = make_line(line_way(where, baud, "--check"), line_bus(bus.name))
    search = partial(bus.checked_line, link, expected=expected, own=own, baud=baud)
    return asyncio.run(run_on_line(link, bus.name, "check", search)).answer()


def _compared(
    config: FarmConfig, bus: CheckingBus, expected: Sequence[StationFacts], answers: Sequence[CheckAnswer]
) -> Iterator[StationCheck]:
    """Without the file's own controller, if the plant has it; what answers at two places is one station."""
    before: set[str] = set()
    found: list[StationFacts] = []
    for answer in answers:
        found += [one for one in answer.stations if repr(one) not in before]
        before |= {repr(one) for one in answer.stations}
    own = {one.name for one in config.controllers}
    own |= {str(ip.ip) for one in config.controllers if (ip := getattr(one, "ip", None)) is not None}
    for check in compare(expected, found, by_name=bus.has_names):
        if check.state != "extra" or own.isdisjoint((check.name, check.address)):
            yield check


def rows_of(bus: str, check: StationCheck, sides: tuple[str, str]) -> Iterator[tuple[str, str, str, str, str]]:
    """For a table: bus, name, address, state, what differs, one row for each difference."""
    texts = [f"{one.what}: {sides[0]} {one.expected}, {sides[1]} {one.found}" for one in check.differences]
    texts += check.remarks
    for place, text in enumerate(texts or [""]):
        if place:
            yield "", "", "", "", text
        else:
            yield bus, check.name, check.address or "-", STATES[check.state], text


def _show(
    file: Path, checks: dict[str, list[StationCheck]], remarks: Sequence[str], *, equal: bool, as_json: bool
) -> None:
    whole = [(name, check) for name, each in checks.items() for check in each]
    if as_json:
        stations = [{"bus": name, **_as_dict(check)} for name, check in whole]
        print_json({"equal": equal, "stations": stations, "remarks": list(remarks)})
        return
    rows = [row for name, check in whole for row in rows_of(name, check, ("file", "plant"))]
    print_table(("BUS", "STATION", "ADDRESS", "STATE", "~WHAT"), rows)
    for remark in remarks:
        print_line(f"note: {remark}")
    other = sum(check.state != "equal" for _, check in whole)
    print_line("")
    print_line(
        f"The plant is as {file} says: {counted(len(whole), 'station')}."
        if equal
        else f"{other} of {counted(len(whole), 'station')} are not as {file} says."
    )


def _as_dict(check: StationCheck) -> dict[str, Any]:
    differences = [{"what": one.what, "file": one.expected, "plant": one.found} for one in check.differences]
    return {
        "name": check.name,
        "address": check.address or None,
        "state": check.state,
        "differences": differences,
        "remarks": list(check.remarks),
    }
