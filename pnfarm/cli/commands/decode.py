"""``pnfarm decode``: shows the contents of a capture as text."""

from __future__ import annotations

import datetime as dt
import json
import sys
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pnfarm.buses import registry
from pnfarm.errors import ConfigError
from pnfarm.terminal.output import print_json, print_line, seconds
from pnfarm.vocabulary.quoting import printable, shortened

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from pnfarm.captures.decoder import Decoder, Line
    from pnfarm.captures.reading import CapturedFrame
    from pnfarm.config.device import DeviceConfig
    from pnfarm.config.drive import DriveConfig
    from pnfarm.drives.description.model import Model

__all__ = ["DecodeFormat", "decode"]


#: Stations that are distinguished.
_MOST_STATIONS = 65_536


class DecodeFormat(StrEnum):
    """Output format; JSON is one object per line."""

    TEXT = "text"
    JSON = "json"


def decode(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="Capture file, pcap or pcapng.", show_default=False)],
    drive: Annotated[
        list[str] | None,
        typer.Option(
            "--drive", metavar="NAME|MAC", help="Show only frames of this station.  Repeatable.", show_default=False
        ),
    ] = None,
    only: Annotated[
        list[str] | None,
        typer.Option(
            "--only",
            metavar="KIND",
            help=f"Show only this kind of frame: {', '.join(registry.frame_filters())}.",
            show_default=False,
        ),
    ] = None,
    summary: Annotated[
        bool, typer.Option("--summary", help="Print a summary for each pair of stations instead of lines.")
    ] = False,
    farm: Annotated[
        Path | None,
        typer.Option(
            "--farm",
            metavar="FILE",
            help="Farm file; gives names and data layouts where the capture has no Connect.",
            show_default=False,
        ),
    ] = None,
    gap: Annotated[
        float, typer.Option("--gap", metavar="CYCLES", min=1.0, help="Report gaps in cyclic data longer than this.")
    ] = 3.0,
    every_frame: Annotated[bool, typer.Option("--every-frame", help="Print a line for every cyclic frame.")] = False,
    output: Annotated[DecodeFormat, typer.Option("--format", help="Output format.")] = DecodeFormat.TEXT,
) -> None:
    """Show the contents of a capture: connections, records, DCP, alarms, and changes in the cyclic data."""
    from pnfarm.captures.reading import FrameReader

    families = _families(only or ())
    decoder = registry.decoder(gap_cycles=gap, every_frame=every_frame)
    if farm is not None:
        _learn_farm(farm, decoder)
    chosen = _Chosen(drive or (), decoder)
    reader = FrameReader(file, decoder.link_types)
    # written at once but not flushed: flushing each line would slow down a long capture
    write = sys.stdout.write
    for frame in reader:
        lines = decoder.feed(frame)
        chosen.see(frame)
        for line in lines:
            if not summary and line.family in families and chosen.wants(line):
                write(_text(line, decoder) if output is DecodeFormat.TEXT else f"{json.dumps(decoder.as_dict(line))}\n")
    if summary:
        _summary(decoder, drive or (), output)
    if reader.complaint is not None:
        sys.stderr.write(f"{file}: the file cannot be read to its end: {reader.complaint}\n")
    if reader.foreign:
        sys.stderr.write(f"{file}: {reader.foreign} packets are not Ethernet frames and were skipped\n")
    if missing := chosen.missing():
        sys.stdout.flush()
        raise ConfigError(f"station {missing[0]!r} is not in {file}; {chosen.seen_stations()}")


def _families(words: Sequence[str]) -> frozenset[str]:
    """The frame families of these kinds; without any, all families that a decoder knows."""
    from pnfarm.captures.families import OTHER

    known = registry.frame_filters()
    for word in words:
        if word not in known:
            raise ConfigError(f"unknown kind of frame {word!r}, allowed are {', '.join(known)}")
    return frozenset[str]().union(*(known[word] for word in words or known)) - (frozenset() if words else {OTHER})


def _mac(text: str) -> bytes | None:
    from pnfarm.wire.mac import parse_mac

    try:
        return parse_mac(text)
    except ValueError:
        return None


class _Chosen:
    """The stations of ``--drive``, by name or MAC address; a name matches from the frame that announces it."""

    def __init__(self, stations: Iterable[str], decoder: Decoder) -> None:
        self._decoder = decoder
        self._asked = {text: _mac(text) for text in stations}
        #: Stations for which a line was found.
        self._found: set[str] = set()
        self._senders: dict[bytes, None] = {}
        self._addressed: set[bytes] = set()

    def see(self, frame: CapturedFrame) -> None:
        """Note the stations of one frame, whether or not it makes a line."""
        if self._asked and len(self._senders) < _MOST_STATIONS and len(self._addressed) < _MOST_STATIONS:
            destination, source = self._decoder.ends(frame)
            # a telegram of a line may have none
            if source:
                self._senders[source] = None
                self._addressed.add(destination)

    def wants(self, line: Line) -> bool:
        """Whether a line is from or to one of the stations; always, if none was asked for."""
        if not self._asked:
            return True
        ends = (line.source, line.destination)
        names = {self._decoder.name(mac) for mac in ends}
        found = {text for text, mac in self._asked.items() if (text in names if mac is None else mac in ends)}
        self._found |= found
        return bool(found)

    def missing(self) -> list[str]:
        """The stations asked for that no frame is from or to."""
        seen = self._senders.keys() | self._addressed
        names = {self._decoder.name(mac) for mac in seen}
        return [
            text
            for text, mac in self._asked.items()
            if text not in self._found and (text not in names if mac is None else mac not in seen)
        ]

    def seen_stations(self) -> str:
        """The stations that send, for the end of an error message."""
        names = list(dict.fromkeys(self._decoder.name(mac) for mac in self._senders))
        return f"it has frames of {shortened(names, joint=', ')}" if names else "it has no frames"


