"""Python files of users that are none, or that nobody can compile."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from pnfarm.errors import ConfigError
from pnfarm.user_code.file import MAX_OCTETS, run_file


@pytest.mark.parametrize(
    ("content", "why"),
    [
        ("#" * (MAX_OCTETS + 1), f"has more than {MAX_OCTETS} octets"),
        ("-" * 100_000 + "1", "model.py:1: "),
        ("1" + "+1" * 100_000, "model.py:1: "),
    ],
)
def test_a_file_that_python_cannot_take_is_refused_with_a_sentence(content: str, why: str, tmp_path: Path):
    path = tmp_path / "model.py"
    path.write_text(content)
    with pytest.raises(ConfigError, match=why):
        run_file(path, "python")


def test_a_pipe_or_a_device_in_place_of_a_file_is_not_read(tmp_path: Path):
    os.mkfifo(tmp_path / "pipe")
    for path, what in ((Path("/dev/null"), "it is a device"), (tmp_path / "pipe", "it is a pipe")):
        with pytest.raises(ConfigError, match=f"cannot be read: {what}, not a regular file"):
            run_file(path, "python")
