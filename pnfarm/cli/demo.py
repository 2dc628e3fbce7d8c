"""``pnfarm demo``: a farm, a controller, two faults and two recoveries, on any Linux machine, without a PLC.

It makes a network of its own: an ordinary user's user, network and mount namespace, or as root a private network
namespace.  Where a machine forbids both it runs in memory, paced by the real clock, and says so.
"""

from __future__ import annotations

import json
import os
import time
from ipaddress import IPv4Address
from pathlib import Path
from typing import Annotated, Any

import typer

from pnfarm.errors import EnvironmentError_
from pnfarm.farm.address_space import ENGINE, require_address_space

__all__ = ["command"]

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
  watchdog_factor: 6
  program: {{kind: sine, speed_rpm: 600, period: 4s, acknowledge_after: 500ms}}
  reconnect: {{after: 200ms}}
"""
GROUP = """
  - name: axis-{{n:02}}
    start: {first}
    count: {count}
    model: {model}
    ip: {ip}/16
    cycle: {cycle}
    load: {{inertia: 2.0e-4, friction: 0.05}}"""
#: Models beside the AKD, each with a cycle that its manual grants; one drive in eight is of each.
OTHERS = (("akd-profinet-2012", "8ms"), ("hiwin-e1", "4ms"), ("moog-msd", "4ms"))
PARENT, PEER = "pndemo0", "pndemo1"


def command(
    drives: Annotated[int, typer.Option(min=1, max=256, help="How many virtual drives.")] = 8,
    seconds: Annotated[float, typer.Option(min=1.0, help="How long it runs at least.")] = 12.0,
    json_file: Annotated[Path | None, typer.Option("--json", metavar="FILE", help="Write the summary as JSON.")] = None,
    svg_file: Annotated[
        Path | None, typer.Option("--svg", metavar="FILE", help="Write a picture of the table.")
    ] = None,
    pcap: Annotated[
        Path | None, typer.Option("--pcap", metavar="FILE", help="Capture all frames of the drives, pcapng.")
    ] = None,
) -> None:
    """Show a farm at work: drives, a controller, faults and recovery.  No root, no PLC."""
    require_address_space(ENGINE)
    for file in (json_file, svg_file, pcap):
        _check_writable(file)
    where, why = _enter()
    _announce(where, why)
    # numpy and the engine start threads, so they come only after the namespace was entered
    import anyio

    from pnfarm.cli.demo_run import Demo
    from pnfarm.cli.running import compile_ahead

    anyio.run(compile_ahead)
    # what is told of times is the farm's and the controller's, not the compiler's
    begin = time.monotonic()
    if where == "memory":
        text = FILE.format(link="{kind: memory}", groups=_groups(drives), where="mac: auto")
    else:
        _cable()
        link = f"{{kind: macvlan, parent: {PARENT}}}"
        text = FILE.format(link=link, groups=_groups(drives), where=f"interface: {PEER}")
    demo = Demo(text, in_memory=where == "memory", seconds=seconds, begin=begin, picture=svg_file, pcap=pcap)
    summary: dict[str, Any] = anyio.run(demo.run)
    if json_file is not None:
        json_file.write_text(json.dumps(summary, indent=1) + "\n", encoding="utf-8")
    if not summary["ok"]:
        raise typer.Exit(1)


def _groups(drives: int) -> str:
    """AKDs first, as the faults of the demo are theirs; then drives of every other model."""
    each = drives // 8
    groups, first = "", 1
    for model, cycle, count in (
        ("akd-profinet", "16ms", drives - each * len(OTHERS)),
        *((model, cycle, each) for model, cycle in OTHERS),
    ):
        if count:
            ip = IPv4Address("10.77.0.10") + first
            groups += GROUP.format(first=first, count=count, model=model, ip=ip, cycle=cycle)
            first += count
    return groups


def _check_writable(file: Path | None) -> None:
    """Before the demo runs, not after it.  Raises :class:`~pnfarm.errors.EnvironmentError_`."""
    if file is None:
        return
    if file.is_dir():
        raise EnvironmentError_(f"{file} cannot be written: it is a folder; give a file")
    if not os.access(file if file.exists() else file.parent, os.W_OK):
        why = "no permission" if file.parent.is_dir() else "its folder does not exist"
        raise EnvironmentError_(f"{file} cannot be written: {why}")


def _enter() -> tuple[str, str]:
    """Where the demo runs, "user", "root" or "memory", and why it is memory."""
    from pnfarm.links.sandbox import enter_sandbox

    if os.environ.get("PNFARM_DEMO_MEMORY") == "1":
        return "memory", "PNFARM_DEMO_MEMORY is set"
    try:
        sandbox = enter_sandbox()
        _try()
    except EnvironmentError_ as exc:
        return "memory", str(exc)
    return sandbox.kind, ""


def _try() -> None:
    """Whether this kernel lets us have what the demo needs: a cable, a macvlan on it, a raw socket."""
    from pnfarm.links import bpf
    from pnfarm.links.base import PortSpec
    from pnfarm.links.interfaces import Interfaces
    from pnfarm.links.packet import open_packet_socket
    from pnfarm.wire.ethernet import ETHERTYPE_PROFINET

    _cable()
    try:
        with Interfaces() as interfaces:
            (port,) = interfaces.create_macvlans("demo trial", PARENT, [PortSpec("trial", b"\x02\0\0\0\0\x01")])
        open_packet_socket(ETHERTYPE_PROFINET, bpf.ethertype_filter(port.index, port.index)).close()
    finally:
        # what stands on the cable goes with it
        _uncable()


def _announce(where: str, why: str) -> None:
    if where == "memory":
        typer.echo(
            f"This machine forbids a network of our own ({why}): the demo runs in memory, in real time.", err=True
        )
    else:
        kind = "private network namespace" if where == "root" else "user and network namespace of its own"
        typer.echo(f"Running in a {kind}: nothing of this machine's network is touched.", err=True)


def _cable() -> None:
    """A veth pair: the farm's macvlans on one end, the controller on the other."""
    from pnfarm.links.interfaces import Interfaces

    with Interfaces() as interfaces:
        interfaces.create_cable(PARENT, PEER)


def _uncable() -> None:
    from pnfarm.links.interfaces import Interfaces

    with Interfaces() as interfaces:
        interfaces.remove_cable(PARENT)
