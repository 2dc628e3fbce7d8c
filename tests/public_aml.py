"""``python -m tests.public_aml --out FOLDER``: public projects (CAx data, SIMATIC AX), and what is made of them.

The files are others' and stay out of this repository: ``cli/aml_public.csv`` has repository, commit, path and SHA-256
of each, with those GSDML files of their devices that are public.  A farm file is made of each project, and read; the
built-in controller brings its devices to data exchange, in memory: as a farm file's, and as ``plc --project`` reads the
project.  A table says how many stations a project has besides its PLCs, how many became drives and
devices, how many lack a file, and how many did not exchange data, of each controller.  The exit code is 1 where a file
could not be had, or a device did not exchange data.
"""

from __future__ import annotations

import re
import sys
from collections import Counter
from ipaddress import ip_interface, ip_network
from pathlib import Path

from tests.public_files import TESTS, run

#: Drives and devices that the built-in controller did not bring to data exchange, by the farm file and by the project.
_SILENT = "silent by the farm file", "silent by the project"
#: Where the built-in controller is if no station of a project has an address.
_ANY = ip_network("10.77.0.0/24")


def report(out: Path) -> int:
    """How many drives and devices of the projects do not exchange data."""
    library = out / "library"
    library.mkdir(exist_ok=True)
    projects = []
    for path in sorted(one for one in out.iterdir() if one.is_file()):
        begin, _, name = path.name.partition("-")
        if not re.fullmatch("[0-9a-f]{8}", begin):
            # not fetched: a file of somebody's own
            continue
        if name.lower().startswith("gsdml-"):
            (library / name).write_bytes(path.read_bytes())
        else:
            projects.append(path)
    rows = {path.name: _counts(path, library) for path in projects}
    sums = sum(rows.values(), Counter[str]())
    heads = ("stations", "drives", "devices", "signals by tags", "lacking a file", "left out in part", *_SILENT)
    sys.stdout.write(f"| project | {' | '.join(heads)} |\n|---|{'---|' * len(heads)}\n")
    for name, counts in [*rows.items(), (f"{len(rows)} projects", sums)]:
        sys.stdout.write(f"| {name} | {' | '.join(str(counts[head]) for head in heads)} |\n")
    return sum(sums[one] for one in _SILENT)


def _counts(path: Path, library: Path) -> Counter[str]:
    from project_line import running

    from pnfarm.buses.imports import FoundStation
    from pnfarm.buses.projects.description_folders import DescriptionFolders
    from pnfarm.cli.projects.file import read_project
    from pnfarm.farm.file.found import write_farm
    from pnfarm.testing import Line

    buses, project = read_project(path)
    found = [one for bus in buses for one in bus.of_project(project, DescriptionFolders([library], library), library)]
    made = write_farm(found, "project", "eth1", path.name, library)
    lacking = sum(isinstance(one, FoundStation) and bool(one.missing) for one in found)
    played = [*made.drives, *made.devices]
    counts = Counter({
        "stations": len(played) + lacking, "drives": len(made.drives), "devices": len(made.devices),
        "signals by tags": sum(len(one.keys.get("signals", ())) for one in made.devices),
        "lacking a file": lacking, "left out in part": len(made.left_out),
    })  # fmt: skip
    if played:
        network = next((ip_interface(one.keys["ip"]).network for one in played if "ip" in one.keys), _ANY)
        plc = f"{network.broadcast_address - 1}/{network.prefixlen}"
        file = library / f"{path.stem}.pnfarm.yml"
        text = made.text.replace("kind: macvlan, parent: eth1", "kind: memory")
        file.write_text(f"{text}controller: {{name: public-plc, ip: {plc}}}\n", encoding="utf-8")
        with Line.from_file(file) as line:
            line.run(10)
            exchanging = [line.core.station(one.name).device.connection().exchanging for one in played]
        counts[_SILENT[0]] = exchanging.count(False)
        file.write_text(made.text, encoding="utf-8")
        with running(path, file, [library], seconds=10) as (controllers, _, _):
            rows = controllers.snapshot()
        ran = sum(row["state"] == "DATA" and not row["unusable"] and not row["alarms_received"] for row in rows)
        counts[_SILENT[1]] = len(played) - ran
    return counts


if __name__ == "__main__":
    sys.exit(run("public_aml", __doc__ or "", TESTS / "cli" / "aml_public.csv", report))
