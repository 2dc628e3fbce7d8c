"""duplicate-name: a second station has the drive's station name."""

from __future__ import annotations

from pnfarm.buses.profinet.faults.second_station import MAC, SecondName
from pnfarm.faults.kind import InjectionKind

__all__ = ["KIND"]

KIND = InjectionKind(
    "duplicate-name",
    "link",
    "A second station at the drive's port has the drive's station name and type, and no IP address: it answers "
    "each DCP Identify that the drive answers.  An existing connection continues; the next search finds both.",
    "an answer of the second station",
    SecondName,
    {"mac": MAC},
    takes=frozenset({"for"}),
    place=70,
    wire="Two answers with one station name to a DCP Identify, from two MAC addresses.",
    reports="An existing connection continues. A search finds the name twice, and the controller does not "
    "connect: the device stays failed, with a duplicate name in the diagnosis (S7-1500, CODESYS: "
    "assumed).",
)
