"""A bus's decoder of a capture with one function for each family of frames, and the state that these share."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Generic, TypeVar

from pnfarm.buses.decoding.channel import SummedChannel
from pnfarm.captures.decoder import FrameDecoder
from pnfarm.captures.stations import Bounded

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from pnfarm.captures.conversations import CyclicChannel
    from pnfarm.captures.packet import Capture, Description, Packet

__all__ = ["FamilyDecoder", "SharedState"]

_Key = TypeVar("_Key")
_Channel = TypeVar("_Channel", bound=SummedChannel)
_Template = TypeVar("_Template")
_Observed = TypeVar("_Observed")
_Shared = TypeVar("_Shared", bound="SharedState[Any, Any, Any, Any]")


class SharedState(Generic[_Key, _Channel, _Template, _Observed]):
    """``capture`` is shared by the buses; the rest is one bus's."""

    def __init__(self, capture: Capture) -> None:
        self.capture = capture
        self.stations = capture.stations
        #: Cyclic channels by their addresses and number, the one with the latest frame last.
        self.channels: Bounded[_Key, _Channel] = Bounded()
        #: Layouts of a farm file, by the drive's MAC address and whether the drive sends.
        self.templates: dict[tuple[bytes, bool], _Template] = {}
        #: Who is there and how it is connected, where it is wanted.
        self.observed: _Observed | None = None


class FamilyDecoder(FrameDecoder, Generic[_Shared]):
    """``families``: the functions by the words of the families."""

    families: Mapping[str, Callable[[Packet, Any], Iterator[Description]]]

    def __init__(self, shared: _Shared) -> None:
        self.shared = shared

    def describe(self, family: str, packet: Packet) -> Iterator[Description]:
        return self.families[family](packet, self.shared)

    def cyclic_channels(self) -> Iterator[CyclicChannel]:
        for channel in self.shared.channels.values():
            if channel.frames:
                yield channel.summary()
