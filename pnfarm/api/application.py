"""An application of the API: the paths of every subject, the web page, the errors, and the access checks."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from fastapi import FastAPI

from pnfarm.api.access.audit import Audit
from pnfarm.api.access.guard import Guard
from pnfarm.api.access.rights import Rights
from pnfarm.api.access.streams import STREAMS, Streams
from pnfarm.api.access.throttle import Throttle
from pnfarm.api.changes import Changes
from pnfarm.api.description import add_description
from pnfarm.api.page import add_page
from pnfarm.api.paths.devices import add_stations
from pnfarm.api.paths.drives import add_drives
from pnfarm.api.paths.farm import add_farm
from pnfarm.api.paths.faults import add_faults
from pnfarm.api.paths.plant import add_plant
from pnfarm.api.paths.scenarios import add_scenarios
from pnfarm.api.paths.states import add_states
from pnfarm.api.paths.streams import add_streams
from pnfarm.api.paths.traces import add_traces
from pnfarm.api.problems import install_handlers
from pnfarm.api.schemas.problem import PROBLEMS
from pnfarm.version import __version__
from pnfarm.web.paths import Paths

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from pnfarm.api.access.audit import AuditLog
    from pnfarm.api.access.keys import Keys
    from pnfarm.api.paths.devices import StationsHost
    from pnfarm.api.paths.drives import DrivesHost
    from pnfarm.api.paths.farm import FarmHost
    from pnfarm.api.paths.faults import FaultsHost
    from pnfarm.api.paths.host import Host
    from pnfarm.api.paths.plant import PlantHost
    from pnfarm.api.paths.states import StatesHost
    from pnfarm.api.paths.streams import StreamsHost
    from pnfarm.api.paths.traces import TracesHost
    from pnfarm.scenario.running import KeptScenarios
    from pnfarm.web.paths import Described

__all__ = ["Hosts", "make_api"]


@dataclass(frozen=True, slots=True)
class Hosts:
    """Who answers the paths of each subject."""

    drives: DrivesHost
    #: Adds what is below one drive.
    add_drive: Callable[[FastAPI], None]
    stations: StationsHost
    #: Adds what is below one device.
    add_device: Callable[[FastAPI], None]
    faults: FaultsHost
    scenarios: KeptScenarios
    traces: TracesHost
    states: StatesHost
    farm: FarmHost
    streams: StreamsHost
    plant: PlantHost
    #: What is described otherwise than of a farm, by handler.
    described: Mapping[str, Described] = field(default_factory=dict)


def make_api(
    host: Host, hosts: Hosts, *, title: str, description: str, keys: Keys, audit: AuditLog | None = None
) -> FastAPI:
    """The application; its ``state.context`` is ``host``.

    With tokens in ``keys`` every client must show one, and may do what its role says; without, only requests for
    loopback are answered.  ``audit`` gets a record of each request that changes something.
    """
    app = FastAPI(
        title=title,
        version=__version__,
        description=description,
        docs_url=None,
        redoc_url=None,
        openapi_url=None,
        responses=PROBLEMS,
    )
    app.state.context = host
    host.on_close.append(hosts.scenarios.close)
    install_handlers(app)

    def path(tag: str) -> Paths:
        return Paths(app, tag, hosts.described)

    add_drives(path("drives"), hosts.drives)
    hosts.add_drive(app)
    add_stations(path("devices"), hosts.stations)
    hosts.add_device(app)
    add_plant(path("plant"), hosts.plant)
    add_faults(path("faults"), host, hosts.faults)
    add_scenarios(path("scenarios"), hosts.scenarios, host)
    add_traces(path("traces"), hosts.traces)
    add_states(path("states"), hosts.states)
    add_farm(path("farm"), hosts.farm)
    add_streams(path("farm"), hosts.streams)
    add_page(app)
    add_description(app)
    app.add_middleware(Changes, record=host.record)
    app.add_middleware(Rights)
    if audit is not None:
        app.add_middleware(Audit, log=audit)
    # by the client's token, which the guard finds
    app.add_middleware(Streams)
    app.add_middleware(Guard, keys=keys)
    # outermost: a request above the limits is refused before its token is checked
    app.add_middleware(Throttle, without=STREAMS)
    return app
