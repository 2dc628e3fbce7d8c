"""``python -m tests.public_aml --out FOLDER``: CAx data of public projects, and what ``pnfarm import`` makes of them.

The files are others' and stay out of this repository: ``cli/aml_public.csv`` has repository, commit, path and SHA-256
of each, with those GSDML files of their devices that are public.  A farm file is made of each project, and read; the
built-in controller brings its devices to data exchange, in memory.  A table says how many stations a project has, how
many became drives and devices, how many lack a file, and how many did not exchange data.  The exit code is 1 where a
file could not be had, or a device did not exchange data.
"""

from __future__ import annotations

import sys
from collections import Counter
from ipaddress import ip_interface, ip_network
from pathlib import Path

from tests.public_files import TESTS, run

#: Where the built-in controller is if no station of a project has an address.
_ANY = ip_network("10.77.0.0/24")


def report(out: Path) -> int:
    """How many drives and devices of the projects do not exchange data."""
    library = out / "library"
    library.mkdir(exist_ok=True)
    projects = []
    for path in sorted(one for one in out.iterdir() if one.is_file()):
        name = path.name.partition("-")[2]
        if name.lower().startswith("gsdml-"):
            (library / name).write_bytes(path.read_bytes())
        else:
            projects.append(path)
    sums = Counter[str]()
    for path in projects:
        counts = _counts(path, library)
        sums += counts
        sys.stdout.write(f"{path.name}: {', '.join(f'{number} {what}' for what, number in counts.items())}\n")
    sys.stdout.write(f"{len(projects)} projects: {', '.join(f'{number} {what}' for what, number in sums.items())}\n")
    return sums["without data exchange"]


def _counts(path: Path, library: Path) -> Counter[str]:
    from pnfarm.buses.imports import FoundStation
    from pnfarm.buses.profinet.project.stations import of_project
    from pnfarm.buses.projects.caex import parse_caex
    from pnfarm.buses.projects.description_folders import DescriptionFolders
    from pnfarm.farm.file.found import write_farm
    from pnfarm.testing import Line

    found = list(of_project(parse_caex(path.read_bytes()), DescriptionFolders([library], library), library))
    made = write_farm(found, "project", "eth1", path.name, library)
    lacking = sum(isinstance(one, FoundStation) and bool(one.missing) for one in found)
    counts = Counter({
        "stations": len(found), "drives": len(made.drives), "devices": len(made.devices),
        "signals by tags": sum(len(one.keys.get("signals", ())) for one in made.devices),
        "lacking a file": lacking, "left out in part": len(made.left_out), "without data exchange": 0,
    })  # fmt: skip
    played = [*made.drives, *made.devices]
    if played:
        network = next((ip_interface(one.keys["ip"]).network for one in played if "ip" in one.keys), _ANY)
        plc = f"{network.broadcast_address - 1}/{network.prefixlen}"
        file = library / f"{path.stem}.pnfarm.yml"
        text = made.text.replace("kind: macvlan, parent: eth1", "kind: memory")
        file.write_text(f"{text}controller: {{name: public-plc, ip: {plc}}}\n", encoding="utf-8")
        with Line.from_file(file) as line:
            line.run(10)
            exchanging = [line.core.station(one.name).device.connection().exchanging for one in played]
        counts["without data exchange"] = exchanging.count(False)
    return counts


if __name__ == "__main__":
    sys.exit(run("public_aml", __doc__ or "", TESTS / "cli" / "aml_public.csv", report))
