"""A page for each drive model: what it is, how it gets into a project, its telegrams, what it assumes.

Facts come from the model's data, the rest from ``drives/notes/MODEL.md``.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import assembly_types
import manual_coverage
from table_cell import cell

from pnfarm.buses.registry import BUSES
from pnfarm.drives.catalogue import model, models
from pnfarm.drives.description.as_json import as_json
from pnfarm.drives.profiles.cip.part import CIP
from pnfarm.vocabulary.durations import format_duration

__all__ = ["SHARED", "index", "page"]

NOTES = Path(__file__).resolve().parent / "drives" / "notes"
#: Bus -> the option of the farm file, the command that writes a description file, its kind.
FILES = {"profinet": ("gsdml", "GSDML"), "ethernetip": ("eds", "EDS"), "profibus": ("gsd", "GSD")}
#: Bus -> what a farm file says where a project holds the maker's file.
HELD = {
    "profinet": "`gsdml: FILE` of the drive; no ident has to be typed",
    "ethernetip": "put its idents under `identity:` of the drive",
    "profibus": "`gsd: FILE` of the drive; no ident has to be typed",
}
#: Parts of an identity that a project's file has, and their names here.
IDENTITY = {
    "vendor_id": "vendor", "device_id": "device or ident number", "device_type": "device type",
    "product_code": "product code", "product_name": "product name", "revision": "revision",
    "order_id": "order number", "station_type": "station type",
}  # fmt: skip
#: Models whose parameters and coverage are another's as well.
SHARED = {"moog-msd-dp": "moog-msd", "profidrive-dp": "profidrive"}


def _hexadecimal(number: int) -> str:
    return f"0x{number:04X}"


def _words(names: list[str | None]) -> str:
    """Names of process data; a signal of several words once."""
    shown: list[str] = []
    for name in names:
        if not shown or name is None or shown[-1] != name:
            shown.append(name or "-")
    return ", ".join(shown)


def _telegrams(described: dict[str, Any]) -> list[str]:
    telegrams = described["telegrams"]
    if not telegrams:
        return []
    lines = ["## Telegrams", ""]
    named = "identifiers" if telegrams[0].get("identifiers") else "module"
    lines += [
        f"| number | from the controller | to the controller | octets out / in | {named} |",
        "|---|---|---|---|---|",
    ]
    for one in telegrams:
        out, back = one["output"], one["input"]
        mapped = "mapped: parameters define the words"
        shown = (mapped, mapped) if one["free_mapping"] else (_words(out), _words(back))
        name = (one.get("identifiers") or f"0x{one['module_ident']:X}").upper().replace("0X", "0x")
        row = f"| {one['number']} | {cell(shown[0])} | {cell(shown[1])} | {2 * len(out)} / {2 * len(back)} |"
        lines.append(f"{row} `{name}` |")
    beside = [
        f"Supplementary telegram {one['number']} (`supplementary: {one['number']}`), submodule "
        f"`0x{one['submodule_ident']:X}` in subslot {one['subslot']} beside any of them: {_words(one['output'])} from "
        f"the controller, {_words(one['input'])} to it ({_told(one)})."
        for one in described["supplements"]
    ]
    lines += ["", *beside] if beside else []
    told = f"The drive starts with telegram {described['default_telegram']}, and takes what the controller plugs or its"
    more = "parameters select; `telegram:` of a drive in the farm file names another one."
    return [*lines, "", told, more, "", *_sources(described)]


def _sources(described: dict[str, Any]) -> list[str]:
    """Where the telegrams and their words come from, and the bits by name."""
    lines = ["| telegram | source |", "|---:|---|"]
    lines += [f"| {one['number']} | {_told(one)} |" for one in described["telegrams"]]
    lines += ["", "| word | bits | source | names of its bits, from 0 |", "|---|---:|---|---|"]
    for one in described["signals"]:
        words = [bits for bits in described["bits"] if bits["word"] == one["name"]]
        names = "; ".join(
            f"{'in ' + ', '.join(map(str, bits['telegrams'])) + ': ' if bits['telegrams'] else ''}"
            + ", ".join(f"{bit} {name}" for bit, name in enumerate(bits["names"]) if name)
            for bits in words
        )
        lines.append(f"| {one['name']} | {one['bits']} | {_told(one)} | {cell(names)} |")
    return [*lines, ""]


def _told(fact: dict[str, Any]) -> str:
    """A source and its note."""
    return cell(" ".join(filter(None, (fact["source"], f"({fact['note']})" if fact["note"] else ""))))


def _identity(described: dict[str, Any]) -> list[str]:
    facts = described.get("bus_facts") or {}
    # a drive on EtherNet/IP has its identity among the facts of its bus
    identity = described["identity"] or {key: facts[key]["value"] for key in IDENTITY if key in facts}
    sources = identity.get("sources", facts)
    lines = [
        "## Identity",
        "",
        "What a project's description file must agree with; `assumed` where it is in the maker's file only.",
        "",
        "| | value | source |",
        "|---|---|---|",
    ]
    for key, title in IDENTITY.items():
        if key not in identity:
            continue
        value = identity[key]
        source = sources.get(key, {})
        told = _told({"source": "", "note": ""} | source)
        if isinstance(value, int):
            shown = f"`{_hexadecimal(value)}` ({value})"
        else:
            shown = f"`{'.'.join(map(str, value))}`" if isinstance(value, list | tuple) else f"`{value}`"
        lines.append(f"| {title} | {shown} | {told} |")
    dap = described.get("dap")
    if dap:
        lines.append(f"| access point, module ident | `0x{dap['module_ident']:X}` | {cell(dap['module_source'])} |")
    return [*lines, ""]


def _limits(described: dict[str, Any]) -> list[str]:
    limits = described["limits"]
    lines = ["## Limits", ""]
    if described["bus"] != "profibus":
        lines.append(f"- Shortest cycle: {format_duration(limits['min_cycle_ns'])}; `limits: lax` takes any.")
    if limits["max_cycle_ns"]:
        lines.append(f"- Longest cycle: {format_duration(limits['max_cycle_ns'])}.")
    if described["bus"] == "profinet":
        lines.append(f"- Controllers at one drive: {limits['io_controllers']}. Ports: {limits['ports']}.")
        if limits["axes"] > 1:
            lines.append(f"- Axes on one connection (`axes:`): {limits['axes']}.")
    loss = described.get("communication_loss", {}).get("fault")
    if loss:
        number = loss["value"]
        shown = f"F{number}" if isinstance(number, int) else f"error {number}"
        lines.append(f"- Loss of the connection: {shown} ({cell(loss['source'])}).")
    return [*lines, ""]


def page(name: str) -> str:
    """The page of a model."""
    described = as_json(model(name))
    bus = described["bus"]
    command, kind = FILES[bus]
    parameters = SHARED.get(name, name)
    manual = parameters in manual_coverage.MANUALS
    covered = f" [coverage of its manual](../coverage.md#{parameters})," if manual else ""
    lines = [
        f"# {described['title']}",
        "",
        "Generated by `python docs/build.py` from the model's data and `docs/drives/notes/`.",
        "",
        f"`model: {name}` in a farm file; also {', '.join(f'`{alias}`' for alias in described['aliases'])}.",
        f"After {described['manual']}, {described['edition']}. Bus: {BUSES[bus].title}.",
        "",
        f"Its [parameters](../parameters/{parameters}.md),{covered}",
        f"[what the manual leaves open](../behaviour.md#{name}).",
        "",
        (NOTES / f"{name}.md").read_text(encoding="utf-8").strip(),
        "",
        f"## {kind} file",
        "",
        f"A project that holds the maker's file: {HELD[bus]}.",
        "A project of your own may use the file that pnfarm writes, whose idents are the model's:",
        "",
        f"    pnfarm {command} {name} -o .",
        "",
        "[Tool by tool](index.md#engineering-tools) describes where to install it.",
        "",
        *_telegrams(described),
        *(assembly_types.lines(model(name)) if model(name).profile == CIP else []),
        *_identity(described),
        *_limits(described),
    ]
    return "\n".join(lines)


def index() -> str:
    """The page about all of them."""
    lines = [
        "# The drives",
        "",
        "Generated by `python docs/build.py` from the models' data and `docs/drives/notes/index.md`.",
        "",
        "| model | bus | after | telegrams |",
        "|---|---|---|---|",
    ]
    for name in sorted(models()):
        described = as_json(model(name))
        numbers = [str(one["number"]) for one in described["telegrams"]]
        shown = ", ".join(numbers) if len(numbers) < 12 else f"{', '.join(numbers[:7])} ... {numbers[-1]}"
        lines.append(
            f"| [`{name}`]({name}.md) | {BUSES[described['bus']].title} | {cell(described['manual'])}, "
            f"{cell(described['edition'])} | {shown or 'assemblies 101 and 102'} |"
        )
    lines += ["", (NOTES / "index.md").read_text(encoding="utf-8").strip(), ""]
    return "\n".join(lines)
