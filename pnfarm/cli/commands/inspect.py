"""``pnfarm inspect``: the drives and devices of a running farm."""

from __future__ import annotations

import datetime as dt
import json
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pnfarm.cli.completion import complete_drive
from pnfarm.cli.inspected_connections import print_connections
from pnfarm.cli.inspected_devices import listed_devices, print_device, print_devices
from pnfarm.cli.inspected_readiness import print_readiness
from pnfarm.errors import ConfigError
from pnfarm.terminal import client
from pnfarm.terminal.output import number, print_found, print_line, print_section, print_table, seconds
from pnfarm.terminal.partial import raise_for_missing
from pnfarm.terminal.settings import DEFAULT_URL, ApiOption, Format, FormatOption, TlsCaOption, TokenOption

if TYPE_CHECKING:
    from collections.abc import Iterable

__all__ = ["inspect"]

#: Events shown below the table of one drive; `--events` shows all that are kept.
LAST_EVENTS = 8


def inspect(
    name: Annotated[
        str | None,
        typer.Argument(
            metavar="NAME",
            help="Show one drive in full; default: a table of all.",
            show_default=False,
            autocompletion=complete_drive,
        ),
    ] = None,
    events: Annotated[bool, typer.Option("--events", help="Show the event log and follow it until Ctrl-C.")] = False,
    follow: Annotated[
        bool, typer.Option("--follow/--no-follow", help="With --events: keep following, or show the log and exit.")
    ] = True,
    readiness: Annotated[
        bool,
        typer.Option(
            "--readiness",
            help="Show what each controller has found, configured and refused, with the line of the farm file to "
            "change.",
        ),
    ] = False,
    output: FormatOption = Format.TABLE,
    api: ApiOption = DEFAULT_URL,
    token: TokenOption = None,
    tls_ca: TlsCaOption = None,
) -> None:
    """Show the drives of the running farm: state, telegram, controller, cycle, last fault."""
    if not follow and not events:
        raise ConfigError("--no-follow needs --events")
    if readiness and (events or name is not None):
        raise ConfigError("--readiness is about all stations: leave out NAME and --events")
    with client.FarmClient(api, token, tls_ca) as farm:
        if readiness:
            view = farm.get("readiness")
            print_found(view, output, print_readiness)
            raise_for_missing(view)
            return
        if name is not None:
            try:
                drive = farm.get("drives", name)
            except ConfigError:
                if name not in [one["name"] for one in listed_devices(farm)]:
                    raise
                if events:
                    everything = farm.events(None, follow=follow)
                    _follow((entry for entry in everything if entry.get("drive") == name), output)
                else:
                    print_found(farm.get("devices", name), output, print_device)
                return
            name = str(drive["name"])
        if events and not follow and name is not None:
            _follow(drive["events"], output)
        elif events:
            _follow(farm.events(name, follow=follow), output)
        elif name is not None:
            print_found({**drive, "controller_record": farm.get("drives", name, "controller")}, output, _one)
        else:
            view = farm.get("drives")
            print_found(view, output, _all)
            if output is Format.TABLE:
                print_devices(listed_devices(farm))
            raise_for_missing(view)


def _follow(entries: Iterable[dict[str, Any]], output: Format) -> None:
    try:
        for entry in entries:
            print_line(json.dumps(entry) if output is Format.JSON else _event_line(entry))
    except KeyboardInterrupt:
        return


def _event_line(entry: dict[str, Any]) -> str:
    if "event" not in entry:
        return f"... {entry.get('lost', 'some')} older events are no longer kept"
    rest = dict(entry)
    rest.pop("sequence", None)
    rest.pop("farm_seconds", None)
    moment = dt.datetime.fromtimestamp(rest.pop("time"), dt.UTC).astimezone()
    drive, event = rest.pop("drive") or "farm", rest.pop("event")
    more = "  ".join(f"{key.removesuffix('_seconds')}={_data(key, value)}" for key, value in rest.items())
    return f"{moment:%H:%M:%S.%f} {drive:<16} {event}  {more}".rstrip()


def _data(key: str, value: Any) -> str:
    if key.endswith("_seconds") and isinstance(value, int | float):
        return seconds(float(value))
    return ("no", "yes")[value] if isinstance(value, bool) else str(value)


def _all(view: dict[str, Any]) -> None:
    columns = ("DRIVE", "STATE", ">TELEGRAM", "CONNECTION", "~CONTROLLER", ">CYCLE", ">RPM", "~LAST FAULT", "~INJECTED")
    rows = [
        (
            drive["name"],
            drive["state"],
            drive["telegram"],
            drive["ar_state"],
            _controller(drive),
            seconds(drive["cycle_seconds"]),
            number(drive["velocity_rpm"]),
            _last_fault(drive),
            " ".join(drive["faults_injected"]),
        )
        for drive in view["drives"]
    ]
    print_table(columns, rows)
    # an older farm's answer has none
    if shard := view.get("shard"):
        print_line(f"shard {shard['index']}/{shard['count']} of farm {view['farm']}")
    if standing := view.get("standing"):
        print_line(_standing_text(standing))
    for line in view["lines"]:
        print_line(_line_text(line))


