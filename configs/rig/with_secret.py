"""Runs a command with a secret in its environment: ``with_secret.py NAME FILE COMMAND [ARGUMENT ...]``.

A Docker engine gives secrets as files; what PostgreSQL's client takes from the environment would otherwise stand in
the stack's file.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path


def main(arguments: list[str]) -> None:
    """Become the command; exit with 4 when the file cannot be read."""
    name, file, *command = arguments
    try:
        secret = Path(file).read_text("utf-8").strip()
    except OSError as error:
        sys.stderr.write(f"the secret {file} cannot be read: {error.strerror}\n")
        sys.exit(4)
    os.execvpe(command[0], command, {**os.environ, name: secret})  # noqa: S606 - no shell needed


if __name__ == "__main__":
    main(sys.argv[1:])
