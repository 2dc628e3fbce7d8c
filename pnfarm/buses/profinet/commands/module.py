"""``pnfarm module``: the modules in a drive's slots; pull and plug them while a controller is connected."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from pnfarm.buses.profinet.commands.device import IpOption, OwnOption, device_of
from pnfarm.terminal.numbers import LONG, WORD, number_of
from pnfarm.terminal.settings import (
    DEFAULT_URL,
    ApiOption,
    Format,
    FormatOption,
    TlsCaOption,
    TokenOption,
    help_without_command,
)

if TYPE_CHECKING:
    from pnfarm.buses.profinet.controller.module_client import DeviceModule
    from pnfarm.buses.profinet.controller.record_client import RecordClient
    from pnfarm.buses.profinet.controller.records import RecordPlace

__all__ = ["app"]

#: Of one answer: more than the modules of any device need.
MOST_OCTETS = 32_768

app = typer.Typer(help="Show, pull and plug a drive's modules.")
app.callback(invoke_without_command=True)(help_without_command)

Station = Annotated[
    str | None,
    typer.Argument(
        metavar="[NAME]",
        help="The drive of the running farm; with --interface, any device's station name.",
        show_default=False,
    ),
]
InterfaceOption = Annotated[
    str | None,
    typer.Option("--interface", "-i", metavar="IF", help="Ask a device on the wire, such as eth1, and not the farm."),
]
Drive = Annotated[str, typer.Argument(metavar="NAME", help="The drive.", show_default=False)]
Place = Annotated[
    str,
    typer.Argument(
        metavar="SLOT[.SUBSLOT]", help="A slot, or one submodule of it: 1, 1.2, 1.0x0002.", show_default=False
    ),
]
Slot = Annotated[
    int, typer.Argument(parser=number_of("slot", WORD), metavar="SLOT", help="The slot.", show_default=False)
]


@app.command("list")
def show(
    name: Station = None,
    interface: InterfaceOption = None,
    ip: IpOption = None,
    own_ip: OwnOption = None,
    output: FormatOption = Format.TABLE,
    api: ApiOption = DEFAULT_URL,
    token: TokenOption = None,
    tls_ca: TlsCaOption = None,
) -> None:
    """Show the modules in the slots of a drive of the running farm, or of any device on the wire."""
    from pnfarm.terminal.client import FarmClient

    if interface is not None:
        _print_device(interface, own_ip, device_of(name, ip, "NAME, --ip"), output)
        return
    if ip is not None or own_ip is not None:
        raise typer.BadParameter("is for a device on the wire, with --interface", param_hint="--ip, --own-ip")
    if name is None:
        raise typer.BadParameter("is needed: a drive's, or a device's with --interface", param_hint="NAME")
    with FarmClient(api, token, tls_ca) as farm:
        _print(farm.get("drives", name, "modules"), output)


@app.command("pull")
def pull(
    name: Drive,
    place: Place,
    output: FormatOption = Format.TABLE,
    api: ApiOption = DEFAULT_URL,
    token: TokenOption = None,
    tls_ca: TlsCaOption = None,
) -> None:
    """Pull a module or a submodule: its controller gets an alarm, its data are bad."""
    from pnfarm.terminal.client import FarmClient

    slot, subslot = _place(place)
    query = {} if subslot is None else {"subslot": subslot}
    with FarmClient(api, token, tls_ca) as farm:
        _print(farm.delete("drives", name, "modules", str(slot), query=query), output)


@app.command("plug")
def plug(
    name: Drive,
    slot: Slot,
    telegram: Annotated[int | None, typer.Option(metavar="N", help="The module of this telegram.")] = None,
    module: Annotated[
        int | None,
        typer.Option(
            parser=number_of("module ident", LONG),
            metavar="IDENT",
            help="A module of any ident, such as 0x12345678: a wrong one.",
        ),
    ] = None,
    substitute: Annotated[bool, typer.Option(help="It works in place of what the controller expects.")] = False,
    output: FormatOption = Format.TABLE,
    api: ApiOption = DEFAULT_URL,
    token: TokenOption = None,
    tls_ca: TlsCaOption = None,
) -> None:
    """Plug a module; without options the one that was pulled."""
    from pnfarm.terminal.client import FarmClient

    body: dict[str, Any] = {"substitute": substitute}
    if telegram is not None:
        body["telegram"] = telegram
    if module is not None:
        body["module_ident"] = module
    with FarmClient(api, token, tls_ca) as farm:
        found = farm.put("drives", name, "modules", str(slot), body=body)
    if not found["changed"]:
        typer.echo(f"slot {slot} of {name} holds this module already; nothing was plugged", err=True)
    _print(found, output)


def _place(text: str) -> tuple[int, int | None]:
    slot, dot, subslot = text.partition(".")
    return number_of("slot", WORD)(slot), number_of("subslot", WORD)(subslot) if dot else None


def _print(found: dict[str, Any], output: Format) -> None:
    from pnfarm.terminal.output import print_json, print_table

    if output is Format.JSON:
        print_json(found)
        return
    rows = []
    for module in found["modules"]:
        name = module["module_ident"] or "empty"
        if module["telegram"] is not None:
            name += f" (telegram {module['telegram']})"
        if module["substitute"]:
            name += " substitute"
        rows.append([str(module["slot"]), "", name, "", "", "held" if module["held"] else ""])
        for sub in module["submodules"]:
            octets = f"{sub['input_bytes']} in, {sub['output_bytes']} out"
            state = "awaits parameters" if sub["awaits_parameters"] else ""
            rows.append(["", sub["subslot"], sub["submodule_ident"], octets, sub["owner"] or "", state])
    print_table(("SLOT", "SUBSLOT", "IDENT", "OCTETS", "OWNER", ""), rows)


def _print_device(interface: str, own_ip: str | None, target: Any, output: Format) -> None:
    """The modules that a device reports, read without a connection."""
    from pnfarm.buses.profinet.commands.device import access_device
    from pnfarm.buses.profinet.controller.module_client import read_modules
    from pnfarm.buses.profinet.controller.record_client import RecordTask
    from pnfarm.terminal.output import print_json, print_table

    asking = read_modules()
    first = next(asking)
    found: tuple[DeviceModule, ...] = ()

    def more(client: RecordClient) -> RecordPlace | None:
        nonlocal found
        try:
            return asking.send(client)
        except StopIteration as end:
            found = end.value
            return None

    client = access_device(interface, own_ip, RecordTask(target, first, length=MOST_OCTETS, implicit=True), more)
    info = None if client.station is None else client.station.info
    if output is Format.JSON:
        print_json(
            {
                "name": None if info is None else info.name,
                "ip": None if info is None else str(info.ip),
                "modules": [_as_dict(module) for module in found],
            }
        )
        return
    rows = []
    for module in found:
        rows.append([str(module.slot), "", f"0x{module.ident:08X}", ""])
        rows += [
            ["", f"0x{s.subslot:04X}", f"0x{s.ident:08X}", f"0x{s.api:04X}" if s.api else ""] for s in module.submodules
        ]
    print_table(("SLOT", "SUBSLOT", "IDENT", "API"), rows)


def _as_dict(module: DeviceModule) -> dict[str, Any]:
    """Names and forms as those of a farm's drive."""
    return {
        "slot": module.slot,
        "module_ident": f"0x{module.ident:08X}",
        "submodules": [
            {"subslot": f"0x{s.subslot:04X}", "submodule_ident": f"0x{s.ident:08X}", "api": f"0x{s.api:04X}"}
            for s in module.submodules
        ],
    }
