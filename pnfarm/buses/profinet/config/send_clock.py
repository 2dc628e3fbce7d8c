"""Send clock and reduction ratio of a drive, from what the farm file says of cycles."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from pnfarm.buses.profinet.config.clock import USUAL_FACTOR, check_clock, join_cycle, split_cycle
from pnfarm.vocabulary.durations import format_duration

if TYPE_CHECKING:
    from pnfarm.buses.profinet.config.controller import ProfinetController
    from pnfarm.buses.profinet.config.drive import ProfinetDrives
    from pnfarm.config.known import ModelFacts

__all__ = ["DEFAULT_CYCLE_NS", "Clock", "clock_key", "clock_of", "own_cycle_ns"]

#: AKD PROFINET manual 4.2.2: the AKD's fastest cycle.
DEFAULT_CYCLE_NS = 16_000_000


@dataclass(frozen=True, slots=True)
class Clock:
    """How the built-in controller runs one drive."""

    send_clock_factor: int
    reduction_ratio: int

    @property
    def cycle_ns(self) -> int:
        """Time between two frames."""
        return join_cycle(self.send_clock_factor, self.reduction_ratio)


def clock_of(controller: ProfinetController, cycle_ns: int | None = None) -> Clock:
    """The send clock and ratio for a drive; ``cycle_ns`` is the drive's own cycle.

    Raises ValueError with a sentence when cycle, factor and ratio do not fit each other.
    """
    factor: int | None = controller.send_clock_factor
    # a drive's own cycle takes the send clock, which all drives of a controller share, and a ratio of its own
    ratio: int | None = controller.reduction_ratio if cycle_ns is None else None
    wanted = controller.cycle_ns if cycle_ns is None else cycle_ns
    if factor is not None and ratio is not None:
        made = join_cycle(factor, ratio)
        if wanted not in {None, made}:
            wish = format_duration(wanted or 0)
            raise ValueError(f"factor {factor} and ratio {ratio} make {format_duration(made)}, not {wish}")
    elif factor is not None:
        ratio = _quotient(wanted or DEFAULT_CYCLE_NS, factor)
    elif ratio is not None:
        factor = _quotient(wanted, ratio) if wanted is not None else USUAL_FACTOR
    else:
        factor, ratio = split_cycle(wanted or DEFAULT_CYCLE_NS)
    if (wrong := check_clock(factor, ratio)) is not None:
        raise ValueError(wrong)
    return Clock(factor, ratio)


def own_cycle_ns(group: ProfinetDrives, controller: ProfinetController | None, model: ModelFacts | None) -> int | None:
    """The cycle of a group's drives where it is not the controller's.

    A file that names no cycle at all means the usual one, or a model's slowest where that is faster.
    """
    if group.cycle_ns is not None or controller is None or model is None or group.limits != "strict":
        return group.cycle_ns
    if controller.cycle_ns or controller.send_clock_factor or controller.reduction_ratio:
        return None
    return model.max_cycle_ns if 0 < model.max_cycle_ns < DEFAULT_CYCLE_NS else None


def _quotient(cycle_ns: int, part: int) -> int:
    whole, rest = divmod(cycle_ns, join_cycle(part, 1))
    if rest or not whole:
        raise ValueError(f"{format_duration(cycle_ns)} is not a multiple of {format_duration(join_cycle(part, 1))}")
    return whole


def clock_key(controller: ProfinetController) -> str:
    """What the controller's send clock follows from."""
    keys = ("send_clock_factor", "reduction_ratio")
    return next((key for key in keys if getattr(controller, key) is not None), "cycle")
