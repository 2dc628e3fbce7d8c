"""What Wireshark reads in a capture, by its program tshark; a test is skipped where that is not installed."""

import subprocess

from tools import needed


def tshark(path, *arguments) -> str:
    needed("tshark")
    command = ["tshark", "-n", "-r", str(path), *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=120)
    assert done.returncode == 0, done.stderr
    return done.stdout


def tshark_fields(path, *names, where="", options=()) -> list[list[str]]:
    """A row for each frame, with one text per name; ``where`` is a display filter."""
    fields = [word for name in names for word in ("-e", name)]
    chosen = ["-Y", where] if where else []
    shown = tshark(path, *options, "-T", "fields", "-E", "separator=/t", *fields, *chosen)
    return [line.split("\t") for line in shown.splitlines()]
