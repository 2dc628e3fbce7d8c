"""``python -m tests.soak``: hours of random faults over drives of all models with the built-in controller.

Memory is to stay flat, every drive to come back, no fault, task or table row to be left, and the event stream to be
complete. In real time the farm and the controller are the programs that a user starts, in a network namespace of
their own; with ``--virtual`` everything is one process in virtual time, and the same seed makes the same run.
The exit code is 0 if everything held, 1 if not, 2 for a wrong argument, 4 where the machine permits no namespace.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "tests" / "support"), str(ROOT / "tests" / "faults")]


def _positive(text: str) -> float:
    value = float(text)
    if not 0 < value < 1e6:
        raise ValueError(text)
    return value


def _drives(text: str) -> int:
    value = int(text)
    if not 1 <= value <= 200:
        raise ValueError(text)
    return value


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.soak", description=(__doc__ or "").partition("\n")[0])
    parser.add_argument(
        "--hours", type=_positive, default=2.0, help="how long (default: 2); of virtual time with --virtual"
    )
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--drives", type=_drives, default=None, help="1 to 200 (default: 64; 8 with --virtual)")
    parser.add_argument("--rate", type=_positive, default=1.5, help="actions a second (default: 1.5)")
    parser.add_argument("--link", choices=("veth", "macvlan"), default="veth", help="in real time (default: veth)")
    parser.add_argument("--virtual", action="store_true", help="one process, in virtual time")
    parser.add_argument("--out", type=Path, metavar="FILE", help="a report as JSON, with all samples")
    options = parser.parse_args()
    if options.drives is None:
        options.drives = 8 if options.virtual else 64
    if options.virtual:
        from tests.soak import virtual

        return virtual.main(options)
    # before anything starts a thread: namespaces belong to threads
    from pnfarm.errors import EnvironmentError_
    from pnfarm.links.kernel.sandbox import enter_sandbox

    try:
        enter_sandbox()
    except EnvironmentError_ as exc:
        sys.stderr.write(f"tests.soak: {exc}\n")
        return 4
    from tests.soak import real

    return real.main(options)


if __name__ == "__main__":
    sys.exit(main())
