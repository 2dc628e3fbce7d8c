"""PROFIBUS's part of the capture decoder: captures hold frames of networks, and a line has none."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from pnfarm.captures.conversations import CyclicChannel
    from pnfarm.captures.decoder import PlannedDrive
    from pnfarm.captures.packet import Capture, Description, Packet

__all__ = ["ProfibusDecoder"]


class ProfibusDecoder:
    """A :class:`~pnfarm.captures.decoder.FrameDecoder`: no frame is its own."""

    def __init__(self, capture: Capture) -> None:
        del capture

    def family_of(self, packet: Packet) -> str | None:
        del packet
        return None

    def describe(self, family: str, packet: Packet) -> Iterator[Description]:
        del family, packet
        yield from ()

    def cyclic_channels(self) -> Iterator[CyclicChannel]:
        yield from ()

    def expect(self, controller: str, mac: bytes, drives: Sequence[PlannedDrive]) -> None:
        """A line has no hardware addresses."""
