"""The farm file of what was found, and what it has to keep."""

from __future__ import annotations

from pathlib import Path

from pnfarm.buses.imports import FoundDrive, FoundStation
from pnfarm.farm.file.found import write_farm
from pnfarm.farm.file.reading import expand, parse_farm


def farm_text(drives, others, name="any", parent="eth1", source="any.pcapng", folder=Path("/nowhere")):
    return write_farm(drives, others, name, parent, source, folder).text


def check_found(found, folder=Path("/nowhere")):
    """The farm file can be read, has every drive that it promises, and says what it has not."""
    found = list(found)
    drives = [one for one in found if isinstance(one, FoundDrive)]
    others = [one for one in found if isinstance(one, FoundStation)]
    made = write_farm(drives, others, "any", "eth1", "any.pcapng", folder)
    assert len(made.drives) + len(made.others) == len(found)
    if made.drives:
        assert len(expand(parse_farm(made.text, folder / "any.pnfarm.yml"))) == len(made.drives)
    comments = " ".join(made.text.replace("#", " ").split())
    for line in made.left_out:
        assert " ".join(line.partition(": ")[2].replace("#", " ").split())[:50] in comments, line
    return made
