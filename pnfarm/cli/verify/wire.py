"""The parts of ``pnfarm verify`` that need a network of their own: ``python -m pnfarm.cli.verify.wire [--no-limits]``.

A process of its own, because it enters a private namespace before any thread exists.  Says on standard error what it
does, and prints one JSON object (:class:`Answer`).
"""

from __future__ import annotations

import os
import sys
import time

from pydantic import BaseModel

from pnfarm.cli.errors import report
from pnfarm.cli.verify.report import CycleFigures, Part
from pnfarm.errors import EnvironmentError_, PnfarmError

__all__ = ["Answer"]

#: The cable of known/wire.pnfarm.yml.
NEAR, FAR = "pnverify0", "pnverify1"
NO_LIMITS = "--no-limits"


class Answer(BaseModel):
    """What was found; ``left_out`` says what was not, and why."""

    part: Part | None = None
    cycles: list[CycleFigures] = []
    left_out: list[str] = []


def main() -> int:
    """See the module's docstring."""
    # the imports come late: a namespace is entered before anything may start a thread
    from pnfarm.links.kernel.private_line import enter_private_line

    answer = Answer()
    sys.stderr.write("wire: the known farm over a veth pair, in real time\n")
    try:
        enter_private_line(NEAR, FAR)
    except EnvironmentError_ as exc:
        answer.left_out.append(f"wire and shortest cycle: this machine permits no network of one's own: {exc}")
    else:
        try:
            _in_network(answer)
        except EnvironmentError_ as exc:
            answer.left_out.append(f"{'wire and ' if answer.part is None else ''}shortest cycle: {exc}")
        except PnfarmError as exc:
            return report(exc)
    sys.stdout.write(answer.model_dump_json())
    return 0


def _in_network(answer: Answer) -> None:
    import anyio

    from pnfarm.cli.verify.run import on_wire
    from pnfarm.links.kernel.private_line import create_cable
    from pnfarm.links.serial.eager_loop import LOOKING

    create_cable(NEAR, FAR)
    answer.part = anyio.run(on_wire, backend_options=LOOKING)
    if NO_LIMITS not in sys.argv:
        _measure(answer)


def _measure(answer: Answer) -> None:
    from pnfarm.bench.line import FARM_CPU, PEER_CPU
    from pnfarm.cli.verify.limits import cycle_figures

    if not {FARM_CPU, PEER_CPU} <= os.sched_getaffinity(0):
        answer.left_out.append(
            f"shortest cycle: farm and controller each need a processor of their own, {FARM_CPU} and {PEER_CPU}"
        )
        return
    sys.stderr.write("limits: the shortest cycle that this machine holds\n")
    answer.cycles, why = cycle_figures(time.monotonic)
    answer.left_out += why


if __name__ == "__main__":
    sys.exit(main())
