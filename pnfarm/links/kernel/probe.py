"""Tries, in a namespace that vanishes again, what a farm needs of the kernel: ``python -m pnfarm.links.kernel.probe``.

Runs in a separate process, so that its trials leave no traces in the caller. Prints one JSON object: name of
the trial -> null when it worked, else the reason.
"""

from __future__ import annotations

import asyncio
import ctypes
import json
import os
import sys
from typing import TYPE_CHECKING

from pnfarm.errors import PnfarmError
from pnfarm.links.kernel.sandbox import enter_sandbox
from pnfarm.wire.ethernet import ETHERTYPE_PROFINET

if TYPE_CHECKING:
    from collections.abc import Callable

# The imports inside the trials come late on purpose: a namespace is entered before anything may start a thread.

__all__ = ["TRIALS", "try_everything"]

_MCL_CURRENT_AND_FUTURE = 3
_MCL_ONFAULT = 4

TRIALS = ("scheduler", "mlock", "namespace", "veth", "macvlan", "tap", "packet-socket")


def _scheduler() -> None:
    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
    os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))


def _mlock() -> None:
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.mlockall(_MCL_CURRENT_AND_FUTURE | _MCL_ONFAULT) != 0:
        code = ctypes.get_errno()
        raise OSError(code, os.strerror(code))
    libc.munlockall()


def _namespace() -> None:
    enter_sandbox()


def _veth() -> None:
    from pnfarm.links.veth import VethLink  # noqa: PLC0415 - after the namespace, see above

    asyncio.run(_open_and_close(VethLink("probe", own_bridge=True)))


def _macvlan() -> None:
    from pnfarm.links.base import PortSpec  # noqa: PLC0415 - after the namespace, see above
    from pnfarm.links.macvlan import MacvlanLink  # noqa: PLC0415 - after the namespace, see above
    from pnfarm.links.veth import VethLink  # noqa: PLC0415 - after the namespace, see above

    async def trial() -> None:
        cable = VethLink("probe-parent")
        (port,) = await cable.open([PortSpec("probe", bytes.fromhex("020000000003"))])
        try:
            await _open_and_close(MacvlanLink("probe", port.name))
        finally:
            await cable.close()

    asyncio.run(trial())


def _tap() -> None:
    from pnfarm.links.tap import TapLink  # noqa: PLC0415 - after the namespace, see above

    asyncio.run(_open_and_close(TapLink("probe")))


def _packet_socket() -> None:
    from pnfarm.links.kernel.bpf import cyclic_filter  # noqa: PLC0415 - after the namespace, see above
    from pnfarm.links.kernel.packet import open_packet_socket  # noqa: PLC0415 - after the namespace, see above

    open_packet_socket(ETHERTYPE_PROFINET, cyclic_filter(1, 1)).close()


async def _open_and_close(link: object) -> None:
    from pnfarm.links.base import Link, PortSpec  # noqa: PLC0415 - after the namespace, see above

    assert isinstance(link, Link)
    try:
        await link.open([PortSpec("probe", bytes.fromhex("020000000001"))])
    finally:
        await link.close()


def try_everything() -> dict[str, str | None]:
    """Run every trial in this process, which ends up in its own namespace; for a throw-away process only."""
    steps: dict[str, Callable[[], None]] = {
        "scheduler": _scheduler,
        "mlock": _mlock,
        "namespace": _namespace,
        "veth": _veth,
        "macvlan": _macvlan,
        "tap": _tap,
        "packet-socket": _packet_socket,
    }
    results: dict[str, str | None] = {}
    for name in TRIALS:
        if name not in {"scheduler", "mlock", "namespace"} and results["namespace"] is not None:
            results[name] = "not tried: no private namespace to try it in"
            continue
        try:
            steps[name]()
        except PnfarmError as exc:
            results[name] = str(exc)
        except OSError as exc:
            results[name] = exc.strerror or str(exc)
        else:
            results[name] = None
    return results


if __name__ == "__main__":
    json.dump(try_everything(), sys.stdout)