def _standing_text(standing: dict[str, Any]) -> str:
    """The memory's database and the lease in words."""
    memory = "up" if standing["memory_up"] else f"away ({standing['memory_reason']})"
    ago, other = standing["renewed_seconds_ago"], standing["held_by"]
    text = f"memory {standing['memory']}: {memory}; lease {standing['lease']}"
    if ago is not None:
        text += f", renewed {seconds(ago)} ago, mute {seconds(standing['mute_after_seconds'])} after that"
    if other is not None:
        text += f"; the drives run in shard {other['shard'] or '1/1'} on {other['host']}"
    return text


def _line_text(line: dict[str, Any]) -> str:
    """A serial line in words."""
    dropped = sum(line["dropped"].values())
    reply = line["reply_seconds_mean"]
    return (
        f"line {line['name']}: {line['way']} {line['where']}, {'up' if line['up'] else 'no client connected'}, "
        f"{line['baud']} bit/s, {line['telegrams_received']} telegrams received, {line['telegrams_sent']} sent"
        + (f", {dropped} wrong" if dropped else "")
        + (f", {line['answers_withheld']} answers withheld as too late" if line["answers_withheld"] else "")
        + (f", answers after {seconds(reply)}" if reply is not None else "")
    )


def _controller(drive: dict[str, Any]) -> str:
    controller = drive["controller"]
    return f"{controller['name']} {controller['ip']}".strip() if controller else "-"


def _fault_text(fault: dict[str, Any]) -> str:
    return f"F{fault['number']} {fault['name']}".strip()


def _last_fault(drive: dict[str, Any]) -> str:
    fault = drive["fault"] or drive["last_fault"]
    if fault is None:
        return "-"
    return _fault_text(fault) + (" (active)" if drive["fault"] else "")


def _one(drive: dict[str, Any]) -> None:
    from pnfarm.farm.views.discard_texts import discard_text

    controller = drive.pop("controller_record")
    events = drive.pop("events", [])
    discards = drive.get("frames_discarded") or {}
    details = drive.get("details") or {}
    relations, ignored = details.pop("connections", []), details.pop("ignored_records", [])
    rows = [(key.replace("_", " "), _cell(key, value)) for key, value in drive.items() if key != "frames_discarded"]
    place = next((n for n, row in enumerate(rows) if row[0] == "frames received"), len(rows) - 1) + 1
    if "frames_discarded" in drive:
        rows[place:place] = [("frames discarded", number(sum(discards.values())))]
    if ignored:
        rows.append(("isochronous", f"asked for ({', '.join(ignored)}) and ignored: RT without the clock"))
    print_table(("FIELD", "~VALUE"), rows)
    if discards:
        most = sorted(discards.items(), key=lambda entry: (-entry[1], entry[0]))
        table = [(number(count), reason, discard_text(reason)) for reason, count in most]
        print_section((">DISCARDED", "REASON", "~WHAT IT MEANS"), table)
    print_connections(relations, "drive")
    print_section(("CONTROLLER DID", "~VALUE"), _controller_rows(controller))
    if events:
        print_line()
        for entry in events[-LAST_EVENTS:]:
            print_line(_event_line(entry))


def _controller_rows(record: dict[str, Any]) -> list[tuple[str, str]]:
    """What the controller did, and its newest start-up and reaction."""

    def mean(distribution: dict[str, Any]) -> str:
        value = distribution["mean_seconds"]
        return "-" if value is None else seconds(value)

    rows = [
        ("mean interval", mean(record["intervals"])),
        ("mean jitter", mean(record["jitter"])),
        ("missed updates", number(record["missed_updates"])),
        ("late frames", _cell("", record["late_frames"])),
        ("watchdog expirations", _cell("", record["watchdog_expirations"])),
        ("connects", f"{record['connects']} of {record['attempts']} attempts, {record['refused']} refused"),
    ]
    if record["start_ups"]:
        newest = record["start_ups"][-1]
        phases = ", ".join(f"{name} {seconds(t)}" for name, t in newest["phases"].items())
        back = newest["after_loss_seconds"]
        rows += [
            ("last start-up", phases or "-"),
            ("of", f"{newest['controller'] or '-'}, {newest['attempts']} attempts"),
            ("reconnected after", "-" if back is None else seconds(back)),
        ]
    if record["faults"]:
        fault = record["faults"][-1]
        bits = ", ".join(f"{bit['name']}={bit['value']} {seconds(bit['after_seconds'])}" for bit in fault["stw1"])
        done, reacted = fault["acknowledged_seconds"], fault["reaction_seconds"]
        rows += [
            ("last fault", f"F{fault['code']}, injected: {fault['kind']}"),
            ("enable withdrawn after", "-" if reacted is None else seconds(reacted)),
            ("STW1 after it", bits or "no change"),
            ("acknowledged after", "-" if done is None else seconds(done)),
        ]
    if record["sign_of_life"] is not None:
        rows.append(("sign of life", _cell("", record["sign_of_life"])))
    return rows


def _cell(key: str, value: Any) -> str:
    match value:
        case None:
            return "-"
        case bool():
            return "yes" if value else "no"
        case float() if key.endswith(("seconds", "seconds_ago")):
            return seconds(value)
        case float():
            return f"{value:.6g}"
        case {"number": _, "name": _}:
            return _fault_text(value)
        case {"port_id": _, "chassis": _}:
            where = " ".join(word for word in (value["mac"], value["ip"]) if word)
            return f"{value['station']} {value['port_id']} ({where}) at {value['port']}"
        case dict():
            return ", ".join(f"{name} {inner}" for name, inner in value.items()) or "-"
        case list():
            return ", ".join(_cell("", item) for item in value) or "-"
        case _:
            return str(value)