def _text(line: Line, decoder: Decoder) -> str:
    described = line.description
    text = (
        f"{_clock(line.time_ns)} {decoder.name(line.source)} -> {decoder.name(line.destination)} "
        f"{described.what} {described.text}".rstrip()
    )
    return printable(text) + "\n"


def _clock(time_ns: int) -> str:
    """The time of day; of a stamp beyond any calendar, which a damaged file may have, its seconds."""
    seconds, rest = divmod(time_ns, 1_000_000_000)
    try:
        moment = f"{dt.datetime.fromtimestamp(seconds, dt.UTC).astimezone():%H:%M:%S}"
    except (ValueError, OverflowError, OSError):
        moment = str(seconds)
    return f"{moment}.{rest // 1000:06}"


def _learn_farm(path: Path, decoder: Decoder) -> None:
    """Give the decoder the names, models and planned connections of a farm file."""
    from pnfarm.captures.decoder import LineDecoder, PlannedDrive
    from pnfarm.cli.farm_file import read
    from pnfarm.controller.plan import plan_controllers
    from pnfarm.farm.farm import model_of
    from pnfarm.farm.file.reading import expand, expand_devices

    config = read(path)
    drives, devices = expand(config), expand_devices(config)
    known: list[tuple[DriveConfig | DeviceConfig, Model | None, str]] = [(one, None, one.bus) for one in devices]
    known += [(drive, model, model.bus) for drive in drives for model in (model_of(drive),)]
    stations = decoder.capture.stations
    for station, model, bus in known:
        if isinstance(own := decoder.buses[bus], LineDecoder):
            own.learn(station, model)
            continue
        stations.learn(station.mac, name=station.name, model=model)
    for one in plan_controllers(config, drives, devices) if config.controllers else ():
        section = one.section
        if one.mac is not None:
            stations.learn(one.mac, name=section.name)
        if isinstance(own := decoder.buses[one.bus.name], LineDecoder):
            own.learn_controller(section)
        # those of other machines, whose addresses the file does not have, come last
        members = [(drive.mac, model) for drive, model in one.members]
        own_devices = [(device.mac, None) for device in devices if device.bus == one.bus.name]
        planned = [
            PlannedDrive(mac, model, wanted)
            for (mac, model), wanted in zip([*members, *own_devices], one.plan.devices, strict=False)
        ]
        decoder.buses[one.bus.name].expect(section.name, one.mac or bytes(6), planned)


# -- the summary


def _summary(decoder: Decoder, stations: Iterable[str], output: DecodeFormat) -> None:
    talks = decoder.summary()
    asked = {mac.hex(":") if (mac := _mac(text)) is not None else text for text in stations}
    names = {decoder.name(mac) if (mac := _mac(text)) is not None else text for text in stations}
    if asked:
        talks = [talk for talk in talks if (names | asked) & set(talk["between"])]
    if output is DecodeFormat.JSON:
        print_json({"conversations": talks})
        return
    for talk in talks:
        for text in _paragraph(talk):
            print_line(printable(text))


_COUNTERS = (
    ("connects", "connects"), ("refused", "refused"), ("releases", "releases"), ("aborts", "aborts"),
    ("watchdogs", "watchdogs expired"), ("alarms", "alarms"), ("writes", "writes"), ("reads", "reads"),
    ("record errors", "records refused"), ("faults", "RPC faults"), ("repeated", "calls repeated"),
    ("errors", "requests refused"), ("unanswered", "without an answer"), ("malformed", "malformed"),
)  # fmt: skip


def _paragraph(talk: dict[str, Any]) -> Iterable[str]:
    families = ", ".join(f"{count} {kind}" for kind, count in talk["families"].items())
    yield f"{' <-> '.join(talk['between'])}: {talk['frames']} frames in {talk['seconds']:.3f} s ({families})"
    for channel in talk["cyclic"]:
        telegram = f", telegram {channel['telegram']}" if channel["telegram"] is not None else ""
        intervals = [seconds(channel[f"interval_{which}_seconds"]) or "-" for which in ("min", "mean", "max")]
        yield (
            f"  cyclic from {channel['from']} {channel['frame_id']}{telegram}: {channel['frames']} frames, "
            f"cycle {seconds(channel['cycle_seconds']) or 'unknown'}, min/mean/max {' / '.join(intervals)}"
        )
        if channel["gaps"] or channel["counter_jumps"] or channel["frames_missing"]:
            yield (
                f"    {channel['gaps']} gaps (longest {seconds(channel['longest_gap_seconds']) or '-'}), "
                f"{channel['frames_missing']} frames missing, {channel['counter_jumps']} jumps of the cycle counter, "
                f"{channel['watchdog_gaps']} silences longer than the watchdog"
            )
    counted = [f"{talk['counts'][key]} {words}" for key, words in _COUNTERS if talk["counts"].get(key)]
    if counted:
        yield f"  {', '.join(counted)}"
    for key in ("refused", "aborts", "record errors", "faults", "errors", "unanswered", "malformed"):
        for reason, count in talk["reasons"].get(key, {}).items():
            yield f"    {key}: {f'{count} x ' if count > 1 else ''}{reason}"
