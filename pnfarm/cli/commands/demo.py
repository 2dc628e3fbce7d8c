"""``pnfarm demo``: a farm, a controller, a fault of each family and a scenario, on any Linux machine without a PLC.

It runs in a network of its own: as an ordinary user in a user, network and mount namespace, as root in a network
namespace.  Where the machine permits neither, it runs in memory, paced by the real clock, and says so.
"""

from __future__ import annotations

import json
import os
import tempfile
import time
from functools import partial
from ipaddress import IPv4Address, IPv4Interface
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pnfarm.errors import EnvironmentError_
from pnfarm.farm.process.address_space import ENGINE, require_address_space
from pnfarm.terminal.streams import going_on_unread

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

__all__ = ["command"]

#: A drive drops the connection after 32 cycles without a frame, 128 ms with the shortest cycle of 4 ms: a machine
#: may stall for tens of milliseconds, and no connection may be lost by that.
FILE = """
farm: demo
link: {link}
api: off
drives:{groups}
controller:
  name: plc
  ip: 10.77.255.1/16
  {where}
  cycle: 16ms
  watchdog_factor: 32
  program: {{kind: sine, speed_rpm: 600, period: 4s, acknowledge_after: 500ms}}
  reconnect: {{after: 200ms}}{scanner}{master}
"""
#: The controller's other half, for the drives on EtherNet/IP.
SCANNER = """
  ethernetip: {{ip: {ip}, {where}, timeout_multiplier: 16}}"""
SCANNER_IP = IPv4Interface("10.77.255.2/16")
#: And for those on PROFIBUS.  Both ends are in this event loop, and a worker of the kernel carries the octets of a pty:
#: beside a disk that is written to it was seen to rest for 600 ms.
MASTER = """
  profibus: {cycle: 10ms, watchdog: 3s, latency: 700ms, retries: 3}"""
GROUP = """
  - name: axis-{{n:02}}
    start: {first}
    count: {count}
    model: {model}
    {place}
    {pace}
    load: {{inertia: 2.0e-4, friction: 0.05}}"""
#: The model of the scanner, and the one that has a line in place of a network.
ON_IP, ON_LINE, FIRST_ADDRESS = "akd-ethernetip", "moog-msd-dp", 11
#: Models beside the AKD, each with a cycle that its manual allows; each gets one drive in eight, and one of fewer.
OTHERS = (
    ("akd-profinet-2012", "cycle: 8ms"),
    ("hiwin-e1", "cycle: 4ms"),
    ("moog-msd", "cycle: 4ms"),
    (ON_IP, "rpi: 10ms"),
    (ON_LINE, ""),
)
PARENT, PEER = "pndemo0", "pndemo1"


@going_on_unread()
def command(
    drives: Annotated[int, typer.Option(min=1, max=256, help="Number of virtual drives.")] = 8,
    seconds: Annotated[float, typer.Option(min=1.0, help="Minimum run time.")] = 12.0,
    json_file: Annotated[
        Path | None, typer.Option("--json", metavar="FILE", help="Write the summary to this file as JSON.")
    ] = None,
    svg_file: Annotated[
        Path | None, typer.Option("--svg", metavar="FILE", help="Write a picture of the table to this file.")
    ] = None,
    pcap: Annotated[
        Path | None,
        typer.Option("--pcap", metavar="FILE", help="Capture all frames of the drives to this pcapng file."),
    ] = None,
    html: Annotated[
        Path | None,
        typer.Option(
            "--html", metavar="FILE", help="Write the scenario's report to this file.", show_default="a temporary file"
        ),
    ] = None,
) -> None:
    """Run a demo farm: drives, a controller, a fault of each family and the recovery, and a scenario with its verdict.

    Needs no root and no PLC.
    """
    from pnfarm.cli.commands.run import check_writable

    require_address_space(ENGINE)
    for file in filter(None, (json_file, svg_file, pcap, html)):
        check_writable(file)
    where, why = _enter()
    _announce(where, why)
    # numpy and the engine start threads, so they are imported only after the namespace was entered
    import anyio

    from pnfarm.cli.demo.run import Demo
    from pnfarm.cli.running import compile_ahead
    from pnfarm.links.serial.eager_loop import LOOKING

    anyio.run(partial(compile_ahead, in_memory=where == "memory"))
    # the times that are shown do not include compilation
    begin = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="pnfarm-demo-") as folder:
        text = _text(drives, None if where == "memory" else Path(folder) / "line")
        demo = Demo(
            text, in_memory=where == "memory", seconds=seconds, begin=begin, picture=svg_file, pcap=pcap, report=html
        )
        summary: dict[str, Any] = anyio.run(demo.run, backend_options=LOOKING)
    if json_file is not None:
        json_file.write_text(json.dumps(summary, indent=1) + "\n", encoding="utf-8")
    if not summary["ok"]:
        raise typer.Exit(1)


def _text(drives: int, line: Path | None) -> str:
    """The farm file: in a network, with a pty named ``line``; in memory without."""
    from pnfarm.links.kernel.private_line import create_cable

    groups = _groups(drives)
    models = {model for model, _, _ in groups}
    scanner, master = SCANNER if ON_IP in models else "", MASTER if ON_LINE in models else ""
    if line is None:
        link, where, own = "{kind: memory}", "mac: auto", "mac: auto"
    else:
        create_cable(PARENT, PEER)
        own = f"mac: auto, link: {{kind: macvlan, parent: {PEER}}}"
        lines = f", lines: {{profibus: {{pty: '{line}'}}}}" if master else ""
        link, where = f"{{kind: macvlan, parent: {PARENT}{lines}}}", f"profinet: {{interface: {PEER}}}"
    text = "".join(_section(groups))
    return FILE.format(
        link=link, groups=text, where=where, scanner=scanner.format(ip=SCANNER_IP, where=own), master=master
    )


def _groups(drives: int) -> list[tuple[str, str, int]]:
    """Model, pace and number: one drive in eight of each of the others, if there is room for them, and AKDs first."""
    others = [(model, pace, max(1, drives // 8)) for model, pace in OTHERS[: drives - 1]]
    return [("akd-profinet", "cycle: 16ms", drives - sum(count for _, _, count in others)), *others]


def _section(groups: Sequence[tuple[str, str, int]]) -> Iterator[str]:
    first = 1
    for model, pace, count in groups:
        place = f"address: {FIRST_ADDRESS}" if model == ON_LINE else f"ip: {IPv4Address('10.77.0.10') + first}/16"
        yield GROUP.format(first=first, count=count, model=model, place=place, pace=pace)
        first += count


def _enter() -> tuple[str, str]:
    """Where the demo runs ("user", "root" or "memory"), and the reason if it is memory."""
    from pnfarm.links.kernel.private_line import enter_private_line

    if os.environ.get("PNFARM_DEMO_MEMORY") == "1":
        return "memory", "PNFARM_DEMO_MEMORY is set"
    try:
        return enter_private_line(PARENT, PEER).kind, ""
    except EnvironmentError_ as exc:
        return "memory", str(exc)


def _announce(where: str, why: str) -> None:
    if where == "memory":
        typer.echo(
            f"This machine does not permit a network namespace ({why}): the demo runs in memory, in real time.",
            err=True,
        )
    else:
        kind = "network namespace" if where == "root" else "user and network namespace"
        typer.echo(f"Running in a {kind} of its own: the network of this machine is not touched.", err=True)
