"""The application of one farm."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from pnfarm.api.access.keys import Keys
from pnfarm.api.application import Hosts, make_api
from pnfarm.api.context import ApiContext
from pnfarm.api.hosts.devices import FarmDevices
from pnfarm.api.hosts.drives import FarmDrives
from pnfarm.api.hosts.farm import FarmItself
from pnfarm.api.hosts.faults import FarmFaults
from pnfarm.api.hosts.plant import FarmPlant
from pnfarm.api.hosts.states import FarmStates
from pnfarm.api.hosts.streams import FarmStreams
from pnfarm.api.hosts.traces import FarmTraces
from pnfarm.api.live import LiveViews
from pnfarm.api.paths.devices import add_device
from pnfarm.api.paths.drives import add_drive
from pnfarm.buses.registry import BUSES
from pnfarm.farm.state.states import SavedStates
from pnfarm.metrics import FarmCollector
from pnfarm.scenario.running import RunningScenarios
from pnfarm.web.paths import Paths

if TYPE_CHECKING:
    from collections.abc import Callable

    from fastapi import FastAPI

    from pnfarm.api.access.audit import AuditLog
    from pnfarm.api.access.token_file import TokenFile
    from pnfarm.api.paths.drives import DriveHost
    from pnfarm.buses.bus import RouteHost
    from pnfarm.farm.core import FarmCore

__all__ = ["add_one_drive", "make_app"]


def make_app(
    core: FarmCore,
    *,
    now: Callable[[], int] = time.monotonic_ns,
    poke: Callable[[], None] = lambda: None,
    token: str | None = None,
    read_token: str | None = None,
    tokens: TokenFile | None = None,
    audit: AuditLog | None = None,
    wall: Callable[[], float] = time.time,
    collector: FarmCollector | None = None,
    states: SavedStates | None = None,
) -> FastAPI:
    """The API of one farm; tokens as :class:`~pnfarm.api.access.keys.Keys` takes them.

    ``now`` is the farm's clock and ``poke`` what makes its runtime look at a change
    (:meth:`~pnfarm.farm.realtime.RealTimeDriver.poke`); ``wall`` is the time by which tokens expire, seconds since
    1970.  ``states``: its saved states, None without a folder for them.
    """
    context = ApiContext(core=core, collector=collector or FarmCollector(core), now=now, poke=poke)
    drives = FarmDrives(context)
    devices = FarmDevices(context)
    views = LiveViews(context)
    hosts = Hosts(
        drives=drives,
        add_drive=lambda app: add_one_drive(app, drives, context),
        stations=devices,
        add_device=lambda app: add_device(Paths(app, "devices"), devices),
        faults=FarmFaults(context),
        scenarios=RunningScenarios(core, context.collector, now, poke),
        traces=FarmTraces(context),
        states=FarmStates(states or SavedStates(core, None, now, poke)),
        farm=FarmItself(context),
        streams=FarmStreams(context, views),
        plant=FarmPlant(context),
    )
    description = f"The virtual drives of farm {core.name}."
    keys = Keys(token, read_token, tokens, wall)
    app = make_api(context, hosts, title="pnfarm", description=description, keys=keys, audit=audit)
    app.state.views = views
    return app


def add_one_drive(app: FastAPI, drives: DriveHost, host: RouteHost) -> None:
    """The paths below one drive, also those of its bus."""
    add_drive(Paths(app, "drives"), drives)
    for bus in BUSES.values():
        bus.add_routes(app, host)
