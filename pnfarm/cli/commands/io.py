"""``pnfarm io``: the signals of a running farm's devices and drives, and the ports of its plant's models."""

from __future__ import annotations

import json
import time
from contextlib import suppress
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from pnfarm.cli.completion import complete_signal
from pnfarm.errors import ConfigError, EnvironmentError_, RemoteError
from pnfarm.signals.layers import EVERY
from pnfarm.terminal import client
from pnfarm.terminal.output import print_json, print_line, print_table
from pnfarm.terminal.partial import raise_for_missing
from pnfarm.terminal.settings import DEFAULT_URL, ApiOption, Format, FormatOption, TlsCaOption, TokenOption
from pnfarm.vocabulary.quoting import did_you_mean, shortened, shown

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Mapping, Sequence

    from pnfarm.terminal.client import FarmClient

__all__ = ["io"]

#: Owners that overrule what is written.
_STRONG = frozenset({"fault", "force"})
#: Longest value of the table, characters: 16 octets; a signal that is asked for by its name is shown whole.
MAX_VALUE = 47
#: Between two checks where there is no stream, and before one that broke is asked for again.
AGAIN_SECONDS = 1.0


class _Wanted(NamedTuple):
    """One word of the command line; ``signal`` empty: all of the station, ``value`` None: only read."""

    station: str
    signal: str = ""
    value: str | None = None


def io(
    words: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="STATION[.SIGNAL[=VALUE]]...",
            help="A device, a drive or a model of the plant, one of its signals, or a signal's new value; default: all "
            "devices and models.",
            show_default=False,
            autocompletion=complete_signal,
        ),
    ] = None,
    force: Annotated[
        bool, typer.Option("--force", help="The values stay, whatever is written, until they are released.")
    ] = False,
    release: Annotated[
        bool, typer.Option("--release", help="End the force of these signals, or of all signals of these devices.")
    ] = False,
    watch: Annotated[bool, typer.Option("--watch", help="Follow what changes until Ctrl-C.")] = False,
    output: FormatOption = Format.TABLE,
    api: ApiOption = DEFAULT_URL,
    token: TokenOption = None,
    tls_ca: TlsCaOption = None,
) -> None:
    """List, read, write, force or follow the signals of devices, drives and models of the plant of the running farm.

    Several values for one device are written together, all or none. Inputs of the controller, and inputs of a model
    without a wire, can be written; outputs and the signals of drives can only be read.
    """
    if force and release:
        raise ConfigError("--force and --release exclude each other")
    with client.FarmClient(api, token, tls_ca) as farm:
        listed = farm.get("devices")
        models = [str(one["name"]) for one in farm.get("plant")["models"]]
        known = [*(str(one["name"]) for one in listed["devices"]), *models]
        drives = _drives(farm) if any(_station(word, known) not in known for word in words or []) else frozenset()
        wanted = [_parsed(word, [*known, *drives]) for word in words or []] or [_Wanted(name) for name in known]
        if force and (bare := next((one for one in wanted if one.value is None), None)):
            raise ConfigError(
                f"--force: {bare.station}.{bare.signal or 'SIGNAL'} is given no value, such as =on or =6.5"
            )
        for station, values in (_releases(wanted) if release else _writes(wanted)).items():
            if station in drives:
                raise ConfigError(f"{station} is a drive: its signals can only be read; `pnfarm param set` writes")
            _write(farm, station, values, "force" if force or release else "value")
        if watch:
            with suppress(KeyboardInterrupt):
                _watch(
                    farm, wanted, drives, output, [*dict.fromkeys(one.station for one in wanted)] if words else ["all"]
                )
            return
        found = _read(farm, wanted, drives)
        if output is Format.JSON:
            views = found.values()
            print_json({f"{kind}s": [view for view in views if kind in view] for kind in ("device", "drive")})
        elif any(one.signal for one in wanted):
            for line in _lines(found):
                print_line(line)
        elif found:
            print_table(
                ("STATION", "SIGNAL", "DIRECTION", "TYPE", ">VALUE", "UNIT", "STATUS", "OWNER", "PLACE"),
                _rows(found, models),
            )
        else:
            print_line("the farm has no devices and no plant; `pnfarm io DRIVE` lists the signals of a drive")
    raise_for_missing(listed if not words else {})


def _drives(farm: FarmClient) -> frozenset[str]:
    return frozenset(str(one["name"]) for one in farm.get("drives")["drives"])


def _station(word: str, known: Collection[str]) -> str:
    """Of a word; a station's name may have dots, and that of an FMU's port."""
    name = word.partition("=")[0]
    places = [len(name), *(place for place, letter in reversed(list(enumerate(name))) if letter == ".")]
    return name[: next((one for one in places if name[:one] in known), places[:2][-1])]


def _parsed(word: str, known: Sequence[str]) -> _Wanted:
    name, equals, value = word.partition("=")
    station = _station(word, known)
    signal = name[len(station) + 1 :]
    if station not in known:
        hint = did_you_mean(station, known)
        raise ConfigError(
            f"there is no device, drive or model {shown(station)}{hint}; this farm has {shortened(known) or 'none'}"
        )
    if equals and not signal:
        raise ConfigError(f"{word}: give the signal to write, {station}.SIGNAL=VALUE")
    return _Wanted(station, signal, value if equals else None)


