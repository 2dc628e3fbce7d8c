"""Layouts of class 1 connections from a capture's Forward_Open or a farm file, and the state of each direction."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from pnfarm.buses.decoding.channel import SummedChannel
from pnfarm.buses.ethernetip.decode.assemblies import STATIC
from pnfarm.buses.ethernetip.device.product import Product

if TYPE_CHECKING:
    from pnfarm.captures.conversations import CyclicChannel
    from pnfarm.drives.description.model import Model

__all__ = ["Channel", "Template", "octets_behind"]

#: Sequence count, and run/idle header, octets.
COUNT, HEADER = 2, 4


@dataclass(frozen=True, slots=True)
class Template:
    """How to read one direction's data; ``octets`` are those of data alone.

    ``header`` is None where nothing says whether there is one.  ``model``: the drive's, if the data are its assembly.
    ``variable``: data may have fewer octets.
    """

    from_device: bool
    octets: int
    header: bool | None
    rpi_ns: int
    timeout_ns: int
    assembly: int | None = None
    model: Model | None = None
    variable: bool = False

    def fits(self, octets: int) -> bool:
        """Whether data may have so many octets."""
        return octets <= self.octets if self.variable else octets == self.octets

    def is_static(self, data: bytes) -> bool:
        """Whether the data are a position controller's assembly."""
        return self.model is not None and len(data) >= STATIC


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


@dataclass(slots=True, eq=False)
class Channel(SummedChannel):
    """One direction of a connection."""

    connection_id: int
    template: Template | None
    sequence: int = 0
    count: int = 0
    header: int | None = None
    #: Whether the sequence count does not change.
    stands: bool = False

    @property
    def cycle_ns(self) -> int:
        return self.template.rpi_ns if self.template is not None else 0

    def summary(self) -> CyclicChannel:
        """For the summary of the capture."""
        return self.figures(f"0x{self.connection_id:08X}", None, self.cycle_ns)
