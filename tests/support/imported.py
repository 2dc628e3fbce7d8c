"""The farm file of what was found, and what it has to keep."""

from pathlib import Path
from tempfile import TemporaryDirectory

from pnfarm.farm.file.found import write_farm
from pnfarm.farm.file.reading import expand_all, load_farm, parse_farm


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
    # a long name goes on in the next line
    comments = "".join(made.text.replace("#", " ").split())
    for line in made.left_out:
        assert "".join(line.partition(": ")[2].replace("#", " ").split())[:50] in comments, line
    return made


def importing(pnfarm, file, write):
    """A function that writes a project of these parts into ``file``, and imports it beside it.

    It returns the result of the command, and the farm file.
    """
    out = file.with_suffix(".pnfarm.yml")

    def run(*parts, options=(), **more):
        file.write_text(write(*parts, **more), encoding="utf-8")
        return pnfarm("import", file, "-o", out, "--force", *options), out

    return run


def groups(out):
    """The devices of a farm file, by name."""
    return {group.name: group for group in load_farm(out).devices}


def comments(out):
    """The text of a farm file without the marks of its comments, in one line."""
    return " ".join(out.read_text().replace("#", " ").split())