def _writes(wanted: Iterable[_Wanted]) -> dict[str, dict[str, str]]:
    """By station; raises for a signal with two values."""
    found: dict[str, dict[str, str]] = {}
    for station, signal, value in wanted:
        if value is None:
            continue
        if signal in found.setdefault(station, {}):
            raise ConfigError(f"{station}.{signal} is given two values")
        found[station][signal] = value
    return found


def _releases(wanted: Iterable[_Wanted]) -> dict[str, dict[str, None]]:
    """By station, the signals that are forced no longer; raises for one with a value."""
    found: dict[str, dict[str, None]] = {}
    for station, signal, value in wanted:
        if value is not None:
            raise ConfigError(f"{station}.{signal}={value}: a force ends without a value")
        found.setdefault(station, {})[signal or EVERY] = None
    return found


def _write(farm: FarmClient, station: str, values: Mapping[str, str | None], how: str) -> None:
    try:
        answer = farm.patch("devices", station, "signals", body=values, query={"as": how})
    except ConfigError as exc:
        raise ConfigError(f"{station}: {exc}") from exc
    for signal, owner in answer["overruled"].items():
        typer.echo(f"{station}.{signal}: a {owner} has it now; {values[signal]} takes effect when that ends", err=True)


def _read(farm: FarmClient, wanted: Sequence[_Wanted], drives: Collection[str]) -> dict[str, dict[str, Any]]:
    """By station, the wanted signals of it; raises for one that it does not have."""
    found: dict[str, dict[str, Any]] = {}
    for station in dict.fromkeys(one.station for one in wanted):
        kind = "drive" if station in drives else "device"
        view = farm.get(f"{kind}s", station, "signals")
        names = {one["name"] for one in view["signals"]}
        chosen = {one.signal for one in wanted if one.station == station}
        for name in sorted(chosen - names - {""}):
            hint = did_you_mean(name, names) or f"; it has {shortened(sorted(names)) or 'none'}"
            raise ConfigError(f"{station} has no signal {shown(name)}{hint}")
        signals = [one for one in view["signals"] if "" in chosen or one["name"] in chosen]
        found[station] = {kind: view[kind], "signals": signals}
    return found


def _line(station: str, signal: Mapping[str, Any]) -> str:
    unit = f" {signal['unit']}" if signal["unit"] not in {"", "1"} else ""
    notes = [word for word in (signal.get("owner"),) if word in _STRONG] + ([] if signal.get("good", True) else ["bad"])
    return f"{station}.{signal['name']} = {signal['shown']}{unit}" + (f" ({', '.join(notes)})" if notes else "")


def _lines(found: Mapping[str, Mapping[str, Any]]) -> Iterable[str]:
    return (_line(station, signal) for station, view in found.items() for signal in view["signals"])


def _rows(found: Mapping[str, Mapping[str, Any]], models: Sequence[str]) -> Iterable[Sequence[object]]:
    for station, view in found.items():
        for signal in view["signals"]:
            what = signal["type"], _in_table(signal["shown"]), signal["unit"]
            if "drive" in view:
                yield station, signal["name"], "", *what, "", "drive", ""
                continue
            status = "good" if signal["good"] else "bad"
            place = "plant" if station in models else signal["place"]
            yield station, signal["name"], signal["direction"], *what, status, signal["owner"], place


def _in_table(text: str) -> str:
    """A value as the table has it: a long one would widen the column of all."""
    return text if len(text) <= MAX_VALUE else f"{text[: MAX_VALUE - 3].rstrip()}..."


def _watch(
    farm: FarmClient, wanted: Sequence[_Wanted], drives: frozenset[str], output: Format, devices: Sequence[str]
) -> None:
    """Print every signal once, then each whose value, status or owner is another one.

    The signals of drives are read once a second, and those of devices beside them.
    """
    seen: dict[tuple[str, str], tuple[Any, ...]] = {}

    def show(station: str, signal: Mapping[str, Any]) -> None:
        now = signal["value"], signal.get("good"), signal.get("owner")
        if seen.get((station, signal["name"])) != now:
            seen[station, signal["name"]] = now
            kind = "drive" if station in drives else "device"
            print_line(json.dumps({kind: station, **signal}) if output is Format.JSON else _line(station, signal))

    while True:
        # what a stream that broke has left out; raises where the farm has gone
        known: dict[tuple[str, str], Mapping[str, Any]] = {}
        for station, view in _read(farm, wanted, drives).items():
            for signal in view["signals"]:
                known[station, signal["name"]] = signal
                show(station, signal)
        # the farm has no room for one more stream, or it broke
        with suppress(EnvironmentError_, RemoteError):
            for message in farm.values(devices) if drives.isdisjoint(devices) else ():
                for state in message["signals"]:
                    found = known.get((message["device"], state["name"]))
                    if found is not None:
                        show(message["device"], {**found, **state})
        time.sleep(AGAIN_SECONDS)
