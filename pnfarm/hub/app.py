"""The hub's application: the paths of a farm's ``/api/v1``, its page, and the same access checks."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.api.access.keys import Keys
from pnfarm.api.application import Hosts, make_api
from pnfarm.api.problems import problem
from pnfarm.hub.described import DESCRIBED
from pnfarm.hub.hosts.devices import HubDevices
from pnfarm.hub.hosts.drives import HubDrives
from pnfarm.hub.hosts.farm import HubItself
from pnfarm.hub.hosts.faults import HubFaults
from pnfarm.hub.hosts.plant import HubPlant
from pnfarm.hub.hosts.scenarios import HubScenarios
from pnfarm.hub.hosts.states import HubStates
from pnfarm.hub.hosts.streams import HubStreams
from pnfarm.hub.hosts.traces import HubTraces
from pnfarm.hub.hub import RefusedError, passed_on
from pnfarm.hub.live import HubLive

if TYPE_CHECKING:
    from fastapi import FastAPI, Request
    from starlette.responses import Response

    from pnfarm.api.access.audit import AuditLog
    from pnfarm.api.access.token_file import TokenFile
    from pnfarm.hub.hub import Hub

__all__ = ["make_hub_app"]


def make_hub_app(
    hub: Hub,
    *,
    token: str | None = None,
    read_token: str | None = None,
    tokens: TokenFile | None = None,
    audit: AuditLog | None = None,
) -> FastAPI:
    """The API of one hub; tokens as :class:`~pnfarm.api.access.keys.Keys` takes them."""
    drives, devices, faults = HubDrives(hub), HubDevices(hub), HubFaults(hub)
    views = HubLive(hub)
    hosts = Hosts(
        drives=drives,
        add_drive=drives.add_drive,
        stations=devices,
        add_device=devices.add_device,
        faults=faults,
        scenarios=HubScenarios(hub, faults),
        traces=HubTraces(hub),
        states=HubStates(hub),
        farm=HubItself(hub),
        streams=HubStreams(hub, views),
        plant=HubPlant(hub),
        described=DESCRIBED,
    )
    description = "The virtual drives of several farms as of one."
    keys = Keys(token, read_token, tokens)
    app = make_api(hub, hosts, title="pnfarm hub", description=description, keys=keys, audit=audit)
    app.state.views = views
    app.add_exception_handler(RefusedError, _refused)
    return app


def _refused(request: Request, exc: Exception) -> Response:
    """A shard's refusal, as the shard words it."""
    assert isinstance(exc, RefusedError)
    try:
        found = exc.answer.object()
        members = {key: found[key] for key in ("errors", "error_number") if key in found}
        return problem(exc.answer.status, str(found["detail"]), request, **members)
    except (ValueError, KeyError):
        return passed_on(exc.answer)
