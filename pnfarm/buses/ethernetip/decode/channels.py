"""Layouts of class 1 connections from a capture's Forward_Open or a farm file, and the state of each direction."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pnfarm.buses.ethernetip.decode.assemblies import STATIC
from pnfarm.buses.ethernetip.device.product import Product

if TYPE_CHECKING:
    from pnfarm.drives.description.model import Model

__all__ = ["Channel", "Template", "octets_behind"]

#: Sequence count, and run/idle header, octets.
COUNT, HEADER = 2, 4


@dataclass(frozen=True, slots=True)
class Template:
    """How to read one direction's data; ``octets`` are those of data alone.

    ``header`` is None where nothing says whether there is one.  ``model``: the drive's, if the data are its assembly.
    """

    from_device: bool
    octets: int
    header: bool | None
    rpi_ns: int
    timeout_ns: int
    assembly: int | None = None
    model: Model | None = None

    @property
    def is_static(self) -> bool:
        """Whether the data are a position controller's assembly."""
        return self.model is not None and self.octets >= STATIC


def octets_behind(size: int, model: Model | None, *, from_device: bool) -> tuple[int, bool | None, bool]:
    """A connection's size taken apart: octets of data, whether they have a header, whether they are the assembly."""
    if size <= COUNT:
        return 0, False, False
    if model is None or model.bus != "ethernetip":
        return size - COUNT, None, False
    product = Product.of(model)
    header = product.input_run_idle if from_device else product.output_run_idle
    octets = max(size - COUNT - HEADER * header, 0)
    return octets, header, octets == (product.input_size if from_device else product.output_size)


class Channel:
    """One direction of a connection; times in nanoseconds.  ``source`` and ``destination`` are MAC addresses."""

    __slots__ = (
        "begun", "connection_id", "count", "data", "destination", "frames", "gap_ns", "gaps", "header",
        "interval_count", "jumps", "last_ns", "longest_ns", "missing", "sequence", "shortest_ns", "source", "stands",
        "template", "told", "total_ns", "watchdogs",
    )  # fmt: skip

    def __init__(self, connection_id: int, template: Template | None) -> None:
        self.connection_id = connection_id
        self.template = template
        self.source = self.destination = b""
        self.begun = False
        self.last_ns = 0
        self.sequence = 0
        self.count = 0
        self.header: int | None = None
        self.data = b""
        #: Whether the sequence count stands still.
        self.stands = False
        self.frames = 0
        self.interval_count = 0
        self.total_ns = 0
        self.shortest_ns = 0
        self.longest_ns = 0
        self.gaps = 0
        self.gap_ns = 0
        self.missing = 0
        self.jumps = 0
        self.watchdogs = 0
        #: Lines that were written, by kind.
        self.told: dict[str, int] = {}

    @property
    def cycle_ns(self) -> int:
        return self.template.rpi_ns if self.template is not None else 0

    def figures(self) -> dict[str, Any]:
        """For the summary; plain JSON values."""
        count = self.interval_count
        return {
            "frame_id": f"0x{self.connection_id:08X}",
            "telegram": None,
            "frames": self.frames,
            "cycle_seconds": self.cycle_ns / 1e9 if self.cycle_ns else None,
            "interval_min_seconds": self.shortest_ns / 1e9 if count else None,
            "interval_mean_seconds": self.total_ns / count / 1e9 if count else None,
            "interval_max_seconds": self.longest_ns / 1e9 if count else None,
            "gaps": self.gaps,
            "longest_gap_seconds": self.gap_ns / 1e9 if self.gaps else None,
            "frames_missing": self.missing,
            "counter_jumps": self.jumps,
            "watchdog_gaps": self.watchdogs,
        }
