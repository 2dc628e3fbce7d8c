"""Events of the plant (:mod:`pnfarm.station.events`)."""

from __future__ import annotations

from pnfarm.station.event import Event, event

__all__ = ["PlantModelFailed", "PlantModelLate", "PlantStepsLeftOut"]


@event("plant model failed", "error")
class PlantModelFailed(Event):
    """A model in Python raised an exception or did not return, or an FMU failed: it makes no more steps.

    Its outputs stay, or an FMU's have the values of ``on_failure``.
    """

    model: str
    error: str
    file: str
    line: int


@event("plant model late", "warning")
class PlantModelLate(Event):
    """A model in Python, or an FMU, takes longer than its step; reported the first, tenth, hundredth time ..."""

    model: str
    duration_seconds: float
    step_seconds: float
    missed: int


@event("plant steps left out", "warning")
class PlantStepsLeftOut(Event):
    """The machine stalled longer than the plant makes up for; at most once per second, with the sum since the last."""

    steps: int
