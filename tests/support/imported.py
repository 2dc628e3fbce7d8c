"""The farm file of what was found, and what it has to keep."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

from pnfarm.farm.file.found import write_farm
from pnfarm.farm.file.reading import expand_all, parse_farm


def check_found(found, folder=Path("/nowhere")):
    """The farm file can be read, has every drive and device that it promises, and says what it has not."""
    found = list(found)
    made = write_farm(found, "any", "eth1", "any.pcapng", folder)
    played = [*made.drives, *made.devices]
    assert len(played) + len(made.others) == len(found)
    if played:
        with TemporaryDirectory() as own:
            # its description files, and those of the folder that it was made for
            for file in folder.iterdir() if folder.exists() else ():
                if file.is_file():
                    (Path(own) / file.name).write_bytes(file.read_bytes())
            for name, octets in made.files.items():
                (Path(own) / name).write_bytes(octets)
            assert len(expand_all(parse_farm(made.text, Path(own) / "any.pnfarm.yml"))) == len(played)
    comments = " ".join(made.text.replace("#", " ").split())
    for line in made.left_out:
        assert " ".join(line.partition(": ")[2].replace("#", " ").split())[:50] in comments, line
    return made
