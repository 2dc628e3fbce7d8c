"""Serves a running farm: a thread with the server, which ends with the farm and never ends it."""

from __future__ import annotations

import asyncio
import logging
import threading
from importlib.util import find_spec
from typing import TYPE_CHECKING

import anyio
from anyio import TASK_STATUS_IGNORED

from pnfarm.api.server import listen
from pnfarm.errors import EnvironmentError_
from pnfarm.farm.events import OpcUaFailed, OpcUaListening
from pnfarm.opcua.carrier import Carrier

if TYPE_CHECKING:
    from anyio.abc import TaskStatus

    from pnfarm.farm.farm import Farm
    from pnfarm.opcua.server import FarmServer

__all__ = ["prepare_opcua", "serve_opcua"]

#: Time that the server gets to end its sessions.
_GRACE_SECONDS = 3.0


async def prepare_opcua(farm: Farm) -> FarmServer | None:
    """What serves a farm as its file's ``opcua`` section says; None where that is ``off``.

    To be called before the farm starts: the address space of the standard takes seconds.  Raises
    :class:`EnvironmentError_` with what is missing.
    """
    section = farm.config.opcua
    if section is None:
        return None
    if find_spec("asyncua") is None:
        raise EnvironmentError_("opcua: needs `pip install 'pnfarm[opcua]'`")
    # what asyncua logs of a client's requests is the client's doing, and has no bound
    logging.getLogger("asyncua").setLevel(logging.CRITICAL)
    found = listen(*section.listen, what="the OPC UA server", key="opcua")

    async def close() -> None:
        found.close()

    async def prepared() -> FarmServer:
        from pnfarm.opcua.server import FarmServer  # noqa: PLC0415 - an extra

        server = FarmServer(farm.config, section, found)
        await server.prepare()
        return server

    try:
        # a loop of its own, for nothing of the server is bound to one before it runs
        server = await asyncio.to_thread(asyncio.run, prepared())
    except BaseException:
        found.close()
        raise
    farm.on_close.append(close)
    return server


async def serve_opcua(
    farm: Farm, server: FarmServer | None, *, task_status: TaskStatus[str] = TASK_STATUS_IGNORED
) -> None:
    """Serve a running farm until cancelled; started with the URL.

    Returns at once without a server, and when the server has failed, which is an event.
    """
    if server is None:
        task_status.started("")
        return
    loop = asyncio.get_running_loop()
    carrier = Carrier(loop)
    ready, ended = anyio.Event(), anyio.Event()
    failures: list[BaseException] = []

    def run() -> None:
        try:
            asyncio.run(server.run(farm, carrier, lambda: loop.call_soon_threadsafe(ready.set)))
        except BaseException as exc:  # noqa: BLE001 - carried to the farm's log
            failures.append(exc)
        finally:
            loop.call_soon_threadsafe(ready.set)
            loop.call_soon_threadsafe(ended.set)

    thread = threading.Thread(target=run, name="pnfarm opcua", daemon=True)
    thread.start()
    try:
        await ready.wait()
        if not failures:
            farm.log.record(farm.now(), "", OpcUaListening(server.url))
        task_status.started("" if failures else server.url)
        await ended.wait()
        for failure in failures:
            farm.log.record(farm.now(), "", OpcUaFailed(f"{type(failure).__name__}: {failure}"))
    finally:
        server.stop()
        with anyio.CancelScope(shield=True), anyio.move_on_after(_GRACE_SECONDS):
            await ended.wait()
