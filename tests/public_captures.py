"""``python -m tests.public_captures --out FOLDER``: public captures, and what ``pnfarm import`` makes of them.

The files are others' and stay out of this repository: ``cli/captures_public.csv`` has repository, commit, path and
SHA-256 of each; captures that are in FOLDER besides are taken, too.  Each PROFINET device of a capture becomes a farm
in memory, and gets each start that its controllers made in the capture, octet for octet; each on EtherNet/IP is held
against its Forward_Opens.  A table says which was accepted, and what the farm's device refused; the comments of a farm
file promise the latter (a connection that a later one contradicts, a kind that the farm does not have).  The exit code
is 1 where a file could not be had, or a start was refused that the comments do not promise.
"""

from __future__ import annotations

import asyncio
import sys
from collections import Counter
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from tests.public_files import TESTS, run

if TYPE_CHECKING:
    from captured_controller import Start

    from pnfarm.buses.ethernetip.decode.observed import SeenOpening
    from pnfarm.buses.imports import FoundDevice
    from pnfarm.controller.line import VirtualLine

_CAPTURES = {".pcap", ".pcapng"}


def report(out: Path) -> int:
    """How many starts were refused for a reason that the import does not report."""
    sums = Counter[str]()
    files = sorted(one for one in out.iterdir() if one.suffix in _CAPTURES)
    for file in files:
        lines, counts = _of_file(file)
        sums += counts
        sys.stdout.write("\n".join((f"{file.name}: {_shown(counts)}", *(f"    {line}" for line in lines), "")))
    sys.stdout.write(f"{len(files)} captures: {_shown(sums)}\n")
    return sums["starts refused without a comment"]


def _shown(counts: Counter[str]) -> str:
    return ", ".join(f"{number} {what}" for what, number in counts.items()) or "nothing"


def _of_file(file: Path) -> tuple[list[str], Counter[str]]:
    from captured_controller import captured_starts

    from pnfarm.buses.imports import FoundDevice, FoundDrive
    from pnfarm.cli.import_inputs import read_inputs
    from pnfarm.errors import ConfigError

    try:
        found = read_inputs([file], [], [], file.parent, models=False).found
    except ConfigError as error:
        return [str(error)], Counter()
    lines, counts = [], Counter[str]()
    facts = " ".join(fact for one in found for fact in one.facts)
    for one in found:
        if not isinstance(one, FoundDevice):
            counts["drives" if isinstance(one, FoundDrive) else "other stations"] += 1
            continue
        counts["devices"] += 1
        if one.file.key == "eds":
            for opening in _openings(file, one.keys["ip"].partition("/")[0]):
                why = _refused_opening(one, opening)
                counts["starts refused without a comment" if why else "starts accepted"] += 1
                lines += [f"{one.name}: {why}"] if why else []
            continue
        mac = bytes.fromhex(one.keys["mac"].replace(":", ""))
        for start in captured_starts(file, mac):
            why = _refusal(one, start)
            promised = f"behind the interface of MAC {one.keys['mac']}" in facts or any(
                "refuses the Connect" in note or "by another, which counts" in note for note in one.notes
            )
            counts[
                "starts accepted" if not why else f"starts refused {'with' if promised else 'without'} a comment"
            ] += 1
            lines += [f"{one.name}, {len(start.calls)} calls: {why}"] if why else []
    return lines, counts


def _line(device: FoundDevice) -> VirtualLine:
    from pnfarm.controller.line import VirtualLine
    from pnfarm.farm.file.found import write_farm
    from pnfarm.farm.file.reading import parse_farm

    with TemporaryDirectory() as folder:
        made = write_farm([device], "public", "eth1", "public", Path(folder))
        for name, octets in made.files.items():
            (Path(folder) / name).write_bytes(octets)
        text = made.text.replace("kind: macvlan, parent: eth1", "kind: memory").replace("api: 127.0.0.1:8702", "")
        return asyncio.run(VirtualLine.create(parse_farm(text, Path(folder) / "public.pnfarm.yml")))


def _openings(file: Path, ip: str) -> list[SeenOpening]:
    from pnfarm.buses import registry
    from pnfarm.buses.ethernetip.bus import ETHERNETIP
    from pnfarm.captures.reading import FrameReader

    decoder = registry.decoder()
    ETHERNETIP.observe(decoder.buses["ethernetip"])
    for frame in FrameReader(file):
        decoder.feed(frame)
    observed = decoder.buses["ethernetip"].shared.observed
    return [opening for (_, device, *_), opening in observed.openings.items() if str(device) == ip]


def _refused_opening(device: FoundDevice, opening: SeenOpening) -> str:
    """Why a farm with this device alone does not take a captured Forward_Open; empty if it does."""
    from ipaddress import IPv4Address

    from pnfarm.protocols.enip.connection_check import Refusal, check_io, check_key, read_path
    from pnfarm.protocols.enip.status import GeneralStatus, status_text

    line = _line(device)
    try:
        kind = line.farm.stations[0].device.kind
        own, path = kind.described.sheet.key, read_path(opening.request.path)
        check_key(path.key, own)
        check_io(opening.request, path, kind.settings(own, IPv4Address("239.0.0.1")))
    except Refusal as refusal:
        return status_text(GeneralStatus(refusal.status), refusal.extended)
    finally:
        asyncio.run(line.close())
    return ""


def _refusal(device: FoundDevice, start: Start) -> str:
    """What a farm with this device alone did not take of a start; empty if it took all."""
    from captured_controller import CapturedController, differences

    line = _line(device)
    try:
        answer, statuses = CapturedController(line, None, line.farm.stations[0], start).start()
    except AssertionError as error:
        return str(error).partition("\n")[0]
    finally:
        asyncio.run(line.close())
    refused = sum(not status.ok for status in statuses)
    told = [f"{refused} of {len(statuses)} records refused"] if refused else []
    return "; ".join([*told, *(["modules differ"] if differences(answer) and not start.differs else [])])


if __name__ == "__main__":
    sys.exit(run("public_captures", __doc__ or "", TESTS / "cli" / "captures_public.csv", report))
