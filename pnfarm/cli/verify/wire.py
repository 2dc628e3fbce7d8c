"""The parts of ``pnfarm verify`` that need a network of their own: ``python -m pnfarm.cli.verify.wire [--no-limits]``.

A process of its own, because it enters a private namespace before any thread exists.  Says on standard error what it
does, and prints JSON (:class:`.report.Answer`): a line with the known farm's part, then one with the limits as well.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from typing import TYPE_CHECKING

from pnfarm.cli.errors import report
from pnfarm.cli.verify.report import Answer
from pnfarm.errors import EnvironmentError_, PnfarmError
from pnfarm.links.kernel.private_line import create_cable, enter_private_line

if TYPE_CHECKING:
    from pnfarm.cli.verify.report import CycleFigures, Part

__all__ = ["main"]

# The imports inside the functions come late on purpose: a namespace is entered before anything may start a thread.

#: The cable of known/wire.pnfarm.yml.
NEAR, FAR = "pnverify0", "pnverify1"
NO_LIMITS = "--no-limits"


def main() -> int:
    """See the module's docstring."""
    sys.stderr.write("wire: the known farm over a veth pair, in real time\n")
    try:
        enter_private_line(NEAR, FAR)
        create_cable(NEAR, FAR)
        part = _known_farm()
    except EnvironmentError_ as exc:
        _print(Answer(left_out=[f"wire and shortest cycle: {exc}"]))
        return 0
    except PnfarmError as exc:
        return report(exc)
    except KeyboardInterrupt:
        # the command, which gets the signal too, reports it
        return 130
    _print(Answer(part=part))
    if NO_LIMITS not in sys.argv:
        try:
            cycles, left_out = _cycles()
        except (PnfarmError, OSError, subprocess.SubprocessError) as exc:
            cycles, left_out = [], [f"shortest cycle: {exc}"]
        _print(Answer(part=part, cycles=cycles, left_out=left_out))
    return 0


def _print(answer: Answer) -> None:
    sys.stdout.write(answer.model_dump_json() + "\n")
    sys.stdout.flush()


def _known_farm() -> Part:
    import anyio

    from pnfarm.cli.verify.run import on_wire
    from pnfarm.links.serial.eager_loop import LOOKING

    return anyio.run(on_wire, backend_options=LOOKING)


def _cycles() -> tuple[list[CycleFigures], list[str]]:
    from pnfarm.bench.line import FARM_CPU, PEER_CPU
    from pnfarm.cli.verify.limits import cycle_figures

    if not {FARM_CPU, PEER_CPU} <= os.sched_getaffinity(0):
        raise EnvironmentError_(f"farm and controller need a processor each, {FARM_CPU} and {PEER_CPU}")
    sys.stderr.write("limits: the shortest cycle that this machine holds\n")
    return cycle_figures(time.monotonic)


if __name__ == "__main__":
    sys.exit(main())
