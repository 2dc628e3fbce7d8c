"""``python -m tests.swarm``: a farm in shards behind a hub, in virtual time: start, a storm of faults, a lost shard.

The exit code is 0 if everything held, 1 if not.  A thousand drives take a minute.
"""

from __future__ import annotations

import argparse
import resource
import sys
import time
from dataclasses import asdict
from pathlib import Path

import structlog

sys.path.insert(0, str(Path(__file__).resolve().parent / "support"))


def main() -> int:
    from swarm_world import SwarmWorld, simulate

    parser = argparse.ArgumentParser(prog="python -m tests.swarm", description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--drives", type=int, default=1000, help="default: 1000")
    parser.add_argument("--shards", type=int, default=10, help="default: 10")
    parser.add_argument("--cycle", type=int, default=64, metavar="MS", help="of the controllers (default: 64)")
    parser.add_argument(
        "--faults", type=int, default=6, help="in the storm, each on a tenth of the drives (default: 6)"
    )
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    structlog.configure(wrapper_class=structlog.make_filtering_bound_logger(50))
    began = time.monotonic()
    report = simulate(
        SwarmWorld(options.drives, options.shards, cycle=options.cycle), faults=options.faults, seed=options.seed
    )
    for name, value in asdict(report).items():
        if name != "wrong":
            sys.stdout.write(f"{name.replace('_', ' ')}: {value:g}\n")
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    sys.stdout.write(f"took {time.monotonic() - began:.0f} s and {memory:.0f} MB\n")
    for sentence in report.wrong:
        sys.stdout.write(f"WRONG: {sentence}\n")
    return 1 if report.wrong else 0


if __name__ == "__main__":
    sys.exit(main())
