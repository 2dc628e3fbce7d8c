"""What a terminal shows while something takes long, and that a pipe shows nothing of it."""

import os
import pty
import subprocess
import sys

PROGRAM = """
from pnfarm.terminal.working import working
with working("reading") as show:
    for n in range(3):
        show(f"part {n + 1}")
print("done")
"""


def test_a_pipe_shows_nothing_of_what_is_under_way():
    run = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=True, timeout=60)
    assert (run.stdout, run.stderr) == ("done\n", "")


def test_a_terminal_shows_what_is_under_way_and_how_far():
    near, far = pty.openpty()
    try:
        subprocess.run(
            [sys.executable, "-c", PROGRAM], stdout=subprocess.PIPE, stderr=far, check=True, timeout=60,
            env={**os.environ, "TERM": "xterm", "COLUMNS": "100"},
        )  # fmt: skip
        shown = os.read(near, 65536).decode()
    finally:
        os.close(near)
        os.close(far)
    assert "reading: part 2" in shown
    assert "reading: part 3" in shown
