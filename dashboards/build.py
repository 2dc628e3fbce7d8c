"""Makes the dashboards' JSON: ``python dashboards/build.py`` writes ``dashboards/json``; ``--check`` only compares."""

from __future__ import annotations

import json
import sys
from pathlib import Path

from farm_overview import farm_overview
from one_drive import one_drive

FOLDER = Path(__file__).resolve().parent / "json"


def render() -> dict[str, str]:
    """File name -> its text."""
    boards = {"farm-overview.json": farm_overview(), "one-drive.json": one_drive()}
    return {name: json.dumps(board, indent=2, ensure_ascii=False) + "\n" for name, board in boards.items()}


def main(arguments: list[str]) -> int:
    """Write the files, or with ``--check`` list those that are out of date."""
    stale = []
    for name, text in render().items():
        path = FOLDER / name
        if not path.is_file() or path.read_text(encoding="utf-8") != text:
            stale.append(name)
            if "--check" not in arguments:
                path.write_text(text, encoding="utf-8")
    sys.stdout.write(f"{', '.join(stale) or 'nothing'} {'is stale' if '--check' in arguments else 'written'}\n")
    return 1 if stale and "--check" in arguments else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
