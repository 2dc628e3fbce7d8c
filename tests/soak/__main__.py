"""``python -m tests.soak``: hours of random faults over a cell of drives of all models, devices and a plant.

Nothing is to grow, every station to come back, no fault, task or table row to be left, and the event streams to be
complete. In real time farms, controllers and a hub are the programs that a user starts, in a network namespace of
their own; with ``--virtual`` everything is one process in virtual time, and the same seed makes the same run.
The exit code is 0 if everything held, 1 if not, 2 for a wrong argument or another soak's file, 3 where the machine let
the farm not run, 4 where it permits no namespace, 130 if it was interrupted.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from pnfarm.vocabulary.durations import parse_duration

#: Of the real time's run.  Few drives and many faults: the logs, which have an end, are full before growth is judged.
DRIVES, RATE = 24, 6.0
#: Of the run in virtual time, which is one process.
VIRTUAL_DRIVES = 8
ROOT = Path(__file__).resolve().parents[2]
STATE = ROOT / "build" / "soak.json"
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


def _seconds(text: str) -> float:
    return parse_duration(text) / 1e9


def _options(arguments: list[str] | None = None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tests.soak", description=(__doc__ or "").partition("\n")[0])
    parser.add_argument(
        "--hours", type=_positive, default=8.0, help="how long (default: 8); of virtual time with --virtual"
    )
    parser.add_argument(
        "--state", type=Path, metavar="FILE", default=STATE,
        help="what was done so far; the same command goes on with it (default: build/soak.json)",
    )  # fmt: skip
    parser.add_argument(
        "--piece", type=_seconds, metavar="TIME", default=7200.0, help="length of one piece (default: 2h)"
    )
    parser.add_argument(
        "--for", type=_seconds, metavar="TIME", dest="during", help="stop behind this time, such as 30min"
    )
    parser.add_argument("--report", type=Path, metavar="FILE", help="write the page of what --state has, and end")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument(
        "--drives", type=_drives, default=None,
        help=f"drives of the makers' models on PROFINET, 1 to 200 (default: {DRIVES}; {VIRTUAL_DRIVES} with --virtual);"
        " from 8 on, the other buses, a drive system, devices and a plant come with them",
    )  # fmt: skip
    parser.add_argument("--rate", type=_positive, default=RATE, help=f"actions a second (default: {RATE:g})")
    parser.add_argument("--link", choices=("veth", "macvlan"), default="veth", help="in real time (default: veth)")
    parser.add_argument("--virtual", action="store_true", help="one process, in virtual time")
    parser.add_argument(
        "--out", type=Path, metavar="FILE", help="one piece of --hours alone: its report as JSON, with all samples"
    )
    options = parser.parse_args(arguments)
    if options.drives is None:
        options.drives = VIRTUAL_DRIVES if options.virtual else DRIVES
    return options


def main() -> int:
    options = _options()
    if options.out is None:
        from tests.soak import pieces

        return pieces.main(options)
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
