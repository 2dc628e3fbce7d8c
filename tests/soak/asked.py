"""What a PLC asks its drives for beside the cyclic data, on each bus in its own way."""

from __future__ import annotations

from typing import Any

from pnfarm.buses.ethernetip.controller.core import EthernetIpCore
from pnfarm.buses.line_parameters import LineQuestion
from pnfarm.buses.profinet.controller.core import ProfinetCore
from pnfarm.controller.line_door import ask_controller
from pnfarm.errors import PnfarmError
from tests.soak.judge import Check

__all__ = ["ask", "ask_station", "asked_check"]

#: I&M0; class, instance and attribute of the vendor's number; the parameter with the node's address.
_IDENTIFICATION, _VENDOR, _ADDRESS = 0xAFF0, (1, 1, 1), 918


def ask(controller: Any, name: str, now: int) -> Any:
    """A request to a drive that every model answers; it is ``done`` some time later."""
    if isinstance(controller, ProfinetCore):
        return controller.access_record(name, _IDENTIFICATION, None, now)
    if isinstance(controller, EthernetIpCore):
        return controller.get_attribute(name, *_VENDOR, now)
    return controller.read_parameter(name, _ADDRESS, now)


def ask_station(line: str, station: int) -> str:
    """The same as another process does, through the master that runs on a line: why there is no answer, or ""."""
    try:
        found = ask_controller(line, LineQuestion(station, str(_ADDRESS)))
    except PnfarmError as exc:
        return str(exc)
    return "no master is on the line" if found is None else ""


def asked_check(jobs: dict[str, Any]) -> Check:
    """Whether each was answered well; by the drives' names."""
    failures = {name: _failure(job) for name, job in jobs.items()}
    wrong = [f"{name}: {why}" for name, why in failures.items() if why]
    return Check("the PLC's requests at a rest answered", ok=not wrong, told="; ".join(wrong[:5]) or f"{len(jobs)}")


def _failure(job: Any) -> str:
    if not job.done:
        return "no answer yet"
    return str(job.failure if hasattr(job, "failure") else job.error)
