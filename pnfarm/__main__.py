"""``python -m pnfarm`` is the program ``pnfarm``."""

from __future__ import annotations

from pnfarm.cli.main import run

if __name__ == "__main__":
    run()
